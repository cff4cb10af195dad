"""What the foundation model foretells, in a second or two, of a press by the hyperelastic model that takes many.

A frustum is crushed when it is compressed by more than `FULL_POCKET` of its height: its pocket is full, contacts occur that are not
modelled, and load steps are flagged. The foundation model's map foretells that. Its own compression does not, as it saturates.
An object that rests on the shell and touches little more than the pad's border is carried by a few points of the cover, and load
steps are flagged, too: frusta there have several balances, and maps differ by 6 to 97 % of their maximum between meshes.
"""

import contextlib
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from trimesh import Trimesh

from softtact.errors import ConvergenceError, CrushedWarning, ShellWarning
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
# Of 100 contacts on coro with the draft mesh, the five that rested on the shell and were flagged for too few points had moved an
# area of 3.3 to 4.8 frusta by a tenth of a frustum's height in the foundation model's map; the others on the shell 7.2 and more.
_MOVED, _FEW_FRUSTA = 0.1, 6.0


class _Crushed(Exception):
    """Ends a press at the first load step with crushed frusta."""


@dataclass(frozen=True)
class Foretold:
    """What the foundation model's map says of a press up to a force."""

    may_crush_n: float
    """Force in N from which on frusta may be crushed; infinite where that is above the largest one."""
    will_crush_n: float
    """The same from which on they will be."""
    grazed_frusta: float | None
    """Number of frusta that come down by a tenth of their height or more, where they are few and the object rests on the shell."""


def foretell(sensor: "Sensor", placed: Trimesh, largest_n: float) -> Foretold:
    """What becomes of a press up to a force in N; nothing where the foundation model finds no balance."""
    found = _pressed(sensor, placed, largest_n)
    if found is None:
        return Foretold(np.inf, np.inf, None)
    depths = np.append(0.0, found.deformation_map_mm.max(axis=(1, 2))) / sensor.spec.frustum_height_mm
    may, will = np.interp([_MAY, _WILL], depths, np.append(0.0, found.normal_force_n), right=np.inf)
    return Foretold(float(may), float(will), _grazed(sensor.spec, found))


def _pressed(sensor, placed, largest_n):
    """The foundation model's result, up to the first load step with surely crushed frusta; None without a load step."""
    deepest = _WILL * sensor.spec.frustum_height_mm

    def end_if_crushed(so_far: PressResult) -> None:
        if so_far.deformation_map_mm[-1].max() > deepest:
            raise _Crushed      # deeper load steps would take most of the time

    control = RunControl(label="", reached=Reached(end_if_crushed))
    with warnings.catch_warnings(action="ignore"):      # the press itself will warn
        with contextlib.suppress(_Crushed, ConvergenceError):
            press_on_foundation(sensor, placed, largest_n * np.linspace(0, 1, _LOAD_STEPS + 1)[1:], control)
        return control.reached.result()


def _grazed(spec, found):
    """`Foretold.grazed_frusta` of a result."""
    if not found.shell_force_n[-1] > 0:
        return None
    node = np.diff(spec.map_x_mm)[0] * np.diff(spec.map_y_mm)[0]
    cell = np.prod(spec.footprint_mm) / np.prod(spec.frusta_counts)
    frusta = float((found.deformation_map_mm[-1] >= _MOVED * spec.frustum_height_mm).sum() * node / cell)
    return frusta if 0.0 < frusta < _FEW_FRUSTA else None      # the shell alone carries an object that moves none


def warn_before(sensor: "Sensor", placed: Trimesh, largest_n: float) -> None:
    """Warn where a press up to a force may be flagged; silent where the foundation model is not prepared."""
    if np.isnan(sensor.spec.frustum_height_mm) or sensor.seconds_to_prepare_foundation() > 0:
        return
    told = foretell(sensor, placed, largest_n)
    if np.isfinite(told.may_crush_n):
        surely = f", and surely from {told.will_crush_n:.2g} N on" if np.isfinite(told.will_crush_n) else ""
        warnings.warn(f"Frusta may be crushed, by more than {FULL_POCKET:.0%} of their height, from {told.may_crush_n:.2g} N "
                      f"on{surely}, after the foundation model's map: load steps there are slow and will be flagged; ask for "
                      "smaller forces.", CrushedWarning, stacklevel=5)
    if told.grazed_frusta is not None:
        warnings.warn(f"The object will rest on the shell and presses the sensor at its border only, on about "
                      f"{told.grazed_frusta:.0f} frusta after the foundation model's map: fewer points of the cover than a map "
                      "needs may carry it, and load steps be flagged; move the object inwards.", ShellWarning, stacklevel=5)
