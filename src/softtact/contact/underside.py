"""An object's underside over a grid of nodes: the points that it can touch (`ObjectPoints`), with its edges.

A node near an edge gets the plane of a facet and the heights of its surroundings over it. The facet is the one over the node
or the lowest one nearby, whichever plane contains more of the surroundings. Beside a kink, where a node is touched only at larger
depth, the node gets both (`Beneath`). A part of the object between nodes, which none is under, goes to the nearest one
(`narrow_parts`).
"""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import binary_dilation

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.narrow_parts import lowest_missed
from softtact.contact.node_grid import NodeGrid
from softtact.contact.object_points import LOWEST, REACH, SAMPLES, Beneath, ObjectPoints, hat_shares, window_places
from softtact.contact.unilateral import depth_on_springs
from softtact.errors import InputError

_SMOOTH = 0.6        # largest slope of a surface without an edge
_KINK = 0.1          # change of slope from node to node that counts as an edge
_FLAT = 0.05         # of a step: tolerance of the height of samples in a plane
_MOSTLY = 2.0        # the facet over a node is taken if its plane contains so many times the share of the lowest facet's plane ...
_ENOUGH = 0.9        # ... or at least this share of the surroundings
_ALIKE = 0.99        # share in a plane from which all of a node's surroundings count as lying in it
_TRAPEZOID = np.array([0.25, 0.5, 0.25])


