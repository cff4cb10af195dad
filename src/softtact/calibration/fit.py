"""Fit a sensor's unknowns to experiments, with their covariance and what the presses do not determine; write the sensor's file.

The file is a copy of the sensor's file with a block `calibration`, which `load_sensor` reads. A calibration with the hyperelastic
model would take too long, so that model is only compared with the calibrated sensor.
"""

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from scipy.optimize import least_squares

from softtact.calibration.discrepancy import discrepancy
from softtact.calibration.ladder import COVERS, Presses, parabola, with_cover
from softtact.calibration.problem import Linear, Problem
from softtact.errors import ConvergenceError
from softtact.files import atomic_path
from softtact.progress import announce
from softtact.readout.taxels import relative_change
from softtact.sensors.base import FILES_OF_READOUTS, read_mapping
from softtact.sensors.fields import CalibrationBlock, SidesBelow
from softtact.sensors.specification import spec_from_dict

_ROUNDS, _SETTLED = 6, 0.5       # rounds of new presses at the fitted places, and the change of counts over noise that ends them
_UNKNOWN = 0.5                   # of the prior's standard deviation; with more left, the presses do not determine an unknown
_PARTS = 0.35                    # least component of a unit vector for which an unknown is named
_HEAD = "# Made by `softtact calibrate` from {source}. Counts: gain x counts_per_relative_change x dC/C0 + zero_counts.\n"


@dataclass(frozen=True)
class CalibrationResult:
    """The result of a calibration."""

    problem: Problem
    """Experiments and unknowns."""
    vector: np.ndarray
    """(p,) fitted unknowns in the order of `problem.names`."""
    linear: Linear
    """Common scale, gains and zeros."""
    counts: list[np.ndarray]
    """Predicted (b, row, column) of each experiment."""
    covariance: np.ndarray
    """(q, q) covariance of `names`, with the priors and the error of the model; a misfit beyond the noise counts as noise, too."""
    names: list[str]
    """(q,) `problem.names`, `ln scale`, `gain 0` to the last taxel's, `zero 0` to the last taxel's."""
    misfit: float
    """Root mean square of the misfits over their noise: 1 if the model explains all but the noise."""
    not_identifiable: list[str]
    """Sentences on unknowns that these presses do not determine; empty if they determine all."""
    model_error: float
    """Relative error of the model's maps, estimated from the misfits (`calibration.discrepancy`)."""
    noise_covariance: np.ndarray
    """(q, q) the part of `covariance` that more presses reduce: without the error of the model."""

    @property
    def modulus_scale(self) -> float:
        """Moduli over those of the materials' files; 1 if not fitted."""
        return float(np.exp(self.problem.value(self.vector, "ln modulus", 0.0)))

    def deviation(self, name: str) -> float:
        """Standard deviation of an unknown by its name."""
        return float(np.sqrt(self.covariance[self.names.index(name), self.names.index(name)]))

    @property
    def gain_deviation(self) -> np.ndarray:
        """(row, column) standard deviation of the gains over the common scale, including that of the scale."""
        k, s = self.names.index("gain 0"), self.names.index("ln scale")
        n, c = self.linear.gain.size, self.covariance
        variance = np.diag(c)[k:k + n] + c[s, s] + 2 * c[s, k:k + n]
        return np.sqrt(variance).reshape(self.linear.gain.shape)

    @property
    def zero_deviation(self) -> np.ndarray:
        """(row, column) standard deviation of the zeros in counts."""
        k = self.names.index("zero 0")
        return np.sqrt(np.diag(self.covariance)[k:]).reshape(self.linear.zero.shape)

    def block(self) -> CalibrationBlock:
        """The block `calibration` of a sensor's file."""
        shares, times = self.problem.creep(self.vector)
        deviations = {name: float(f"{self.deviation(name):.3g}") for name in self.names if not name.startswith(("gain", "zero"))}
        deviations |= {"gain, mean": float(f"{self.gain_deviation.mean():.3g}"),
                       "zero, mean": float(f"{self.zero_deviation.mean():.3g}")}
        noise = float(np.mean([one.noise_counts for one in self.problem.experiments]))
        return CalibrationBlock(
            gain=_rounded(self.linear.gain / self.linear.scale, 5), zero_counts=_rounded(self.linear.zero, 2),
            counts_per_relative_change=round(self.linear.scale, 3), relaxation=tuple(round(one, 5) for one in shares),
            relaxation_s=tuple(round(one, 4) for one in times), modulus_scale=round(self.modulus_scale, 5),
            noise_counts=round(noise, 3), source="; ".join(one.name for one in self.problem.experiments),
            not_identifiable=tuple(self.not_identifiable), standard_deviations=deviations)


def _rounded(values, digits):
    return tuple(tuple(round(float(one), digits) for one in row) for row in values)


