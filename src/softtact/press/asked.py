"""What a press is asked for: an object, forces or a motion; read, checked, and in one form."""

import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import trimesh

from softtact.contact.motion import Motion
from softtact.errors import InputError
from softtact.geometry.meshes import read_mesh


def mesh_of(mesh: trimesh.Trimesh | str | Path, unit: str | None) -> trimesh.Trimesh:
    """A mesh in mm, read where it is the path of a file, which needs a `unit`."""
    if isinstance(mesh, trimesh.Trimesh):
        return mesh
    if unit is None:
        raise InputError(f"{mesh}: a mesh file does not state its unit; give unit='mm', or another one.")
    return read_mesh(mesh, unit=unit)


def motion_of(force_n: float | Sequence[float] | None, motion: Motion | None) -> Motion:
    """The motion of a press, be it of forces (N) alone. InputError where both or neither are given."""
    if (motion is None) == (force_n is None):
        raise InputError("A press takes either force_n or motion; give one of them.")
    return motion if motion is not None else Motion().press(force_n=force_n)


def given_forces(force_n: float | Sequence[float] | None, motion: Motion | None) -> float | Sequence[float]:
    """The forces (N) of a press, be they a motion's. InputError where both or neither are given."""
    given = motion.forces_n if motion is not None and force_n is None else force_n
    if given is None or (motion is not None and force_n is not None):
        raise InputError("A press takes either force_n or motion; give one of them.")
    return given


def checked_forces(force_n: float | Sequence[float], force_range_n: tuple[float, float], name: str) -> np.ndarray:
    """Forces (N) as an increasing array within the range of the sensor of that name; others are refused."""
    forces = np.atleast_1d(np.asarray(force_n, dtype=float))
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
