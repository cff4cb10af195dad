"""Which model a press takes: the paper's count of mesh points, or the error that each cheaper model is expected to make.

`paper`: the hyperelastic model for an object with fine details, else the elastic one (`geometry.complexity`).
`error`: both cheap models are pressed first, in about a second. What they disagree by is the elastic model's error, for the
foundation model is nearer to the hyperelastic one by an order of magnitude; the foundation model's own error grows with how far
the frusta are compressed, and is read from presses of indenters (`calibrate`). The cheapest model within the tolerance is taken.
Errors are root mean squares over the map, in mm, against the hyperelastic model; the largest of a press' load steps counts.
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from trimesh import Trimesh

from softtact.errors import ConvergenceError, InputError
from softtact.geometry.complexity import OVERLAP_THRESHOLD, TOTAL_THRESHOLD, choose_model, score
from softtact.press.making import Course
from softtact.press.models import PRESSES
from softtact.press.result import PressResult

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

POLICIES = ("paper", "error")
TOLERANCE_MM = 0.01
CALIBRATED_ON = "coro"     # the sensor whose presses gave the expected error below
_POWER = 3       # of the compression, with which the foundation model's relative error grows
_KNOWN = 0.5     # of a frustum's height: the error was calibrated up to a compression of 0.36, and is not told much beyond


@dataclass(frozen=True)
class FoundationError:
    """Expected error of the foundation model over its map's root mean square: `at_rest` + `growth` * (compression / height)^3.

    compression: of the most compressed frustum; of the powers 1 to 4 the third and fourth follow the indenters best. The values
    given here are those of ten indenters (bordes_v, circle_g, circle_m, cruz, donut_m, echo_v, glasses, square, star, triangle) at
    five load steps to 50 N on the sensor `coro`, against the hyperelastic model's fine mesh (benchmarks/choice.py).
    """

    at_rest: float = 0.0128
    growth: float = 0.640

    def __call__(self, maps_mm: np.ndarray, compression_mm: np.ndarray, height_mm: float) -> np.ndarray:
        """Errors (l,) in mm of maps (l, y, x) with largest compressions (l,) in mm."""
        return (self.at_rest + self.growth * (np.asarray(compression_mm) / height_mm) ** _POWER) * rms(maps_mm)


def rms(maps_mm: np.ndarray) -> np.ndarray:
    """Root mean square over the maps (..., y, x)."""
    return np.sqrt((np.asarray(maps_mm) ** 2).mean(axis=(-2, -1)))


def calibrate(maps_mm: np.ndarray, compression_mm: np.ndarray, true_mm: np.ndarray, *, height_mm: float) -> FoundationError:
    """`FoundationError` from presses: maps (n, y, x), largest compressions (n,), true errors (n,), all in mm.

    Least squares of the relative error with weights that make it relative, too; neither constant is below zero.
    """
    from scipy.optimize import nnls

    scale = rms(maps_mm)
    measured = np.asarray(true_mm) / scale
    features = np.column_stack([np.ones(len(measured)), (np.asarray(compression_mm) / height_mm) ** _POWER])
    (at_rest, growth), _ = nnls(features / measured[:, None], np.ones(len(measured)))
    return FoundationError(at_rest=float(at_rest), growth=float(growth))


def expected_errors(elastic: PressResult, foundation: PressResult, *, height_mm: float,
                    model: FoundationError = FoundationError()) -> dict[str, np.ndarray]:
    """{model: errors (l,) in mm} of two `PressResult`s, or data sets with their names, of the same press.

    Infinite where frusta are compressed much further than in any press that the error was calibrated on.
    """
    compression = np.asarray(foundation.frustum_compression_mm)
    known = compression < _KNOWN * height_mm
    ours = np.where(known, model(foundation.deformation_map_mm, compression, height_mm), np.inf)
    apart = rms(np.asarray(elastic.deformation_map_mm) - np.asarray(foundation.deformation_map_mm))
    return {"elastic": np.hypot(apart, ours), "foundation": ours}


def cheapest(errors: dict[str, np.ndarray], tolerance_mm: float) -> str:
    """The first of elastic, foundation whose errors are all within the tolerance, else hyperelastic."""
    return next((name for name in ("elastic", "foundation") if errors[name].max() <= tolerance_mm), "hyperelastic")


def press_auto(sensor: "Sensor", placed: Trimesh, forces: np.ndarray, course: Course, *, policy: str,
               tolerance_mm: float) -> PressResult:
    """A press with the model that a policy takes; the result tells which, why, and with what error to expect."""
    if policy not in POLICIES:
        raise InputError(f"The policy {policy!r} is unknown; use one of {', '.join(POLICIES)}.")
    if policy == "paper":
        return _by_counts(sensor, placed, forces, course)
    if not tolerance_mm > 0:
        raise InputError(f"The tolerance {tolerance_mm:g} mm is not positive; give the largest error of a map in mm.")
    if np.isnan(sensor.spec.frustum_height_mm):
        return _without_frusta(sensor, placed, forces, course)
    return _by_error(sensor, placed, forces, tolerance_mm, course)


def _by_counts(sensor, placed, forces, course):
    counts = score(placed.triangles, footprint_mm=sensor.spec.footprint_mm, reach_mm=sensor.spec.thickness_mm)
    model = choose_model(counts.NPt, counts.CHt, counts.NPo, counts.CHo)
    result = PRESSES[model](sensor, placed, forces, course)
    reason = (f"the paper's rule: NPt / CHt = {counts.ratio_total:.3g} ({TOTAL_THRESHOLD:g} asks for the hyperelastic model), "
              f"NPo / CHo = {counts.ratio_overlap:.3g} ({OVERLAP_THRESHOLD:g})")
    return replace(result, selection_reason=reason)


def _without_frusta(sensor, placed, forces, course):
    """The hyperelastic press: what the cheap models err by was calibrated on frusta, and nothing tells it without."""
    result = PRESSES["hyperelastic"](sensor, placed, forces, course)
    return replace(result, selection_reason=f"{sensor.spec.name} has no frusta, on which the expected errors were calibrated: the "
                   "hyperelastic model", expected_error_mm=np.zeros(len(forces)))


def _by_error(sensor, placed, forces, tolerance_mm, course):
    elastic = PRESSES["elastic"](sensor, placed, forces, course)
    try:
        foundation = PRESSES["foundation"](sensor, placed, forces, course)
    except ConvergenceError as error:
        result = PRESSES["hyperelastic"](sensor, placed, forces, course)
        return replace(result, selection_reason=f"the foundation model tells no error: {error}",
                       expected_error_mm=np.zeros(len(forces)))
    errors = expected_errors(elastic, foundation, height_mm=sensor.spec.dielectric.frusta.height_mm)
    model = cheapest(errors, tolerance_mm)
    told = "; ".join(f"{name} {1e3 * values.max():.3g} um" for name, values in errors.items())
    reason = f"expected errors: {told}; asked for {1e3 * tolerance_mm:.3g} um"
    if sensor.spec.name != CALIBRATED_ON:
        reason += f" (calibrated on presses of the sensor {CALIBRATED_ON}, not of {sensor.spec.name})"
    if model == "hyperelastic":
        result = PRESSES[model](sensor, placed, forces, course)
        spent = result.wall_time_s + elastic.wall_time_s + foundation.wall_time_s
        return replace(result, selection_reason=reason, expected_error_mm=np.zeros(len(forces)), wall_time_s=spent)
    result = {"elastic": elastic, "foundation": foundation}[model]
    return replace(result, selection_reason=reason, expected_error_mm=errors[model],
                   wall_time_s=elastic.wall_time_s + foundation.wall_time_s)
