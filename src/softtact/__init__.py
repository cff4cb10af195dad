"""Simulate a soft tactile sensor: press a mesh on it, read its deformation and the readings of its readouts."""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from softtact.contact.motion import Motion
    from softtact.errors import ConvergenceError, InputError
    from softtact.fem.body_mesh import mesh_body
    from softtact.geometry.meshes import read_mesh
    from softtact.geometry.pose import Pose
    from softtact.press.objects import SoftObject
    from softtact.press.result import PressResult, read_press
    from softtact.press.result import PressResult as SolidResult
    from softtact.press.sensor import Sensor, load_sensor, load_solid_sensor
    from softtact.press.sensor import Sensor as SolidSensor

__version__ = "0.1.0"
__all__ = ["ConvergenceError", "InputError", "Motion", "Pose", "PressResult", "Sensor", "SoftObject", "SolidResult", "SolidSensor",
           "__version__", "load_sensor", "load_solid_sensor", "mesh_body", "read_mesh", "read_press"]
# {name: (module, its name there)}. SolidResult, SolidSensor and load_solid_sensor are names of version 0.1 for the same.
_PLACES = {"ConvergenceError": ("errors",), "InputError": ("errors",), "Motion": ("contact.motion",), "Pose": ("geometry.pose",),
           "PressResult": ("press.result",), "SolidResult": ("press.result", "PressResult"), "Sensor": ("press.sensor",),
           "SolidSensor": ("press.sensor", "Sensor"), "SoftObject": ("press.objects",), "load_sensor": ("press.sensor",),
           "load_solid_sensor": ("press.sensor",), "mesh_body": ("fem.body_mesh",), "read_mesh": ("geometry.meshes",),
           "read_press": ("press.result",)}


def __getattr__(name: str) -> object:
    # `import softtact` stays fast: a name's module loads when the name is first asked for.
    if name not in _PLACES:
        raise AttributeError(f"module 'softtact' has no attribute {name!r}")
    module, *other = _PLACES[name]
    value = getattr(importlib.import_module(f"softtact.{module}"), other[0] if other else name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return list(__all__)
