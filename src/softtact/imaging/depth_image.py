"""Depth images of a rigid object that moves on a gel: a z-buffer of its underside, seen through the gel by the camera behind it.

The rays of the camera are followed from the lowest point that they may meet up to the surface at rest, in steps of one point of
the underside at most. A ray meets the object where it first reaches the height of the underside, found by halving the last step.
Exact to the triangles up to half a pixel; no graphics library is needed.
"""

from dataclasses import dataclass

import numpy as np
import trimesh
from scipy.ndimage import minimum_filter

from softtact.compiled import compiled
from softtact.contact.height_field import HeightField
from softtact.imaging.pinhole import Pinhole

_FINER = 2                # points of the underside for each pixel of the surface at rest
_PRECISION_MM = 7e-4      # of a depth


@dataclass(frozen=True)
class MovedObject:
    """A rigid object and where it is at each step of a motion."""

    mesh: trimesh.Trimesh
    """In mm, in the sensor's frame, placed as at the motion's start."""
    first_touch_mm: float
    """Height of its point that touches first over the surface at rest."""
    aside_mm: np.ndarray
    """(step, 2): its displacement along x and y."""
    down_mm: np.ndarray
    """(step,): its depth from first touch."""
    turned_deg: np.ndarray
    """(step,): its rotation about the vertical through `about_mm`, before it moves aside."""
    about_mm: tuple[float, float] = (0.0, 0.0)
    """x and y of that vertical."""

    def depths_mm(self, pinhole: Pinhole, *, deepest_mm: float) -> np.ndarray:
        """(step, row, column), single precision: depth below the surface at rest that a camera sees, 0 to the deepest."""
        cameras: dict[float, DepthCamera] = {}
        reach = float(np.abs(self.aside_mm).max())
        images = np.empty((len(self.down_mm), pinhole.rows, pinhole.columns), dtype=np.float32)
        for step, (down, aside, angle) in enumerate(zip(self.down_mm, self.aside_mm, self.turned_deg, strict=True)):
            if angle not in cameras:
                cameras[angle] = DepthCamera(self._turned(angle), pinhole, deepest_mm=deepest_mm, reach_mm=reach,
                                             first_touch_mm=self.first_touch_mm)
            images[step] = cameras[angle].image(down, aside)
        return images

    def _turned(self, angle_deg):
        if not angle_deg:
            return self.mesh
        turn = trimesh.transformations.rotation_matrix(np.radians(angle_deg), [0, 0, 1], [*self.about_mm, 0])
        return self.mesh.copy().apply_transform(turn)


class DepthCamera:
    """The depth images of one placed object, at any displacement.

    mesh: in mm, placed as at the start of a motion, lowest point of it over the sensor at `first_touch_mm`
    pinhole: the camera's geometry;  deepest_mm: depth at which an image ends
    reach_mm: how far the object moves aside at most
    """

    def __init__(self, mesh: trimesh.Trimesh, pinhole: Pinhole, *, deepest_mm: float, reach_mm: float,
                 first_touch_mm: float | None = None) -> None:
        self.pinhole, self.deepest_mm = pinhole, deepest_mm
        self._directions = pinhole.directions(pinhole.pixels()).reshape(-1, 2)
        half = np.abs(self._directions).max(axis=0) * pinhole.distance_mm + reach_mm
        self._spacing = pinhole.mm_per_px / _FINER
        x, y = (np.arange(-np.ceil(side / self._spacing), np.ceil(side / self._spacing) + 1) * self._spacing for side in half)
        heights = HeightField(mesh).on_grid(x, y)
        touch = np.nanmin(heights) if first_touch_mm is None else first_touch_mm
        self._first = np.array([x[0], y[0]])
        self._heights = np.where(np.isnan(heights), np.inf, heights - touch)
        aside = int(np.ceil(np.abs(self._directions).max() * deepest_mm / self._spacing))      # of a ray below the surface at rest
        self._lowest = minimum_filter(self._heights, 2 * aside + 3)

    def image(self, down_mm: float, aside_mm: np.ndarray) -> np.ndarray:
        """(rows, columns) depth in mm of the underside below the surface at rest, 0 to the deepest, after a displacement.

        down_mm: from first touch, positive;  aside_mm: (2,) along x and y
        """
        first = self._first + np.asarray(aside_mm, dtype=float)
        depth = _depths(self._directions, self._heights, self._lowest, first, self._spacing, float(down_mm),
                        self.pinhole.distance_mm, self.deepest_mm)
        return depth.reshape(self.pinhole.rows, self.pinhole.columns)


@compiled
def _depths(directions, heights, lowest, first, spacing, down, distance, deepest):
    """Depths (n,) at which rays (n, 2), mm along x and y for each mm from the pinhole, meet the underside.

    lowest: the least of all heights that a ray passes, at its place on the surface at rest
    """
    found = np.zeros(len(directions))
    for k in range(len(directions)):
        u, v = directions[k]
        start = min(deepest, down - _height(u * distance, v * distance, lowest, first, spacing))      # deeper it meets nothing
        if start <= 0:
            continue
        steps = int(np.ceil(max(abs(u), abs(v)) * start / spacing)) + 1
        above, below, met = start, start, False      # the depth lies between
        for step in range(steps, -1, -1):
            above = start * step / steps
            met = _meets(u, v, above, heights, first, spacing, down, distance)
            if met:
                break
            below = above
        while met and below - above > _PRECISION_MM:
            middle = 0.5 * (above + below)
            if _meets(u, v, middle, heights, first, spacing, down, distance):
                above = middle
            else:
                below = middle
        found[k] = 0.5 * (above + below)
    return found


@compiled
def _meets(u, v, depth, heights, first, spacing, down, distance):
    """Whether a ray is within the object at a depth."""
    return _height(u * (distance - depth), v * (distance - depth), heights, first, spacing) - down < -depth


@compiled(inline="always")
def _height(x, y, heights, first, spacing):
    """The height at the grid's point next to a place; infinite outside the grid."""
    column, row = int(np.round((x - first[0]) / spacing)), int(np.round((y - first[1]) / spacing))
    if row < 0 or column < 0 or row >= heights.shape[0] or column >= heights.shape[1]:
        return np.inf
    return heights[row, column]
