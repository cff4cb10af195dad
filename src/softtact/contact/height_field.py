"""The lower envelope of a rigid triangle mesh: what a sensor below it can touch, exact to the triangles.

Over lines of points each triangle lowers the heights of the points above which it lies (`lower_envelope`). Vertical lines through
other points are cut with the triangles found in a grid of bins. No sampling of the surface takes place.
"""

import copy
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Self
from weakref import WeakKeyDictionary

import numpy as np
import trimesh

from softtact.compiled import compiled
from softtact.contact.lower_envelope import NO_CONTACT_MM, facing_down, lowest_corner, lowest_in_box, lowest_over_lines
from softtact.contact.rounded_object import RoundedObject

_KEPT: "WeakKeyDictionary[trimesh.Trimesh, HeightField]" = WeakKeyDictionary()     # by their contents' hash
NEAR_MM = 0.1         # height over the sensing surface, or depth below it, beyond which an object is moved to first touch


class HeightField:
    """Height z (mm) and unit normal of the underside of a placed object over points (x, y)."""

    def __init__(self, mesh: trimesh.Trimesh, *, bins: int = 128) -> None:
        points, facets = np.array(mesh.vertices, dtype=float), np.ascontiguousarray(mesh.faces, dtype=np.int64)
        self.triangles, self.normals, kept = facing_down(points, facets)
        self._corners, self._bins, self._surface = facets[kept], bins, (points, facets)
        self.lowest_mm = float(points[facets, 2].min())

    @classmethod
    def of(cls, mesh: trimesh.Trimesh) -> "HeightField":
        """That of a mesh, made once for as long as the mesh lives and stays as it is: the steps of one press ask for it in turn."""
        found = _KEPT.get(mesh)
        if found is None:
            found = _KEPT[mesh] = cls(mesh)
        return found

    @cached_property
    def _search(self):
        """Origin (2,) and size (2,) of the bins, and the triangles in each: starts (bins^2 + 1,), members."""
        low, high = self._plan_bounds()
        size = np.maximum((high - low) / self._bins, 1e-6)
        return low, size, *_fill_bins(self.triangles, low, size, self._bins)

    @cached_property
    def rounded(self) -> RoundedObject:
        """The object with rounded edges."""
        return RoundedObject.of(*self._surface)

    def _plan_bounds(self):
        if not len(self.triangles):
            return np.zeros(2), np.ones(2)
        points = self.triangles[..., :2].reshape(-1, 2)
        return points.min(axis=0) - 1e-9, points.max(axis=0) + 1e-9

    def moved(self, offset_mm: np.ndarray) -> Self:
        """The height field after a displacement (3,) of the object; both share the bins in which triangles are searched for."""
        other, way = copy.copy(self), np.asarray(offset_mm, dtype=float)
        other.triangles, other.lowest_mm = self.triangles + way, self.lowest_mm + way[2]
        other._surface = (self._surface[0] + way, self._surface[1])
        if "rounded" in vars(self):
            other.rounded = self.rounded.moved(way)
        if "_search" in vars(self):
            origin, *same = self._search
            other._search = (origin + way[:2], *same)
        return other

    def carried(self, way: Callable[[np.ndarray], np.ndarray]) -> "HeightField":
        """The height field after displacements way(corners (n, 3)) (n, 3) in mm of the object's corners."""
        points, facets = self._surface
        return HeightField(trimesh.Trimesh(points + way(points), facets, process=False))

    def over_lines(self, x_mm: np.ndarray, y_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Heights (y, x) over points of rising lines x_mm (x,), y_mm (y,), and the triangles (y, x) there; -1 beside the object."""
        height, number = lowest_over_lines(self.triangles, np.asarray(x_mm, dtype=float), np.asarray(y_mm, dtype=float))
        return height.reshape(len(y_mm), len(x_mm)), number.reshape(len(y_mm), len(x_mm))

    def on_grid(self, x_mm: np.ndarray, y_mm: np.ndarray) -> np.ndarray:
        """Heights (y, x) over the points of rising lines x_mm (x,), y_mm (y,); nan beside the object."""
        heights, _ = self.over_lines(x_mm, y_mm)
        return np.where(heights < NO_CONTACT_MM, heights, np.nan)

    def __call__(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Heights (n,) and normals (n, 3) pointing out of the object (downwards) for points (n,), (n,)."""
        x, y = np.ascontiguousarray(x, dtype=float), np.ascontiguousarray(y, dtype=float)
        origin, size, starts, members = self._search
        height, number = _lowest_crossing(x, y, self.triangles, origin, size, self._bins, starts, members)
        return height, self.normals_of(number)

    def normals_of(self, triangles: np.ndarray) -> np.ndarray:
        """Normals (..., 3) of triangles by their numbers (...); straight down for -1."""
        hit = triangles >= 0
        normal = np.tile([0.0, 0.0, -1.0], (*triangles.shape, 1))
        normal[hit] = self.normals[triangles[hit]]
        return normal

    def slopes_of(self, triangles: np.ndarray) -> np.ndarray:
        """Derivatives (n, 2) by x and y of the heights of triangles (n,), zero for -1."""
        normals = self.normals_of(triangles)
        return -normals[:, :2] / normals[:, 2:]

    def first_touch_mm(self, x_mm: np.ndarray, y_mm: np.ndarray) -> float:
        """Height (mm) of the underside's lowest point over a sensor whose map has columns x_mm and rows y_mm, edges included.

        The lowest of the facets' corners over the sensor and of the heights over the map's points; NO_CONTACT_MM if none.
        """
        x, y = np.asarray(x_mm, dtype=float), np.asarray(y_mm, dtype=float)
        return float(min(lowest_corner(self.triangles, x, y), lowest_over_lines(self.triangles, x, y)[0].min()))

    def near_touch(self, x_mm: np.ndarray, y_mm: np.ndarray) -> "HeightField":
        """The underside moved down or up to `first_touch_mm` if it is far away, for models whose first guesses start there."""
        away = self.first_touch_mm(x_mm, y_mm)
        return self if abs(away) <= NEAR_MM else self.moved(np.array([0.0, 0.0, -away]))

    def points_below(self, height_mm: float) -> np.ndarray:
        """Corners (n, 2) of the parts of the facets below a height: their own corners there, and where their edges cross it."""
        start = self.triangles[self.triangles[..., 2].min(axis=1) < height_mm]
        end = np.roll(start, -1, axis=1)
        start, end = start.reshape(-1, 3), end.reshape(-1, 3)
        cross = (start[:, 2] < height_mm) != (end[:, 2] < height_mm)
        share = (height_mm - start[cross, 2]) / (end[cross, 2] - start[cross, 2])
        return np.vstack([start[start[:, 2] < height_mm, :2], start[cross, :2] + share[:, None] * (end - start)[cross, :2]])

    def along_edges(self, below_mm: float, spacing_mm: float) -> np.ndarray:
        """Points (k, 3) on the edges of all facets below a height, from end to end in steps of at most `spacing_mm` in x and y."""
        near = self.triangles[..., 2].min(axis=1) < below_mm
        ends = np.stack([self._corners[near], np.roll(self._corners[near], -1, axis=1)], axis=2).reshape(-1, 2)
        key = ends.min(axis=1) * (self._corners.max(initial=0) + 1) + ends.max(axis=1)
        _, once = np.unique(key, return_index=True)      # two facets share an edge
        facet, side = np.divmod(once, 3)
        start, end = self.triangles[near][facet, side], self.triangles[near][facet, (side + 1) % 3]
        parts = np.maximum(1, np.ceil(np.linalg.norm((end - start)[:, :2], axis=1) / spacing_mm).astype(int))
        edge = np.repeat(np.arange(len(parts)), parts + 1)
        share = (np.arange(len(edge)) - np.repeat(np.cumsum(parts + 1) - parts - 1, parts + 1)) / parts[edge]
        points = start[edge] + share[:, None] * (end - start)[edge]
        return points[points[:, 2] < below_mm]

    def lowest_over(self, low: np.ndarray, high: np.ndarray) -> float:
        """Height (mm) of the underside's lowest point over a rectangle with corners low (2,) and high (2,), exact to the triangles;
        NO_CONTACT_MM where the object is not above the rectangle.
        """
        return float(lowest_in_box(self.triangles, np.array([low[0], high[0], low[1], high[1]], dtype=float)))


@dataclass(frozen=True)
class MovedSurface:
    """An object's underside after a displacement along x and y."""

    surface: Callable
    """Heights (n,) and normals (n, 3) of the object's underside over points, as `HeightField`."""
    offset_mm: np.ndarray
    """The displacement (2,)."""

    @cached_property
    def rounded(self) -> RoundedObject | None:
        """The object with rounded edges; None where the surface has none."""
        rounded = getattr(self.surface, "rounded", None)
        return rounded and rounded.moved(np.append(self.offset_mm, 0.0))

    def __call__(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Heights (n,) and normals (n, 3) over points (n,), (n,) of the sensor."""
        return self.surface(x - self.offset_mm[0], y - self.offset_mm[1])


@dataclass(frozen=True)
class SweptSurface:
    """The lower envelope of an object's underside over all positions of a motion."""

    surface: Callable
    """Heights (n,) and normals (n, 3) of the object's underside over points, as `HeightField`."""
    offsets_mm: np.ndarray
    """The displacements (k, 2) from its first place."""

    def __call__(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Heights (n,) and normals (n, 3) over points (n,), (n,) of the sensor."""
        each = [self.surface(x - offset[0], y - offset[1]) for offset in self.offsets_mm]
        lowest = np.argmin([height for height, _ in each], axis=0)
        every = np.arange(len(x))
        return np.stack([height for height, _ in each])[lowest, every], np.stack([normal for _, normal in each])[lowest, every]


def _fill_bins(triangles, origin, size, bins):
    """Triangles per bin in compressed rows: starts (bins^2 + 1,), members."""
    if not len(triangles):
        return np.zeros(bins * bins + 1, dtype=np.int64), np.zeros(0, dtype=np.int64)
    low = np.clip(((triangles[..., :2].min(axis=1) - 1e-9 - origin) / size).astype(int), 0, bins - 1)
    high = np.clip(((triangles[..., :2].max(axis=1) + 1e-9 - origin) / size).astype(int), 0, bins - 1)
    return _listed(low, high, triangles, origin, size, bins)


@compiled
def _listed(low, high, triangles, origin, size, bins):
    """Which triangles, in boxes of bins from low to high (t, 2), reach into each bin: starts (bins^2 + 1,), rising members."""
    starts = np.zeros(bins * bins + 1, dtype=np.int64)
    for t in range(len(low)):
        for j in range(low[t, 1], high[t, 1] + 1):
            for i in range(low[t, 0], high[t, 0] + 1):
                if _reaches(triangles[t], origin, size, i, j):
                    starts[j * bins + i + 1] += 1
    starts = np.cumsum(starts)
    members, fill = np.empty(starts[-1], dtype=np.int64), starts[:-1].copy()
    for t in range(len(low)):
        for j in range(low[t, 1], high[t, 1] + 1):
            for i in range(low[t, 0], high[t, 0] + 1):
                if _reaches(triangles[t], origin, size, i, j):
                    members[fill[j * bins + i]] = t
                    fill[j * bins + i] += 1
    return starts, members


@compiled
def _reaches(t, origin, size, i, j):
    """Whether a triangle (3, 3) reaches into a bin of its box: no side has the whole bin, a little enlarged, beyond it.

    Thin triangles, as of a disc from a CAD program, fill few bins of their boxes.
    """
    for k in range(3):
        a, b, c = t[k], t[(k + 1) % 3], t[(k + 2) % 3]
        along_x, along_y = b[0] - a[0], b[1] - a[1]
        double_area = along_x * (c[1] - a[1]) - along_y * (c[0] - a[0])
        sense = 1.0 if double_area > 0 else -1.0
        x = origin[0] + size[0] * (i + (1 + 1e-6 if sense * along_y < 0 else -1e-6)) - a[0]     # of the bin's innermost corner
        y = origin[1] + size[1] * (j + (1 + 1e-6 if sense * along_x > 0 else -1e-6)) - a[1]
        if sense * (along_x * y - along_y * x) < -1e-6 * abs(double_area):
            return False
    return True


@compiled
def _lowest_crossing(x, y, triangles, origin, size, bins, starts, members):
    heights = np.full(len(x), NO_CONTACT_MM)
    index = np.full(len(x), -1)
    for n in range(len(x)):
        i, j = int(np.floor((x[n] - origin[0]) / size[0])), int(np.floor((y[n] - origin[1]) / size[1]))
        if i < 0 or j < 0 or i >= bins or j >= bins:
            continue
        for k in range(starts[j * bins + i], starts[j * bins + i + 1]):
            t = triangles[members[k]]
            bx, by = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1]
            cx, cy = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1]
            px, py = x[n] - t[0, 0], y[n] - t[0, 1]
            double_area = bx * cy - by * cx
            u, v = (px * cy - py * cx) / double_area, (bx * py - by * px) / double_area
            if u >= -1e-9 and v >= -1e-9 and u + v <= 1 + 1e-9:
                z = t[0, 2] + u * (t[1, 2] - t[0, 2]) + v * (t[2, 2] - t[0, 2])
                if z < heights[n]:
                    heights[n], index[n] = z, members[k]
    return heights, index
