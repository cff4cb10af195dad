"""Least squares fit of the family of laws to test curves, with uncertainty.

Every law is linear in its constants of unit MPa and nonlinear in the others (exponents, locking stretch). So a start
only guesses the nonlinear ones; the linear ones follow from a bounded linear fit, and both are then polished together.
"""

from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import least_squares, lsq_linear
from scipy.stats import qmc

from softtact.errors import InputError
from softtact.materials.laws.base import principal_stretches
from softtact.materials.laws.registry import LAWS, law_class

STARTS = 12


@dataclass(frozen=True)
class LawFit:
    """A fitted law.

    law: name;  parameters: {name: MPa or 1}
    covariance: (p, p) of the parameters in their order, or None where the curves do not determine them
    rmse_mpa: over all points;  rmse_by_mode_mpa: {mode: MPa}
    aicc: Akaike's criterion corrected for few points; lower is better, constants without use cost
    at_bound: names of constants that ended on a bound of the search
    record: the optimiser's own account: points, starts, starts_agreeing, evaluations
    """

    law: str
    parameters: dict
    covariance: np.ndarray | None
    rmse_mpa: float
    rmse_by_mode_mpa: dict
    aicc: float
    at_bound: list = field(default_factory=list)
    record: dict = field(default_factory=dict)

    def make(self, *, bulk_modulus=1.0):
        """The `Law` itself."""
        return LAWS[self.law](self.parameters, bulk_modulus=bulk_modulus)


@dataclass(frozen=True)
class Points:
    """All points of the curves: principal stretches (n, 3), stress in MPa (n,), and the mode of each (n,)."""

    stretches: np.ndarray
    stress: np.ndarray
    mode: np.ndarray

    def predict(self, law):
        """Nominal stress (n,) of a law in MPa."""
        t = law.principal_stress(self.stretches)
        return (t[:, 0] - t[:, 2]) / self.stretches[:, 0]


def collect(curves):
    """`Points` of a list of curves."""
    return Points(
        stretches=np.concatenate([principal_stretches(curve.mode, curve.stretch) for curve in curves]),
        stress=np.concatenate([curve.nominal_stress for curve in curves]),
        mode=np.concatenate([np.full(len(curve.stretch), curve.mode) for curve in curves]),
    )


def fit_family(curves, *, laws="all", nonnegative=False, starts=STARTS, seed=0):
    """{law: LawFit} for a list of law names or "all"."""
    names = list(LAWS) if laws in ("all", ["all"]) else [laws] if isinstance(laws, str) else list(laws)
    return {name: fit_law(name, curves, nonnegative=nonnegative, starts=starts, seed=seed) for name in names}


def fit_law(name, curves, *, nonnegative=False, starts=STARTS, seed=0):
    """Fit one law to all curves at once: every point counts equally, residuals in MPa.

    nonnegative: keep the constants of unit MPa from being negative, which makes any law here stable everywhere
    """
    kind, points = law_class(name), collect(curves)
    if len(points.stress) <= len(kind.constants):
        raise InputError(
            f"Law {name} has {len(kind.constants)} constants and the curves only {len(points.stress)} points;"
            " give more points or choose a law with fewer constants."
        )
    problem = _Problem(kind, points, nonnegative=nonnegative)
    solutions = [problem.polish(problem.start(guess)) for guess in _guesses(problem, starts, seed)]
    best = min(solutions, key=lambda solution: solution.cost)
    agreeing = int(sum(solution.cost < best.cost * 1.001 + 1e-15 for solution in solutions))
    evaluations = int(sum(solution.nfev for solution in solutions))
    record = {"points": len(points.stress), "starts": len(solutions), "starts_agreeing": agreeing}
    return _report(problem, best.x, record | {"evaluations": evaluations})