class Underside:
    """An object's underside over the nodes of a grid;  lowest_mm: over the free surface."""

    def __init__(self, surface: HeightField, grid: NodeGrid) -> None:
        self._surface, self._grid = surface, grid
        self._coarse = _sampled(surface, grid)
        self.lowest_mm = min(float(self._coarse.min()), surface.first_touch_mm(grid.x, grid.y))
        if self.lowest_mm >= NO_CONTACT_MM:
            raise InputError("The object misses every free point of the sensor's surface; move it over the sensor.")

    def depth_on_springs(self, force_n: float, foundation_modulus: float) -> float:
        """First guess of the depth (mm) below first touch under a force: on a Winkler foundation of `foundation_modulus` N/mm3,
        with the heights sampled around the nodes; infinite for an object that stands between all of them.
        """
        there = self._coarse < NO_CONTACT_MM
        if not there.any():
            return np.inf
        area = np.broadcast_to(np.outer(_TRAPEZOID, _TRAPEZOID).ravel() * np.prod(self._grid.step), there.shape)[there]
        return depth_on_springs(self._coarse[there] - self.lowest_mm, area, force_n / foundation_modulus)

    def points(self, reach_mm: float) -> ObjectPoints:
        """The `ObjectPoints` where the object is less than `reach_mm` above its lowest point."""
        near = self._near_edges()
        plain = np.setdiff1d(np.flatnonzero(self._middle < self.lowest_mm + reach_mm), near)
        nodes, gap, slope, window, beneath = self._beside_edges(near, reach_mm)
        height, slopes = self._facets(self._grid.points[plain])
        order = np.argsort(np.concatenate([plain, nodes]))
        edge = np.argsort(order)[len(plain):]
        found = ObjectPoints(nodes=np.concatenate([plain, nodes])[order], gap=np.concatenate([height, gap])[order],
                             slope=np.vstack([slopes, slope])[order], edge=edge, window=window, step=self._grid.step,
                             beneath=beneath)
        missed = self._missed(found.nodes, found.gap, reach_mm)
        touched = np.flatnonzero(missed < NO_CONTACT_MM)
        return found.with_nodes(touched, missed[touched]) if len(touched) else found

    def nodes(self, reach_mm: float) -> ObjectPoints:
        """`points` without partial contact at edges: edges are less sharp, but no node is below the object."""
        height, slope = self._facets(self._grid.points)
        missed = self._missed(np.arange(self._grid.count), height, reach_mm)
        slope[missed < height] = 0.0
        height = np.minimum(height, missed)
        kept = np.flatnonzero(height < self.lowest_mm + reach_mm)
        side = len(window_places())
        return ObjectPoints(nodes=kept, gap=height[kept], slope=slope[kept], edge=np.zeros(0, dtype=np.int64),
                            window=np.zeros((0, side, side), dtype=np.float32), step=self._grid.step)

    def narrow_parts(self, reach_mm: float) -> bool:
        """Whether the object has parts within `reach_mm` above its lowest point that no node is under."""
        height = self._facets(self._grid.points)[0]
        return bool((self._missed(np.arange(self._grid.count), height, reach_mm) < NO_CONTACT_MM).any())

    def _missed(self, nodes, gap, reach_mm):
        """`lowest_missed` (n,) where nodes (c,) see gaps (c,)."""
        seen = np.full(self._grid.count, NO_CONTACT_MM)
        seen[nodes] = gap
        return lowest_missed(self._surface, self._grid, seen, self.lowest_mm + reach_mm)

    @property
    def _middle(self):
        return self._coarse[:, self._coarse.shape[1] // 2]

    def _facets(self, places):
        """Height (p,) of the object over places (p, 2), and slope (p, 2), zero beside the object."""
        height, normal = self._surface(*places.T)
        return height, np.where((height < NO_CONTACT_MM)[:, None], -normal[:, :2] / normal[:, 2:], 0.0)

    def _near_edges(self):
        """Nodes with an edge within the hat function's support or a displacement of one step beyond it."""
        shape, step = self._grid.shape, self._grid.step.min()
        low, high = (bound.reshape(shape) for bound in (self._coarse.min(axis=1), self._coarse.max(axis=1)))
        edges = (low < NO_CONTACT_MM) & (high - low > _SMOOTH * step)
        middle = self._middle.reshape(shape)
        for axis in (0, 1):
            bend = np.abs(np.diff(middle, n=2, axis=axis)) > _KINK * step
            edges |= np.pad(bend, [(1, 1) if k == axis else (0, 0) for k in (0, 1)])
            jump = np.abs(np.diff(middle, axis=axis)) > 2 * _SMOOTH * step
            edges |= np.pad(jump, [(0, 1) if k == axis else (0, 0) for k in (0, 1)])
            edges |= np.pad(jump, [(1, 0) if k == axis else (0, 0) for k in (0, 1)])
        return np.flatnonzero(binary_dilation(edges, np.ones((3, 3)), iterations=REACH))

    def _beside_edges(self, near, reach_mm):
        """Nodes near edges that the object may touch: numbers (e,), gaps, slopes and windows; and their `Beneath`."""
        heights = self._windows(near)
        over_node = self._above(near, heights, np.zeros((len(near), 2)))
        over_lowest = self._above(near, heights, _lowest_places(heights))
        still = np.zeros((len(near), 2))
        tolerance = _FLAT * self._grid.step.min()
        above, lowest = (hat_shares(np.abs(found[2]), still, tolerance) for found in (over_node, over_lowest))
        mostly = (above >= _MOSTLY * lowest) | (above >= _ENOUGH)
        gap, slope, window = (np.where(mostly.reshape(-1, *(1,) * (a.ndim - 1)), a, b)
                              for a, b in zip(over_node, over_lowest, strict=True))
        kept = (window <= LOWEST * self._grid.step.min()).any(axis=(1, 2)) & (gap < self.lowest_mm + reach_mm)
        both = np.flatnonzero(mostly[kept] & (lowest[kept] > 0) & (lowest[kept] < _ALIKE))
        beneath = Beneath(both, *(values[kept][both] for values in over_lowest)) if len(both) else None
        return near[kept], gap[kept], slope[kept], window[kept], beneath

    def _above(self, nodes, heights, places):
        """Gaps (e,), slopes (e, 2) and windows of nodes on the planes of the facets over places (e, 2) in steps from them.

        Facets too steep to represent a node's surroundings count as horizontal; without a facet the gap is NO_CONTACT_MM.
        """
        step, samples = self._grid.step, window_places()
        height, slope = self._facets(self._grid.points[nodes] + places * step)
        slope[np.linalg.norm(slope, axis=1) > _SMOOTH] = 0.0
        gap = height - (slope * places * step).sum(axis=1)
        x, y = (slope[:, axis, None] * samples * step[axis] for axis in (0, 1))
        window = heights - (gap[:, None, None] + y[:, :, None] + x[:, None, :])
        window[(heights >= NO_CONTACT_MM) | (height >= NO_CONTACT_MM)[:, None, None]] = NO_CONTACT_MM
        return gap, slope, window.astype(np.float32)

    def _windows(self, nodes):
        """Heights (e, s, s) of the object at the samples around nodes."""
        j, i = np.divmod(nodes, self._grid.shape[1])
        wanted = np.zeros([count + 2 * REACH for count in self._grid.shape], dtype=bool)
        wanted[j + REACH, i + REACH] = True
        rectangles = np.argwhere(binary_dilation(wanted, np.ones((3, 3)), iterations=REACH))
        side = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5
        away = (rectangles - REACH)[:, None, None, ::-1] + np.stack(np.meshgrid(side, side), axis=-1)
        where = self._grid.points[0] + away * self._grid.step
        blocks = np.full((*wanted.shape, SAMPLES, SAMPLES), NO_CONTACT_MM)
        blocks[tuple(rectangles.T)] = self._surface(*where.reshape(-1, 2).T)[0].reshape(-1, SAMPLES, SAMPLES)
        raster = blocks.transpose(0, 2, 1, 3).reshape(wanted.shape[0] * SAMPLES, -1)
        size = len(window_places())
        return sliding_window_view(raster, (size, size))[SAMPLES * j + SAMPLES // 2, SAMPLES * i + SAMPLES // 2]


def _sampled(surface, grid):
    """Heights (n, 9) at three by three samples of each node's rectangle, cut off at the sensor's sides."""
    side = np.linspace(-0.5, 0.5, 3)
    where = grid.points[:, None] + np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2) * grid.step * (1 - 1e-9)
    if grid.sides:
        where = np.clip(where, grid.points[0], grid.points[-1])
    return surface(*where.reshape(-1, 2).T)[0].reshape(grid.count, 9)


def _lowest_places(heights):
    """Offsets (e, 2) in steps from the node to the lowest sample within the hat function's support; the nearest of equal ones."""
    places = window_places()
    x, y = np.meshgrid(places, places)
    within = np.maximum(np.abs(x), np.abs(y)) < 1
    away = np.stack([x[within], y[within]], axis=1)
    hat = heights[:, within]
    lowest = hat <= hat.min(axis=1, keepdims=True) + 1e-6
    return away[np.where(lowest, np.linalg.norm(away, axis=1), np.inf).argmin(axis=1)]
