"""Choice of the model of a press: by the expected error of each cheaper model, or by the paper's count of mesh points.

`error`: the cheapest model that is within the tolerance in nine of ten presses and valid for all load steps. Both fast models are
pressed first, in about a second. Their difference is nearly the elastic model's error, since the foundation model is closer to
the hyperelastic one by an order of magnitude: squares of the difference and of the foundation model's own expected error are
added. That one grows with the depth of the object. After a model that fails, or is not valid for a load step, the next one is
tried; if the hyperelastic one is not valid either, the result states that no model is.
`paper`: the hyperelastic model for an object with fine details, else the elastic one (`geometry.complexity`).
Errors are root mean squares over the map, in mm, against the hyperelastic model; the largest of a press' load steps counts.
"""

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from trimesh import Trimesh

from softtact.contact.motion import Motion
from softtact.errors import ConvergenceError, InputError, ShellWarning, TimeLimitError
from softtact.geometry.complexity import OVERLAP_THRESHOLD, TOTAL_THRESHOLD, choose_model, score
from softtact.press.cache import in_words
from softtact.press.count_error import FOUNDATION, hyperelastic_counts
from softtact.press.fast import press_elastic, press_on_foundation
from softtact.press.reached import Reached
from softtact.press.result import PressResult
from softtact.press.task import RunControl
from softtact.words import plain

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

POLICIES = ("error", "paper")


def press_hyperelastic(sensor: "Sensor", placed: Trimesh, forces: np.ndarray | Motion, control: RunControl) -> PressResult:
    """`press.hyperelastic.press_hyperelastic`, whose forty modules load when it is first asked for."""
    from softtact.press import hyperelastic

    return hyperelastic.press_hyperelastic(sensor, placed, forces, control)


# The models that press straight down by force: from a placed object and forces to a `PressResult`.
PRESSES: dict[str, Callable[["Sensor", Trimesh, np.ndarray, RunControl], PressResult]] = {
    "elastic": press_elastic, "foundation": press_on_foundation, "hyperelastic": press_hyperelastic}
# The numbers below come from random contacts on this sensor (benchmarks/expected_error.py, benchmarks/results/expected_error.json).
CALIBRATED_ON = "coro"
ELASTIC_RELATIVE = 0.45     # the elastic model's error over its map's root mean square, without a press by the foundation model
# True error over expected error, 10th to 90th percentile: of the foundation model, fitted with objects left out in turn (7 % of the
# presses of objects outside of the fit lie above); of the elastic model with its error from the difference of both models; and, 5th
# to 95th percentile, of the elastic model alone (0.311 to 0.760 over 0.45).
INTERVALS = {"foundation": (0.80, 1.64), "elastic": (0.98, 1.05), "elastic alone": (0.69, 1.68)}
_POWER, _DEPTH_POWER = 3, 2      # of the compression and of the depth, with which the foundation model's relative error grows
_LONGEST_S = 120.0     # preparation of a model that the user did not name
_LARGEST_COMPRESSION = 0.5     # of a frustum's height, with a known error; calibrated up to 0.36


@dataclass(frozen=True)
class FoundationError:
    """Expected error of the foundation model over its map's root mean square.

    It is `at_rest` + `growth` (compression / frustum's height)^3 + `deep` (depth / sensor's thickness)^2, of the most compressed
    frustum and of the object's indentation. Source of the default values: benchmarks/expected_error.py.
    """

    at_rest: float = 0.0306
    growth: float = 0.0
    deep: float = 0.504

    def __call__(self, maps_mm: np.ndarray, compression: np.ndarray, depth: np.ndarray | float = 0.0) -> np.ndarray:
        """Errors (l,) in mm of maps (l, y, x) with largest compressions (l,) and depths (l,) as shares of height and thickness."""
        grown = self.growth * np.asarray(compression) ** _POWER + self.deep * np.asarray(depth) ** _DEPTH_POWER
        return (self.at_rest + grown) * rms(maps_mm)


def rms(maps_mm: np.ndarray) -> np.ndarray:
    """Root mean square over the maps (..., y, x)."""
    return np.sqrt((np.asarray(maps_mm) ** 2).mean(axis=(-2, -1)))


def calibrate(relative: np.ndarray, compression: np.ndarray, depth: np.ndarray | None = None) -> FoundationError:
    """`FoundationError` from true errors over the maps' root mean squares (n,), compressions (n,) and depths (n,) as for it.

    Least squares of the errors relative to the true ones; no constant is below zero. Without depths `deep` is 0.
    """
    from scipy.optimize import nnls

    columns = [np.ones(len(relative)), np.asarray(compression) ** _POWER]
    columns += [] if depth is None else [np.asarray(depth) ** _DEPTH_POWER]
    found, _ = nnls(np.column_stack(columns) / np.asarray(relative)[:, None], np.ones(len(relative)))
    return FoundationError(at_rest=float(found[0]), growth=float(found[1]), deep=0.0 if depth is None else float(found[2]))


