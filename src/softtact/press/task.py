"""The task of a press: an object, forces or a motion, and options; read, checked and in one form."""

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np
import trimesh

from softtact.contact.motion import Motion, numbers_of
from softtact.errors import InputError
from softtact.geometry.meshes import check_given, read_mesh
from softtact.geometry.pose import Pose
from softtact.press.objects import SoftObject
from softtact.press.reached import Reached
from softtact.unknown_names import unknown

if TYPE_CHECKING:
    from softtact.press.result import PressResult
    from softtact.sensors.base import Specification

TOLERANCE_MM = 0.01     # of the policy `error`, by default


class PressOptions(TypedDict, total=False):
    """Options of `Sensor.press`, all by keyword."""

    policy: str
    """How model="auto" chooses: `error`, the cheapest model that is expected to be within `tolerance_mm` of the hyperelastic one,
    or `paper`, by the complexity of the contact. See `press.choice`."""
    tolerance_mm: float
    """Of the policy `error`: root mean square over the map in mm (0.01)."""
    label: str
    """First words of its progress on stderr ("press"); an empty one writes nothing."""
    threads: int | None
    """Of the linear algebra; by default one for each core."""
    keep_body: bool
    """Let the result hold the deformed body at each load step, some 20 MB each: `PressResult.pressed_body` of the hyperelastic
    model, and `PressResult.solid` of the solid model, which sensors of kind solid always keep."""
    keep_object: bool
    """Let the result hold a rigid object where it is at each load step (`PressResult.placed_object`)."""
    time_limit_s: float | None
    """Seconds after which the press ends in a TimeLimitError."""
    on_step: "Callable[[PressResult], None] | None"
    """Called with the partial result after each completed load step except the last."""


class BatchOptions(TypedDict, total=False):
    """Options of `Sensor.press_many`, all by keyword."""

    workers: int | None
    """Processes; by default one for each core."""
    device: str
    """`cuda`, or `auto` where there is a GPU, runs the elastic model's batch on it; on the `cpu` its batches, and the presses of
    the other models, run in processes. `cuda` is refused where no batch runs: with other models, soft objects, gels and sensors
    whose lower side is free."""
    failures: str
    """`raise` the first, after all are done (default), or `keep` each error in its press' place."""
    label: str
    """First words of the progress on stderr ("presses")."""
    policy: str
    """As for `Sensor.press`."""
    tolerance_mm: float
    """As for `Sensor.press`."""


@dataclass(frozen=True)
class RunControl:
    """How a press runs; no option changes its numbers."""

    label: str = "press"
    """First words of its progress; nothing is written where it is empty."""
    threads: int = 1
    """Of the linear algebra."""
    keep_body: bool = False
    """Whether the result holds the whole body's displacements at each load step, where the model has one."""
    keep_object: bool = False
    """Whether the result holds a rigid object where it is at each load step."""
    time_limit_s: float | None = None
    """Wall-clock seconds, after which a press ends with the completed load steps."""
    reached: Reached = field(default_factory=Reached)
    """Keeps the completed load steps."""


@dataclass(frozen=True)
class PressTask:
    """A press in the form that the models take."""

    pressed: trimesh.Trimesh | SoftObject
    """The object, in mm."""
    pose: Pose | None
    """Its pose in the sensor frame; None: centred."""
    motion: Motion
    """Its motion."""
    control: RunControl
    """How the press runs."""
    policy: str = "error"
    """How model="auto" chooses."""
    tolerance_mm: float = TOLERANCE_MM
    """Of that policy."""

    @property
    def soft(self) -> bool:
        """Whether the object is a `SoftObject`."""
        return isinstance(self.pressed, SoftObject)


def task_of(spec: "Specification", pressed: "trimesh.Trimesh | SoftObject | str | Path", unit: str | None, pose: Any,
            motion: Motion, options: Mapping[str, Any]) -> PressTask:
    """The task of a press; InputError for an unknown option, a file without a unit, a load out of the sensor's range."""
    refuse_unknown(options, PressOptions)
    given = dict(options)
    on_step = given.pop("on_step", None)
    choice = {name: given.pop(name) for name in ("policy", "tolerance_mm") if name in given}
    control = RunControl(**given | {"threads": given.get("threads") or cores()}, reached=Reached(on_step))
    if not isinstance(pressed, SoftObject):
        pressed = mesh_of(pressed, unit)
    if not motion.steps:
        raise InputError("The motion of a press has no step; give at least one, such as Motion().press(force_n=5).")
    check_loads(motion, spec.force_range_n, spec.name)
    return PressTask(pressed, None if pose is None else Pose.of(pose), motion, control, **choice)


def refuse_unknown(options: Mapping[str, Any], known: Any) -> None:
    """Refuse an option that a TypedDict does not have."""
    for name in options:
        if name not in known.__annotations__:
            hint = unknown(name, list(known.__annotations__), kind="option")
            raise InputError(f"A press: {hint}{'' if hint.endswith('?') else '.'}")


def mesh_of(mesh: trimesh.Trimesh | str | Path, unit: str | None) -> trimesh.Trimesh:
    """A mesh in mm, read where it is the path of a file, which needs a `unit` unless it states one."""
    if not isinstance(mesh, trimesh.Trimesh):
        return read_mesh(mesh, unit=unit)
    check_given(mesh)
    return mesh


def motion_of(spec: "Specification", force_n: float | Sequence[float] | None, motion: Motion | str | None) -> Motion:
    """The motion of a press by forces (N), by a `Motion` or by its text.

    InputError where both or neither is given, or a force is outside the sensor's range.
    """
    if (motion is None) == (force_n is None):
        raise InputError("A press takes either force_n or motion; give one of them.")
    if force_n is not None:
        forces = numbers_of("force_n", force_n)
        for force in forces:
            checked_forces(force, spec.force_range_n, spec.name)
        return Motion().press(force_n=forces)
    if not isinstance(motion, str | Motion):
        raise InputError(f"motion={motion!r} is no motion; give a Motion, or its text such as \"z -1.0; x 1.0\".")
    return Motion.parse(motion) if isinstance(motion, str) else motion


def checked_forces(force_n: float | Sequence[float], force_range_n: tuple[float, float], name: str) -> np.ndarray:
    """Forces (N) as an increasing array within the range of the sensor of that name; others are refused."""
    forces = np.array(numbers_of("force_n", force_n))
    low, high = force_range_n
    outside = forces[~((forces > low) & (forces <= high))]
    if len(outside):
        raise InputError(f"The force {outside[0]:g} N is out of the range of {name}; "
                         f"give forces above {low:g} N and up to {high:g} N.")
    if (np.diff(forces) <= 0).any():
        raise InputError("The forces must increase; sort them and leave out doubles.")
    return forces


def check_loads(motion: Motion, force_range_n: tuple[float, float], name: str) -> None:
    """Refuse a motion that presses down with a force out of the range of the sensor of that name."""
    for load in (step.loads["z"] for step in motion.steps if step.loads.get("z", 0.0) < 0):
        checked_forces(-load, force_range_n, name)


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
