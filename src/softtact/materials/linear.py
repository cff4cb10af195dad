"""Elastic constants at small strain, and the bulk modulus of a law from a volumetric test or from a stated ratio.

Symbols: E Young's modulus (MPa), nu Poisson's ratio; mu = E / (2 (1 + nu)), K = E / (3 (1 - 2 nu)).
E is the slope of the uniaxial curve at small strain. Stress curves alone hold nothing of nu: it has to be stated.
Of a law: J volume ratio, p pressure; U(J) = K/2 (J - 1)^2, so p = K (1 - J) and D = 2/K.
E = 9 K mu0/(3 K + mu0), nu = (3 K - 2 mu0)/(6 K + 2 mu0).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from softtact.errors import InputError
from softtact.materials.curves import AnyCurve, VolumetricCurve
from softtact.materials.laws.base import Law

# A test whose stiffness p/(1-J) differs from a constant K by more than this is reported: U has no second constant.
_CURVED = 0.05


@dataclass(frozen=True)
class LinearConstants:
    """E (MPa) and nu of an isotropic linear elastic material."""

    young_mpa: float
    poisson: float

    def __post_init__(self):
        if not self.young_mpa > 0:
            raise InputError(f"Young's modulus is {self.young_mpa:g} MPa; give a positive one.")
        if not -1 < self.poisson < 0.5:
            raise InputError(f"Poisson's ratio is {self.poisson:g}; give one between -1 and 0.5.")

    @classmethod
    def of(cls, parameters: dict[str, float]) -> Self:
        """The constants of a mapping, which must hold these two and no others."""
        if set(parameters) != {"young_mpa", "poisson"}:
            raise InputError(f"Linear constants are young_mpa and poisson, not {', '.join(map(str, parameters)) or 'none'}.")
        return cls(**parameters)

    @classmethod
    def of_law(cls, law: Law) -> Self:
        """Those of a law at small strain."""
        K, mu = law.bulk_modulus, law.mu0
        return cls(9 * K * mu / (3 * K + mu), (3 * K - 2 * mu) / (6 * K + 2 * mu))

    @property
    def mu_mpa(self) -> float:
        """Shear modulus, MPa."""
        return self.young_mpa / (2 * (1 + self.poisson))

    @property
    def bulk_modulus_mpa(self) -> float:
        """Bulk modulus, MPa."""
        return self.young_mpa / (3 * (1 - 2 * self.poisson))


def young_modulus(curves: Sequence[AnyCurve], *, small_strain: float) -> tuple[float, float, float]:
    """(E, its standard error, RMSE) in MPa from the uniaxial points with strain up to `small_strain`.

    The stress is fitted by E e + b e^2: without the square, points on one side of zero bias the slope by some percent.
    """
    strain, stress = _small_strain_points(curves, small_strain)
    A = np.stack([strain, strain**2], axis=1)
    if len(strain) < 3 or np.linalg.matrix_rank(A) < 2:
        raise InputError(
            f"{len(strain)} uniaxial point(s) lie within a strain of {small_strain:g}: too few for Young's modulus;"
            " give a uniaxial curve or raise small_strain."
        )
    inverse = np.linalg.inv(A.T @ A)
    young, curvature = inverse @ (A.T @ stress)
    error = stress - A @ [young, curvature]
    variance = float(error @ error) / (len(strain) - 2)
    return float(young), float(np.sqrt(variance * inverse[0, 0])), float(np.sqrt(np.mean(error**2)))


def _small_strain_points(curves, small_strain):
    """Engineering strain and nominal stress of the uniaxial points near the undeformed state."""
    near = [c.within((1 - small_strain, 1 + small_strain)) for c in curves if c.mode == "uniaxial"]
    strain = np.concatenate([np.empty(0)] + [curve.stretch - 1 for curve in near])
    return strain, np.concatenate([np.empty(0)] + [curve.nominal_stress for curve in near])


@dataclass(frozen=True)
class BulkModulus:
    """K = `modulus_mpa` and its standard error from a test, or K = `over_shear` * mu0 as stated; `source` names the origin."""

    source: str
    modulus_mpa: float | None = None
    standard_error_mpa: float | None = None
    over_shear: float | None = None
    misfit: float = 0.0

    def of(self, mu0: float) -> float:
        """K (MPa) of a law with the initial shear modulus `mu0`."""
        return self.over_shear * mu0 if self.modulus_mpa is None else self.modulus_mpa     # type: ignore[operator]

    @property
    def warnings(self) -> Iterator[str]:
        """Sentences on faults of the test."""
        if self.misfit > _CURVED:
            yield (f"The volumetric curve is not straight: K (1 - J) leaves {self.misfit:.1%} of its pressure; narrow its window to"
                   " the volume ratios that the sensor reaches.")


def bulk_modulus(curve: VolumetricCurve | None, *, bulk_over_shear: float) -> BulkModulus:
    """`BulkModulus` from a `VolumetricCurve`, or, where that is None, from the stated ratio K / mu0."""
    if curve is None:
        return BulkModulus(f"stated: K / mu0 = {bulk_over_shear:g}; no volumetric test was given", over_shear=bulk_over_shear)
    compression = 1 - curve.volume_ratio
    modulus = float(compression @ curve.pressure / (compression @ compression))
    left = curve.pressure - modulus * compression
    error = float(np.sqrt(left @ left / (len(left) - 1) / (compression @ compression)))
    low, high = curve.window
    return BulkModulus(f"volumetric test, J {low:.4g} to {high:.4g} ({curve.source})", modulus_mpa=modulus,
                       standard_error_mpa=error, misfit=float(np.linalg.norm(left) / np.linalg.norm(curve.pressure)))


def small_strain_constants(mu0: float, bulk: float) -> dict[str, float]:
    """{young_mpa, poisson} of an isotropic solid with the moduli mu0 and K."""
    return {"young_mpa": 9 * bulk * mu0 / (3 * bulk + mu0), "poisson": (3 * bulk - 2 * mu0) / (6 * bulk + 2 * mu0)}


def poisson_ratio(young: float, bulk: float) -> float:
    """nu of an isotropic solid with E and K: K = E / (3 (1 - 2 nu))."""
    return (1 - young / (3 * bulk)) / 2
