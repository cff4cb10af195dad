"""Images of a ball pressed into a gel: the slope of the surface at every pixel, for fitting a shading.

Inside the contact's circle the surface is the ball. Outside it rises smoothly to its level at rest, as the elastic layer has it
(`models/elastic/ball_on_layer.py`): no sharp edge, and nothing is blurred by a filter. Lengths are in px of the image.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.optimize import least_squares

from softtact.errors import InputError
from softtact.imaging.shading import Shading, ShadingSamples
from softtact.models.elastic.ball_on_layer import BallOnLayer

_PROFILE = 90       # distances at which the layer's profile is computed, between which it is linear
_INSIDE = 60        # distances inside the contact, for heights
_LAYERS = 17        # layers for which it is computed
_THINNESS = (0.02, 9.0)     # contact radius over the layer's thickness: at the least, a half-space


@dataclass(frozen=True)
class Gel:
    """What all presses of one data set have in common."""

    ball_px: float
    """Radius of the ball."""
    thickness_px: float = np.inf
    """Thickness of the gel; inf: a half-space."""
    poisson: float = 0.49
    """Poisson's ratio of the gel."""


@dataclass(frozen=True)
class BallPress:
    """One image with its contact."""

    image: np.ndarray
    """(rows, columns, 3) grey levels."""
    background: np.ndarray
    """(rows, columns, 3) the same without contact."""
    centre_px: tuple[float, float]
    """Column and row of the contact's centre."""
    radius_px: float
    """Radius of the contact's circle."""
    name: str = ""
    """For messages and tables."""

    def __post_init__(self) -> None:
        if self.image.shape != self.background.shape:
            raise InputError(f"{self.name or 'a press'}: its image has {_size(self.image)} px, the background "
                             f"{_size(self.background)} px; take both with one camera.")
        rows, columns = self.image.shape[:2]
        x, y = self.centre_px
        if not (0 <= x < columns and 0 <= y < rows and self.radius_px > 0):
            raise InputError(f"{self.name or 'a press'}: the circle at ({x:g}, {y:g}) of radius {self.radius_px:g} px does not lie "
                             f"in the image of {_size(self.image)} px; correct it.")

    @property
    def difference(self) -> np.ndarray:
        """(rows, columns, 3) image minus background."""
        return self.image.astype(float) - self.background

    def distance(self) -> np.ndarray:
        """(rows, columns) from the contact's centre, px."""
        y, x = np.mgrid[:self.image.shape[0], :self.image.shape[1]]
        return np.hypot(x - self.centre_px[0], y - self.centre_px[1])

    def square(self, half_px: float, *, step: int = 1) -> tuple[np.ndarray, np.ndarray]:
        """Columns and rows (row, column) of the image's pixels in a square around the contact's centre."""
        rows, columns = self.image.shape[:2]
        x, y = self.centre_px
        y, x = np.mgrid[max(0, int(y - half_px)):min(rows, int(y + half_px) + 2):step,
                        max(0, int(x - half_px)):min(columns, int(x + half_px) + 2):step]
        return x, y

    def slopes(self, gel: Gel) -> np.ndarray:
        """(rows, columns, 2) d height / d x and d height / d y of the surface under this press."""
        y, x = np.mgrid[:self.image.shape[0], :self.image.shape[1]]
        return ball_slopes(x - self.centre_px[0], y - self.centre_px[1], self.radius_px, gel)

    def samples(self, gel: Gel, *, reach: float = 1.0, step: int = 1) -> ShadingSamples:
        """Pixels up to `reach` contact radii from the centre, every `step`-th row and column."""
        far = reach * self.radius_px
        x, y = self.square(far, step=step)
        near = np.hypot(x - self.centre_px[0], y - self.centre_px[1]) <= far
        x, y = x[near], y[near]
        slopes = ball_slopes(x - self.centre_px[0], y - self.centre_px[1], self.radius_px, gel)
        return ShadingSamples(slopes[:, 0], slopes[:, 1], x.astype(float), y.astype(float),
                              self.image[y, x].astype(float) - self.background[y, x])


