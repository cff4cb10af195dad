"""The lower envelope of a rigid triangle mesh: what a sensor below it can touch, exact to the triangles.

Vertical lines through query points are cut with the triangles found in a grid of bins; no sampling of the surface takes place.
"""

import copy
from collections.abc import Callable
from dataclasses import dataclass
from typing import Self
from weakref import WeakKeyDictionary

import numpy as np
import trimesh

from softtact.compiled import compiled

_KEPT: "WeakKeyDictionary[trimesh.Trimesh, HeightField]" = WeakKeyDictionary()     # by their contents' hash
NEAR_MM = 0.1         # height over the sensing surface, or depth below it, beyond which an object is moved to first touch
NO_CONTACT_MM = 1e3   # height reported where the object is not above the point


class HeightField:
    """Height z (mm) and unit normal of the underside of a placed object over points (x, y)."""

    def __init__(self, mesh: trimesh.Trimesh, *, bins: int = 128) -> None:
        triangles = np.ascontiguousarray(mesh.triangles, dtype=float)
        cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        area = np.linalg.norm(cross, axis=1)
        facing_down = cross[:, 2] < -1e-9 * np.maximum(area, 1e-300)   # walls and upper sides cannot be touched
        self.triangles, self._corners = triangles[facing_down], np.asarray(mesh.faces)[facing_down]
        self.normals = cross[facing_down] / area[facing_down, None]
        self.lowest_mm = float(triangles[..., 2].min())
        low, high = self._plan_bounds()
        self._origin, self._size = low, np.maximum((high - low) / bins, 1e-6)
        self._starts, self._members = _fill_bins(self.triangles, self._origin, self._size, bins)
        self._bins = bins

    @classmethod
    def of(cls, mesh: trimesh.Trimesh) -> "HeightField":
        """That of a mesh, made once for as long as the mesh lives and stays as it is: the steps of one press ask for it in turn."""
        found = _KEPT.get(mesh)
        if found is None:
            found = _KEPT[mesh] = cls(mesh)
        return found

    def _plan_bounds(self):
        if not len(self.triangles):
            return np.zeros(2), np.ones(2)
        points = self.triangles[..., :2].reshape(-1, 2)
        return points.min(axis=0) - 1e-9, points.max(axis=0) + 1e-9

    def moved(self, offset_mm: np.ndarray) -> Self:
        """The height field after a displacement (3,) of the object; both share the bins in which triangles are searched for."""
        other, way = copy.copy(self), np.asarray(offset_mm, dtype=float)
        other.triangles, other._origin, other.lowest_mm = self.triangles + way, self._origin + way[:2], self.lowest_mm + way[2]
        return other

    def on_grid(self, x_mm: np.ndarray, y_mm: np.ndarray) -> np.ndarray:
        """Heights (y, x) over the grid of points x_mm (x,), y_mm (y,); nan beside the object."""
        x, y = np.meshgrid(x_mm, y_mm)
        heights = np.asarray(self(x.ravel(), y.ravel())[0], dtype=float).reshape(x.shape)
        return np.where(heights < NO_CONTACT_MM, heights, np.nan)

    def __call__(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Heights (n,) and normals (n, 3) pointing out of the object (downwards) for points (n,), (n,)."""
        x, y = np.ascontiguousarray(x, dtype=float), np.ascontiguousarray(y, dtype=float)
        height, index = _lowest_crossing(x, y, self.triangles, self._origin, self._size, self._bins,
                                         self._starts, self._members)
        normal = np.tile([0.0, 0.0, -1.0], (len(x), 1))
        hit = index >= 0
        normal[hit] = self.normals[index[hit]]
        return height, normal

    def first_touch_mm(self, x_mm: np.ndarray, y_mm: np.ndarray) -> float:
        """Height (mm) of the underside's lowest point over a sensor whose map has columns x_mm and rows y_mm, edges included.

        The lowest of the facets' corners over the sensor and of the heights over the map's points; NO_CONTACT_MM if none.
        """
        corners = self.triangles.reshape(-1, 3)
        over = ((corners[:, 0] >= x_mm[0]) & (corners[:, 0] <= x_mm[-1]) & (corners[:, 1] >= y_mm[0]) & (corners[:, 1] <= y_mm[-1]))
        height, _ = self(*(line.ravel() for line in np.meshgrid(x_mm, y_mm)))
        return float(min(corners[over, 2].min(initial=NO_CONTACT_MM), height.min()))

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
        xy = self.triangles[..., :2]
        near = ((xy.max(axis=1) >= low) & (xy.min(axis=1) <= high)).all(axis=1)
        vertices, faces = self.triangles[near].reshape(-1, 3), np.arange(3 * near.sum()).reshape(-1, 3)
        for axis, sign, bound in ((0, 1.0, low[0]), (1, 1.0, low[1]), (0, -1.0, high[0]), (1, -1.0, high[1])):
            if not len(faces):
                break
            normal, origin = sign * np.eye(3)[axis], bound * np.eye(3)[axis]
            vertices, faces, _ = trimesh.intersections.slice_faces_plane(vertices, faces, normal, origin)
        return float(vertices[faces, 2].min(initial=NO_CONTACT_MM))


@dataclass(frozen=True)
class MovedSurface:
    """An object's underside after a displacement along x and y."""

    surface: Callable
    """Heights (n,) and normals (n, 3) of the object's underside over points, as `HeightField`."""
    offset_mm: np.ndarray
    """The displacement (2,)."""

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


def lowest_crossing_naive(x: np.ndarray, y: np.ndarray, mesh: trimesh.Trimesh) -> np.ndarray:
    """The heights of a `HeightField` by testing every triangle: the reference implementation for tests."""
    heights = np.full(len(x), NO_CONTACT_MM)
    for triangle in mesh.triangles:
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = triangle
        double_area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if abs(double_area) < 1e-14:
            continue
        u = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / double_area
        v = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / double_area
        inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
        heights[inside] = np.minimum(heights[inside], (az + u * (bz - az) + v * (cz - az))[inside])
    return heights


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
