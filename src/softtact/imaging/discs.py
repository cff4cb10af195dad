"""Bright contact discs in a camera frame: found by their edges, measured with an outline fitted to their light."""

import warnings
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from scipy.ndimage import binary_erosion, distance_transform_edt, gaussian_gradient_magnitude, maximum
from skimage.measure import find_contours, regionprops
from skimage.segmentation import expand_labels

from softtact.errors import FrameWarning
from softtact.imaging.light import grey, warn_of_unseen_contrast
from softtact.imaging.outline import (
    COLUMN,
    NAMES,
    ROW,
    A,
    B,
    Outline,
    R,
    S,
    box,
    contrast_light,
    corners,
    first_priors,
    fit_outline,
    inside,
    pooled_priors,
)
from softtact.imaging.regions import EDGE_SCALE, FAINTEST, find_regions, is_ring, noise_of, smooth_surface

DTYPES = {"disc": int, "x_mm": float, "y_mm": float, "area_mm2": float, "area_sd_mm2": float, "diameter_mm": float,
          "signal_to_noise": float, "clipped": bool, "touching": bool, "measured_by": str}
COLUMNS = list(DTYPES)
SMALLEST_PIXELS = 6      # area; a smaller region is noise or a hot pixel
SURE = 3.0               # least area of a disc, in its standard deviations; below, it may be noise
_MISFIT, _RESIDUAL = 1.5, 0.08   # rms residual over noise and over contrast; above both, the contact has no such outline
_GROUND = 0.4            # share of the frame; a bright region without outline that is larger is the background
PASSES = 3               # fits of each disc: alone, with priors from the other discs, and again with its neighbours' light


def detect_discs(frame: np.ndarray, *, pixel_mm: float, smallest_mm: float = 0.0, transfer: str = "linear",
                 lossy: bool = False) -> pd.DataFrame:
    """Table of the bright discs in a frame (rows, columns) or (rows, columns, channels), one row each.

    disc             number from 0, top to bottom
    x_mm, y_mm       centre relative to the frame's; y grows downwards
    area_mm2         of the contact; area_sd_mm2: its standard deviation due to noise
    diameter_mm      of the circle of that area
    signal_to_noise  contrast over the noise of one pixel, at the disc
    clipped          cut by the frame's border: the area is the visible part, the centre that of the whole outline
    touching         part of one bright region with a neighbour: pixels in both outlines are shared between them
    measured_by      outline, or light (summed) if the contact has no simple outline

    smallest_mm: smallest diameter of a disc that is kept. A frame without discs gives an empty table.
    transfer, lossy: relation of pixel values to light, see `softtact.imaging.light.grey`
    Warns (`FrameWarning`) if the frame may not suit the detection.
    """
    return discs_and_outlines(frame, pixel_mm=pixel_mm, smallest_mm=smallest_mm, transfer=transfer, lossy=lossy)[0]


def discs_and_outlines(frame: np.ndarray, *, pixel_mm: float, smallest_mm: float = 0.0, transfer: str = "linear",
                       lossy: bool = False) -> tuple[pd.DataFrame, list[np.ndarray]]:
    """The table of `detect_discs`, and the outline of each disc: x_mm and y_mm of its corners (corners, 2)."""
    image = grey(frame, transfer=transfer, lossy=lossy)
    scene = Scene(image)
    least = max(SMALLEST_PIXELS, np.pi * (0.5 * smallest_mm / pixel_mm) ** 2)
    rows = [row for row in map(scene.measure, range(len(scene.fits)))
            if row["pixels"] >= least and row["contrast"] >= FAINTEST and row["pixels"] > SURE * row["pixels_sd"]]
    _warn(rows, image, lossy=lossy)
    middle = 0.5 * (np.array(image.shape) - 1)
    outlines = [(scene.corners(row) - middle)[:, ::-1] * pixel_mm for row in rows]
    return _table(rows, middle, pixel_mm), outlines


def _warn(rows, image, *, lossy):
    """Warn if the detected regions are probably not contact discs."""
    if not rows:
        warn_of_unseen_contrast(image, lossy=lossy)
    if sum(row["pixels"] for row in rows if row["measured_by"] == "light") > _GROUND * image.size:
        warnings.warn("much of the frame is bright and has no outline of a disc; contacts must be bright on dark: invert the frame "
                      "if they are dark.", FrameWarning, stacklevel=3)


