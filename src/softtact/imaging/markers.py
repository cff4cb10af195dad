"""Dark markers in a camera's image: places to a fraction of a pixel, and their motion from a rest image.

    darkness = 1 - grey / background      background: the image without its markers, smooth across them

A marker is a maximum of the darkness, averaged over half of its radius. Its place is the centroid of the darkness in a circle
around it that is centred on the centroid itself, so that no side is cut off earlier than the other. Detection does not use a grid;
tracking takes the nearest marker of the image at rest, within a limit.
"""

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

from softtact.compiled import compiled
from softtact.errors import FrameWarning, InputError

LEAST_CONTRAST = 0.2      # the faintest of 99 markers on a real gel has 0.37 (docs/how-to/camera_of_a_gel.md)
_RADII = np.geomspace(2.0, 20.0, 24)      # px, among which the markers' radius is searched
_WINDOW = 1.6             # radii of the circle of the centroid: a marker and its blurred edge, no neighbour
_APART = 1.3              # radii between two markers' middles at least
_PASSES = 20              # of the centroid
_WHOLE = 0.4              # share of a marker's area that must lie in the image
_SMALLEST_SIDE = 17       # px of an image: more than eight of the smallest radii
_COLOURS = {1: 1, 2: 1, 3: 3, 4: 3}     # by the number of channels, of which 2 and 4 end with alpha
_DEEP, _LEAST_DEEP = 2**16 - 1, 2**12     # largest value of 16 bits, and the least that the largest value of such a picture has


@dataclass(frozen=True)
class Markers:
    """Markers found in an image, row by row of the image."""

    px: np.ndarray
    """(n, 2) column and row of their centroids, 0 in the middle of the first pixel."""
    contrast: np.ndarray
    """(n,) darkness in the inner half of each, 0 to 1."""
    inside: np.ndarray
    """(n,) share of each one's area in the image; below 1 its centroid lies too far inside."""
    radius_px: float
    """Their radius in px, stated or found."""


def grey_of(image: np.ndarray) -> np.ndarray:
    """Grey values (rows, columns), 0 to 255, of an image of one or three channels; a further one, alpha, is left out."""
    values = np.asarray(image, dtype=float)
    channels = values.shape[2] if values.ndim == 3 else 1
    if values.ndim not in (2, 3) or channels not in _COLOURS or min(values.shape[:2]) < _SMALLEST_SIDE:
        raise InputError(f"an image of shape {np.shape(image)} shows no markers; give (rows, columns) or (rows, columns, 3), "
                         f"{_SMALLEST_SIDE} pixels a side at least.")
    if not np.isfinite(values).all():
        first = tuple(map(int, np.argwhere(~np.isfinite(values))[0][:2]))
        raise InputError(f"an image holds values that are not finite numbers, the first at row, column {first}; fill them in.")
    return values[..., :_COLOURS[channels]].mean(axis=2) if values.ndim == 3 else values


def find_markers(image: np.ndarray, *, radius_px: float | None = None, least_contrast: float = LEAST_CONTRAST) -> Markers:
    """The `Markers` of an image (rows, columns) or (rows, columns, 3) in grey values 0 to 255.

    radius_px: of a marker, by default found;  least_contrast: darkness below which a spot is no marker
    Markers of which the image's border cuts more than three fifths off are left out. Raises InputError for an image without any.
    """
    grey = grey_of(image)
    radius = find_radius(grey) if radius_px is None else float(radius_px)
    if not 1 <= radius <= 0.5 * min(grey.shape):
        raise InputError(f"radius_px is {radius:g}; give that of a marker in px, from 1 to half of the image's shorter side.")
    dark = darkness(grey, radius)
    smooth = ndimage.gaussian_filter(dark, 0.5 * radius)
    high = ndimage.maximum_filter(smooth, size=2 * int(round(radius)) + 1) == smooth
    rows, columns = np.nonzero(high & (smooth > 0.5 * least_contrast))
    found = _apart(np.column_stack([columns, rows]).astype(float), smooth[rows, columns], _APART * radius)
    px, inner, total = _centroids(dark, found, _WINDOW * radius, 0.5 * radius)
    whole = ((px > radius) & (px < np.array(grey.shape)[::-1] - 1 - radius)).all(axis=1)
    area = total / np.maximum(inner, 1e-9)
    typical = np.median(area[whole & (inner > least_contrast)]) if (whole & (inner > least_contrast)).any() else np.pi * radius**2
    inside = np.where(whole, 1.0, np.minimum(area / typical, 1.0))
    kept = (inner > least_contrast) & (inside > _WHOLE)
    if not kept.any():
        raise InputError(f"the image shows no marker of radius {radius:.1f} px that is darker than its surroundings by "
                         f"{least_contrast:g}; check that the gel has markers, or state their radius_px.")
    order = np.flatnonzero(kept)[np.lexsort([px[kept, 0], np.round(px[kept, 1] / (2 * radius))])]
    return Markers(px[order], inner[order], inside[order], radius)


def darkness(grey: np.ndarray, radius_px: float) -> np.ndarray:
    """Darkness (rows, columns) of spots of a radius against their surroundings: 0 there, 1 where an image is black."""
    light = np.maximum(grey, 1e-6)
    covered = ndimage.grey_closing(ndimage.gaussian_filter(light, 0.5), size=2 * int(1.5 * radius_px) + 1)
    dark = 1 - light / covered
    noise = 1.4826 * np.median(np.abs(dark - np.median(dark)))
    marked = ndimage.binary_dilation(dark > max(0.1, np.median(dark) + 5 * noise), iterations=2)
    free = (~marked).astype(float)
    around = ndimage.gaussian_filter(free, 1.5 * radius_px)
    background = np.where(around > 1e-3, ndimage.gaussian_filter(light * free, 1.5 * radius_px) / np.maximum(around, 1e-3), covered)
    return 1 - light / background