def foundation_error(foundation: PressResult, *, height_mm: float, thickness_mm: float,
                     model: FoundationError = FoundationError()) -> np.ndarray:
    """Expected errors (l,) in mm of a press with the foundation model, or a data set with its names.

    Infinite where frusta are compressed much more than in the presses of the calibration.
    """
    compression = np.asarray(foundation.frustum_compression_mm) / height_mm
    expected = model(foundation.deformation_map_mm, compression, np.asarray(foundation.indentation_mm) / thickness_mm)
    return np.where(compression < _LARGEST_COMPRESSION, expected, np.inf)


def expected_errors(elastic: PressResult, foundation: PressResult, *, height_mm: float, thickness_mm: float,
                    model: FoundationError = FoundationError()) -> dict[str, np.ndarray]:
    """{model: errors (l,) in mm} of two `PressResult`s, or data sets with their names, of the same press."""
    of_foundation = foundation_error(foundation, height_mm=height_mm, thickness_mm=thickness_mm, model=model)
    difference = rms(np.asarray(elastic.deformation_map_mm) - np.asarray(foundation.deformation_map_mm))
    return {"elastic": np.hypot(difference, of_foundation), "foundation": of_foundation}


def cheapest(errors: dict[str, np.ndarray], tolerance_mm: float) -> str:
    """The first of elastic and foundation whose errors are all within the tolerance, else hyperelastic."""
    return next((name for name in ("elastic", "foundation") if name in errors and errors[name].max() <= tolerance_mm),
                "hyperelastic")


def with_expected_error(sensor: "Sensor", result: PressResult) -> PressResult:
    """The result of a fast model with its expected error, if the sensor has frusta, for which the errors were calibrated."""
    if result.model not in ("elastic", "foundation") or np.isnan(sensor.spec.frustum_height_mm):
        return result
    if np.isnan(result.hyperelastic_counts).all():
        result = replace(result, hyperelastic_counts=_counts_of_hyperelastic(sensor, result))
    if not np.isnan(np.asarray(result.expected_error_mm)).all():
        return _with_interval(result, result.model)
    expected = (ELASTIC_RELATIVE * rms(result.deformation_map_mm) if result.model == "elastic" else
                foundation_error(result, height_mm=sensor.spec.frustum_height_mm, thickness_mm=sensor.spec.thickness_mm))
    name = "elastic alone" if result.model == "elastic" else result.model
    return _with_interval(replace(result, expected_error_mm=expected), name)


def _counts_of_hyperelastic(sensor, result):
    """Counts (l, 3) to expect of the hyperelastic model where a fast model was pressed."""
    if result.model == "elastic":
        return hyperelastic_counts(sensor.spec, result)
    expected = foundation_error(result, height_mm=sensor.spec.frustum_height_mm, thickness_mm=sensor.spec.thickness_mm)
    return hyperelastic_counts(sensor.spec, result, FOUNDATION, np.isfinite(expected))


def _with_interval(result, name):
    """The result with the percentiles of the true over the expected error, and where both come from, as attributes."""
    low, high = INTERVALS[name]
    return replace(result, attributes=result.attributes | {
        "expected_error_times_low": low, "expected_error_times_high": high, "expected_error_calibrated_on": CALIBRATED_ON})


def press_auto(sensor: "Sensor", placed: Trimesh, forces: np.ndarray, control: RunControl, *, policy: str,
               tolerance_mm: float) -> PressResult:
    """A press with the model that a policy chooses; the result states the model, the reason and the expected error."""
    if policy not in POLICIES:
        raise InputError(f"The policy {policy!r} is unknown; use one of {', '.join(POLICIES)}.")
    if policy == "paper":
        return _by_counts(sensor, placed, forces, control)
    if not tolerance_mm > 0:
        raise InputError(f"The tolerance {tolerance_mm:g} mm is not positive; give the largest error of a map in mm.")
    reason = _reason_against_fast_models(sensor)
    if reason:
        result = PRESSES["hyperelastic"](sensor, placed, forces, control)
        return replace(result, selection_reason=f"{reason}: the hyperelastic model", expected_error_mm=np.zeros(len(forces)))
    return _by_error(sensor, placed, forces, tolerance_mm, control)


