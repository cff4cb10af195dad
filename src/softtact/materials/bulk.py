"""The volume's part of a law: K from a volumetric test or from a stated ratio, and the small-strain constants that follow.

Symbols: J volume ratio, p pressure, K bulk modulus (MPa); U(J) = K/2 (J - 1)^2, so p = K (1 - J) and D = 2/K.
Small strain: E = 9 K mu0/(3 K + mu0), nu = (3 K - 2 mu0)/(6 K + 2 mu0).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from softtact.materials.curves import VolumetricCurve

# A test of stiffness p/(1-J) that departs from one K by more than this is told: U has no second constant.
_CURVED = 0.05


@dataclass(frozen=True)
class BulkModulus:
    """K = `modulus_mpa` and its standard error from a test, or K = `over_shear` * mu0 as stated; `source` says which."""

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
        """What to say of the test."""
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
