"""The interface of hyperelastic laws: energy, stress and tangent at points, and the curves of simple tests.

Symbols: C right Cauchy-Green tensor, J = sqrt(det C), l1 l2 l3 principal stretches, lb = J^(-1/3) l their isochoric
parts, psi(lb) isochoric energy per reference volume (MPa), K bulk modulus (MPa).
The whole energy is psi + U(J), with U the law's volumetric function (`volumetric.py`); `isochoric` never includes U.
"""

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np

from softtact.errors import ExtrapolationWarning, InputError
from softtact.materials.laws.volumetric import Quadratic, VolumetricFunction

if TYPE_CHECKING:
    from softtact.materials.inelastic import Inelastic

# Exponents (e1, e2, e3) of the incompressible test paths: l_k = stretch ** e_k. Direction 3 is always free of stress.
TEST_PATHS = {
    "uniaxial": (1.0, -0.5, -0.5),
    "equibiaxial": (1.0, 1.0, -2.0),
    "planar": (1.0, 0.0, -1.0),
}
SIMPLE_SHEAR = "simple_shear"     # F = I + gamma e1 x e2: the principal stretches of planar tension, with turning axes


@dataclass(frozen=True)
class Parameter:
    """A material constant: its name, its unit ("MPa" or "1") and the bounds of a fit.

    `low` and `high`, for unit "MPa", are multiples of the curves' stiffness. psi must be linear in its constants of unit
    "MPa": the fit solves for them directly.
    """

    name: str
    unit: str
    low: float
    high: float


@dataclass(frozen=True)
class IsochoricResponse:
    """Isochoric energy, stress and tangent of n points (MPa); components in the order xx, yy, zz, xy, yz, zx.

    energy: (n,) psi per reference volume
    stress: (n, 6) second Piola-Kirchhoff stress S
    tangent: (n, 6, 6) D in dS = D dE with E = [Exx, Eyy, Ezz, 2 Exy, 2 Eyz, 2 Ezx], or None
    """

    energy: np.ndarray
    stress: np.ndarray
    tangent: np.ndarray | None


