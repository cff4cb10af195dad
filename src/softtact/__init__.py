"""Simulate a soft capacitive tactile sensor: press a mesh on it, read its deformation and its taxels."""

__version__ = "0.1.0"
__all__ = ["load_sensor", "__version__"]


def __getattr__(name):
    # `import softtact` stays fast: the solvers load when a sensor is first asked for.
    if name == "load_sensor":
        from softtact.press.sensor import load_sensor

        return load_sensor
    raise AttributeError(f"module 'softtact' has no attribute {name!r}")