def calibrate(problem: Problem, *, label: str = "calibration") -> CalibrationResult:
    """Fit a `Problem`. Raises ConvergenceError if new presses at the fitted places still change the counts after some rounds."""
    vector = problem.mean.copy()
    for number in range(1, _ROUNDS + 1):
        vector = _descend(problem, vector)
        before = _predicted(problem, vector)
        problem.at(vector)
        _, inverse = problem.stacked()
        change = float(np.sqrt(((inverse * (_predicted(problem, vector) - before)) ** 2).sum() / (inverse > 0).sum()))
        if label:
            announce(f"{label}: round {number}; new presses at the fitted places changed the counts by {change:.2g} of their noise")
        if change <= _SETTLED:
            break
    else:
        raise ConvergenceError(f"The calibration has not converged after {_ROUNDS} rounds: new presses at the fitted places still "
                               f"change the counts by {change:.2g} of their noise; state the places more exactly (--place).")
    vector = _descend(problem, vector)
    return _result(problem, vector)


def _predicted(problem, vector):
    change = np.concatenate(problem.changes(vector))
    best = problem.linear(change)
    return best.gain * change + best.zero


def _descend(problem, start):
    """The vector of unknowns after the least-squares fit from a start."""
    if not len(start):
        return start

    def jacobian(vector):
        return problem.jacobian(vector, _steps(problem, vector))

    low, high = problem.bounds
    inside = np.clip(start, low + 1e-9, high - 1e-9)
    return least_squares(problem.residuals, inside, jac=jacobian, bounds=(low, high), x_scale=problem.deviation, xtol=1e-4,
                         ftol=1e-6, max_nfev=30).x


def _steps(problem, vector):
    """Steps (p,) of forward differences; backward ones at an upper bound."""
    return np.where(vector + problem.steps < problem.bounds[1], problem.steps, -problem.steps)


def _differences(function, vector, steps):
    """Differences (n, p) of a function (n,) for steps (p,)."""
    here = function(vector)
    return np.stack([(function(moved) - here) / step for moved, step in zip(vector + np.diag(steps), steps, strict=True)], axis=1)


def _result(problem, vector):
    changes = problem.changes(vector)
    best = problem.linear(np.concatenate(changes))
    counts, inverse = problem.stacked()
    predicted = [best.gain * change + best.zero for change in changes]
    misfits = inverse * (counts - np.concatenate(predicted))
    used = int((inverse > 0).sum())
    unknowns = len(vector) + 2 * best.gain.size
    misfit = float(np.sqrt((misfits**2).sum() / max(used - unknowns, 1)))
    names, jacobian, prior = sensitivities(problem, vector, best, np.concatenate(changes), inverse)
    information = jacobian.T @ jacobian / max(misfit, 1.0) ** 2
    covariance = np.linalg.inv(information + np.diag(prior**-2.0))
    unknown = not_identifiable(names, information, covariance, prior, best.gain.shape)
    off_prior = np.concatenate([vector - problem.mean, [0.0], (best.gain / best.scale - 1).ravel(), best.zero.ravel()])
    wrong = discrepancy(problem, vector, best, misfits.ravel(), jacobian=jacobian, prior=prior, off_prior=off_prior)
    return CalibrationResult(problem, vector, best, predicted, covariance + wrong.covariance, names, misfit, unknown,
                             wrong.relative, covariance)


def sensitivities(problem: Problem, vector: np.ndarray, best: Linear, change: np.ndarray,
                  inverse: np.ndarray) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Names (q,) of all unknowns, derivatives (n, q) of the predicted counts over their noise, and the priors' deviations (q,)."""
    taxels = best.gain.size
    fitted = _differences(lambda moved: (best.gain * np.concatenate(problem.changes(moved))).ravel(), vector,
                          _steps(problem, vector)) if len(vector) else np.zeros((change.size, 0))
    at = np.tile(np.arange(taxels), len(change))
    each = (at[:, None] == np.arange(taxels)).astype(float)
    columns = [fitted, (best.gain * change).reshape(-1, 1), best.scale * change.reshape(-1, 1) * each, each]
    names = [*problem.names, "ln scale", *(f"gain {k}" for k in range(taxels)), *(f"zero {k}" for k in range(taxels))]
    p = problem.priors
    prior = np.concatenate([problem.deviation, [p.log_scale], np.full(taxels, p.gain), np.full(taxels, p.zero_counts)])
    return names, inverse.reshape(-1, 1) * np.hstack(columns), prior


def not_identifiable(names: Sequence[str], information: np.ndarray, covariance: np.ndarray, prior: np.ndarray,
                     shape: tuple[int, int]) -> list[str]:
    """Sentences on unknowns that presses with this information (q, q) leave about as uncertain as before.

    One unknown: more than half of its prior's standard deviation is left. Several together: a combination that the presses do not
    separate (an eigenvector of the information, in units of the priors, with an eigenvalue below one).
    """
    left = np.sqrt(np.diag(covariance)) / prior
    open_taxels = [int(name.split()[1]) for name, share in zip(names, left, strict=True)
                   if name.startswith("gain ") and share > _UNKNOWN]
    sentences = []
    if open_taxels:
        sentences.append(f"the gain of {len(open_taxels)} of {shape[0] * shape[1]} taxels, which hardly feel these presses and "
                         f"keep the common gain: {', '.join(map(str, open_taxels))}")
    for name, share in zip(names, left, strict=True):
        if share > _UNKNOWN and not name.startswith(("gain ", "zero ")):
            sentences.append(f"{in_words(name)}: {share:.0%} of what was uncertain before is left")
    keep = [k for k, name in enumerate(names) if not name.startswith(("gain ", "zero "))]
    inner = np.ix_(keep, keep)
    # Information on these with gains and zeros free: the inverse of their block of the covariance.
    scaled = np.linalg.inv(covariance[inner]) * np.outer(prior[keep], prior[keep]) - np.eye(len(keep))
    values, vectors = np.linalg.eigh(scaled)
    for value, vector in zip(values, vectors.T, strict=True):
        parts = [in_words(names[keep[k]]) for k in np.flatnonzero(np.abs(vector) > _PARTS)]
        if value < 1 and len(parts) > 1:
            sentences.append(f"{' and '.join(parts)} apart from each other")
    return sentences


