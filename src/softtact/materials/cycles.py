"""Tests with loading and unloading, and the fit of the Mullins effect to them (`mullins.py`).

Symbols       P the measured stress at a stretch, P0 that of the law, which is fitted to first loading; W the law's energy, W_max
              its greatest value so far in the test; r, m, beta as in `mullins.py`
Rows          first loading: I1 - 3 exceeds that of all rows before; the others follow P = eta(W, W_max) P0
Fit           least squares of eta P0 - P over these rows, in multiples of the greatest stress; from several starts, within r > 1,
              m >= 0, beta >= 0
Limits        one amplitude does not tell m and beta apart, only m + beta W_max: then beta is 0, as in Ogden and Roxburgh (1999).
              The model has no hysteresis between unloading and reloading, no permanent set, and no softening after the second cycle
References    Ogden and Roxburgh, Proc. R. Soc. A 455 (1999) 2861-2877; Abaqus Analysis User's Guide, Mullins effect
"""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from softtact.errors import InputError
from softtact.materials.curves import DEFORMATION, AnyCurve
from softtact.materials.history import first_loading, steady_loading
from softtact.materials.laws.base import Law, principal_stretches
from softtact.materials.mullins import Mullins
from softtact.materials.uncertainty import covariance_of

FIRST, STEADY, MULLINS = CYCLES = ("first", "steady", "mullins")
_ONE_AMPLITUDE = 1.2    # ratio of the greatest energies below which the data do not part m and beta
_NO_AMPLITUDE = 0.02    # share of the greatest energy below which rows are jitter at the test's start, no amplitude
_LARGEST_ERROR = 0.25   # of the softened stress, root mean square: above, the effect does not describe these cycles
_LARGEST_R = 100.0      # the softening is below 1 % there
_LOOSE = 0.01           # a constant with a smaller standard error, as _STARTS in 1 or mean W_max, is determined, even if it is 0
_FEWEST = 4             # rows of unloading and reloading
_STARTS = ((1.3, 3.0), (0.1, 0.5, 2.0), (0.02, 0.2))    # r; m over the mean W_max; beta


@dataclass(frozen=True)
class CyclicTest:
    """A test of loading and unloading: its curve, with all rows in the order of time."""

    history: AnyCurve

    @property
    def first(self) -> np.ndarray:
        """(n,) whether a row is of first loading."""
        return first_loading(self.history.deformation, mode=self.history.mode)

    def rows(self, cycles: str) -> np.ndarray:
        """Indices of the rows that a law is fitted to: of first loading, or of the last loading of `steady` cycles."""
        rows = np.flatnonzero(self.first)
        if cycles == STEADY:
            found = steady_loading(self.history.deformation, mode=self.history.mode)
            if found is None:
                raise InputError(f"{self.history.source}: it is loaded once, so there is no steady cycle; take --cycles first.")
            rows = found
        if len(rows) < 2:
            raise InputError(f"{self.history.source}: {len(rows)} row(s) of loading make no curve; give the test from its start.")
        return rows

    def curve(self, cycles: str) -> AnyCurve:
        """The curve of these rows, in the order of their strain."""
        rows = self.rows(cycles)
        return self.history.taken(rows[np.argsort(self.history.deformation[rows], kind="stable")])


@dataclass(frozen=True)
class MullinsFit:
    """The Mullins effect fitted to cycles.

    law: name of the law that softens;  relative_error: root mean square of the error over that of the softened stress
    standard_error: {constant: value}, None where the cycles do not determine them together
    not_identifiable: constants that the cycles do not determine;  several: whether there are several amplitudes
    """

    effect: Mullins
    law: str
    relative_error: float
    standard_error: dict | None
    not_identifiable: list
    several: bool
    points: int

    @property
    def warnings(self) -> Iterator[str]:
        """Sentences on constants that the cycles do not determine, and on cycles that the effect does not describe."""
        if not self.several:
            yield ("mullins: the cycles have one amplitude, which does not tell m and beta apart: beta is 0, and m holds for this "
                   "amplitude; add cycles of another one.")
        loose = [name for name in self.not_identifiable if self.several or name != "beta"]
        if loose:
            yield f"mullins: these cycles do not determine {', '.join(loose)} (standard error above 100 %); unload farther."
        if self.relative_error > _LARGEST_ERROR:
            yield (f"mullins: it misses the stress of unloading and reloading by {self.relative_error:.0%} (root mean square): "
                   "these cycles have a hysteresis or a permanent set that it does not describe, or the law misses first loading.")

    def entry(self) -> dict[str, Any]:
        """The card's block `mullins`."""
        return {"r": self.effect.r, "m_mpa": self.effect.m_mpa, "beta": self.effect.beta, "law": self.law, "points": self.points,
                "standard_error": self.standard_error, "not_identifiable": self.not_identifiable,
                "relative_error": self.relative_error}


