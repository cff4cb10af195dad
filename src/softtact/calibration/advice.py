"""Which further press would tell most about a sensor: what each of some candidates would leave of the covariance.

D-optimal: the press that shrinks the volume of what is uncertain most; the mean deviation of the gains afterwards, which A-optimal
presses minimise, stands beside it (A. Atkinson, A. Donev, R. Tobias, Optimum Experimental Designs, 2007, ch. 10). The object is
taken to lie exactly where it is said to.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from softtact.calibration.fit import CalibrationResult
from softtact.readout.calibrated import relative_change

_LEVELS = 4            # of a candidate's staircase
_READINGS = 60.0       # at each: a second


@dataclass(frozen=True)
class Candidate:
    """A press that could be recorded: the object (mm) and its place x, y in mm, angle in degrees."""

    name: str
    mesh: trimesh.Trimesh
    place: tuple[float, float, float]


@dataclass(frozen=True)
class Advice:
    """What a candidate would tell. information: growth of half the logarithm of the information's determinant, in nats;
    gain_deviation: mean over the taxels, of the common gain, that would be left;  largest_n: the force to press up to
    """

    candidate: Candidate
    information: float
    gain_deviation: float
    largest_n: float


def quarters(name: str, mesh: trimesh.Trimesh, footprint_mm: Sequence[float]) -> list[Candidate]:
    """An object in the sensor's middle and in the middles of its quarters."""
    x, y = (0.25 * side for side in footprint_mm)
    places = [(0.0, 0.0), (-x, -y), (x, -y), (-x, y), (x, y)]
    return [Candidate(name, mesh, (px, py, 0.0)) for px, py in places]


def rank(result: CalibrationResult, candidates: Sequence[Candidate], *, largest_n: float) -> list[Advice]:
    """An `Advice` for each candidate pressed up to a force (N), as far as the model is valid; the one that tells most first."""
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
    own = [name for name in ("ln modulus", "ln scale") if name in names] + ["gain", "zero"]
    noise = np.mean([one.noise_counts for one in problem.experiments]) * max(result.misfit, 1.0)
    jacobian = np.hstack([columns[name] for name in own]) / max(noise, np.sqrt(1 / 12)) * np.sqrt(_READINGS)
    before = result.covariance[np.ix_(keep, keep)]
    after = np.linalg.inv(np.linalg.inv(before) + jacobian.T @ jacobian)
    growth = 0.5 * (np.linalg.slogdet(before)[1] - np.linalg.slogdet(after)[1])
    first, common = names.index("gain 0"), names.index("ln scale")
    gains = np.diag(after)[first:first + taxels] + after[common, common] + 2 * after[common, first:first + taxels]
    return Advice(candidate, float(growth), float(np.sqrt(gains).mean()), float(forces[-1] * scale))