def ball_slopes(x_px: np.ndarray, y_px: np.ndarray, contact_px: float, gel: Gel) -> np.ndarray:
    """Slopes (..., 2) of the height at places relative to the contact's centre, under a ball with a given contact radius.

    Raises InputError if the contact is as large as the ball.
    """
    if not 0 < contact_px < gel.ball_px:
        raise InputError(f"the contact radius {contact_px:g} px is not between 0 and the ball's radius {gel.ball_px:g} px; correct "
                         "one of them.")
    distance = np.hypot(x_px, y_px)
    edge = contact_px / np.sqrt(gel.ball_px**2 - contact_px**2)
    over_distance = np.where(distance <= contact_px, 1 / np.sqrt(gel.ball_px**2 - np.minimum(distance, contact_px)**2),
                             edge * _outside(distance / contact_px, contact_px / gel.thickness_px, gel.poisson)
                             / np.maximum(distance, 1e-9))
    return np.stack([over_distance * x_px, over_distance * y_px], axis=-1)


def ball_heights(distance_px: np.ndarray, contact_px: float, gel: Gel) -> np.ndarray:
    """Heights (...) at distances from the contact's centre, below 0; 0 far away. Raises InputError as `ball_slopes` does."""
    places = contact_px * np.concatenate([np.linspace(0, 1, _INSIDE, endpoint=False), _ratios()])
    slopes = ball_slopes(places, np.zeros(len(places)), contact_px, gel)[:, 0]
    rise = np.concatenate([[0.0], np.cumsum(0.5 * (slopes[1:] + slopes[:-1]) * np.diff(places))])
    return np.interp(distance_px, places, rise - rise[-1])


def _outside(ratio, thinness, poisson):
    """Slope outside the contact over that at its edge, at distances over the contact radius; thinness: contact over thickness."""
    profiles = _profiles(poisson)
    place = np.clip((np.log(max(thinness, _THINNESS[0])) - np.log(_THINNESS[0])) / np.log(_THINNESS[1] / _THINNESS[0]), 0, 1)
    place *= len(profiles) - 1
    low = min(int(place), len(profiles) - 2)
    profile = (1 - place + low) * profiles[low] + (place - low) * profiles[low + 1]
    return np.interp(ratio, _ratios(), profile)


@cache
def _profiles(poisson):
    """Profiles (thinness, ratio), for thinnesses in equal steps of their logarithm."""
    thinness = np.geomspace(*_THINNESS, _LAYERS)
    slopes = np.array([BallOnLayer(1.0, 100.0, 1 / one, poisson).slope(_ratios() + 1e-9) for one in thinness])
    return slopes / slopes[:, :1]


def _ratios():
    return 1 + np.concatenate([[0.0], np.geomspace(1e-4, 30, _PROFILE)])


def joined_samples(presses: Sequence[BallPress], gel: Gel, *, reach: float = 1.0, step: int = 1) -> ShadingSamples:
    """The samples of several presses."""
    return ShadingSamples.joined([press.samples(gel, reach=reach, step=step) for press in presses])


def refined_circle(press: BallPress, gel: Gel, shading: Shading, *, reach: float = 1.5, step: int = 2,
                   most_px: float = np.inf) -> BallPress:
    """The press with the centre and radius that explain its colours best under a shading; starts from the circle that it has.

    most_px: how far the centre may move
    """
    x, y = press.square(reach * press.radius_px, step=step)
    seen, places = press.image[y, x].astype(float) - press.background[y, x], shading.at_places(x, y)

    def residual(circle):
        slopes = ball_slopes(x - circle[0], y - circle[1], circle[2], gel)
        return (shading.difference_at(slopes[..., 0], slopes[..., 1], places) - seen).ravel() / 10

    start = np.array([*press.centre_px, min(press.radius_px, 0.95 * gel.ball_px)])
    reach_px = np.array([most_px, most_px, np.inf])
    lower = np.maximum(start - reach_px, [-np.inf, -np.inf, 1.0])
    upper = np.minimum(start + reach_px, [np.inf, np.inf, 0.99 * gel.ball_px])
    found = least_squares(residual, start, bounds=(lower, upper), x_scale=[1, 1, 1], diff_step=1e-3, loss="soft_l1", max_nfev=30).x
    return replace(press, centre_px=(float(found[0]), float(found[1])), radius_px=float(found[2]))


def _size(image):
    return f"{image.shape[1]} x {image.shape[0]}"
