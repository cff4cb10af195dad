"""What a calibration's model errs by, and what that adds to the covariance of the fitted unknowns.

    counts = J t + s B b + B' b' + n        t unknowns; n noise; b, b' independent, of standard deviation 1

A fit by the noise alone takes the model for exact: its intervals shrink with the number of readings, while its estimates are off by
what gains and moduli absorb of the model's error. s is the model's relative error, the root mean square over a map; columns of B:
* all maps are larger by a share: a model errs in the same sense in all presses;
* each press' maps are larger by another share, half as large;
* the map over each taxel is larger in each press, by the same amount for all taxels, constant or linear in the force.
B': the sheet over each taxel is thicker than nominal, which bends its reading beside changing its gain.
s is the mode of its posterior from the misfits (restricted maximum likelihood: all unknowns are free within their priors), so that
it counts what the fit absorbed, too; its prior is the model's known error. The estimates stay those of the fit by noise. With
A = J'J + P and P the priors' precision, their covariance is A^-1 + A^-1 J' (s^2 B B' + B' B'') J A^-1.
References: Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001) 425; Patterson and Thompson, Biometrika 58 (1971) 545.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from softtact.calibration.problem import Linear, Problem

# Relative error of the map against the hyperelastic model, median before a fit (docs/explanation/fast_models.md: of the foundation
# model within its validity, 3 % at rest and as much again with the depth); of that model its meshes' (discretisation.md).
MODEL_ERROR = {"foundation": 0.06, "elastic": 0.45, "hyperelastic": 0.03}
_FACTOR = 2.0            # by which it may be larger or smaller: one standard deviation of its logarithm
_OF_A_PRESS = 0.5        # error of one press over that of all; benchmarks/calibration_intervals.py
_WITH_FORCE = 0.5        # part over a taxel that is linear in the force, over the constant one
SHEET_SCATTER = 0.02     # of the sheet's thickness over the taxels, the virtual sensor's; assumed
_SMALL = 0.01            # relative change of the map, for a difference
_AT_REST_MM = 0.1        # uniform displacement at which a gain is that of a nominal sheet


@dataclass(frozen=True)
class Discrepancy:
    """The error of a calibration's model."""

    relative: float
    """s: relative error of the maps."""
    covariance: np.ndarray
    """(q, q) that it and the uneven sheet add to the covariance of the unknowns."""


def discrepancy(problem: Problem, vector: np.ndarray, best: Linear, misfits: np.ndarray, *, jacobian: np.ndarray,
                prior: np.ndarray, off_prior: np.ndarray) -> Discrepancy:
    """The `Discrepancy` at the fitted unknowns.

    misfits (n,), jacobian (n, q): over the noise;  prior (q,): deviations before the fit;  off_prior (q,): fitted unknowns less the
    means before the fit
    """
    inverse = problem.stacked()[1]
    model, sheet = _of_model(problem, vector, best, inverse), _of_sheet(problem, vector, best, inverse)
    relative = _most_likely(misfits + jacobian @ off_prior, np.hstack([jacobian * prior, sheet]), model,
                            MODEL_ERROR[problem.presses.model])
    gained = np.linalg.solve(jacobian.T @ jacobian + np.diag(prior**-2.0), jacobian.T @ np.hstack([relative * model, sheet]))
    return Discrepancy(relative, gained @ gained.T)


def _of_model(problem, vector, best, inverse):
    """B (n, m) over the noise: changes of the counts for a relative error of 1 of the maps."""
    slope = (np.concatenate(problem.changes_of(vector, amplitude=1 + _SMALL)) - np.concatenate(problem.changes(vector))) / _SMALL
    each = inverse * best.gain * slope
    typical = (inverse > 0) * np.sqrt((each**2).mean(axis=(1, 2), keepdims=True))
    columns, end = [each], 0
    for one in problem.experiments:
        start, end = end, end + len(one.counts)
        ramp = (2 * one.force_of_bins / one.force_of_bins.max() - 1)[:, None, None]
        columns.append(_OF_A_PRESS * _padded(each[start:end], start, each))
        for row, column in np.ndindex(each.shape[1:]):
            over = np.zeros_like(each[start:end])
            over[:, row, column] = typical[start:end, row, column]
            columns += [_padded(over, start, each), _WITH_FORCE * _padded(ramp * over, start, each)]
    return np.stack([column.ravel() for column in columns], axis=1)


def _padded(part, start, whole):
    """Zeros like `whole` with some rows from `start` on."""
    out = np.zeros_like(whole)
    out[start:start + len(part)] = part
    return out


def _of_sheet(problem, vector, best, inverse):
    """B' (n, taxels) over the noise: changes of the counts for one standard deviation of each taxel's sheet, at an equal gain."""
    spec = problem.presses.sensor.spec
    thicker = SHEET_SCATTER * spec.dielectric.sheet_thickness_mm
    change, other = (np.concatenate(problem.changes_of(vector, sheet_excess_mm=excess)) for excess in (0.0, thicker))
    flat = np.full((1, *spec.map_shape), _AT_REST_MM)
    less = problem.change_of(flat, sheet_excess_mm=thicker)[0] / problem.change_of(flat)[0]
    each = inverse * best.gain * (other / less - change)
    count = each[0].size
    return (each.reshape(-1, count, 1) * np.eye(count)).reshape(-1, count)


def _most_likely(values, known, model, median):
    """Mode of the posterior of s for values (n,) ~ N(0, 1 + known known' + s^2 model model'), ln s ~ N(ln median, ln _FACTOR)."""
    both = np.hstack([known, model])
    gram, seen = both.T @ both, both.T @ values

    def minus_log(ln_s):
        scale = np.concatenate([np.ones(known.shape[1]), np.full(model.shape[1], np.exp(ln_s))])
        matrix, right = np.eye(len(scale)) + scale[:, None] * gram * scale, scale * seen
        _, logarithm = np.linalg.slogdet(matrix)
        prior = (ln_s - np.log(median)) ** 2 / np.log(_FACTOR) ** 2
        return logarithm - right @ np.linalg.solve(matrix, right) + prior

    low, high = np.log(median) - 12 * np.log(_FACTOR), np.log(median) + 3 * np.log(_FACTOR)
    return float(np.exp(minimize_scalar(minus_log, bounds=(low, high), method="bounded").x))
