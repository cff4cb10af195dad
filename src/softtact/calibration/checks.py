"""Checks before a fit that recordings are of the stated presses, and the further press that would help the calibration most.

Each recording alone is compared with the simulated press at one common gain and zero, with the object up to 1.5 mm off its stated
place. The share of the counts' variance that this leaves unexplained is small for the right press: gains that differ by 20 % leave
4 %. For a wrong press it is larger, and the counts may fit much better turned round, from the other finger, or with the force
in another unit.

The best further press is D-optimal: among candidates it reduces the volume of the uncertainty most. The mean deviation of the
gains after it is also reported, which A-optimal presses minimise (A. Atkinson, A. Donev, R. Tobias, Optimum Experimental
Designs, 2007, ch. 10). The object is assumed to lie exactly in its stated place.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from softtact.calibration.experiment import Experiment
from softtact.calibration.fit import CalibrationResult
from softtact.calibration.problem import Problem
from softtact.errors import InputError
from softtact.press.ladder import Ladder
from softtact.readout.taxels import relative_change

UNEXPLAINED = 0.1      # unexplained share of the variance that refuses a recording: that of gains 30 % apart, beyond any sensor
_CLEARLY = 0.5         # ratio of the unexplained shares below which another interpretation of the recording is better
_AT_BOUND = 0.01       # distance from a bound that counts as at the bound, in ln modulus or mm
_PERFECT = 0.01        # unexplained share below which no other interpretation is tried
UNITS = {"kilograms-force": 9.80665, "pounds-force": 4.44822}     # one unit of force in N
_OFF_MM = (-1.5, -0.75, 0.0, 0.75, 1.5)
_BINS = 30
_TURNS = {"its rows turned round": (-1, 1), "its columns turned round": (1, -1), "rows and columns turned round": (-1, -1)}
_LEVELS = 4            # load steps of a candidate press
_READINGS = 60.0       # at each load step: one second


@dataclass(frozen=True)
class PressCheck:
    """How well the stated press explains a recording.

    unexplained: share of the variance that a common gain and zero leave;  turned: the least share with rows or columns turned round
    """

    unexplained: float
    turned: float

    @property
    def tells_orientation(self) -> bool:
        """Whether the press shows the orientation: turned round, the taxels would fit clearly worse."""
        return self.unexplained < _CLEARLY * self.turned


def check_recordings(problem: Problem) -> list[PressCheck]:
    """A `PressCheck` of each experiment. Raises InputError where a recording is not of the stated press."""
    return [_check(problem, k, one) for k, one in enumerate(problem.experiments)]


def check_result(result: CalibrationResult) -> None:
    """Raises InputError if moduli, cover, friction or a place are at a bound of the fit, or a taxel does not follow the presses."""
    problem = result.problem
    gain = result.linear.gain / result.linear.scale
    if gain.min() <= 0:
        row, column = np.unravel_index(int(gain.argmin()), gain.shape)
        names = ", ".join(one.name for one in problem.experiments)
        raise InputError(f"{names}: taxel {row * gain.shape[1] + column} (row {row}, column {column}) does not follow the press "
                         f"(its gain would be {gain.min():.2g} of the common one); check the taxel.")
    low, high = problem.bounds
    for name, value, least, most in zip(problem.names, result.vector, low, high, strict=True):
        if name == "ln modulus" and min(value - least, most - value) < _AT_BOUND:
            raise InputError(f"The fitted moduli are {result.modulus_scale:.2f} times those of the materials, a bound of the "
                             "fit; check that the forces are in newtons, and that the objects are those that were pressed.")
        if name == "cover" and min(value - least, most - value) < _AT_BOUND:
            raise InputError(f"The fitted cover is {value:.2f} times as thick as the file states, a bound of the fit; correct the "
                             "file's thickness, or leave 'cover' out of --fit.")
        if name == "friction" and most - value < _AT_BOUND:
            raise InputError(f"The fitted friction is {value:.2f}, a bound of the fit; leave 'friction' out of --fit and state it.")
        if name.startswith("angle ") and min(value - least, most - value) < _AT_BOUND:
            raise InputError(f"{problem.experiments[int(name.split()[1]) - 1].name}: the object would be turned by {value:.0f} "
                             "degrees, a bound of the fit; state how it lay (--place).")
        if name.startswith(("x ", "y ")) and min(value - least, most - value) < _AT_BOUND:
            number = int(name.split()[1])
            raise InputError(f"{problem.experiments[number - 1].name}: the object would lie {value:.1f} mm along {name[0]}, a "
                             "bound of the fit; state where it lay (--place).")


def _check(problem, k, one):
    ladder, moving = problem.at_place(k)
    bins = np.unique(np.linspace(0, len(one.counts) - 1, _BINS).astype(int))
    bins = bins[one.force_of_bins[bins] <= problem.valid_n[k]]
    if problem.valid_n[k] <= 0 or not (one.force_of_bins[bins] > 0).any():
        raise InputError(f"{one.name}: the {problem.presses.model} model is valid at none of its forces, up to "
                         f"{one.force_n.max():g} N; give presses of a blunter object or with smaller forces, or another "
                         "--model.")
    usable = one.usable[bins].astype(float)
    predicted = _predicted(problem, one, ladder, moving, bins, 1.0)
    here = _unexplained(predicted, one.counts[bins], usable)
    turned = {words: _unexplained(predicted, one.counts[bins][:, ::y, ::x], usable[:, ::y, ::x])
              for words, (y, x) in _TURNS.items()}
    if here > _PERFECT:
        _refuse_other_finger(one, predicted, bins, here)
        best = min(turned, key=turned.__getitem__)
        if turned[best] < _CLEARLY * here:
            raise InputError(f"{one.name}: its counts follow the press better with {best} ({here:.0%} of their variance are not "
                             f"explained as they are, {turned[best]:.1%} so); put the object where it lay (--place), or turn the "
                             "recording's taxels round.")
        _refuse_unit(problem, one, here)
    if here > UNEXPLAINED:
        raise InputError(f"{one.name}: the press explains {1 - here:.0%} of its counts' variance only; is it another object, "
                         "another place (--place), or another force?")
    return PressCheck(here, min(turned.values()))


def _refuse_other_finger(one, predicted, bins, here):
    if one.other_counts is None:
        return
    other = one.other_counts[bins]
    if np.ptp(other) > 0.5 * np.ptp(one.counts) and _unexplained(predicted, other, np.ones_like(other)) < _CLEARLY * here:
        raise InputError(f"{one.name}: the other finger follows the press clearly better; are the fingers swapped? Calibrate that "
                         "one (--finger).")


def _refuse_unit(problem, one, here):
    """Refuse forces that fit clearly better in another unit."""
    top = problem.presses.reach(one.mesh, one.place, largest_n=max(UNITS.values()) * one.force_n.max())[1]
    ladder = problem.presses.ladder(one.mesh, one.place, largest_n=top)
    bins = np.unique(np.linspace(0, len(one.counts) - 1, _BINS).astype(int))
    for unit, factor in UNITS.items():
        within = bins[factor * one.force_of_bins[bins] <= top]
        usable = one.usable[within].astype(float)
        if len(within) < 3 or np.ptp(one.counts[within]) < 0.5 * np.ptp(one.counts):
            continue
        as_given, as_unit = (_unexplained(_predicted(problem, one, ladder, None, within, times), one.counts[within], usable)
                             for times in (1.0, factor))
        if as_unit < _CLEARLY * as_given:
            raise InputError(f"{one.name}: its counts rise as if the forces were in {unit} ({as_given:.0%} of their variance are "
                             f"not explained by newtons, {as_unit:.1%} by {unit}); give them in newtons.")


def _predicted(problem: Problem, one: Experiment, ladder: Ladder, moving: np.ndarray | None, bins: np.ndarray,
               times: float) -> np.ndarray:
    """dC/C0 (place, b, row, column) without creep, at `times` the forces, with the object at its place and at offsets from it."""
    weights = (one.bins @ ladder.weights(times * one.force_n))[bins]
    places = [np.zeros(3)] if moving is None else [np.array([x, y, 0.0]) for x in _OFF_MM for y in _OFF_MM]
    spec = problem.presses.sensor.spec
    return np.stack([relative_change(spec, np.tensordot(
        weights, ladder.maps_mm if moving is None else ladder.maps_mm + np.tensordot(off, moving, 1), 1)) for off in places])


def _unexplained(predicted, counts, usable):
    """Share of the variance of the counts (b, row, column) that a common gain and zero leave, the least over the places."""
    total = max(usable.sum(), 1e-30)
    y = counts - (usable * counts).sum() / total
    m = predicted - (usable * predicted).sum(axis=(1, 2, 3), keepdims=True) / total
    gain = (usable * m * y).sum(axis=(1, 2, 3)) / np.maximum((usable * m * m).sum(axis=(1, 2, 3)), 1e-30)
    gain = np.maximum(gain, 0.0)      # pressing does not lower counts
    left = (usable * (y - gain[:, None, None, None] * m) ** 2).sum(axis=(1, 2, 3)) / max((usable * y * y).sum(), 1e-30)
    return float(left.min())


@dataclass(frozen=True)
class Candidate:
    """A press that could be recorded: an object (mm) and its place x, y in mm, angle in degrees."""

    name: str
    mesh: trimesh.Trimesh
    place: tuple[float, float, float]


@dataclass(frozen=True)
class Advice:
    """The benefit of a candidate press.

    information: increase of half the logarithm of the determinant of the information matrix, in nats
    gain_deviation: remaining standard deviation of a gain over the common gain, mean over the taxels;  largest_n: largest force
    """

    candidate: Candidate
    information: float
    gain_deviation: float
    largest_n: float


def quarters(name: str, mesh: trimesh.Trimesh, footprint_mm: Sequence[float]) -> list[Candidate]:
    """Candidates of an object at the centre of the sensor and at the centres of its quarters."""
    x, y = (0.25 * side for side in footprint_mm)
    places = [(0.0, 0.0), (-x, -y), (x, -y), (-x, y), (x, y)]
    return [Candidate(name, mesh, (px, py, 0.0)) for px, py in places]


def rank(result: CalibrationResult, candidates: Sequence[Candidate], *, largest_n: float) -> list[Advice]:
    """An `Advice` for each candidate pressed up to a force (N) within the model's validity, the most informative first."""
    return sorted((_advice(result, one, largest_n) for one in candidates), key=lambda advice: -advice.information)


