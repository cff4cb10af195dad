"""Simulate a soft capacitive tactile sensor: press a mesh on it, read its deformation and its taxels."""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from softtact.contact.motion import Motion
    from softtact.errors import ConvergenceError, InputError
    from softtact.fem.body_mesh import mesh_body
    from softtact.geometry.meshes import read_mesh
    from softtact.geometry.pose import Pose
    from softtact.press.result import PressResult, read_press
    from softtact.press.sensor import Sensor, load_sensor
    from softtact.press.soft_object import SoftObject
    from softtact.press.solid_sensor import SolidSensor, load_solid_sensor

__version__ = "0.1.0"
__all__ = ["ConvergenceError", "InputError", "Motion", "Pose", "PressResult", "Sensor", "SoftObject", "SolidSensor",
           "__version__", "load_sensor", "load_solid_sensor", "mesh_body", "read_mesh", "read_press"]
_MODULES = {"ConvergenceError": "errors", "InputError": "errors", "Motion": "contact.motion", "Pose": "geometry.pose",
            "PressResult": "press.result", "Sensor": "press.sensor", "load_sensor": "press.sensor",
            "SoftObject": "press.soft_object", "SolidSensor": "press.solid_sensor", "load_solid_sensor": "press.solid_sensor",
            "mesh_body": "fem.body_mesh",
            "read_mesh": "geometry.meshes", "read_press": "press.result"}


def __getattr__(name: str) -> object:
    # `import softtact` stays fast: a name's module loads when the name is first asked for.
    if name not in _MODULES:
        raise AttributeError(f"module 'softtact' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"softtact.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return list(__all__)
