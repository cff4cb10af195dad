"""Foretelling of crushed frusta, in a second before a press of many by the hyperelastic model.

A frustum is crushed when it is compressed by more than `FULL_POCKET` of its height: its pocket is full, contacts occur that are not
modelled, and load steps are flagged. The foundation model's map foretells that. Its own compression does not, as it saturates.
"""

import contextlib
import warnings
from typing import TYPE_CHECKING

import numpy as np
from trimesh import Trimesh

from softtact.errors import ConvergenceError, CrushedWarning
from softtact.models.hyperelastic.mesh_settings import FULL_POCKET
from softtact.press.fast import press_on_foundation
from softtact.press.reached import Reached
from softtact.press.result import PressResult
from softtact.press.task import RunControl

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

# The map's maximum over a frustum's height where frusta may be and will be crushed: on coro with the draft mesh, at 1.2, a box on
# its edge compresses them by 81 % of their height and a ball of 4 mm radius by 59 %; at 1.52 a rod's rim by 85 %, a ball by 75 %.
_MAY, _WILL = 1.2, 1.6
_LOAD_STEPS = 6     # up to the largest force, between which the map is interpolated


class _Crushed(Exception):
    """Ends a press at the first load step with crushed frusta."""


def crushing_forces_n(sensor: "Sensor", placed: Trimesh, largest_n: float) -> np.ndarray:
    """Forces (2,) in N from which on frusta may be and will be crushed; infinite where that is above `largest_n`."""
    height = sensor.spec.frustum_height_mm

    def end_if_crushed(so_far: PressResult) -> None:
        if so_far.deformation_map_mm[-1].max() > _WILL * height:
            raise _Crushed      # deeper load steps would take most of the time

    control = RunControl(label="", reached=Reached(end_if_crushed))
    with warnings.catch_warnings(action="ignore"):      # the press itself will warn
        with contextlib.suppress(_Crushed, ConvergenceError):
            press_on_foundation(sensor, placed, largest_n * np.linspace(0, 1, _LOAD_STEPS + 1)[1:], control)
        found = control.reached.result()
    if found is None:
        return np.full(2, np.inf)
    depths = np.append(0.0, found.deformation_map_mm.max(axis=(1, 2))) / height
    return np.interp([_MAY, _WILL], depths, np.append(0.0, found.normal_force_n), right=np.inf)


def warn_of_crushing(sensor: "Sensor", placed: Trimesh, largest_n: float) -> None:
    """Warn where a press up to a force may crush frusta; silent where the foundation model is not prepared."""
    if np.isnan(sensor.spec.frustum_height_mm) or sensor.seconds_to_prepare_foundation() > 0:
        return
    may, will = crushing_forces_n(sensor, placed, largest_n)
    if np.isfinite(may):
        surely = f", and surely from {will:.2g} N on" if np.isfinite(will) else ""
        warnings.warn(f"Frusta may be crushed, by more than {FULL_POCKET:.0%} of their height, from {may:.2g} N on{surely}, after "
                      "the foundation model's map: load steps there are slow and will be flagged; ask for smaller forces.",
                      CrushedWarning, stacklevel=5)
