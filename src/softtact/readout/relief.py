"""The motion of a sensing surface on a regular grid, as readouts with a camera need it, for sensors of any kind."""

import functools
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
from scipy.spatial import Delaunay

from softtact.errors import InputError
from softtact.imaging.gel_image import Relief
from softtact.readout.registry import Samples, SurfaceMotion

if TYPE_CHECKING:
    from softtact.sensors.base import BaseSpec

_FINEST = 400      # points along the longer side of a solid's surface at most


def reliefs(surface: SurfaceMotion) -> Iterator[Relief]:
    """The surface at each load step. Where a model gives the height alone, nothing moves along x and y.

    On layers at the points of the map; on a solid on a grid as fine as its facets' points, linear between them, seen from below.
    """
    if surface.plane is not None:
        for moved in surface.plane.displacement_mm:
            yield Relief(surface.plane.x_mm, surface.plane.y_mm, moved)
    elif surface.spec.has_layers:
        spec: BaseSpec = surface.spec      # type: ignore[assignment]
        for samples in surface.displacement(None):
            yield Relief(spec.map_x_mm, spec.map_y_mm, np.nan_to_num(samples.values.reshape(*spec.map_shape, 3)))
    else:
        moved_samples = surface.displacement(None)
        grid = _GridOfPoints.of(moved_samples[0])
        rest = grid.on(moved_samples[0].points_mm[:, 2:] - moved_samples[0].points_mm[:, 2].max())[..., 0]
        for samples in moved_samples:
            moved = grid.on(samples.values)
            moved[..., 2] += rest
            yield Relief(grid.x_mm, grid.y_mm, moved, rest)


def object_depths(surface: SurfaceMotion) -> Iterator[np.ndarray]:
    """(ny, nx) depth in mm of the object's underside below the surface at rest, at the points of `reliefs`; -inf without an object
    above, nan where the model does not give the gap."""
    if surface.plane is not None:
        for moved, gap in zip(surface.plane.displacement_mm, surface.plane.gap_mm, strict=True):
            yield -(moved[..., 2] + gap)
        return
    gaps = None if surface.spec.has_layers else surface.gap(None)
    if gaps is None:
        for relief in reliefs(surface):
            yield np.full(relief.moved_mm.shape[:2], np.nan)
        return
    grid = _GridOfPoints.of(surface.displacement(None)[0])
    for relief, gap in zip(reliefs(surface), gaps, strict=True):
        near = NearestNDInterpolator(gap.points_mm[:, :2], gap.values)(*np.meshgrid(grid.x_mm, grid.y_mm))
        yield -(relief.moved_mm[..., 2] + near)


class _GridOfPoints:
    """A regular grid over the points of a solid's surface."""

    def __init__(self, points: np.ndarray, spacing: float) -> None:
        low, high = points[:, :2].min(axis=0), points[:, :2].max(axis=0)
        counts = np.clip(np.ceil((high - low) / spacing).astype(int) + 1, 2, _FINEST)
        self.x_mm, self.y_mm = (np.linspace(low[k], high[k], counts[k]) for k in range(2))
        self._triangles, self._points = Delaunay(points[:, :2]), points[:, :2]

    @classmethod
    def of(cls, samples: Samples) -> "_GridOfPoints":
        """The grid of some samples. Raises InputError where they do not cover an area as seen from below."""
        points = samples.points_mm
        if len(points) < 4 or np.ptp(points[:, :2], axis=0).min() <= 0:
            raise InputError("a camera needs a sensing surface that spreads along x and y; turn the body's mesh so that its face "
                             "of the contact looks along z.")
        return _grid_of(points.tobytes(), len(points), float(np.sqrt(np.median(samples.area_mm2))))

    def on(self, values: np.ndarray) -> np.ndarray:
        """(ny, nx, k) of values (n, k) at the points; those of the nearest point beside them."""
        at = np.meshgrid(self.x_mm, self.y_mm)
        found: np.ndarray = LinearNDInterpolator(self._triangles, values)(*at)
        outside = np.isnan(found[..., 0])
        found[outside] = NearestNDInterpolator(self._points, values)(at[0][outside], at[1][outside])
        return found


@functools.lru_cache(maxsize=4)
def _grid_of(points: bytes, count: int, spacing: float) -> Any:
    return _GridOfPoints(np.frombuffer(points).reshape(count, 3), spacing)
