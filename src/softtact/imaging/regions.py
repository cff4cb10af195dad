"""Bright regions of a frame, one per disc, found by the edges around them.

Light that varies slowly has no edges, so an empty frame has no regions, however uneven its light. The threshold of brightness
follows from the edges themselves (Yanowitz and Bruckstein, 1989): a smooth surface through them lies halfway between glass and
disc in every part of an uneven frame. Near edges the threshold follows them, so that dim discs beside bright ones are found.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.ndimage import convolve, distance_transform_edt, gaussian_filter, gaussian_gradient_magnitude, maximum
from skimage.measure import label, regionprops
from skimage.morphology import dilation, disk, h_maxima
from skimage.segmentation import find_boundaries, watershed

if TYPE_CHECKING:
    from skimage.measure._regionprops import RegionProperties

EDGE_SCALE = 1.5        # pixels; sd of the filter that finds edges
EDGE_SIGNIFICANCE = 6.5  # sd of the noise: reached by one pixel in 1e9 of an empty frame; clipped noise at black has a longer tail
WIDEST_EDGE = 8.0       # pixels; sd of the widest blur at which contact is distinguished from uneven light
FAINTEST = 0.02         # of full scale; less contrast comes from compression or stripes of the electronics, not from a disc
_NEARBY = 6.0           # pixels; sd of the neighbourhood in which edges belong to one disc
_SMOOTH = 1.0           # pixels; sd of the filter before the threshold
_FEWEST_PIXELS = 4      # above the threshold; smaller regions cannot be measured
_FAR, _ENOUGH = 4.0, 300   # least distance in pixels from any region for an estimate of noise, and least number of such pixels
_CONVEX = 0.93          # of the convex hull's area; a region that fills more of it has no waist
_EDGED = 0.3            # share of a region's rim that must be a significant edge
_COUNT = 1 / 255 / 12**0.5   # rounding to 8 bits is noise too


class Regions(NamedTuple):
    """The regions of one frame."""

    labels: np.ndarray      # (rows, columns) int: 0 is glass, k the k-th disc
    threshold: np.ndarray   # (rows, columns): brightness halfway between glass and disc
    touching: np.ndarray    # (discs,) bool: split from a neighbour


def noise_of(image: np.ndarray, where: np.ndarray | None = None) -> float:
    """Noise of one pixel as in `pixel_noise`, in an image whose full scale is 1; at least that of rounding to 8 bits."""
    return max(pixel_noise(image, where), _COUNT)


def pixel_noise(image: np.ndarray, where: np.ndarray | None = None) -> float:
    """Standard deviation of the noise of one pixel, from second differences, which slopes do not change and few edges affect.

    where: pixels (rows, columns) bool that count; default all. Median form of J. Immerkaer, Computer Vision and Image
    Understanding 64 (1996) 300.
    """
    cross = convolve(image, np.outer([1, -2, 1], [1, -2, 1]) / 6.0)
    return 1.4826 * float(np.median(np.abs(cross if where is None else cross[where])))


def find_regions(image: np.ndarray, *, noise: float) -> Regions:
    """The `Regions` of a frame (rows, columns) whose full scale is 1."""
    slope = slope_of(image)
    smooth = gaussian_filter(image, _SMOOTH)
    edges = slope > _least_slope(smooth, noise)
    if not edges.any():
        return Regions(np.zeros(image.shape, dtype=int), np.full(image.shape, np.inf), np.zeros(0, dtype=bool))
    threshold = _threshold(smooth, np.where(edges, slope**2, 0.0))
    whole = _edged(label(smooth > threshold), edges)
    labels, touching = _split(_above_glass(whole, slope))
    return Regions(labels, threshold, touching)


def _threshold(smooth, weights):
    """Brightness (rows, columns) halfway between glass and disc: near an edge that of the edge, elsewhere a smooth surface."""
    where = np.nonzero(weights)
    surface = smooth_surface(where, smooth[where], weights=weights[where], shape=smooth.shape)(*np.indices(smooth.shape))
    near = gaussian_filter(weights * (smooth - surface), _NEARBY)
    return surface + near / (gaussian_filter(weights, _NEARBY) + 1e-3 * weights[where].mean())


def slope_of(image: np.ndarray) -> np.ndarray:
    """Change of brightness per pixel (rows, columns). It is reduced at the border, where the filter covers half a neighbourhood."""
    slope = gaussian_gradient_magnitude(image, EDGE_SCALE)
    reach = int(2 * EDGE_SCALE)
    for border in (slope[:reach], slope[-reach:], slope[:, :reach], slope[:, -reach:]):
        border *= np.sqrt(0.5)
    return slope


def _least_slope(smooth, noise):
    """Least change of brightness per pixel of an edge, above that of noise, of 8-bit steps and of slowly varying light."""
    of_noise = EDGE_SIGNIFICANCE * noise / (np.sqrt(8 * np.pi) * EDGE_SCALE**2)
    return max(of_noise, steepest(FAINTEST, blur=0.0), steepest(float(np.ptp(smooth)), blur=WIDEST_EDGE))


def steepest(contrast: float, *, blur: float) -> float:
    """Slope in the middle of a blurred edge after the filter that finds edges."""
    return contrast / np.sqrt(2 * np.pi * (blur**2 + EDGE_SCALE**2))


def smooth_surface(where: tuple[np.ndarray, np.ndarray], values: np.ndarray, *, weights: np.ndarray, shape: tuple[int, int],
                   stiffness: float = 1e-3) -> Callable[[float | np.ndarray, float | np.ndarray], np.ndarray]:
    """A function of (rows, columns): the polynomial of second order through `values` (n,) at the places `where` ((n,), (n,)).

    stiffness: regularisation that keeps it flat where there are no values, relative to the sum of the weights
    """
    basis, mean = terms(*where, shape), np.average(values, weights=weights)
    normal = (basis * weights) @ basis.T + stiffness * weights.sum() * np.diag([0, 1, 1, 1, 1, 1])
    factors = np.linalg.solve(normal, basis @ (weights * (values - mean)))
    return lambda rows, columns: mean + np.tensordot(factors, terms(rows, columns, shape), axes=1)


def terms(rows: float | np.ndarray, columns: float | np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Polynomials of second order (6, ...) of the place in a frame of `shape`, each side of which runs from -1 to 1."""
    r, c = (2 * np.asarray(index) / max(size - 1, 1) - 1 for index, size in zip((rows, columns), shape, strict=True))
    return np.stack([np.ones_like(r), r, c, r * r, r * c, c * c])