class Law:
    """A law psi of the isochoric stretches, with an energy U(J) of the volume.

    volumetric: U, a `VolumetricFunction`
    stretch_window: lowest and highest principal stretch of the fitted data; None where not known
    inelastic: softening and relaxation beside the law, which is that of first loading; None for an elastic material
    """

    stretch_window: tuple | None = None
    inelastic: "Inelastic | None" = None
    name: str
    constants: tuple[Parameter, ...]

    def __init__(self, parameters: dict[str, float], *, bulk_modulus: float,
                 volumetric: type[VolumetricFunction] = Quadratic) -> None:
        """parameters {constant: MPa or 1};  bulk_modulus in MPa;  volumetric: the class of U."""
        self.parameters = {constant.name: float(parameters[constant.name]) for constant in self.constants}
        self.volumetric = volumetric(float(bulk_modulus))

    @classmethod
    def in_order(cls, parameters: dict[str, float]) -> dict[str, float]:
        """The same constants, with exchangeable terms in their usual order."""
        return parameters

    @classmethod
    def lowest(cls, stretches: np.ndarray) -> dict[str, float]:
        """{constant: least value} for which psi exists at principal stretches (n, 3); a fit searches above it."""
        return {}

    def __repr__(self):
        values = ", ".join(f"{name}={value:g}" for name, value in self.parameters.items())
        volume = "" if isinstance(self.volumetric, Quadratic) else f", volumetric={type(self.volumetric).__name__}"
        return f"{type(self).__name__}({values}, bulk_modulus={self.bulk_modulus:g}{volume})"

    def scaled(self, factor: float) -> Self:
        """The same law with all of its stresses times a factor above 0."""
        values = {one.name: self.parameters[one.name] * (factor if one.unit == "MPa" else 1.0) for one in self.constants}
        law = type(self)(values, bulk_modulus=factor * self.bulk_modulus, volumetric=type(self.volumetric))
        law.stretch_window = self.stretch_window
        law.inelastic = self.inelastic and self.inelastic.scaled(factor)
        return law

    @property
    def bulk_modulus(self) -> float:
        """K = U''(1), MPa."""
        return self.volumetric.bulk_modulus

    @property
    def projected_modulus(self) -> float:
        """Modulus (MPa) of U(J): K, or 0 for a law whose energy does not divide into an isochoric and a volumetric part."""
        return self.bulk_modulus

    @property
    def mu0(self) -> float:
        """Initial shear modulus, MPa."""
        raise NotImplementedError

    @property
    def plane_modulus(self) -> float:
        """E / (1 - nu^2) for small strains, MPa: the modulus of a half-space under an indenter."""
        return 4 * self.mu0 * (self.bulk_modulus + self.mu0 / 3) / (self.bulk_modulus + 4 * self.mu0 / 3)

    def isochoric(self, C6: np.ndarray, *, tangent: bool = True) -> IsochoricResponse:
        """`IsochoricResponse` for C6 (n, 6): the components xx, yy, zz, xy, yz, zx of C, not doubled."""
        raise NotImplementedError

    def principal_stress(self, stretches: np.ndarray) -> np.ndarray:
        """t_a = l_a dpsi/dl_a (..., 3) in MPa at isochoric principal stretches (..., 3).

        Its deviator is the Kirchhoff stress; the mean is not determined by psi. Complex stretches are allowed, so that
        a derivative can be taken by a complex step, without cancellation.
        """
        raise NotImplementedError

    def nominal_stress(self, mode: str, stretch: float | np.ndarray) -> np.ndarray:
        """Nominal stress (MPa) of the incompressible material in a `uniaxial`, `equibiaxial`, `planar` or `simple_shear` test.

        stretch: of the loaded direction; in simple shear the shear strain gamma, and the stress is the shear stress dpsi/dgamma
        A law with a `stretch_window` warns (`ExtrapolationWarning`) of stretches outside it.
        """
        stretches = principal_stretches(mode, stretch)
        self._warn_outside(stretches)
        stress = self.principal_stress(stretches)
        return (stress[..., 0] - stress[..., 2]) / work_divisor(mode, stretches)

    def pressure(self, volume_ratio: np.ndarray) -> np.ndarray:
        """Pressure (n,) in MPa from all sides at the volume ratios J (n,): -dU/dJ, positive in compression."""
        return -self.volumetric.pressure(np.asarray(volume_ratio, float) - 1)

    def _warn_outside(self, stretches):
        if self.stretch_window is None:
            return
        low, high = self.stretch_window
        if stretches.min() < low * (1 - 1e-9) or stretches.max() > high * (1 + 1e-9):
            warnings.warn(f"Law {self.name} is used at principal stretches {stretches.min():.3g} to {stretches.max():.3g}; its card"
                          f" is based on data from {low:.3g} to {high:.3g}.", ExtrapolationWarning, stacklevel=3)

    def uniaxial_compressible(self, stretch: float | np.ndarray) -> np.ndarray:
        """Nominal stress (MPa) of the uniaxial test with U, for zero lateral stress."""
        axial = np.atleast_1d(np.asarray(stretch, float))
        stress = np.array([self._axial_stress(value) for value in axial])
        return stress.reshape(np.shape(stretch))

    def _axial_stress(self, axial):
        J = _root(lambda J: self._kirchhoff_uniaxial(axial, J)[1])
        return self._kirchhoff_uniaxial(axial, J)[0] / axial

    def _kirchhoff_uniaxial(self, axial, J):
        """Principal Kirchhoff stresses (3,) at the axial stretch and the volume ratio J, lateral stretches equal."""
        lateral = np.sqrt(J / axial)
        stress = self.principal_stress(J ** (-1 / 3) * np.array([axial, lateral, lateral]))
        return stress - stress.mean() + J * self.volumetric.pressure(J - 1)


def principal_stretches(mode: str, stretch: float | np.ndarray) -> np.ndarray:
    """Principal stretches (..., 3) of the incompressible material at the stretch (shear strain) (...) of a test mode."""
    if mode == SIMPLE_SHEAR:    # l - 1/l = gamma
        half = np.asarray(stretch, float) / 2
        return np.exp(np.arcsinh(half))[..., None] ** np.array(TEST_PATHS["planar"])
    if mode not in TEST_PATHS:
        raise InputError(f"Test mode {mode!r} is unknown; use one of {', '.join(TEST_PATHS)}, {SIMPLE_SHEAR}.")
    return np.asarray(stretch, float)[..., None] ** np.array(TEST_PATHS[mode])


def work_divisor(mode: str, stretches: np.ndarray) -> np.ndarray:
    """(t_1 - t_3)/nominal stress (...) at principal stretches (..., 3): l_1, or in simple shear dgamma/dln l_1 = l_1 + 1/l_1."""
    loaded = stretches[..., 0]
    return loaded + 1 / loaded if mode == SIMPLE_SHEAR else loaded


def rest_of(mode: str) -> float:
    """The stretch, shear strain or volume ratio of a test mode without load."""
    return 0.0 if mode == SIMPLE_SHEAR else 1.0


def _root(function):
    """Root of an increasing function of J > 0, bracketed outwards from J = 1."""
    from scipy.optimize import brentq  # a sixth of a second to load, and no fast model asks for a root

    low, high = 0.9, 1.1
    while function(low) > 0 and low > 1e-6:
        low *= 0.7
    while function(high) < 0 and high < 1e6:
        high *= 1.4
    return brentq(function, low, high, xtol=1e-15, rtol=1e-14)
