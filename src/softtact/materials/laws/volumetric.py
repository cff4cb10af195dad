"""Volumetric functions: the energy U(J) of a change of volume, which a law has besides its isochoric energy psi.

Symbols: J volume ratio, d = J - 1 change of volume, K bulk modulus (MPa), U energy per reference volume (MPa).
Every function has U(1) = U'(1) = 0 and U''(1) = K, and is proportional to K. All are written in d, which has no cancellation
near J = 1. To add a function, add a class here and its name to VOLUMETRIC_FUNCTIONS; elements need no change.

quadratic    U = K/2 d^2,                    U' = K d,              U'' = K               (Sussman and Bathe 1987; Abaqus, D = 2/K)
logarithmic  U = K/4 (J^2 - 1 - 2 ln J),     U' = K/2 (J - 1/J),    U'' = K/2 (1 + 1/J^2)  (Simo and Taylor 1982; infinite at J = 0)
Reference: Holzapfel, Nonlinear Solid Mechanics (2000), section 6.5.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np


@dataclass(frozen=True)
class VolumetricFunction:
    """U(J) of a bulk modulus in MPa.

    name: as given to `make_law`;  linear: U' is K d, so that U'' is K for every J;  least_change: U exists for d above this
    """

    bulk_modulus: float
    name: ClassVar[str]
    linear: ClassVar[bool] = False
    least_change: ClassVar[float] = -np.inf

    def energy(self, change: np.ndarray) -> np.ndarray:
        """U (MPa) at changes of volume d = J - 1 of any shape."""
        raise NotImplementedError

    def pressure(self, change: np.ndarray) -> np.ndarray:
        """U' (MPa) at changes of volume d: the hydrostatic stress, positive in tension."""
        raise NotImplementedError

    def stiffness(self, change: np.ndarray) -> np.ndarray:
        """U'' (MPa) at changes of volume d."""
        raise NotImplementedError

    def at(self, J: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """U, U' and U'' (MPa) at volume ratios J of any shape."""
        change = np.asarray(J) - 1
        return self.energy(change), self.pressure(change), self.stiffness(change)

    def with_modulus(self, bulk_modulus: float) -> "VolumetricFunction":
        """The same function of another bulk modulus (MPa)."""
        return replace(self, bulk_modulus=float(bulk_modulus))


class Quadratic(VolumetricFunction):
    """U = K/2 d^2."""

    name = "quadratic"
    linear = True

    def energy(self, change: np.ndarray) -> np.ndarray:
        return 0.5 * self.bulk_modulus * change**2

    def pressure(self, change: np.ndarray) -> np.ndarray:
        return self.bulk_modulus * change

    def stiffness(self, change: np.ndarray) -> np.ndarray:
        return np.full(np.shape(change), self.bulk_modulus)


class Logarithmic(VolumetricFunction):
    """U = K/4 (J^2 - 1 - 2 ln J)."""

    name = "logarithmic"
    least_change = -1.0

    def energy(self, change: np.ndarray) -> np.ndarray:
        return 0.25 * self.bulk_modulus * (change * (change + 2) - 2 * np.log1p(change))

    def pressure(self, change: np.ndarray) -> np.ndarray:
        return 0.5 * self.bulk_modulus * change * (change + 2) / (1 + change)

    def stiffness(self, change: np.ndarray) -> np.ndarray:
        return 0.5 * self.bulk_modulus * (1 + (1 + change) ** -2.0)


VOLUMETRIC_FUNCTIONS = {kind.name: kind for kind in (Quadratic, Logarithmic)}
