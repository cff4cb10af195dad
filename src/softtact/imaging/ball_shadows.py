"""Shadows that a ball pressed into a gel throws, and the lamps that explain those of some images.

The relief is that of `ball_presses`: the ball, and around it the surface of the elastic layer. The lamps' directions are those in
which the shading's colours rise most, so only height, softness and strength are fitted, outside the contacts. A lamp is kept where
shadows that are fitted to one half of the presses lower the error of the other half.
"""

from collections.abc import Sequence

import numpy as np

from softtact.imaging.ball_presses import BallPress, Gel, ball_heights, ball_slopes
from softtact.imaging.gel_image import Shades
from softtact.imaging.shadows import Lamps, horizon

AROUND = 4.0            # contact radii from the middle up to which shadows are fitted
_BEYOND = 1.5           # times as far the relief is known
_CELLS = 10             # of the relief, to a contact radius
_ELEVATIONS = (0.05, 0.08, 0.12, 0.17, 0.22, 0.3, 0.4, 0.5)      # radians
_SOFTNESS = (0.05, 0.1, 0.2, 0.4, 0.8)
_LEAST_GAIN = 0.02      # of the squared error around contacts, below which a lamp is not kept
_TILT = 0.1             # at which the colours' rise is looked at


def press_dimming(press: BallPress, gel: Gel, lamps: Lamps, x_px: np.ndarray, y_px: np.ndarray) -> np.ndarray:
    """(..., 3) share of the colours that shadows take at pixels (...) of a press."""
    relief = _BallRelief(press, gel, x_px, y_px)
    return lamps.dimming(np.stack([relief.horizon(direction) for direction in lamps.directions], axis=-1), relief.slopes)


def with_lamps(shading: Shades, presses: Sequence[BallPress], gel: Gel, *, reach: Sequence[float]) -> Lamps | None:
    """The lamps whose shadows explain presses best, beside a shading; None where shadows explain nothing.

    reach: (press,) contact radii up to which pixels are used
    """
    seen = [_Seen(shading, press, gel, far) for press, far in zip(presses, reach, strict=True)]
    azimuths = _azimuths(shading, seen)
    parts = [[_Channel(one, azimuths[channel], channel) for one in seen] for channel in range(3)]
    best = np.array([_fitted(part) if _predicts(part) else (0.2, 0.1, 0.0) for part in parts])
    return Lamps(azimuths, *best.T) if (best[:, 2] > 0).any() else None


class _BallRelief:
    """The relief around a ball, on a grid about the contact, and at pixels."""

    def __init__(self, press, gel, x_px, y_px):
        x, y = x_px - press.centre_px[0], y_px - press.centre_px[1]
        self.slopes = ball_slopes(x, y, press.radius_px, gel)
        self._step = press.radius_px / _CELLS
        half = int(np.ceil(_BEYOND * max(np.abs(x).max(), np.abs(y).max()) / self._step))
        places = self._step * np.arange(-half, half + 1)
        self._height = -ball_heights(np.hypot(*np.meshgrid(places, places)), press.radius_px, gel)
        self._at = (y / self._step + half, x / self._step + half)

    def horizon(self, direction):
        """(...) tangent of the horizon at the pixels in a direction (2,)."""
        found, (row, column) = horizon(self._height, direction, self._step, self._step), self._at
        j, i = row.astype(int), column.astype(int)
        down, right = row - j, column - i
        return ((1 - down) * ((1 - right) * found[j, i] + right * found[j, i + 1])
                + down * ((1 - right) * found[j + 1, i] + right * found[j + 1, i + 1]))


class _Seen:
    """The pixels around the contact of a press, and their colours without shadows."""

    def __init__(self, shading, press, gel, reach):
        far = reach * press.radius_px
        x, y = press.square(far, step=max(1, round(press.radius_px / 12)))
        distance = np.hypot(x - press.centre_px[0], y - press.centre_px[1])
        around = (distance > press.radius_px) & (distance <= far)
        self.x, self.y = x[around], y[around]
        self.relief = _BallRelief(press, gel, self.x, self.y)
        background = press.background[self.y, self.x]
        self.lit = np.clip(background + shading.difference(*self.relief.slopes.T, self.x, self.y), 0, 255)
        self.left = press.image[self.y, self.x] - self.lit


class _Channel:
    """What a channel's lamp has to explain in a press."""

    def __init__(self, seen, azimuth, channel):
        direction = np.array([np.cos(azimuth), np.sin(azimuth)])
        self._horizon, self._slopes = seen.relief.horizon(direction), seen.relief.slopes
        self._azimuth, self._lit, self._left = azimuth, seen.lit[:, channel], seen.left[:, channel]

    def sums(self, elevation, softness):
        """Darkening by a full shadow times what is left, its square, and the square of what is left."""
        full = Lamps(*(np.full(3, value) for value in (self._azimuth, elevation, softness, 1.0)))
        dark = -full.dimming(self._horizon[:, None], self._slopes)[:, 0] * self._lit
        return np.array([dark @ self._left, dark @ dark, self._left @ self._left])


def _fitted(part):
    """Elevation, softness and strength with the least squared error."""
    tried = [(elevation, softness) for elevation in _ELEVATIONS for softness in _SOFTNESS]
    sums = np.array([np.sum([one.sums(*each) for one in part], axis=0) for each in tried])
    strength = np.clip(sums[:, 0] / np.maximum(sums[:, 1], 1e-12), 0, 1)
    best = int(np.argmax(_gain(sums, strength)))
    return (*tried[best], strength[best])


def _predicts(part):
    """Whether each half of the presses says something about the other."""
    gain = total = 0.0
    for own, other in ((part[::2], part[1::2]), (part[1::2], part[::2])):
        if not (own and other):
            return False
        *shape, strength = _fitted(own)
        sums = np.sum([one.sums(*shape) for one in other], axis=0)
        gain, total = gain + _gain(sums[None], strength)[0], total + sums[2]
    return gain > _LEAST_GAIN * total


def _gain(sums, strength):
    """By how much a strength lowers the squared error."""
    return 2 * strength * sums[:, 0] - strength**2 * sums[:, 1]


def _azimuths(shading, seen):
    """(3,) directions in which the colours rise with the surface's slope, in the mean over the presses."""
    x, y = (np.array([getattr(one, axis).mean() for one in seen]) for axis in "xy")
    rises = []
    for along in ((_TILT, 0.0), (0.0, _TILT)):
        up, down = (shading.difference(*(np.full(len(x), sign * slope) for slope in along), x, y) for sign in (1, -1))
        rises.append((up - down).mean(axis=0))
    return np.arctan2(rises[1], rises[0])
