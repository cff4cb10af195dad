"""A rigid ball on a soft layer that is bonded to a rigid base: pressure, force, depth, and the profile of the free surface.

Symbols: G shear modulus, nu Poisson's ratio, h thickness, a contact radius, R ball radius, k wave number, x = k h.
The contact is frictionless, the strains are small. A pressure with Hankel transform p(k) lowers the surface by

    u(r) = C int_0^inf [1 + g(k h)] p(k) J0(k r) dk,    C = (1 - nu) / G,
    1 + g(x) = [(3 - 4 nu) sinh 2x - 2 x] / [(3 - 4 nu) cosh 2x + 2 x^2 + 5 - 12 nu + 8 nu^2]        (g = 0: half-space)

With p(k) = int_0^a f(t) cos(k t) dt the contact becomes a Fredholm equation with a smooth kernel (Lebedev and Ufliand, 1958):

    f(s) + (2/pi) int_0^a M(s, t) f(t) dt = 2 / (pi C) [depth - s artanh(s / R)],    M = int_0^inf g cos(k s) cos(k t) dk

f(a) = 0 makes the pressure vanish at the edge and gives the depth. Outside the contact the surface rises smoothly to its level at
rest; a nearly incompressible layer bulges above it.
Reference: K. L. Johnson, Contact Mechanics, sections 3.7, 4.2 and 5.8.
"""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.polynomial import legendre
from scipy.special import j0, j1

from softtact.errors import InputError
from softtact.models.elastic.wide_layer import surface_spectrum

_POINTS = 24        # of f over the contact; the equation converges exponentially, 1e-8 of the force for a <= 2 h
_WAVES = 400        # wave numbers of the kernel
_ANGLES = 48        # of the profile outside
_LARGEST_X = 20.0   # g is below 1e-15 beyond


def layer_over_half_space(x: np.ndarray, poisson: float) -> np.ndarray:
    """1 + g(x): normal compliance of the bonded layer over that of a half-space, at x = wave number times thickness."""
    return x * surface_spectrum(x, thickness_mm=1.0, shear_mpa=1.0, poisson=poisson)[0] / (1 - poisson)


@cache
def _gauss(count):
    return legendre.leggauss(count)