def _edged(labels, edges):
    """The labels of regions that are large enough and bounded by an edge, renumbered."""
    near = dilation(edges, disk(1))
    rim = find_boundaries(labels, mode="inner") & (labels > 0)
    size, length = np.bincount(labels.ravel()), np.bincount(labels[rim], minlength=labels.max() + 1)
    edged = np.bincount(labels[rim & near], minlength=len(length))
    keep = (size >= _FEWEST_PIXELS) & (edged > _EDGED * np.maximum(length, 1))
    keep[0] = False
    return (np.cumsum(keep) * keep)[labels]


def _above_glass(labels, slope):
    """The labels of regions whose edges are steeper than chance slopes on the glass far from them, renumbered.

    Compression removes the finest noise and keeps the coarse, so that `noise_of` is too low; the slopes on the glass are not.
    """
    far = distance_transform_edt(labels == 0) >= _FAR
    if not labels.any() or far.sum() < _ENOUGH:
        return labels
    by_chance = np.percentile(slope[far], 25) / np.sqrt(-2 * np.log(0.75))   # the slope's size has a Rayleigh distribution
    keep = np.append(False, maximum(slope, labels, np.arange(1, labels.max() + 1)) > EDGE_SIGNIFICANCE * by_chance)
    return (np.cumsum(keep) * keep)[labels]


def _split(labels):
    """(labels, touching): regions split at their waists by a watershed of the distance to the rim."""
    seeds, touching, count = np.zeros_like(labels), [], 0
    for region in regionprops(labels):
        inside = _seeds(region)
        parts = inside.max()
        seeds[region.slice] += np.where(inside > 0, inside + count, 0)
        count += parts
        touching += [parts > 1] * parts
    if not any(touching):
        return labels, np.zeros(len(touching), dtype=bool)
    depth = distance_transform_edt(np.pad(labels > 0, 1, mode="edge"))[1:-1, 1:-1]
    return watershed(-depth, seeds, mask=labels > 0), np.array(touching)


def _seeds(region):
    """One label per part of a region, on its bounding box. A nearly convex region is one part."""
    if region.solidity > _CONVEX or region.area < 30 or is_ring(region):
        whole = np.zeros(region.image.shape, dtype=int)
        whole[tuple(region.coords[0] - region.bbox[:2])] = 1
        return whole
    depth = distance_transform_edt(np.pad(region.image, 1))[1:-1, 1:-1]
    return label(h_maxima(depth, 0.75 + 0.1 * np.median(_peaks(depth))))


def is_ring(region: "RegionProperties") -> bool:
    """Whether a region is one contact with a dark middle, rather than discs that touch around a gap."""
    return region.euler_number == 0 and region.area_filled > _CONVEX * region.area_convex


def _peaks(depth):
    """Depths of the clear maxima; their median estimates a disc's radius even if one part is much larger."""
    tops = depth[h_maxima(depth, 1.0) > 0]
    return tops if len(tops) else np.array([depth.max()])
