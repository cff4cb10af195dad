"""Linear elastic constants of the small-strain model.

Symbols: E Young's modulus (MPa), nu Poisson's ratio; mu = E / (2 (1 + nu)), K = E / (3 (1 - 2 nu)).
E is the slope of the uniaxial curve at small strain. Stress curves alone hold nothing of nu: it has to be stated.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from softtact.errors import InputError
from softtact.materials.curves import Curve, VolumetricCurve


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

    @property
    def mu_mpa(self) -> float:
        """Shear modulus, MPa."""
        return self.young_mpa / (2 * (1 + self.poisson))

    @property
    def bulk_modulus_mpa(self) -> float:
        """Bulk modulus, MPa."""
        return self.young_mpa / (3 * (1 - 2 * self.poisson))


def young_modulus(curves: Sequence[Curve | VolumetricCurve], *, small_strain: float) -> tuple[float, float, float]:
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
