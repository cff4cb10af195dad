"""A bonded layer whose surface is sheared under a round contact, and its sideways motion under a pressure: in-plane kernels.

Symbols: G shear modulus, nu Poisson's ratio, h thickness, k wave number, x = k h, a contact radius, c radius that sticks.
A wave of traction along its own direction (in plane) moves the surface by A(x) / (G k) times the traction, one across its direction
by tanh(x) / (G k); a pressure p cos(k s) moves it along s by B(x) / (G k) p sin(k s): `wide_layer` has A and B.

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
from softtact.models.elastic.wide_layer import surface_spectrum

_DEEP = 20.0        # x beyond which the layer is a half-space, to 1e-15: the tail begins there
_WAVES = 200        # wave numbers up to there, and as many beyond
_LOG_STEP, _SHARE_STEP = 0.15, 0.1      # of the grid of computed profiles
_POINTLIKE = 8.0    # contact radii from which a contact acts as a point force, to 0.5 %; farther out the waves would be too few
_FARTHEST = 100.0   # thicknesses from a contact beyond which nothing moves
_BEYOND = 60.0      # contact radii: wave number at which the tail ends


def surface_kernels(poisson: float, thickness: float, contact_radius: float) -> tuple[np.ndarray, ...]:
    """x, its weights, A and B at them (wave,): Gauss points over 0 ... 20 and over the tail."""
    nodes, weights = _gauss()
    end = max(6 * _DEEP, _BEYOND * thickness / contact_radius)
    x = np.concatenate([0.5 * _DEEP * (nodes + 1), _DEEP + 0.5 * (end - _DEEP) * (nodes + 1)])
    weight = np.concatenate([0.5 * _DEEP * weights, 0.5 * (end - _DEEP) * weights])
    _, along, _, push = surface_spectrum(x, thickness_mm=1.0, shear_mpa=1.0, poisson=poisson)
    return x, weight, x * along, x * push


@cache
def _gauss():
    return legendre.leggauss(_WAVES)


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
        for name in ("contact_radius", "thickness"):
            if not 0 < getattr(self, name) < np.inf:
                raise InputError(f"ShearedContact: {name}={getattr(self, name):g} is not possible; give a finite length above 0.")
        if not -1 < self.poisson <= 0.5:
            raise InputError(f"ShearedContact: poisson={self.poisson:g} is not possible; give a number above -1 and up to 0.5.")
        if not 0 <= self.stick_share <= 1:
            raise InputError(f"the share that sticks, {self.stick_share:g}, is not between 0 and 1; correct it.")

    def motion(self, along: np.ndarray, across: np.ndarray) -> np.ndarray:
        """Motion (..., 2) of the surface along and across the shear, at places along and across it from the centre (...)."""
        radius, angle = np.hypot(along, across), np.arctan2(across, along)
        centre, *near = self._profiles()
        ratios = _ratios() * self.contact_radius
        far = (part / centre for part in _under_a_point(radius / self.thickness, self.poisson))
        even, double = (np.where(radius <= ratios[-1], np.interp(radius, ratios, profile), beyond)
                        for profile, beyond in zip(near, far, strict=True))
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
    """Distances over the contact radius of the computed profiles."""
    return np.concatenate([[0.0], np.geomspace(0.05, _POINTLIKE, 61)])


def _under_a_point(distance, poisson):
    """Parts (...) that do not turn and turn twice with the angle of the motion under a unit force over G at one point; h = 1.

    distance (...): so far from it that any contact acts as a point
    """
    grid, mean, turning = _times_distance(poisson)
    far = np.clip(distance, grid[0], None)
    return [np.interp(np.log(far), np.log(grid), part, right=0.0) / far for part in (mean, turning)]


@cache
def _times_distance(poisson):
    """Distances (d,), and parts of the motion under a point times distance: of a half-space, and what the layer's bottom adds."""
    panel, weights = legendre.leggauss(40)
    ends = np.linspace(0, _DEEP, 2 * int(_DEEP) + 1)
    x = (ends[:-1, None] + 0.25 * (panel + 1)).ravel()
    weight = np.tile(0.25 * weights, len(ends) - 1)
    _, along, across, _ = surface_spectrum(x, thickness_mm=1.0, shear_mpa=1.0, poisson=poisson)
    distance = np.geomspace(1e-3, _FARTHEST, 400)
    argument = np.outer(distance, x)
    even = j0(argument)
    double = 2 * j1(argument) / np.maximum(argument, 1e-9) - even        # J2
    mean = 0.5 * ((2 - poisson) / distance + even @ (weight * (x * along + x * across - (2 - poisson))))
    turning = -0.5 * (-poisson / distance + double @ (weight * (x * along - x * across + poisson)))
    return distance, mean * distance / (2 * np.pi), turning * distance / (2 * np.pi)


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