def _table(rows, middle, pixel_mm):
    table = pd.DataFrame({name: [row.get(name) for row in rows] for name in DTYPES})
    table["disc"] = np.arange(len(rows))
    for name, axis in (("y_mm", 0), ("x_mm", 1)):
        table[name] = [(row["centre"][axis] - middle[axis]) * pixel_mm for row in rows]
    table["area_mm2"] = [row["pixels"] * pixel_mm**2 for row in rows]
    table["area_sd_mm2"] = [row["pixels_sd"] * pixel_mm**2 for row in rows]
    table["diameter_mm"] = 2 * np.sqrt(table.area_mm2.to_numpy(dtype=float) / np.pi)
    return table.astype(DTYPES)


class Scene:
    """All discs of one frame, fitted together.

    Light and blur change slowly over a frame, so the other discs also give information on a disc's contrast, glass and blur,
    as far as they agree; discs that differ in brightness keep their values. passes: 1 fits every disc alone.
    """

    def __init__(self, image: np.ndarray, *, passes: int = PASSES) -> None:
        self.image, self.passes, noise = image, passes, noise_of(image)
        self.regions = find_regions(image, noise=noise)
        self.props = regionprops(self.regions.labels)
        self.limits = _limits(image)
        self.noise = self._whole_noise(noise)
        self.fits: list[Outline] = []
        if self.props:
            self._fit()

    def _fit(self):
        self.start = self._starts()
        self.margin = int(np.ceil(3 * np.median(self.start[:, S]) + 3))
        self.around = expand_labels(self.regions.labels, self.margin)
        prior, values = first_priors(self.start), self.start
        self.light = np.zeros_like(self.image)
        for number in range(self.passes):
            self.fits = [self._fit_one(k, values[k], prior[k], alone=number == 0) for k in range(len(values))]
            values = np.array([fit.values for fit in self.fits])
            prior = pooled_priors(self.fits, prior, shape=self.image.shape)
            self.light = self._all_light(values)

    def _starts(self):
        """Initial parameters (discs, parameters) from the regions."""
        centres = np.array([region.centroid for region in self.props])
        glass = self._glass(*centres.T)
        at = tuple(np.round(centres).astype(int).T)
        contrast = np.maximum(2 * (self.regions.threshold[at] - glass), FAINTEST)
        start = np.zeros((len(centres), len(NAMES)))
        start[:, A], start[:, B], start[:, [ROW, COLUMN]] = contrast, glass, centres
        start[:, S] = self._blur(contrast)
        start[:, R] = np.sqrt([region.area / np.pi + 1 for region in self.props])
        return start

    @cached_property
    def _glass(self):
        """Brightness without contact, a function of (rows, columns)."""
        away = expand_labels(self.regions.labels, 3) == 0
        if away.sum() < 100:
            away = self.regions.labels == 0
        if not away.any():
            return lambda rows, columns: np.full(np.shape(rows), self.image.min())
        return smooth_surface(np.nonzero(away), self.image[away], weights=np.ones(away.sum()), shape=self.image.shape)

    def _whole_noise(self, noise):
        """Noise of a pixel before the camera clipped it at black, which is larger than the noise in the frame."""
        labels = self.regions.labels
        within, away = binary_erosion(labels > 0, iterations=3), expand_labels(labels, 3) == 0
        if within.sum() > 50:
            noise = max(noise, noise_of(self.image, within))
        if self.limits[0] < 0 or away.sum() < 100:
            return noise
        middle, above = np.percentile((self.image - self._glass(*np.indices(self.image.shape)))[away], [50.0, 84.13])
        return max(noise, above - middle)

    def _blur(self, contrast):
        """Initial blur in pixels, from the steepest slope in each region."""
        steepest = maximum(gaussian_gradient_magnitude(self.image, EDGE_SCALE), self.regions.labels,
                           np.arange(1, len(contrast) + 1))
        wide = np.median(contrast / (np.sqrt(2 * np.pi) * steepest))
        return np.sqrt(max(wide**2 - EDGE_SCALE**2, 0.25))

    def _fit_one(self, k, values, prior, *, alone):
        window, mask = self._pixels(k, alone=alone)
        rows, columns = (index[mask] for index in np.mgrid[window].astype(float))
        other = 0.0 if alone else (self.light[window] - contrast_light(values, window))[mask]
        return fit_outline(rows, columns, self.image[window][mask], start=values, prior=prior, noise=self.noise, other=other,
                           limits=self.limits)

    def _pixels(self, k, *, alone):
        """Window of the frame around a disc, and the mask of this disc's pixels in it."""
        top, left, bottom, right = self.props[k].bbox
        window = tuple(slice(max(first - self.margin, 0), min(last + self.margin, size))
                       for first, last, size in zip((top, left), (bottom, right), self.image.shape, strict=True))
        labels = (self.around if alone else self.regions.labels)[window]
        return window, (labels == 0) | (labels == k + 1)

    def _all_light(self, values):
        """Light (rows, columns) of all discs above the glass."""
        light = np.zeros_like(self.image)
        for one in values:
            window = box(one, shape=self.image.shape, margin=5 * one[S])
            light[window] += contrast_light(one, window)
        return light

    def measure(self, k: int) -> dict[str, Any]:
        """One row of the table, in pixels."""
        fit, region = self.fits[k], self.props[k]
        row = {"label": k + 1, "touching": bool(self.regions.touching[k]), "clipped": self._clipped(k),
               "contrast": fit.values[A], "signal_to_noise": fit.values[A] / self.noise,
               "centre": fit.values[[ROW, COLUMN]], "measured_by": "outline",
               "pixels": fit.area, "pixels_sd": fit.area_sd * max(1.0, fit.misfit)}
        if self._has_no_outline(fit, region):
            row |= {"measured_by": "light", "centre": region.centroid} | self._by_light(k)
        elif row["clipped"] or row["touching"]:
            row["pixels"] = self._share(fit.values)
        if row["clipped"] and row["measured_by"] == "outline":
            row["pixels_sd"] = fit.sd_of(self._share) * max(1.0, fit.misfit)
        return row

    def corners(self, row: dict[str, Any]) -> np.ndarray:
        """Outline (corners, 2) of one disc in rows and columns."""
        k = row["label"] - 1
        if row["measured_by"] == "outline":
            return corners(self.fits[k].values)
        padded = np.pad(self.props[k].image, 1).astype(float)
        return max(find_contours(padded, 0.5), key=len) + self.props[k].bbox[:2] - 1.0

    def _clipped(self, k):
        """Whether the frame's border cuts a disc."""
        (top, left, bottom, right), (rows, columns) = self.props[k].bbox, self.image.shape
        return top == 0 or left == 0 or bottom == rows or right == columns

    def _has_no_outline(self, fit, region):
        moved = np.hypot(*(fit.values[[ROW, COLUMN]] - region.centroid))
        lost = moved > max(fit.values[R], 2.0) or not np.isfinite(fit.area_sd)
        return lost or is_ring(region) or (fit.misfit > _MISFIT and fit.residual > _RESIDUAL)

    def _by_light(self, k):
        """Area from the summed light, for a contact of any shape; its brightness is that of its innermost pixels."""
        window, mask = self._pixels(k, alone=True)
        depth = distance_transform_edt(self.regions.labels[window] == k + 1)
        light = self.image[window] - self._glass(*self.props[k].centroid)
        contrast = light[depth > 0.75 * depth.max()].mean()
        return {"pixels": float(light[mask].sum() / contrast), "pixels_sd": float(np.sqrt(mask.sum()) * self.noise / contrast)}

    def _share(self, values):
        """Number of pixels of the frame in an outline; a pixel in several outlines is shared equally."""
        window = box(values, shape=self.image.shape, margin=2)
        return float((inside(values, window) / np.maximum(self._cover[window], 1.0)).sum())

    @cached_property
    def _cover(self):
        """Number (rows, columns) of outlines that each pixel lies in."""
        cover = np.zeros_like(self.image)
        for fit in self.fits:
            window = box(fit.values, shape=cover.shape, margin=2)
            cover[window] += inside(fit.values, window)
        return cover


def _limits(image):
    """Darkest and brightest value, if so many pixels have them that the camera must have clipped the light."""
    return tuple(edge if (image == edge).mean() > 1e-3 else far
                 for edge, far in ((image.min(), -1e6), (image.max(), 1e6)))
