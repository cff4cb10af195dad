"""Motion of markers in an image: its file, the error of a prediction, the noise of the tracking, and formulas from the literature.

Error of a prediction: sum |predicted - measured| / sum |measured|, over markers and both components (`components`), or of the
vectors' lengths (`vectors`). No motion has 1.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.interpolate import RBFInterpolator
from scipy.optimize import least_squares

from softtact.errors import InputError
from softtact.inputs import check_input, in_one_sentence

COLUMNS = ("Mx", "My", "dx", "dy")
_SOFT_PX = 0.3      # residuals above count linearly: half of the rounding to whole px


@dataclass(frozen=True)
class MarkerMotion:
    """The measured motion of the markers of one image."""

    px: np.ndarray
    """(marker, 2) columns and rows at rest."""
    motion_px: np.ndarray
    """(marker, 2) motion to the image, px."""
    name: str = ""
    """Of the file."""

    @classmethod
    def read(cls, path: str | Path) -> "MarkerMotion":
        """From a CSV with the columns Mx, My (px at rest), dx, dy (motion in px). Raises InputError for another file."""
        check_input(path, "table", missing="there is no such file of markers; correct the path.")
        with in_one_sentence(path, "not readable as CSV", f"write it with the columns {', '.join(COLUMNS)}"):
            table = pd.read_csv(path)
        if missing := [name for name in COLUMNS if name not in table]:
            raise InputError(f"{path}, column {missing[0]!r}: it is missing; write the columns {', '.join(COLUMNS)}.")
        values = table[list(COLUMNS)].apply(pd.to_numeric, errors="coerce").to_numpy(float)
        if len(values) < 10 or not np.isfinite(values).all():
            raise InputError(f"{path}: it needs ten markers or more, and numbers in all columns; it has {len(values)} rows.")
        return cls(values[:, :2], values[:, 2:], Path(path).stem)


@dataclass(frozen=True)
class MotionError:
    """How far a prediction is off."""

    components: float
    """Sum of |predicted - measured| over sum of |measured|, over x and y of all markers."""
    vectors: float
    """The same of the vectors' lengths."""
    rounded: float
    """`components` of the prediction rounded to whole px, as the measured motion is."""


def motion_error(predicted: np.ndarray, measured: np.ndarray) -> MotionError:
    """The `MotionError` of a predicted motion (marker, 2) in px."""
    def components(motion):
        return float(np.abs(motion - measured).sum() / np.abs(measured).sum())

    vectors = np.hypot(*(predicted - measured).T).sum() / np.hypot(*measured.T).sum()
    return MotionError(components(predicted), float(vectors), components(np.rint(predicted)))


def left_out_spline(markers: MarkerMotion) -> np.ndarray:
    """Motion (marker, 2) that a thin-plate spline through all other markers predicts at each: what the tracking's noise leaves."""
    count = np.arange(len(markers.px))
    return np.array([RBFInterpolator(markers.px[count != k], markers.motion_px[count != k])(markers.px[k:k + 1])[0] for k in count])


def shift_and_zoom(px: np.ndarray, middle_px: Sequence[float], values: np.ndarray) -> np.ndarray:
    """Motion (marker, 2) of a camera that moved: values: shift x, y in px, zoom, rotation in rad about the image's middle."""
    x, y = (np.asarray(px) - middle_px).T
    return np.column_stack([values[0] + values[2] * x - values[3] * y, values[1] + values[2] * y + values[3] * x])


REGISTRATIONS = {"none": 0, "shift": 2, "similarity": 4}      # how many values of shift_and_zoom are free


def registration(kind: str, px: np.ndarray, middle_px: Sequence[float], values: Sequence[float]) -> np.ndarray:
    """Motion (marker, 2) of the camera; values: as many as the kind has in REGISTRATIONS."""
    return shift_and_zoom(px, middle_px, np.concatenate([values, np.zeros(4 - len(values))]))


def dilate(px: np.ndarray, centre_px: Sequence[float], heights: np.ndarray, places_px: np.ndarray, scale: float,
           width_px: float) -> np.ndarray:
    """FOTS' spreading by a normal load: scale * sum_i h_i (M - C_i) exp(-|M - C_i|^2 / width^2).

    heights (point,), places_px (point, 2): depth and place, from the centre, of points of the contact;  px (marker, 2) at rest
    Written anew from Y. Zhao et al., FOTS, arXiv 2404.19217, section III.
    """
    away = np.asarray(px)[:, None] - (np.asarray(places_px) + centre_px)[None]
    weight = heights * np.exp(-np.sum(away**2, axis=2) / width_px**2)
    return scale * np.sum(weight[..., None] * away, axis=1)


def shear(px: np.ndarray, centre_px: Sequence[float], shift_px: Sequence[float], width_px: float) -> np.ndarray:
    """FOTS' motion by a sideways load: shift * exp(-|M - G|^2 / width^2)."""
    away = np.asarray(px) - centre_px
    return np.asarray(shift_px) * np.exp(-np.sum(away**2, axis=1) / width_px**2)[:, None]


def twist(px: np.ndarray, centre_px: Sequence[float], angle_rad: float, width_px: float) -> np.ndarray:
    """FOTS' motion by a torsion: angle * (G - M turned by a right angle) * exp(-|M - G|^2 / width^2)."""
    x, y = (np.asarray(px) - centre_px).T
    return angle_rad * np.exp(-(x**2 + y**2) / width_px**2)[:, None] * np.column_stack([-y, x])


@dataclass(frozen=True)
class MotionFit:
    """A model fitted to the motion of one image."""

    values: np.ndarray
    """Of the free parameters, in the order of the start values."""
    predicted_px: np.ndarray
    """(marker, 2)."""
    error: MotionError
    """Of the image that it was fitted to."""


def fit_motion(model: Callable[[np.ndarray], np.ndarray], markers: MarkerMotion, starts: Sequence[Sequence[float]],
               bounds: tuple[Sequence[float], Sequence[float]]) -> MotionFit:
    """The parameters with the least sum of (nearly) absolute residuals, of several starts.  model: values -> motion (marker, 2)"""
    lower, upper = np.asarray(bounds[0], float), np.asarray(bounds[1], float)
    scale = np.maximum(0.05 * np.minimum(upper - lower, 1e3), 1e-3)

    def residual(values):
        return (model(values) - markers.motion_px).ravel()

    fits = [least_squares(residual, np.clip(start, lower, upper), bounds=(lower, upper), loss="soft_l1", f_scale=_SOFT_PX,
                          x_scale=scale, diff_step=1e-3, max_nfev=100) for start in starts]
    best = min(fits, key=lambda fit: fit.cost)
    predicted = model(best.x)
    return MotionFit(best.x, predicted, motion_error(predicted, markers.motion_px))