def _by_counts(sensor, placed, forces, control):
    counts = score(placed.triangles, footprint_mm=sensor.spec.footprint_mm, reach_mm=sensor.spec.thickness_mm)
    model = choose_model(counts.NPt, counts.CHt, counts.NPo, counts.CHo)
    result = PRESSES[model](sensor, placed, forces, control)
    reason = (f"the paper's rule: NPt / CHt = {counts.ratio_total:.3g} ({TOTAL_THRESHOLD:g} asks for the hyperelastic model), "
              f"NPo / CHo = {counts.ratio_overlap:.3g} ({OVERLAP_THRESHOLD:g})")
    return replace(result, selection_reason=reason)


def models_to_prepare(sensor: "Sensor", *, policy: str) -> tuple[str, ...]:
    """Names of the fast models that a policy may use."""
    if not sensor.spec.has_layers:
        return ()
    return ("elastic",) if policy == "paper" else () if _reason_against_fast_models(sensor) else ("elastic", "foundation")


def _reason_against_fast_models(sensor):
    """The reason in words why the fast models' errors are not computed; empty if they are."""
    if np.isnan(sensor.spec.frustum_height_mm):
        return f"{sensor.spec.name} has no frusta, on which the expected errors were calibrated"
    wait = sensor.seconds_to_prepare_foundation()
    if wait <= _LONGEST_S:
        return ""
    return (f"the foundation model, from which errors follow, would take {in_words(wait)} to prepare, once for {sensor.spec.name} "
            "(a press by --model foundation does it)")


def _by_error(sensor, placed, forces, tolerance_mm, control):
    start = time.monotonic()
    pressed, remarks = _fast_presses(sensor, placed, forces, control)
    errors = _errors_of(sensor, pressed)
    for name, result in pressed.items():
        if not result.within_validity.all():
            errors[name] = np.full(len(forces), np.inf)
            first = np.flatnonzero(result.within_validity == 0)[0]
            why = f" ({result.validity_reason[first]})" if result.validity_reason[first] else ""
            on = "" if result.within_validity[first:].any() else " on"
            remarks.append(f"the {name} model does not hold {'from' if on else 'at'} {result.normal_force_n[first]:g} N{on}{why}")
    mostly = {name: INTERVALS[name][1] * values for name, values in errors.items()}
    model = cheapest(mostly, tolerance_mm)
    stated = [f"{name} {plain(values.max())} (90 % below {plain(mostly[name].max())}) mm" for name, values in errors.items()
              if np.isfinite(values).all()]
    reason = "; ".join([f"expected errors: {', '.join(stated)}; asked for {plain(tolerance_mm)} mm" if stated else
                        "no fast model gives an error", *remarks])
    if sensor.spec.name != CALIBRATED_ON:
        reason += f" (calibrated on presses of the sensor {CALIBRATED_ON}, not of {sensor.spec.name})"
    spent = sum(result.wall_time_s for result in pressed.values())
    if model != "hyperelastic":
        if model == "elastic" and "foundation" in pressed:     # which is nearer to the hyperelastic model in this very press
            pressed[model] = replace(pressed[model], hyperelastic_counts=_counts_of_hyperelastic(sensor, pressed["foundation"]))
        return replace(pressed[model], selection_reason=reason, expected_error_mm=errors[model], wall_time_s=spent)
    if control.time_limit_s is not None:      # less the time of the fast presses
        control = replace(control, time_limit_s=control.time_limit_s - (time.monotonic() - start))
    result = PRESSES[model](sensor, placed, forces, control)
    if not result.within_validity.all():
        reason += "; none serves: the hyperelastic model does not hold either at the flagged load steps"
    return replace(result, selection_reason=reason, expected_error_mm=np.zeros(len(forces)), wall_time_s=result.wall_time_s + spent)


def _fast_presses(sensor, placed, forces, control):
    """{model: result} of the fast models that reach all forces, and a remark on each of the others."""
    pressed, remarks = {}, []
    for name in ("elastic", "foundation"):
        try:
            with warnings.catch_warnings():      # the chosen model warns of the shell
                warnings.simplefilter("ignore", ShellWarning)
                pressed[name] = PRESSES[name](sensor, placed, forces, replace(control, reached=Reached()))
        except TimeLimitError:
            raise
        except ConvergenceError as error:
            remarks.append(f"the {name} model fails: {error}")
    return pressed, remarks


def _errors_of(sensor, pressed):
    """{model: expected errors (l,) in mm} of the fast presses; the elastic model's follows from the foundation model's."""
    if "foundation" not in pressed:
        return {}
    size = {"height_mm": sensor.spec.frustum_height_mm, "thickness_mm": sensor.spec.thickness_mm}
    if "elastic" not in pressed:
        return {"foundation": foundation_error(pressed["foundation"], **size)}
    return expected_errors(pressed["elastic"], pressed["foundation"], **size)
