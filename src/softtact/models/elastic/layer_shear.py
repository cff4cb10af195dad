"""A bonded layer whose surface is sheared under a round contact, and its sideways motion under a pressure: in-plane kernels.

Symbols: G shear modulus, nu Poisson's ratio, h thickness, k wave number, x = k h, a contact radius, c radius that sticks.
A wave of traction along its own direction (in plane) moves the surface by A(x) / (G k) times the traction, one across its direction
by tanh(x) / (G k); a pressure p cos(k s) moves it along s by B(x) / (G k) p sin(k s). A and B follow from the solutions of Navier's
equations in a layer, exp(+-k z) and z exp(+-k z), with no displacement below.

The traction of a ball that has stuck inside c and slid outside is Mindlin's difference of two Hertzian domes,
q ~ sqrt(1 - r^2/a^2) - (c/a) sqrt(1 - r^2/c^2): exact on a half-space, an approximation on a layer of a few contact radii.
Reference: K. L. Johnson, Contact Mechanics, sections 3.6, 7.2.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.polynomial import legendre
from scipy.special import j0, j1

from softtact.errors import InputError
from softtact.models.elastic.ball_on_layer import BallOnLayer

_DEEP = 20.0        # x beyond which the layer is a half-space, to 1e-15
_WAVES = 200        # wave numbers up to there, and as many beyond
_LOG_STEP, _SHARE_STEP = 0.15, 0.1      # of the grid of computed profiles
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
        _, mean, turning = self._profiles()
        even, double = (np.interp(radius, _ratios() * self.contact_radius, profile) for profile in (mean, turning))
        return np.stack([even + double * np.cos(2 * angle), double * np.sin(2 * angle)], axis=-1)

    @property
    def motion_per_force(self) -> float:
        """Sideways motion of the centre over the traction's force divided by G, 1 / length."""
        return float(self._profiles()[0]) / self.thickness

    def _profiles(self):
        """Motion of the centre per force (times thickness), and the parts that do not turn and turn twice with the angle.

        Linear between the nodes of a grid over log(a / h) and c / a, whose profiles are computed once.
        """
        place = np.log(self.contact_radius / self.thickness) / _LOG_STEP
        share = self.stick_share / _SHARE_STEP
        low, left = int(np.floor(place)), min(int(share), round(1 / _SHARE_STEP) - 1)
        up, right = place - low, share - left
        corners = ((low, left, (1 - up) * (1 - right)), (low, left + 1, (1 - up) * right), (low + 1, left, up * (1 - right)),
                   (low + 1, left + 1, up * right))
        parts = [[weight * part for part in _node(one, other, self.poisson)] for one, other, weight in corners]
        return [sum(found) for found in zip(*parts, strict=True)]


def _ratios():
    """Distances over the contact radius."""
    return np.concatenate([[0.0], np.geomspace(0.05, 40, 80)])


@cache
def _node(place, share_step, poisson):
    """The profiles at a node of the grid; h = 1."""
    contact, share = float(np.exp(place * _LOG_STEP)), share_step * _SHARE_STEP
    x, weight, along, _ = surface_kernels(poisson, 1.0, contact)
    across, spectrum = np.tanh(x), weight * _dome_transform(x, contact, share)
    argument = np.outer(_ratios() * contact, x)
    even, odd = j0(argument), j1(argument)
    double = 2 * odd / np.maximum(argument, 1e-9) - even        # J2
    double[0] = 0
    mean, turning = even @ (spectrum * 0.5 * (along + across)), -double @ (spectrum * 0.5 * (along - across))
    force = 2 * np.pi * _dome_transform(np.array([1e-9]), contact, share)[0]
    return mean[0] / force, mean / mean[0], turning / mean[0]


def _dome_transform(waves, a, share):
    """Hankel transform, but for a factor, of Mindlin's traction; for a share near 1 its limit 1 / sqrt(1 - r^2/a^2)."""
    if share > 0.999:
        return np.sinc(waves * a / np.pi)
    return _dome(waves, a) - share * _dome(waves, share * a) if share > 0 else _dome(waves, a)


def _dome(waves, a):
    """Of sqrt(1 - r^2/a^2): a^2 (sin y - y cos y) / y^3, y = k a."""
    y = np.maximum(waves * a, 1e-3)
    return a**2 * (np.sin(y) - y * np.cos(y)) / y**3
