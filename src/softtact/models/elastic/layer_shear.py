"""A bonded layer whose surface is sheared under a round contact, and its sideways motion under a pressure: in-plane kernels.

Symbols: G shear modulus, nu Poisson's ratio, h thickness, k wave number, x = k h, a contact radius, c radius that sticks.
A wave of traction along its own direction (in plane) moves the surface by A(x) / (G k) times the traction, one across its direction by
tanh(x) / (G k); a pressure p cos(k s) moves it along s by B(x) / (G k) p sin(k s). A and B follow from the solutions of Navier's
equations in a layer, exp(+-k z) and z exp(+-k z), with no displacement below.

The traction of a ball that has stuck inside c and slid outside is Mindlin's difference of two Hertzian domes,
q ~ sqrt(1 - r^2/a^2) - (c/a) sqrt(1 - r^2/c^2): exact on a half-space, an approximation on a layer of a few contact radii.
Reference: K. L. Johnson, Contact Mechanics, sections 3.6, 7.2.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import legendre
from scipy.special import j0, j1, jv

from softtact.errors import InputError
from softtact.models.elastic.ball_on_layer import BallOnLayer

_DEEP = 20.0        # x beyond which the layer is a half-space, to 1e-15
_WAVES = 200        # wave numbers up to there, and as many beyond
_BEYOND = 60.0      # contact radii: wave number at which the tail ends


def surface_kernels(poisson: float, thickness: float, contact_radius: float) -> tuple[np.ndarray, ...]:
    """x, its weights, A and B at them (wave,): Gauss points over 0 ... 20, then the half-space's values over the tail."""
    nodes, weights = _gauss()
    end = max(6 * _DEEP, _BEYOND * thickness / contact_radius)
    along, push = _near(poisson)
    x = np.concatenate([0.5 * _DEEP * (nodes + 1), _DEEP + 0.5 * (end - _DEEP) * (nodes + 1)])
    weight = np.concatenate([0.5 * _DEEP * weights, 0.5 * (end - _DEEP) * weights])
    return (x, weight, np.concatenate([along, np.full(_WAVES, 1 - poisson)]),
            np.concatenate([push, np.full(_WAVES, -0.5 * (1 - 2 * poisson))]))


@cache
def _gauss():
    return legendre.leggauss(_WAVES)


@cache
def _near(poisson):
    """A and B (wave,) at the Gauss points over 0 ... 20."""
    return np.array([_surface_response(x, poisson) for x in 0.5 * _DEEP * (_gauss()[0] + 1)]).T


def _surface_response(x, nu):
    """A and B of one wave: sideways motion of the surface, times G k, under unit traction sin(k s) and unit pressure cos(k s).

    u = U sin(k s), w = W cos(k s); the four solutions at the bottom (u = w = 0) and at the top (sigma_z, tau given).
    """
    c = 3 - 4 * nu

    def solutions(z):
        up, down = np.exp(z), np.exp(-(z + x))      # z in 1/k: -x at the bottom, 0 at the top; down is 1 at the bottom
        u, w = np.array([up, down, z * up, z * down]), np.array([-up, down, (c - z) * up, (c + z) * down])
        du = np.array([up, -down, (1 + z) * up, (1 - z) * down])
        dw = np.array([-up, -down, (c - z - 1) * up, (1 - c - z) * down])
        return u, w, 2 * (dw + nu / (1 - 2 * nu) * (u + dw)), du - w

    bottom, top = solutions(-x), solutions(0.0)
    system = np.array([bottom[0], bottom[1], top[2], top[3]])
    loads = np.array([[0, 0, 0, 1.0], [0, 0, -1.0, 0]]).T
    return top[0] @ np.linalg.solve(system, loads)


def outward(ball: BallOnLayer, radius: np.ndarray) -> np.ndarray:
    """Motion of the surface away from the axis at distances (r,) under a frictionless ball; unit of length as the ball's."""
    x, weight, _, push = surface_kernels(ball.poisson, ball.thickness, ball.contact_radius)
    waves = x / ball.thickness
    pressure = ball.transform(waves) / (1 - ball.poisson)       # over G
    return j1(np.outer(radius, waves)) @ (weight / ball.thickness * pressure * push)


@dataclass(frozen=True)
class ShearedContact:
    """A round contact that is moved sideways by one unit of length at its centre; lengths in one unit of choice."""

    contact_radius: float
    """a."""
    stick_share: float
    """c / a: 1, all sticks; 0, all slides."""
    thickness: float
    """Of the layer."""
    poisson: float = 0.49
    """Poisson's ratio of the layer."""

    def __post_init__(self) -> None:
        if not 0 <= self.stick_share <= 1:
            raise InputError(f"the share that sticks, {self.stick_share:g}, is not between 0 and 1; correct it.")

    def motion(self, along: np.ndarray, across: np.ndarray) -> np.ndarray:
        """Motion (..., 2) of the surface along and across the shear, at places along and across it from the centre (...)."""
        radius, angle = np.hypot(along, across), np.arctan2(across, along)
        grid = np.concatenate([[0.0], np.geomspace(0.02, 40, 160)]) * self.contact_radius
        mean, turning = self._profiles(grid)
        even, double = np.interp(radius, grid, mean / mean[0]), np.interp(radius, grid, turning / mean[0])
        return np.stack([even + double * np.cos(2 * angle), double * np.sin(2 * angle)], axis=-1)

    @property
    def motion_per_force(self) -> float:
        """Sideways motion of the centre over the traction's force divided by G, 1 / length."""
        mean, _ = self._profiles(np.zeros(1))
        return float(mean[0] / (2 * np.pi * _dome_transform(np.array([1e-9]), self.contact_radius, self.stick_share)[0]))

    def _profiles(self, radius):
        """Parts that do not turn with the angle, and those that turn twice, at distances (r,)."""
        x, weight, along, _ = surface_kernels(self.poisson, self.thickness, self.contact_radius)
        waves, across = x / self.thickness, np.tanh(x)
        spectrum = weight / self.thickness * _dome_transform(waves, self.contact_radius, self.stick_share)
        mean = j0(np.outer(radius, waves)) @ (spectrum * 0.5 * (along + across))
        turning = -jv(2, np.outer(radius, waves)) @ (spectrum * 0.5 * (along - across))
        return mean, turning


def _dome_transform(waves, a, share):
    """Hankel transform, but for a factor, of Mindlin's traction; for a share near 1 its limit 1 / sqrt(1 - r^2/a^2)."""
    if share > 0.999:
        return np.sinc(waves * a / np.pi)
    return _dome(waves, a) - share * _dome(waves, share * a) if share > 0 else _dome(waves, a)


def _dome(waves, a):
    """Of sqrt(1 - r^2/a^2): a^2 (sin y - y cos y) / y^3, y = k a."""
    y = np.maximum(waves * a, 1e-3)
    return a**2 * (np.sin(y) - y * np.cos(y)) / y**3
