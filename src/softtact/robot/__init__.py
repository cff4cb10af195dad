"""Robots with sensors in MuJoCo: grasps, an environment for learning, and sensors in scenes of your own."""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from softtact.robot.attached import AttachedSensor, Reading, attach
    from softtact.robot.contact_forces import hand_back
    from softtact.robot.touch_sensors import export_mjcf

__all__ = ["AttachedSensor", "Reading", "attach", "export_mjcf", "hand_back"]
_PLACES = {"AttachedSensor": "attached", "Reading": "attached", "attach": "attached", "hand_back": "contact_forces",
           "export_mjcf": "touch_sensors"}


def __getattr__(name: str) -> object:
    # Modules of this package that need no MuJoCo stay free of it.
    if name not in _PLACES:
        raise AttributeError(f"module 'softtact.robot' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"softtact.robot.{_PLACES[name]}"), name)
    globals()[name] = value
    return value
