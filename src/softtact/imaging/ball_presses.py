"""Images of a ball pressed into a gel: the slope of the surface at every pixel, for fitting a shading.

Inside the contact's circle the surface is the ball. Outside it rises smoothly to its level at rest, as the elastic layer has it
(`models/elastic/ball_on_layer.py`): no sharp edge, and nothing is blurred by a filter. Lengths are in px of the image.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from softtact.errors import InputError
from softtact.imaging.shading import Shading, ShadingSamples
from softtact.models.elastic.ball_on_layer import BallOnLayer

_PROFILE = 240      # radii at which the layer's profile is computed, between which it is linear


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
    layer = BallOnLayer(contact_px, gel.ball_px, gel.thickness_px, gel.poisson)
    distance = np.hypot(x_px, y_px)
    radii = contact_px * np.concatenate([np.linspace(0, 1, _PROFILE // 3), 1 + np.geomspace(1e-6, 30, _PROFILE)])
    over_distance = np.interp(distance, radii, -layer.slope(radii)) / np.maximum(distance, 1e-9)
    return np.stack([over_distance * x_px, over_distance * y_px], axis=-1)


def joined_samples(presses: Sequence[BallPress], gel: Gel, *, reach: float = 1.0, step: int = 1) -> ShadingSamples:
    """The samples of several presses."""
    return ShadingSamples.joined([press.samples(gel, reach=reach, step=step) for press in presses])


def refined_circle(press: BallPress, gel: Gel, shading: Shading, *, reach: float = 1.5, step: int = 2,
                   most_px: float = np.inf) -> BallPress:
    """The press with the centre and radius that explain its colours best under a shading; starts from the circle that it has.

    most_px: how far the centre may move
    """
    x, y = press.square(reach * press.radius_px, step=step)
    seen = press.difference[y, x]

    def residual(circle):
        slopes = ball_slopes(x - circle[0], y - circle[1], circle[2], gel)
        return (shading.difference(slopes[..., 0], slopes[..., 1], x, y) - seen).ravel() / 10

    start = np.array([*press.centre_px, min(press.radius_px, 0.95 * gel.ball_px)])
    reach_px = np.array([most_px, most_px, np.inf])
    lower = np.maximum(start - reach_px, [-np.inf, -np.inf, 1.0])
    upper = np.minimum(start + reach_px, [np.inf, np.inf, 0.99 * gel.ball_px])
    found = least_squares(residual, start, bounds=(lower, upper), x_scale=[1, 1, 1], diff_step=1e-3, loss="soft_l1", max_nfev=30).x
    return replace(press, centre_px=(float(found[0]), float(found[1])), radius_px=float(found[2]))


def _size(image):
    return f"{image.shape[1]} x {image.shape[0]}"