@dataclass(frozen=True)
class Softened:
    """Rows (n,) that are not of first loading: energy W and its greatest value W_max, stress of the law and measured one, MPa."""

    energy: np.ndarray
    greatest: np.ndarray
    loaded: np.ndarray
    measured: np.ndarray


def softened_rows(law: Law, test: CyclicTest, window: Sequence[float] | None = None) -> Softened:
    """The rows of a test, inside a window [min, max] of its strain, that follow the Mullins effect of a law.

    Raises InputError where the law has no energy at the strains before them.
    """
    curve = test.history
    energy = energy_of(law, curve.mode, curve.deformation)
    low, high = window or curve.window
    later = ~test.first & (curve.deformation >= low) & (curve.deformation <= high)
    greatest = np.maximum.accumulate(energy)
    if not np.isfinite(greatest[later]).all():
        strain = f"{DEFORMATION.get(curve.mode, 'stretch')} {curve.deformation[~np.isfinite(energy)][0]:.4g}"
        raise InputError(f"{curve.source}: the law {law.name} does not exist at the {strain} that the test reaches before these "
                         "cycles; choose another law, or cut the test to the window.")
    return Softened(energy[later], greatest[later], law.nominal_stress(curve.mode, curve.deformation[later]), curve.stress[later])


def energy_of(law: Law, mode: str, deformation: np.ndarray) -> np.ndarray:
    """psi (n,) in MPa of the incompressible material at the stretch or shear strain (n,) of a test mode."""
    squares = principal_stretches(mode, deformation) ** 2
    return law.isochoric(np.concatenate([squares, np.zeros_like(squares)], axis=1), tangent=False).energy


def fit_mullins(law: Law, tests: Sequence[CyclicTest], *, window: Mapping[str, Sequence[float]] | None = None) -> MullinsFit:
    """r, m and beta of cycles, for the law that was fitted to their first loading; window: {mode: [min, max] strain to use}."""
    rows = [softened_rows(law, test, (window or {}).get(test.history.mode)) for test in tests]
    data = Softened(*(np.concatenate([getattr(one, name) for one in rows]) for name in Softened.__dataclass_fields__))
    if len(data.measured) < _FEWEST or not data.measured.any():
        raise InputError(f"{tests[0].history.source}: {len(data.measured)} row(s) of unloading with a stress are too few for the "
                         "Mullins effect; widen the window, or take --cycles first.")
    scale, largest = float(np.mean(data.greatest)), float(np.abs(data.measured).max())
    amplitudes = data.greatest[data.greatest >= _NO_AMPLITUDE * data.greatest.max()]
    several = bool(amplitudes.max() > _ONE_AMPLITUDE * amplitudes.min())
    count = 3 if several else 2

    def residual(constants):
        softening = Mullins(*np.append(constants, [0.0])[:3].tolist()).softening(data.energy, data.greatest)
        return (softening * data.loaded - data.measured) / largest

    unit = np.array([1.0, scale, 1.0])[:count]
    bounds = unit * np.array([1.001, 1e-6, 0.0])[:count], unit * np.array([_LARGEST_R, 100.0, 100.0])[:count]
    starts = itertools.product(*_STARTS[:count])
    found = [least_squares(residual, unit * start, bounds=bounds, x_scale="jac") for start in starts]
    best = min(found, key=lambda one: one.cost)
    effect = Mullins(*np.append(best.x, [0.0])[:3].tolist())
    return _report(law, effect, residual, np.linalg.norm(data.measured) / largest, several, unit)


def _report(law, effect, residual, size, several, unit):
    """`MullinsFit` of the best effect; residual: function of r, m and, with several amplitudes, beta;  size: of the data

    unit: of each constant, so that the report is the same for soft and stiff materials
    """
    names = ["r", "m_mpa", "beta"][:3 if several else 2]
    constants = np.array([getattr(effect, name) for name in names])
    error, steps = residual(constants), np.diag(1e-7 * np.maximum(constants, 1e-3 * unit))
    jacobian = np.stack([(residual(constants + step) - error) / step.sum() for step in steps], axis=1)
    covariance = covariance_of(jacobian, float(error @ error) / max(len(error) - len(constants), 1))
    known = np.maximum(constants - [1, 0, 0][:len(names)], _LOOSE * unit)
    deviation = np.full(len(names), np.inf) if covariance is None else np.sqrt(np.diag(covariance))
    return MullinsFit(
        effect=effect, law=law.name, relative_error=float(np.linalg.norm(error) / size), points=len(error), several=several,
        standard_error=None if covariance is None else dict(zip(names, deviation.tolist(), strict=True)),
        not_identifiable=[name for name, bad in zip(names, deviation > known, strict=True) if bad] + ["beta"] * (not several),
    )  # fmt: skip