@dataclass(frozen=True)
class BallOnLayer:
    """Contact of a rigid ball with a bonded layer; lengths in one unit of choice (mm, px)."""

    contact_radius: float
    """Radius of the contact's circle."""
    ball_radius: float
    """Radius of the ball, larger than the contact's."""
    thickness: float
    """Of the layer; inf: half-space."""
    poisson: float = 0.49
    """Poisson's ratio of the layer."""

    def __post_init__(self) -> None:
        if not 0 < self.contact_radius < self.ball_radius:
            raise InputError(f"the contact radius {self.contact_radius:g} is not between 0 and the ball's radius "
                             f"{self.ball_radius:g}; correct one of them.")
        if not self.thickness >= 0.1 * self.contact_radius:     # the equation's points would be too few
            raise InputError(f"the layer's thickness {self.thickness:g} is below a tenth of the contact radius "
                             f"{self.contact_radius:g}; correct one of them.")

    @property
    def force_over_shear_modulus(self) -> float:
        """Force over G, in the unit of length squared."""
        points, weights = self._points
        return float(2 * np.pi * weights @ self._density(points)) / (1 - self.poisson)

    @property
    def depth(self) -> float:
        """How far the ball's lowest point lies below the surface at rest."""
        return self._solution[1]

    def slope(self, radius: np.ndarray) -> np.ndarray:
        """du/dr of the surface, any shape, at distances from the axis; u is positive into the layer, so du/dr < 0 in the contact.

        Inside it is that of the ball, outside that of the layer.
        """
        radius = np.asarray(radius, dtype=float)
        inside = radius <= self.contact_radius
        cap = -radius / np.sqrt(self.ball_radius**2 - np.minimum(radius, self.contact_radius)**2)
        outer = self._outer_slope(np.maximum(radius, self.contact_radius))
        return np.where(inside, cap, outer)

    def lowering(self, radius: np.ndarray) -> np.ndarray:
        """u of the surface, any shape: positive into the layer."""
        radius = np.asarray(radius, dtype=float)
        cap = self.depth - self.ball_radius + np.sqrt(self.ball_radius**2 - np.minimum(radius, self.contact_radius)**2)
        return np.where(radius <= self.contact_radius, cap, self._outer_lowering(np.maximum(radius, self.contact_radius)))

    @cached_property
    def _points(self) -> tuple[np.ndarray, np.ndarray]:
        nodes, weights = _gauss(_POINTS)
        return 0.5 * self.contact_radius * (nodes + 1), 0.5 * self.contact_radius * weights

    @cached_property
    def _waves(self) -> tuple[np.ndarray, np.ndarray]:
        """Wave numbers and g dk of the kernel's integral; none on a half-space."""
        if not np.isfinite(self.thickness):
            return np.zeros(1), np.zeros(1)
        nodes, weights = _gauss(_WAVES)
        x = 0.5 * _LARGEST_X * (nodes + 1)
        return x / self.thickness, 0.5 * _LARGEST_X * weights / self.thickness * (layer_over_half_space(x, self.poisson) - 1)

    @cached_property
    def _solution(self) -> tuple[np.ndarray, float]:
        """C f as coefficients of Legendre polynomials in t / a, and the depth."""
        points, weights = self._points
        waves, kernel = self._waves
        places = np.append(points, self.contact_radius)
        matrix = (2 / np.pi) * (np.cos(np.outer(places, waves)) * kernel) @ np.cos(np.outer(waves, points)) * weights
        # the last row: f(a) = 0, so the integral alone balances the right-hand side there; the unknowns are f and the depth
        system = np.zeros((_POINTS + 1, _POINTS + 1))
        system[:, :-1] = matrix
        system[:-1, :-1] += np.eye(_POINTS)
        system[:, -1] = -2 / np.pi
        values = np.linalg.solve(system, -2 / np.pi * places * np.arctanh(places / self.ball_radius))
        even = np.concatenate([-points[::-1], points]) / self.contact_radius      # f is even
        fitted = legendre.legfit(even, np.concatenate([values[-2::-1], values[:-1]]), 2 * (_POINTS // 2))
        return fitted, float(values[-1])

    def _density(self, t: np.ndarray) -> np.ndarray:
        return legendre.legval(t / self.contact_radius, self._solution[0])

    def transform(self, waves: np.ndarray) -> np.ndarray:
        """Hankel transform of the pressure times C, (wave,)."""
        points, weights = self._points
        return np.cos(np.outer(waves, points)) @ (weights * self._density(points))

    def _angles(self, radius):
        """Angles and weights of t = r sin(angle) for every radius outside: (..., angle)."""
        nodes, weights = _gauss(_ANGLES)
        ends = np.arcsin(np.minimum(self.contact_radius / radius, 1.0))[..., None]
        return 0.5 * ends * (nodes + 1), 0.5 * ends * weights

    def _outer_lowering(self, radius):
        angles, weights = self._angles(radius)
        half_space = np.sum(weights * self._density(radius[..., None] * np.sin(angles)), axis=-1)
        waves, kernel = self._waves
        return half_space + j0(radius[..., None] * waves) @ (kernel * self.transform(waves))

    def _outer_slope(self, radius):
        angles, weights = self._angles(radius)
        gradient = legendre.legder(self._solution[0]) / self.contact_radius
        t = radius[..., None] * np.sin(angles)
        half_space = np.sum(weights * np.sin(angles) * legendre.legval(t / self.contact_radius, gradient), axis=-1)
        waves, kernel = self._waves
        return half_space - j1(radius[..., None] * waves) @ (kernel * waves * self.transform(waves))
