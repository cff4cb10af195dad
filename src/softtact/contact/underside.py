"""An object's underside over a grid of nodes: the points that it can touch (`ObjectPoints`), with its edges.

A node near an edge gets the plane of a facet and the heights of its surroundings over it. The facet is the one over the node
or the lowest one nearby, whichever plane contains more of the surroundings. Beside a kink, where a node is touched only at larger
depth, the node gets both (`Beneath`). A part of the object between nodes, which none is under, goes to the nearest one
(`narrow_parts`).
"""

from dataclasses import replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import binary_dilation, minimum_filter1d

from softtact.contact.height_field import HeightField
from softtact.contact.lower_envelope import NO_CONTACT_MM, heights_of
from softtact.contact.narrow_parts import lowest_missed
from softtact.contact.node_grid import NodeGrid
from softtact.contact.object_points import LOWEST, REACH, SAMPLES, Beneath, ObjectPoints, hat_shares, window_places
from softtact.contact.unilateral import depth_on_springs
from softtact.errors import MissError

MISSES = "The object misses every free point of the sensor's surface; move it over the sensor."
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
        self._coarse, over_node = _sampled(surface, grid)
        self._height, self._slope = self._coarse[:, 4], surface.slopes_of(over_node)
        self.lowest_mm = min(float(self._coarse.min()), surface.first_touch_mm(grid.x, grid.y))
        if self.lowest_mm >= NO_CONTACT_MM:
            raise MissError(MISSES)

    def depth_on_springs(self, force_n: float, foundation_modulus: float) -> float:
        """First guess of the depth (mm) below first touch under a force: on a Winkler foundation of `foundation_modulus` N/mm3,
        with the heights sampled around the nodes, and deep enough to touch a node; infinite for an object that stands between all.
        """
        there = self._coarse < NO_CONTACT_MM
        if not there.any():
            return np.inf
        area = np.broadcast_to(np.outer(_TRAPEZOID, _TRAPEZOID).ravel() * np.prod(self._grid.step), there.shape)[there]
        depth = depth_on_springs(self._coarse[there] - self.lowest_mm, area, force_n / foundation_modulus)
        return max(depth, float(self._height.min()) - self.lowest_mm)

    def points(self, reach_mm: float) -> ObjectPoints:
        """The `ObjectPoints` where the object is less than `reach_mm` above its lowest point."""
        near = self._near_edges()
        plain = np.setdiff1d(np.flatnonzero(self._height < self.lowest_mm + reach_mm), near)
        nodes, gap, slope, window, beneath = self._beside_edges(near, reach_mm)
        order = np.argsort(np.concatenate([plain, nodes]))
        edge = np.argsort(order)[len(plain):]
        found = ObjectPoints(nodes=np.concatenate([plain, nodes])[order], gap=np.concatenate([self._height[plain], gap])[order],
                             slope=np.vstack([self._slope[plain], slope])[order], edge=edge, window=window, step=self._grid.step,
                             beneath=beneath)
        seen = np.full(self._grid.count, NO_CONTACT_MM)
        seen[found.nodes] = found.gap
        missed = self._missed(seen, reach_mm)
        touched = np.flatnonzero(missed < NO_CONTACT_MM)
        return found.with_nodes(touched, missed[touched]) if len(touched) else found

    def nodes(self, reach_mm: float) -> ObjectPoints:
        """`points` without partial contact at edges: edges are less sharp, but no node is below the object."""
        missed = self._missed(self._height, reach_mm)
        slope = np.where((missed < self._height)[:, None], 0.0, self._slope)
        height = np.minimum(self._height, missed)
        kept = np.flatnonzero(height < self.lowest_mm + reach_mm)
        return replace(ObjectPoints.level(kept, height[kept], self._grid.step), slope=slope[kept])

    def narrow_parts(self, reach_mm: float) -> bool:
        """Whether the object has parts within `reach_mm` above its lowest point that no node is under."""
        return bool((self._missed(self._height, reach_mm) < NO_CONTACT_MM).any())

    def _missed(self, seen, reach_mm):
        """`lowest_missed` (n,) where nodes see gaps (n,)."""
        return lowest_missed(self._surface, self._grid, seen, self.lowest_mm + reach_mm)

    def _near_edges(self):
        """Nodes with an edge within the hat function's support or a displacement of one step beyond it."""
        shape, step = self._grid.shape, self._grid.step.min()
        low, high = (bound.reshape(shape) for bound in (self._coarse.min(axis=1), self._coarse.max(axis=1)))
        edges = (low < NO_CONTACT_MM) & (high - low > _SMOOTH * step)
        middle = self._height.reshape(shape)
        for axis in (0, 1):
            bend = np.abs(np.diff(middle, n=2, axis=axis)) > _KINK * step
            edges |= np.pad(bend, [(1, 1) if k == axis else (0, 0) for k in (0, 1)])
            jump = np.abs(np.diff(middle, axis=axis)) > 2 * _SMOOTH * step
            edges |= np.pad(jump, [(0, 1) if k == axis else (0, 0) for k in (0, 1)])
            edges |= np.pad(jump, [(1, 0) if k == axis else (0, 0) for k in (0, 1)])
        return np.flatnonzero(binary_dilation(edges, np.ones((3, 3)), iterations=REACH))

    def _beside_edges(self, near, reach_mm):
        """Nodes near edges that the object may touch: numbers (e,), gaps, slopes and windows; and their `Beneath`."""
        near, (heights, triangles) = self._windows(near, self.lowest_mm + reach_mm)
        over_node = self._above(heights, np.zeros((len(near), 2)), self._height[near], self._slope[near])
        places, at = _lowest_samples(heights)
        number = triangles.reshape(-1, np.prod(triangles.shape[1:]))[np.arange(len(near)), at]
        height = heights_of(self._surface.triangles, number, *(self._grid.points[near] + places * self._grid.step).T)
        over_lowest = self._above(heights, places, height, self._surface.slopes_of(number))
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

    def _above(self, heights, places, height, slope):
        """Gaps (e,), slopes (e, 2) and windows of nodes on the planes of facets over places (e, 2) in steps from them.

        height (e,), slope (e, 2): of the facets there. Those too steep to represent a node's surroundings count as horizontal;
        without a facet the gap is NO_CONTACT_MM.
        """
        step, samples = self._grid.step, window_places()
        slope = np.where(np.linalg.norm(slope, axis=1, keepdims=True) > _SMOOTH, 0.0, slope)
        gap = height - (slope * places * step).sum(axis=1)
        x, y = (slope[:, axis, None] * samples * step[axis] for axis in (0, 1))
        window = heights - (gap[:, None, None] + y[:, :, None] + x[:, None, :])
        window[(heights >= NO_CONTACT_MM) | (height >= NO_CONTACT_MM)[:, None, None]] = NO_CONTACT_MM
        return gap, slope, window.astype(np.float32)

    def _windows(self, nodes, below_mm):
        """The nodes over which a facet around may come below a height; heights (e, s, s) of the object at the samples around these,
        and the triangles (e, s, s) over the samples.
        """
        side, size = (np.arange(SAMPLES) + 0.5) / SAMPLES - 0.5, len(window_places())
        lines, first = [], []
        for line, step, place in zip((self._grid.x, self._grid.y), self._grid.step, np.divmod(nodes, self._grid.shape[1])[::-1],
                                     strict=True):
            low, high = (place.min(), place.max()) if len(place) else (0, 0)
            lines.append(line[0] + (np.arange(low - REACH, high + REACH + 1)[:, None] + side).ravel() * step)
            first.append(SAMPLES * (place - low) + SAMPLES // 2)
        rasters = self._surface.over_lines(*lines)
        lowest = rasters[0]
        for axis in (0, 1):
            lowest = minimum_filter1d(lowest, size, axis=axis, origin=-(size // 2))     # of the window that begins at each sample
        x, y = first
        low = lowest[y, x] - _SMOOTH * np.linalg.norm(self._grid.step) < below_mm     # plane over the node, from the lowest sample
        return nodes[low], [sliding_window_view(raster, (size, size))[y[low], x[low]] for raster in rasters]


def _sampled(surface, grid):
    """Heights (n, 9) at 3 x 3 samples of each node's rectangle, cut off at the sensor's sides, and triangles (n,) over nodes."""
    lines = []
    for line, step in zip((grid.x, grid.y), grid.step, strict=True):
        samples = (line[:, None] + np.linspace(-0.5, 0.5, 3) * step * (1 - 1e-9)).ravel()
        lines.append(np.clip(samples, line[0], line[-1]) if grid.sides else samples)
    heights, triangles = (values.reshape(len(grid.y), 3, len(grid.x), 3).swapaxes(1, 2).reshape(grid.count, 9)
                          for values in surface.over_lines(*lines))
    return heights, triangles[:, 4]


def _lowest_samples(heights):
    """Offsets (e, 2) in steps from the node to the lowest sample within the hat function's support, the nearest of equal ones; and
    its index (e,) among all samples.
    """
    x, y = (places.ravel() for places in np.meshgrid(window_places(), window_places()))
    away = np.where(np.maximum(np.abs(x), np.abs(y)) < 1, np.hypot(x, y), np.inf)
    samples = heights.reshape(-1, len(x))
    lowest = samples <= samples[:, np.isfinite(away)].min(axis=1, keepdims=True) + 1e-6
    index = np.where(lowest, away, np.inf).argmin(axis=1)
    return np.column_stack([x[index], y[index]]), index
