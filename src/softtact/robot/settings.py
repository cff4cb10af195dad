"""Settings of a scene from a YAML file, and the import of MuJoCo.

The defaults are in `softtact/robot/data/scene.yaml`; a user's file states some of its keys.
"""

import math
import os
from importlib import resources
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, Field, PositiveFloat, ValidationError

from softtact.errors import InputError
from softtact.files import read_yaml
from softtact.sensors.fields import FiniteSection, Length, plain_value

SHIPPED = Path(str(resources.files("softtact.robot"))) / "data" / "scene.yaml"
_Point = Annotated[tuple[float, float, float], BeforeValidator(plain_value)]
_Share = Annotated[float, Field(gt=0.0, lt=1.0)]


class SceneSettings(FiniteSection):
    """The keys of a scene file. The default file gives the reasons of assumed values."""

    mjcf: Path | None = None
    """A user's robot, or None for the UR10 and gripper of this package."""
    time_step_s: Length
    """Of MuJoCo, in s."""
    grip_at_m: _Point
    """(3,) in m in the robot's base frame: where the middle of the grip is."""
    clearance_mm: Length
    """Height above the grip where the descent begins."""
    flange_to_grip_mm: Length
    """From the arm's flange to the middle of the pads."""
    stroke_mm: PositiveFloat
    """Between the fingers' faces when they are open, without sensors."""
    friction: Length
    """Coulomb's coefficient between pads and object in the scene."""
    density_kg_m3: Length
    """Of the object, in kg/m3."""
    closing_mm_s: Length
    """Of each finger, in mm/s."""
    closing_force_n: Length
    """Largest force of a finger before the first contact."""
    ramp_s: Length
    """Time in which the force rises after the first contact, in s."""
    steady_change: _Share
    """Largest change of a steady grip's force, as a share of it ..."""
    steady_s: PositiveFloat
    """... within so many seconds."""
    lift_mm: Length
    """Height of the lift."""
    lift_s: Length
    """Duration of the lift, in s."""
    record_s: Length
    """Between two rows of a record, in s."""


def load_scene(path: str | Path | None = None, **changes: Any) -> SceneSettings:
    """The default `SceneSettings`, with the values of a user's YAML file.

    changes: values by name, in place of the file's;  a relative `mjcf` is found beside its file
    Raises InputError that names file, field and value.
    """
    values = read_yaml(SHIPPED, missing="reinstall softtact.")
    if path is not None:
        stated = read_yaml(path, missing="there is no such scene file; correct the path.")
        if not isinstance(stated, dict):
            raise InputError(f"{path}: a scene file must hold keys and values; see docs/how-to/grasp_in_simulation.md.")
        if stated.get("mjcf"):
            stated["mjcf"] = Path(path).parent / str(stated["mjcf"])
        values |= stated
    try:
        return SceneSettings(**values | changes)
    except ValidationError as error:
        fault = error.errors()[0]
        field = ".".join(map(str, fault["loc"]))
        reason = (f"the key is unknown; use one of {', '.join(SceneSettings.model_fields)}." if fault["type"] == "extra_forbidden"
                  else f"{fault['input']!r} is not usable: {fault['msg']}; correct it.")
        raise InputError(f"{path or 'scene'}, at '{field}': {reason}") from None


def number(name: str, value: Any, *, low: float = -math.inf, high: float = math.inf, unit: str = "") -> float:
    """A setting as a finite number within limits; InputError that names the setting, its value and the limits."""
    try:
        found = math.nan if isinstance(value, str | bytes | bool) else float(value)
    except (TypeError, ValueError):
        found = math.nan
    if not (math.isfinite(found) and low <= found <= high):
        limits = f" from {low:g} to {high:g}" if math.isfinite(high) else f" of at least {low:g}" if math.isfinite(low) else ""
        raise InputError(f"{name}={value!r}: give a finite number{limits}{f' ({unit})' * bool(unit)}.")
    return found


def import_mujoco() -> None:
    """Import MuJoCo without graphics in this process; pictures are drawn in another one (`softtact.robot.offscreen`).

    Otherwise a broken driver in MUJOCO_GL would make the import, and so the physics, fail.
    """
    wanted = os.environ.get("MUJOCO_GL")
    os.environ["MUJOCO_GL"] = "disable"
    try:
        import mujoco  # noqa: F401
    finally:
        if wanted is None:
            del os.environ["MUJOCO_GL"]
        else:
            os.environ["MUJOCO_GL"] = wanted
