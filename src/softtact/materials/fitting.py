"""Least squares fit of the family of laws to test curves, with uncertainty.

Every law is linear in its constants of unit MPa and nonlinear in the others (exponents, locking stretch). So a start
only guesses the nonlinear ones; the linear ones follow from a bounded linear fit, and both are then refined together.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.optimize import least_squares, lsq_linear
from scipy.stats import qmc

from softtact.errors import InputError
from softtact.materials.curves import AnyCurve, refuse_unknown_mode
from softtact.materials.laws.base import Law, principal_stretches, work_divisor
from softtact.materials.laws.registry import LAWS, law_class
from softtact.materials.uncertainty import corrected_aic, correlation_of, covariance_of, unseen

STARTS = 24
RESIDUALS = ("absolute", "relative")
# Relative residuals divide by the stress, and near stretch 1 by this share of the curve's largest one.
_RELATIVE_FLOOR = 0.01
# Most starts end in a few minima: some steps show which, and only the best starts are continued to convergence.
_COARSE, _PROMISING, _FINAL = 10, 6, 100     # steps, starts, steps
_LOOSE_SHARE = 0.05     # of the initial shear modulus: a constant in MPa with a smaller error is identifiable, even if it is zero


@dataclass(frozen=True)
class FitOptions:
    """How a law is fitted.

    residual: "absolute" (MPa) or "relative" (over the stress, or 1 % of the curve's largest where that is more)
    weights: {mode: factor on the squared residuals}, 1 where not stated
    nonnegative: keep the constants of unit MPa from being negative, which makes any law here stable everywhere
    starts: how many guesses of the nonlinear constants;  seed: of these guesses
    """

    residual: str = "absolute"
    weights: dict = field(default_factory=dict)
    nonnegative: bool = False
    starts: int = STARTS
    seed: int = 0

    def __post_init__(self):
        if self.residual not in RESIDUALS:
            raise InputError(f"The residual {self.residual!r} is unknown; use one of {', '.join(RESIDUALS)}.")
        for mode, weight in self.weights.items():
            refuse_unknown_mode("weight", mode)
            if not 0 < weight < np.inf:
                raise InputError(f"The weight of the {mode} curve is {weight:g}; give a positive one that is finite, or leave the "
                                 "curve out.")
        for name, least in (("starts", 1), ("seed", 0)):
            if not (value := getattr(self, name)) >= least or value != int(value):
                raise InputError(f"{name} is {value}; give a whole number from {least} on.")


@dataclass(frozen=True)
class LawFit:
    """A fitted law.

    law: name;  parameters: {name: MPa or 1}
    covariance, correlation: (p, p) of the parameters in their order, or None where the curves do not determine them
    not_identifiable: names of the constants that these curves do not determine
    rmse_mpa: over all points;  rmse_by_mode_mpa: {mode: MPa}
    relative_error: root mean square of error over stress;  relative_error_by_mode: {mode: 1}
    autocorrelation: of neighbouring residuals in a curve; near 1 the misfit of the law, near 0 the test's noise
    aicc: Akaike's criterion corrected for few points; lower is better, superfluous constants raise it
    at_bound: names of constants at a bound of the search
    record: of the optimiser: numbers of points, starts, finished and agreeing starts, evaluations
    """

    law: str
    parameters: dict
    covariance: np.ndarray | None
    correlation: np.ndarray | None
    not_identifiable: list
    rmse_mpa: float
    rmse_by_mode_mpa: dict
    relative_error: float
    relative_error_by_mode: dict
    autocorrelation: float
    aicc: float
    at_bound: list = field(default_factory=list)
    record: dict = field(default_factory=dict)

    def make(self, *, bulk_modulus: float = 1.0) -> Law:
        """The `Law` itself."""
        return LAWS[self.law](self.parameters, bulk_modulus=bulk_modulus)


@dataclass(frozen=True)
class Points:
    """All points of the curves.

    stretches: (n, 3) principal stretches;  stress: (n,) nominal, MPa;  mode: (n,) of each
    divisor: (n,) (t_1 - t_3)/nominal stress
    floor: (n,) the stress in MPa below which relative errors are taken over this
    """

    stretches: np.ndarray
    stress: np.ndarray
    mode: np.ndarray
    divisor: np.ndarray
    floor: np.ndarray

    def predict(self, law: Law) -> np.ndarray:
        """Nominal stress (n,) of a law in MPa."""
        t = law.principal_stress(self.stretches)
        return (t[:, 0] - t[:, 2]) / self.divisor

    @property
    def size(self) -> np.ndarray:
        """(n,) reference stress of relative errors, MPa."""
        return np.maximum(np.abs(self.stress), self.floor)

    def by_mode(self, measure: Callable[[np.ndarray], float], values: np.ndarray) -> dict[str, float]:
        """{mode: measure(values of its points)}"""
        return {str(mode): measure(values[self.mode == mode]) for mode in dict.fromkeys(self.mode)}


def collect(curves: Sequence[AnyCurve]) -> Points:
    """`Points` of a list of curves. Raises InputError for one whose stress is 0 throughout, or not finite."""
    for curve in curves:
        _refuse_no_stress(curve)
    largest = [np.full(len(curve.stress), np.abs(curve.stress).max()) for curve in curves]
    stretches = [principal_stretches(curve.mode, curve.deformation) for curve in curves]
    return Points(
        stretches=np.concatenate(stretches),
        stress=np.concatenate([curve.stress for curve in curves]),
        mode=np.concatenate([np.full(len(curve.stress), curve.mode) for curve in curves]),
        divisor=np.concatenate([work_divisor(curve.mode, at) for curve, at in zip(curves, stretches, strict=True)]),
        floor=_RELATIVE_FLOOR * np.concatenate(largest),
    )


def _refuse_no_stress(curve):
    """Refuse a curve that no law can be fitted to."""
    if not np.isfinite([curve.deformation, curve.stress]).all():
        raise InputError(f"The {curve.mode} curve ({curve.source}) has values that are not finite numbers; leave these rows out.")
    if not curve.stress.any():
        raise InputError(f"The stress of the {curve.mode} curve ({curve.source}) is 0 throughout; leave the curve out, or widen "
                         "its window.")


def errors_of(law: Law, curves: Sequence[AnyCurve]) -> tuple[float, float]:
    """(RMSE in MPa, root mean square relative error) of a law on curves."""
    points = collect(curves)
    error = points.predict(law) - points.stress
    return rms(error), rms(error / points.size)


def law_names(laws: str | Sequence[str]) -> list[str]:
    """Names of laws from a list of them, one name, or "all"."""
    return list(LAWS) if laws in ("all", ["all"]) else [laws] if isinstance(laws, str) else list(laws)


def fit_law(name: str, curves: Sequence[AnyCurve], **options: Any) -> LawFit:
    """Fit one law to all curves at once; options are those of `FitOptions`."""
    kind, points, settings = law_class(name, fitted=True), collect(curves), FitOptions(**options)
    if len(points.stress) <= len(kind.constants):
        raise InputError(
            f"Law {name} has {len(kind.constants)} constants and the curves only {len(points.stress)} points;"
            " give more points or choose a law with fewer constants."
        )
    problem = _Problem(kind, points, settings)
    coarse = [problem.refine(problem.start(guess), _COARSE) for guess in _guesses(problem, settings)]
    promising = sorted(coarse, key=lambda solution: solution.cost)[:_PROMISING]
    final = [problem.refine(solution.x, _FINAL) for solution in promising]
    best = min(final, key=lambda solution: solution.cost)
    record = {
        "points": len(points.stress), "starts": len(coarse), "finished": len(final),
        "finished_agreeing": int(sum(solution.cost < best.cost * 1.001 + 1e-15 for solution in final)),
        "evaluations": int(sum(solution.nfev for solution in coarse + final)), "residual": settings.residual,
    }  # fmt: skip
    return _report(problem, best.x, record)


class _Problem:
    """Least squares of one law in scaled unknowns: constants of unit MPa in multiples of the curves' stiffness."""

    def __init__(self, kind, points, options):
        self.kind, self.points = kind, points
        self.linear = np.array([constant.unit == "MPa" for constant in kind.constants])
        self.stiffness = _stiffness(points)
        self.scale = np.where(self.linear, self.stiffness, 1.0)
        lowest = kind.lowest(points.stretches)
        self.low = np.array([max(constant.low, lowest.get(constant.name, -np.inf)) for constant in kind.constants])
        self.high = np.array([constant.high for constant in kind.constants])
        if options.nonnegative:
            self.low = np.where(self.linear, 0.0, self.low)
        weight = np.array([options.weights.get(str(mode), 1.0) for mode in points.mode])
        size = points.size if options.residual == "relative" else np.abs(points.stress).max()
        self.per_mpa = np.sqrt(weight) / size

    def law(self, x):
        names = [constant.name for constant in self.kind.constants]
        return self.kind(dict(zip(names, (x * self.scale).tolist(), strict=True)), bulk_modulus=1.0)

    def residual(self, x):
        """(n,) weighted errors in stress over their reference stress."""
        return (self.points.predict(self.law(x)) - self.points.stress) * self.per_mpa

    def start(self, guess):
        """Unknowns with the nonlinear ones guessed and the linear ones solved for."""
        x = np.where(self.linear, 0.0, 1.0)
        x[~self.linear] = guess
        A = self._columns(x)
        size = np.linalg.norm(A, axis=0)
        bounds = self.low[self.linear] * size, self.high[self.linear] * size
        x[self.linear] = lsq_linear(A / size, self.points.stress * self.per_mpa, bounds=bounds).x / size
        return np.clip(x, self.low, self.high)

    def _columns(self, x):
        """(n, linear unknowns): the residual of a unit of each of them alone."""
        zero = -self.residual(x)
        columns = []
        for k in np.flatnonzero(self.linear):
            alone = x.copy()
            alone[k] = 1.0
            columns.append(self.residual(alone) + zero)
        return np.stack(columns, axis=1)

    def refine(self, x, steps):
        bounds = (self.low, self.high)
        return least_squares(self.residual, x, bounds=bounds, x_scale="jac", jac="3-point", max_nfev=steps)

    def jacobian(self, x):
        """d residual / d constants (n, p), per unit of each constant; one-sided at a bound, beyond which psi may not exist."""
        steps = 1e-6 * np.maximum(np.abs(x), 1e-2)
        columns = []
        for step in np.diag(steps):
            up, down = np.minimum(x + step, self.high), np.maximum(x - step, self.low)
            columns.append((self.residual(up) - self.residual(down)) / (up - down).sum())
        return np.stack(columns, axis=1) / self.scale


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


def _guesses(problem, options):
    """Starts (m, nonlinear unknowns) spread over their bounds, logarithmically where these span decades; one without unknowns."""
    nonlinear = ~problem.linear
    if not nonlinear.any():
        return np.empty((1, 0))
    low, high = problem.low[nonlinear], problem.high[nonlinear]
    cube = qmc.LatinHypercube(d=int(nonlinear.sum()), rng=options.seed).random(options.starts)
    decades = (low > 0) & (high > 10 * np.abs(low))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(decades, low * (high / low) ** cube, low + (high - low) * cube)


def _report(problem, x, record):
    law = problem.law(x)
    x = np.array(list(problem.kind.in_order(law.parameters).values())) / problem.scale
    law, points = problem.law(x), problem.points
    error, residual, jacobian = points.predict(law) - points.stress, problem.residual(x), problem.jacobian(x)
    relative = error / points.size
    n, p = len(error), len(x)
    covariance = covariance_of(jacobian, float(residual @ residual) / (n - p))
    return LawFit(
        law=problem.kind.name,
        parameters=law.parameters,
        covariance=covariance,
        correlation=None if covariance is None else correlation_of(covariance),
        not_identifiable=_not_identifiable(law, jacobian, covariance),
        rmse_mpa=rms(error),
        rmse_by_mode_mpa=points.by_mode(rms, error),
        relative_error=rms(relative),
        relative_error_by_mode=points.by_mode(rms, relative),
        autocorrelation=_autocorrelation(residual, points.mode),
        aicc=corrected_aic(residual, p),
        at_bound=_at_bound(problem, x),
        record=record,
    )


def rms(values: np.ndarray) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def _at_bound(problem, x):
    """Names of the constants on a bound of the search."""
    width = problem.high - problem.low
    stuck = np.minimum(x - problem.low, problem.high - x) < 1e-6 * width
    return [constant.name for constant, at in zip(problem.kind.constants, stuck, strict=True) if at]


def _autocorrelation(residual, mode):
    """Correlation of neighbouring residuals of the same curve."""
    same = mode[1:] == mode[:-1]
    return float((residual[1:] @ (residual[:-1] * same)) / max(residual @ residual, 1e-300))


def _not_identifiable(law, jacobian, covariance):
    """Constants whose standard error exceeds their value, or that can change together without a change of the curves."""
    values = np.array(list(law.parameters.values()))
    if covariance is None:
        loose = unseen(jacobian)
    else:
        known = [max(abs(value), _LOOSE_SHARE * law.mu0 if constant.unit == "MPa" else 0.0)
                 for value, constant in zip(values, law.constants, strict=True)]
        loose = np.sqrt(np.diag(covariance)) > known
    return [name for name, bad in zip(law.parameters, loose, strict=True) if bad]
