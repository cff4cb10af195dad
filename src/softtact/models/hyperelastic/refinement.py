"""Where the cover's mesh is fine: in steps from far from the object to under it, and finest at its edges.

A flat punch's edge that falls into an element holds the whole element flat: with faces of a pitch the punch acts up to half a pitch
wider, and the map of one of 3 mm radius is 10 % low. And the sheet bulges into the pockets between frusta, which a face of a
pitch cannot follow: 6 % of the map. Both are needed where the object presses, and nowhere else (benchmarks/mesh_error.py).
"""

import numpy as np
from scipy.ndimage import maximum_filter, minimum_filter

from softtact.fem.graded_mesh import split_depths
from softtact.models.hyperelastic.rigid_contact import Surface

REACH_MM = 1.0        # what stands higher above the object's lowest point is taken to stay off the cover
AROUND_MM = 0.3       # the zone under the object ends so far from it
NEAR_MM = 2.4         # and elements have at most the pitch's size so far around
_STEEP = 1.2          # rise over run within an element above which there is an edge in it
_SLANTED = 0.067      # rise over run within an element above which the underside is curved, not flat
_SAMPLES = 4          # heights along each side of the smallest element
FAR, NEAR, FLAT, CURVED, EDGE = range(5)


def zones(surface: Surface, x_lines: np.ndarray, y_lines: np.ndarray, most: int) -> np.ndarray:
    """FAR, NEAR, FLAT, CURVED or EDGE for each place of a grid (ny 2^most, nx 2^most) whose cells are split `most` times."""
    height = _heights(surface, x_lines, y_lines, _SAMPLES << most)
    side = min(np.diff(lines).max() for lines in (x_lines, y_lines)) / (1 << most)
    # An edge on the line between two elements concerns both, so each sample is compared with those beside it. (Farther ones: 9000
    # unknowns more under a wide punch at edges split four times, and the same map to 0.2 %.)
    low = minimum_filter(height, 3)
    rise = _in_places(maximum_filter(height, 3) - low, np.max)
    reached = _in_places(low, np.min) < REACH_MM
    touched = _in_places(height, np.min) < REACH_MM
    under, near = (maximum_filter(touched, 2 * int(np.ceil(far / side - 1e-9)) + 1) for far in (AROUND_MM, NEAR_MM))
    curved, edge = reached & (rise > _SLANTED * side), reached & (rise > _STEEP * side)
    return np.max([NEAR * near, FLAT * under, CURVED * curved, EDGE * edge], axis=0)


def _heights(surface, x_lines, y_lines, parts):
    """Heights (y, x) in mm above the object's lowest point, in the middles of parts of the grid's cells."""
    x, y = (_sampled(lines, parts) for lines in (x_lines, y_lines))
    gx, gy = np.meshgrid(x, y)
    height = surface(gx.ravel(), gy.ravel())[0].reshape(gx.shape)
    return np.minimum(height - height.min(), 2 * REACH_MM)


def _in_places(samples, choose):
    """The least or largest of the samples in each smallest cell."""
    rows, columns = samples.shape
    return choose(samples.reshape(rows // _SAMPLES, _SAMPLES, columns // _SAMPLES, _SAMPLES), axis=(1, 3))


def _sampled(lines, parts):
    """Middles of equal parts of the intervals between lines."""
    fine = np.interp(np.arange(2 * parts * (len(lines) - 1) + 1), 2 * parts * np.arange(len(lines)), lines)
    return fine[1::2]


def split_depths_of(zone: np.ndarray, shape: tuple[int, int], most: int) -> np.ndarray:
    """How often each place is split for wanted levels (ny 2^most, nx 2^most), in a grid of `shape` (nx, ny)."""

    def wanted(low, size, depth):
        block = int(size * (1 << most))
        i, j = (low * (1 << most)).astype(int).T
        whole = zone.reshape(zone.shape[0] // block, block, zone.shape[1] // block, block).max(axis=(1, 3))
        return whole[j // block, i // block] > depth

    return split_depths(shape, wanted, most)