def _advice(result, candidate, largest_n):
    problem, scale = result.problem, result.modulus_scale
    keep = [k for k, name in enumerate(result.names) if name.startswith(("ln scale", "ln modulus", "gain", "zero"))]
    names = [result.names[k] for k in keep]
    valid, top = problem.presses.reach(candidate.mesh, candidate.place, largest_n=largest_n / scale)
    ladder = problem.presses.ladder(candidate.mesh, candidate.place, largest_n=top)
    forces = max(valid, ladder.force_n[0]) * (np.arange(1, _LEVELS + 1) / _LEVELS) ** 2

    def change(at):
        return relative_change(problem.presses.sensor.spec, np.tensordot(ladder.weights(at), ladder.maps_mm, 1))

    m, taxels, step = change(forces), result.linear.gain.size, 0.01
    each = np.tile(np.eye(taxels), (_LEVELS, 1))
    columns = {"ln scale": (result.linear.gain * m).reshape(-1, 1),
               "ln modulus": (result.linear.gain * (change(forces * np.exp(-step)) - m) / step).reshape(-1, 1),
               "gain": result.linear.scale * m.reshape(-1, 1) * each, "zero": each}
    kinds = [name for name in ("ln modulus", "ln scale") if name in names] + ["gain", "zero"]
    noise = np.mean([one.noise_counts for one in problem.experiments]) * max(result.misfit, 1.0)
    jacobian = np.hstack([columns[name] for name in kinds]) / max(noise, np.sqrt(1 / 12)) * np.sqrt(_READINGS)
    both = np.ix_(keep, keep)
    before, of_model = result.noise_covariance[both], result.covariance[both] - result.noise_covariance[both]
    after = np.linalg.inv(np.linalg.inv(before) + jacobian.T @ jacobian)
    growth = 0.5 * (np.linalg.slogdet(before)[1] - np.linalg.slogdet(after)[1])
    first, common = names.index("gain 0"), names.index("ln scale")
    left = after + of_model
    gains = np.diag(left)[first:first + taxels] + left[common, common] + 2 * left[common, first:first + taxels]
    return Advice(candidate, float(growth), float(np.sqrt(gains).mean()), float(forces[-1] * scale))
