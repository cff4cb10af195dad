"""Errors and warnings of softtact, and which extra installs which package. A message names the field, its value and the remedy."""

import importlib.util
from pathlib import Path
from typing import Any

EXTRAS = {"matplotlib": "plot", "PIL": "plot", "skimage": "optics", "tifffile": "optics", "imagecodecs": "optics", "av": "optics",
          "snakemake": "workflow", "jinja2": "workflow", "torch": "learn", "optuna": "learn", "pyvista": "view", "vtk": "view",
          "vtkmodules": "view", "viser": "view", "pypardiso": "mkl", "openpyxl": "excel", "skfem": "skin", "mujoco": "robot",
          "gymnasium": "robot", "pytetwild": "mesh", "warp": "device", "cascadio": "cad", "collada": "cad", "rosbags": "ros",
          "pyarrow": "lerobot"}


class SofttactError(Exception):
    """Base of all errors that a user can act upon."""

    status = 1
    """Exit status of a command that it ends."""


class InputError(SofttactError):
    """A file, a field or an argument is not usable as given."""


class MissError(InputError):
    """An object lies beside the sensor, or what else it is to be pressed on, so that nothing is touched."""


class UnreadableError(InputError):
    """A file exists, and the system does not let us read it."""

    status = 4


class OutputError(SofttactError):
    """A file cannot be written: the disk is full, or its folder is not writable."""

    status = 4


class WorkerError(SofttactError):
    """A process that worked for this one was killed."""

    status = 4


class ConvergenceError(SofttactError):
    """A solver did not reach its tolerance; nothing of the unfinished step may be used.

    result: what was reached before (a `PressResult` of the lower forces), or None
    """

    status = 3

    def __init__(self, message: str, *, result: Any = None) -> None:
        super().__init__(message)
        self.result = result


class TimeLimitError(ConvergenceError):
    """The time limit of a press was reached; `result` holds the finished load steps."""


class ExtrapolationWarning(UserWarning):
    """A law is used outside the range of the data that its material card was fitted to."""


class ShellWarning(UserWarning):
    """An object rests on the shell around a pad, and the shell carries any further force."""


class NarrowPartWarning(UserWarning):
    """An object has parts that are narrower than the distance of a model's points."""


class CrushedWarning(UserWarning):
    """A press by the hyperelastic model will compress frusta until their pockets are full."""


class HardPressWarning(UserWarning):
    """Increments of a press by the hyperelastic model find no balance again and again; it may take minutes, or end."""


class FrameWarning(UserWarning):
    """A camera frame, or a mask, may not meet the assumptions of what reads it."""


class MeshWarning(UserWarning):
    """A mesh of elements was read, and not all of its file is in it, or its pieces do not hang together."""


def missing_extra(error: ImportError) -> str | None:
    """One sentence that says which extra to install for the package that an import did not find; None for any other package."""
    package = (error.name or "").partition(".")[0]
    return how_to_install(package) if package in EXTRAS else None


def how_to_install(package: str) -> str:
    """One sentence that says which extra brings a package of `EXTRAS`."""
    return f"This needs {package}, which is not installed here; run: pip install 'softtact[{EXTRAS[package]}]'."


def require(package: str, what: str | Path) -> None:
    """Raise InputError, before any work, where a package of `EXTRAS` is not installed; `what`: the option or file that needs it."""
    if importlib.util.find_spec(package) is None:
        raise InputError(f"{what}: {how_to_install(package)}")
