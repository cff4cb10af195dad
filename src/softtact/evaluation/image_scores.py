"""Scores of images with markers, as Kim et al. (2023) define them: where the markers are, and how alike the rest of the images is.

    d = sum_i |p_i - q_i|          p, q: places of marker i in px, of a made and of a real image            (its equation 6)
    e = sum_i |v_i - w_i|          v, w: motions of marker i from the same source's own image at rest       (its equation 7)

d and e are equal where both sources have the same image at rest. An image is degenerate where a marker is not found; it has no d.
MAE, MSE, SSIM and PSNR are those of the pixels outside all markers of both images. The paper states no window of its SSIM: here
it is that of Wang et al. (IEEE Trans. Image Processing 13 (2004) 600), Gaussian of 1.5 px cut at 5 px, K1 = .01, K2 = .03.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from softtact.errors import InputError

LARGEST_GREY = 255.0
_SIGMA_PX, _REACH_PX = 1.5, 5
_K1, _K2 = 0.01, 0.03


@dataclass(frozen=True)
class ImageScores:
    """How alike two images are outside the markers."""

    mae: float
    """Mean absolute difference in grey levels over pixels and channels."""
    mse: float
    """Mean squared difference in grey levels squared."""
    ssim: float
    """Mean structural similarity over pixels and channels, at most 1."""
    psnr: float
    """Peak signal-to-noise ratio in dB of the largest grey level, 255; infinite for equal images."""


def position_error_px(made: np.ndarray, real: np.ndarray) -> np.ndarray:
    """d (...) in px of places (..., marker, 2); nan where a marker of one of them is not known."""
    _check_alike(made, real)
    return np.linalg.norm(np.asarray(made, float) - np.asarray(real, float), axis=-1).sum(axis=-1)


def motion_error_px(made: np.ndarray, real: np.ndarray, *, made_at_rest: np.ndarray, real_at_rest: np.ndarray) -> np.ndarray:
    """The magnitude of the error vectors, e (...) in px, of places (..., marker, 2) and those at rest (marker, 2)."""
    return position_error_px(np.asarray(made) - made_at_rest, np.asarray(real) - real_at_rest)


def degenerate(places_px: np.ndarray) -> np.ndarray:
    """(...) whether an image with places (..., marker, 2) lacks a marker: one of them is nan."""
    return ~np.isfinite(places_px).all(axis=(-1, -2))


def outside_markers(shape: tuple[int, int], *places_px: np.ndarray, radius_px: float) -> np.ndarray:
    """(rows, columns) bool: pixels farther than a radius from every marker (marker, 2), (column, row), of any of the images."""
    y, x = np.mgrid[:shape[0], :shape[1]]
    far = np.ones(shape, dtype=bool)
    for places in places_px:
        for column, row in np.asarray(places)[np.isfinite(places).all(axis=-1)]:
            far &= (x - column)**2 + (y - row)**2 > radius_px**2
    return far


def image_scores(made: np.ndarray, real: np.ndarray, *, counted: np.ndarray) -> ImageScores:
    """`ImageScores` of images (rows, columns, channel) of grey levels 0 to 255, over the counted pixels (rows, columns) bool."""
    made, real = np.asarray(made, dtype=float), np.asarray(real, dtype=float)
    _check_alike(made, real)
    if not counted.any():
        raise InputError("no pixel lies outside the markers; give a smaller radius.")
    difference = (made - real)[counted]
    mse = float((difference**2).mean())
    psnr = float(10 * np.log10(LARGEST_GREY**2 / mse)) if mse else np.inf
    return ImageScores(float(np.abs(difference).mean()), mse, float(similarity(made, real)[counted].mean()), psnr)


def similarity(made: np.ndarray, real: np.ndarray) -> np.ndarray:
    """Structural similarity (rows, columns, channel) of two images of grey levels 0 to 255."""
    def mean(values):
        return ndimage.gaussian_filter(values, (_SIGMA_PX, _SIGMA_PX, 0), truncate=_REACH_PX / _SIGMA_PX)

    one, other = mean(made), mean(real)
    var_one, var_other, shared = mean(made**2) - one**2, mean(real**2) - other**2, mean(made * real) - one * other
    c1, c2 = (_K1 * LARGEST_GREY)**2, (_K2 * LARGEST_GREY)**2
    return (2 * one * other + c1) * (2 * shared + c2) / ((one**2 + other**2 + c1) * (var_one + var_other + c2))


def marker_sum_change_px(before: np.ndarray, after: np.ndarray) -> float:
    """|sum of all motions before - that after| in px, of places (marker, 2): how the paper tells fixed objects (its equation 8)."""
    return float(np.linalg.norm((np.asarray(before) - np.asarray(after)).sum(axis=-2)))


def _check_alike(made: np.ndarray, real: np.ndarray) -> None:
    if np.shape(made)[-2:] != np.shape(real)[-2:]:
        raise InputError(f"arrays of shapes {np.shape(made)} and {np.shape(real)} cannot be compared; give as many markers, or "
                         "images of the same size.")