def find_radius(grey: np.ndarray) -> float:
    """Radius in px of the dark spots that fill an image: the scale at which the Laplacian of Gaussians answers most strongly."""
    radii = _RADII[_RADII < 0.125 * min(grey.shape)]
    power = [np.mean(np.maximum(s**2 * ndimage.gaussian_laplace(grey, s), 0.0)**4) for s in radii / np.sqrt(2)]
    best = int(np.argmax(power))
    if 0 < best < len(radii) - 1:      # the top of a parabola over the logarithm of the radius
        low, mid, high = np.log(np.maximum(power[best - 1:best + 2], 1e-300))
        step = np.log(radii[1] / radii[0])
        return float(radii[best] * np.exp(0.5 * step * (low - high) / (low - 2 * mid + high)))
    return float(radii[best])


def track(rest: np.ndarray, now: np.ndarray, *, limit_px: float) -> np.ndarray:
    """Places (n, 2) in px at which the markers `rest` (n, 2) are among those of another image, `now` (m, 2).

    limit_px: largest motion. A marker without one within it is nan. Where two would take the same one, the nearer takes it.
    """
    if not limit_px > 0:
        raise InputError(f"limit_px is {limit_px:g}; give the largest motion in px, above 0.")
    places = np.full((len(rest), 2), np.nan)
    if not len(now):
        return places
    pairs = cKDTree(rest).sparse_distance_matrix(cKDTree(now), limit_px, output_type="ndarray")
    free = np.ones(len(now), dtype=bool)
    for pair in pairs[np.argsort(pairs["v"], kind="stable")]:
        if free[pair["j"]] and np.isnan(places[pair["i"], 0]):
            places[pair["i"]], free[pair["j"]] = now[pair["j"]], False
    return places


def read_image(path: str | Path) -> np.ndarray:
    """An image (rows, columns, 3) uint8 of a file, upright and without alpha; 16 bits become 8.

    Raises InputError that names the file where it is none.
    """
    from softtact.imaging.reading import read_frame

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", FrameWarning)     # of values encoded for a screen: they are taken as they are stored
        frame = read_frame(path)
    colours = frame[..., None] if frame.ndim == 2 else frame[..., :_COLOURS[frame.shape[2]]]
    return np.ascontiguousarray(np.broadcast_to(_eight_bits(colours, path), (*colours.shape[:2], 3)))


def _eight_bits(values, path):
    """Values of 1, 8 or 16 bits as uint8."""
    if values.dtype == np.uint8:
        return values
    if values.dtype == np.bool_:
        return np.where(values, 255, 0).astype(np.uint8)
    if values.dtype.kind not in "ui" or not 0 <= values.min() <= values.max() <= _DEEP:
        raise InputError(f"{path}: its values are {values.dtype}, not grey levels of 8 or 16 bits; convert it to PNG.")
    if values.max() < _LEAST_DEEP:     # 10 or 12 bits stored in 16, of which 8 would leave a few levels
        raise InputError(f"{path}: its values end at {values.max()} of the {_DEEP} that 16 bits hold; save it with 8 bits.")
    return np.round(values / (_DEEP / 255)).astype(np.uint8)


def _apart(px, height, least):
    """The highest of places (n, 2) that lie closer together than `least`."""
    order = np.argsort(-height, kind="stable")
    tree, kept = cKDTree(px), np.ones(len(px), dtype=bool)
    for one in order:
        if kept[one]:
            near = np.array(tree.query_ball_point(px[one], least), dtype=int)
            kept[near[near != one]] = False
    return px[kept]


@compiled(error_model="numpy")
def _centroids(dark, places, radius, inner):
    """Centroids (n, 2) of the darkness in circles centred on them, its means (n,) within `inner` of them, its sums (n,)."""
    found, mean, sums = places.copy(), np.zeros(len(places)), np.zeros(len(places))
    for k in range(len(places)):
        for _ in range(_PASSES):
            total, x, y, _ = _moments(dark, found[k, 0], found[k, 1], radius)
            sums[k] = total
            if total <= 0:
                break
            moved = np.hypot(x / total - found[k, 0], y / total - found[k, 1])
            found[k, 0], found[k, 1] = x / total, y / total
            if moved < 1e-3:
                break
        total, _, _, area = _moments(dark, found[k, 0], found[k, 1], inner)
        mean[k] = total / max(area, 1e-9)
    return found, mean, sums


@compiled(error_model="numpy")
def _moments(dark, x, y, radius):
    """Sum of the darkness in a circle with a soft edge, its moments along columns and rows, and the circle's pixels."""
    total, along, down, area = 0.0, 0.0, 0.0, 0.0
    for j in range(max(int(y - radius) - 1, 0), min(int(y + radius) + 3, dark.shape[0])):
        for i in range(max(int(x - radius) - 1, 0), min(int(x + radius) + 3, dark.shape[1])):
            within = min(max(radius + 0.5 - np.hypot(i - x, j - y), 0.0), 1.0)
            weight = max(dark[j, i], 0.0) * within
            area += within
            total += weight
            along += weight * i
            down += weight * j
    return total, along, down, area