class _Problem:
    """Least squares of one law in scaled unknowns: constants of unit MPa in multiples of the curves' stiffness."""

    def __init__(self, kind, points, *, nonnegative):
        self.kind, self.points = kind, points
        self.linear = np.array([constant.unit == "MPa" for constant in kind.constants])
        self.stiffness = _stiffness(points)
        self.scale = np.where(self.linear, self.stiffness, 1.0)
        self.low = np.array([constant.low for constant in kind.constants])
        self.high = np.array([constant.high for constant in kind.constants])
        if nonnegative:
            self.low = np.where(self.linear, 0.0, self.low)

    def law(self, x):
        names = [constant.name for constant in self.kind.constants]
        return self.kind(dict(zip(names, (x * self.scale).tolist(), strict=True)), bulk_modulus=1.0)

    def residual(self, x):
        """(n,) in multiples of the largest stress."""
        return (self.points.predict(self.law(x)) - self.points.stress) / np.abs(self.points.stress).max()

    def start(self, guess):
        """Unknowns with the nonlinear ones guessed and the linear ones solved for."""
        x = np.where(self.linear, 0.0, 1.0)
        x[~self.linear] = guess
        A = self._columns(x)
        size = np.linalg.norm(A, axis=0)
        bounds = self.low[self.linear] * size, self.high[self.linear] * size
        target = self.points.stress / np.abs(self.points.stress).max()
        x[self.linear] = lsq_linear(A / size, target, bounds=bounds).x / size
        return np.clip(x, self.low, self.high)

    def _columns(self, x):
        """(n, linear unknowns): the stress that each of them causes alone at 1."""
        zero = -self.residual(x)
        columns = []
        for k in np.flatnonzero(self.linear):
            alone = x.copy()
            alone[k] = 1.0
            columns.append(self.residual(alone) + zero)
        return np.stack(columns, axis=1)

    def polish(self, x):
        bounds = (self.low, self.high)
        return least_squares(self.residual, x, bounds=bounds, x_scale="jac", jac="3-point", max_nfev=100)

    def jacobian(self, x):
        """d stress / d constants (n, p), MPa per unit of each constant."""
        steps = 1e-6 * np.maximum(np.abs(x), 1e-2)
        columns = [(self.residual(x + d) - self.residual(x - d)) / (2 * d.sum()) for d in np.diag(steps)]
        return np.stack(columns, axis=1) * np.abs(self.points.stress).max() / self.scale


def _stiffness(points):
    """Shear modulus (MPa) of the neo-Hookean law closest to the points; sets the scale of the search."""
    unit = points.predict(LAWS["neo_hooke"]({"c10": 0.5}, bulk_modulus=1.0))
    modulus = float(unit @ points.stress / (unit @ unit)) if unit.any() else 0.0
    if not modulus > 0:
        raise InputError(
            f"The curves have the shear modulus {modulus:g} MPa over their range;"
            " check the signs of stress and strain, and that there are points away from stretch 1."
        )
    return modulus


def _guesses(problem, starts, seed):
    """Starts (m, nonlinear unknowns) spread over their bounds; one is enough where there are none."""
    nonlinear = ~problem.linear
    if not nonlinear.any():
        return np.empty((1, 0))
    cube = qmc.LatinHypercube(d=int(nonlinear.sum()), rng=seed).random(starts)
    return qmc.scale(cube, problem.low[nonlinear], problem.high[nonlinear])


def _report(problem, x, record):
    law = problem.law(x)
    x = np.array(list(problem.kind.in_order(law.parameters).values())) / problem.scale
    law, points = problem.law(x), problem.points
    error = points.predict(law) - points.stress
    n, p = len(error), len(x)
    width = problem.high - problem.low
    on_bound = np.minimum(x - problem.low, problem.high - x) < 1e-6 * width
    return LawFit(
        law=problem.kind.name,
        parameters=law.parameters,
        covariance=_covariance(problem.jacobian(x), float(error @ error) / (n - p)),
        rmse_mpa=_rms(error),
        rmse_by_mode_mpa={str(mode): _rms(error[points.mode == mode]) for mode in dict.fromkeys(points.mode)},
        aicc=float(n * np.log(max(error @ error, 1e-30) / n) + 2 * p * n / max(n - p - 1, 0.5)),
        at_bound=[c.name for c, stuck in zip(problem.kind.constants, on_bound, strict=True) if stuck],
        record=record,
    )


def _rms(error):
    return float(np.sqrt(np.mean(error**2)))


def _covariance(jacobian, variance):
    """variance (J^T J)^-1, or None where columns of J depend on each other."""
    size = np.linalg.norm(jacobian, axis=0)
    if not (size > 0).all() or np.linalg.cond(jacobian / size) > 1e7:
        return None
    scaled = np.linalg.inv((jacobian / size).T @ (jacobian / size))
    return variance * scaled / np.outer(size, size)