def in_words(name: str) -> str:
    """An unknown's name in words, for a message."""
    kind, _, number = name.rpartition(" ")
    words = {"share": "the share of creep", "ln time": "the time constant of creep", "x": "x of press", "y": "y of press",
             "angle": "the angle of press"}
    alone = {"ln scale": "the common gain", "ln modulus": "the modulus scale", "cover": "the cover's thickness",
             "friction": "the object's friction"}
    return alone.get(name) or f"{words[kind]} {number}"


def write_calibrated(path: str | Path, sensor_file: str | Path, result: CalibrationResult) -> None:
    """Write a copy of `sensor_file` with the result of a calibration; the file is checked before it is put in place."""
    values = read_mapping(sensor_file)
    block = result.block()
    if "cover" in result.problem.names:
        spec: Any = result.problem.presses.sensor.spec     # of kind frusta, else there were no presses
        thicker = with_cover(spec, result.problem.value(result.vector, "cover", 1.0))
        values["cover"]["thickness_mm"] = _calibrated(thicker.cover.thickness_mm, block.source)
        if isinstance(thicker.edge.held, SidesBelow):
            values["edge"] = thicker.edge.model_dump(mode="json") | {
                "held": {"sides_below_mm": _calibrated(thicker.edge.held.sides_below_mm, block.source)}}
    if "friction" in result.problem.names:
        found = round(result.problem.value(result.vector, "friction", 0.0), 4)
        values["friction"] = values.get("friction", {}) | {"object": {"value": found, "reason": f"calibrated from {block.source}"}}
    values["calibration"] = block.model_dump(mode="json")
    _keep_files(values.get("readouts", {}), Path(sensor_file).parent, Path(path).parent)
    spec_from_dict(values, where=str(path))
    text = yaml.safe_dump(values, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True)
    with atomic_path(path) as temporary:
        temporary.write_text(_HEAD.format(source=block.source) + text, encoding="utf-8")


def _keep_files(readouts, before, now):
    """Name files of readouts, which stand beside the sensor's file, from another folder."""
    for entry in readouts.values():
        for key in FILES_OF_READOUTS:
            if isinstance(entry.get(key), str) and (before / entry[key]).is_file():
                entry[key] = os.path.relpath(before / entry[key], now)


def _calibrated(value_mm, source):
    return {"value": round(value_mm, 5), "reason": f"calibrated from {source}"}


def hyperelastic_differences(result: CalibrationResult) -> list[float | None]:
    """Root mean square difference in counts between the hyperelastic and the calibrated model, at each press' largest valid force.

    Both use the calibrated gains, moduli, cover, friction and places, without creep. None if no force is valid, or if the
    hyperelastic model does not reach it.
    """
    return [_difference(result, k) for k in range(len(result.problem.experiments))]


def _difference(result, k):
    problem, one = result.problem, result.problem.experiments[k]
    cover = problem.value(result.vector, "cover", 1.0)
    sensor, place = problem.presses.sensor, problem.place(result.vector, k)
    force = min(problem.valid_n[k], float(one.force_n.max()) / result.modulus_scale)
    if force == 0:
        return None
    announce(f"{one.name}: pressing with the hyperelastic model at {force:.3g} N")
    friction = problem.value(result.vector, "friction", 0.0)
    calibrated = replace(sensor, spec=with_cover(sensor.spec, cover), prepared_models={})
    if "friction" in problem.names:
        calibrated = calibrated.with_friction(friction)
    try:
        other = Presses(calibrated, model="hyperelastic", levels=1).ladder(one.mesh, place, largest_n=force).maps_mm[-1]
    except ConvergenceError:
        return None
    shares = parabola(COVERS, cover) if "cover" in problem.names else {1.0: 1.0}
    fitted = sum(share * problem.presses.ladder(one.mesh, place, largest_n=force, cover=variant).maps_mm[-1]
                 for variant, share in shares.items())
    fitted = fitted + sum(share * np.tensordot(ladder.weights(np.array([force]))[0], ladder.maps_mm, 1)
                          for share, ladder in problem.friction_changes(k, friction))
    apart = result.linear.gain * (relative_change(sensor.spec, other) - relative_change(sensor.spec, fitted))
    return float(np.sqrt(np.mean(apart**2)))
