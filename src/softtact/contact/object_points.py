"""Where a rigid object can touch a grid of nodes, sharper than the grid: a point for each node's own rectangle.

Where the object covers a whole rectangle the point is the node. Where its edge runs through, it is the centroid of the covered
part, so that a uniform pressure has its right force and moment, and an edge counts where it is and not at the next node: under
ridges 3 mm wide, on nodes 0.34 mm apart, the foundation model's map is off by 1.1 instead of 1.7 % (docs/fast_models.md).
Between the nodes displacement and force are interpolated bilinearly in one of the four rectangles that meet at the node.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from softtact.contact.height_field import NO_CONTACT_MM
from softtact.contact.unilateral import depth_on_springs
from softtact.errors import InputError

_SAMPLES = 8              # a side of a rectangle with an edge
_SMOOTH, _LOWEST = 0.6, 0.15    # of a rectangle's side: range of heights without an edge; of those beside one that count
_LEAST_COVERED = 0.1
_FURTHEST = 0.8           # of a step, that a point may move from its node: at the next one it would be that one's point


@dataclass(frozen=True)
class NodeGrid:
    """Free nodes of a surface on lines x (nx,), y (ny,) in mm, symmetric about 0; numbered x fastest."""

    x: np.ndarray
    y: np.ndarray

    @property
    def step(self):
        """Distances (2,) of nodes in x and y."""
        return np.array([self.x[1] - self.x[0], self.y[1] - self.y[0]])

    @property
    def shape(self):
        """(ny, nx)."""
        return len(self.y), len(self.x)

    @property
    def points(self):
        """All nodes (n, 2)."""
        return np.stack(np.meshgrid(self.x, self.y), axis=-1).reshape(-1, 2)

    @property
    def count(self):
        return len(self.x) * len(self.y)

    @property
    def every_second(self):
        """The grid of every second node, from the second one on: the map's, without its outer rows and columns."""
        return NodeGrid(self.x[1::2], self.y[1::2])

    def quarter(self, nodes):
        """Of nodes (n,): their numbers (n,) in the quarter x, y >= 0, from the middle, x fastest; and signs (n, 2) of x and y."""
        j, i = np.divmod(nodes, len(self.x))
        place = np.column_stack([i - len(self.x) // 2, j - len(self.y) // 2])
        away = np.abs(place)
        return away[:, 1] * (len(self.x) // 2 + 1) + away[:, 0], np.where(place < 0, -1, 1)


@dataclass(frozen=True)
class ObjectPoints:
    """Points where an object can touch: a point for each of nodes (c,) of a grid.

    gap (c,): the object's height over the undeformed surface in mm;  slope (c, 2): how it grows in x and y
    covered (c,): share of the node's rectangle under the object
    edge (e,): those of the points that lie at an edge;  offset (e, 2): of these from their nodes, in shares of the grid's step
    toward (e, 2): -1, 0, 1: on which side of the node they lie or may move;  support (e, 4): nodes that they lie among,
    the own node, that beside it in x, in y, and the fourth, as places in `nodes` and from c on in `others`
    others (o,): nodes that carry points without one of their own
    """

    nodes: np.ndarray
    gap: np.ndarray
    slope: np.ndarray
    covered: np.ndarray
    edge: np.ndarray
    offset: np.ndarray
    toward: np.ndarray
    support: np.ndarray
    others: np.ndarray

    @property
    def count(self):
        return len(self.nodes)

    def interpolation(self, weights):
        """Matrix (c, c + o) from what `all_nodes` have to what the points have, with `weights` (e, 4)."""
        plain = np.setdiff1d(np.arange(self.count), self.edge)
        rows, columns = np.concatenate([plain, np.repeat(self.edge, 4)]), np.concatenate([plain, self.support.ravel()])
        values = np.concatenate([np.ones(len(plain)), weights.ravel()])
        return sp.csr_matrix((values, (rows, columns)), shape=(self.count, len(self.all_nodes)))

    @property
    def all_nodes(self):
        """Nodes that carry force: those with points first."""
        return np.concatenate([self.nodes, self.others])

    def weights(self, shift=None):
        """Weights (e, 4) of the supports, the points at edges moved by `shift` (e, 2) in shares of a step."""
        offset = np.abs(self.offset)
        if shift is not None:
            offset = np.clip(offset + shift * self.toward, 0.0, _FURTHEST) * (self.toward != 0)
        a, b = offset.T
        return np.stack([(1 - a) * (1 - b), a * (1 - b), (1 - a) * b, a * b], axis=1)


class Underside:
    """An object's underside over the rectangles of a grid's nodes.

    heights (n,): lowest in each rectangle in mm;  covered (n,): its share under the object;  lowest_mm: over the free surface
    """

    def __init__(self, surface, grid):
        self._surface, self._grid = surface, grid
        self.heights, self.covered, self._centre, self._uneven = _rectangles(surface, grid)
        self.lowest_mm = float(self.heights.min())
        if self.lowest_mm >= NO_CONTACT_MM:
            raise InputError("The object misses every free point of the sensor's surface; move it over the sensor.")

    def depth_on_springs(self, force_n, bedding):
        """How far (mm) the object sinks from its first touch into a bed of springs of `bedding` N/mm3: a first guess."""
        kept = self.heights < NO_CONTACT_MM
        area = self.covered[kept] * np.prod(self._grid.step)
        return depth_on_springs(self.heights[kept] - self.lowest_mm, area, force_n / bedding)

    def points(self, reach_mm):
        """The `ObjectPoints` as far as the object is lower than `reach_mm` over its lowest point."""
        return _object_points(self._surface, self._grid, self.heights, self.covered, self._centre, self._uneven, reach_mm)

    def nodes(self, reach_mm):
        """The same with points at nodes only, each for its whole rectangle: blunter, but no node comes down below the object."""
        height, normal = self._surface(*self._grid.points.T)
        kept = np.flatnonzero(height < self.lowest_mm + reach_mm)
        if not len(kept):
            raise InputError("The object touches between the nodes of the sensor's surface only; take the foundation model.")
        none = np.zeros((0, 2))
        return ObjectPoints(nodes=kept, gap=height[kept], slope=-normal[kept, :2] / normal[kept, 2:], covered=np.ones(len(kept)),
                            edge=np.zeros(0, dtype=np.int64), offset=none, toward=none.astype(np.int64),
                            support=np.zeros((0, 4), dtype=np.int64), others=np.zeros(0, dtype=np.int64))


def _object_points(surface, grid, heights, covered, centre, uneven, reach_mm):
    kept = np.flatnonzero(((covered > _LEAST_COVERED) | _tips(heights, grid)) & (heights < heights.min() + reach_mm))
    gap, slope = _gap_and_slope(surface, grid, kept, heights[kept], centre[kept])
    at_edge = uneven[kept] | _beside_nothing(grid, kept, heights)
    edge = np.flatnonzero(at_edge)
    toward = _side(grid, kept[edge], centre[kept[edge]], heights)
    support, others = _supports(grid, kept, edge, toward)
    return ObjectPoints(nodes=kept, gap=gap, slope=slope, covered=covered[kept], edge=edge,
                        offset=centre[kept[edge]] * (toward != 0), toward=toward, support=support, others=others)


def _rectangles(surface, grid):
    """Of each node's rectangle: lowest height (n,), covered share (n,), its centroid (n, 2) in steps, and if it has an edge."""
    points, step = grid.points, grid.step
    coarse = _sampled(surface, points, step, 3)
    heights, low, high = coarse[:, 4], coarse.min(axis=1), coarse.max(axis=1)
    covered, centre = (low < NO_CONTACT_MM).astype(float), np.zeros((len(points), 2))
    uneven = (low < NO_CONTACT_MM) & (high - low > _SMOOTH * step.min())
    fine = _sampled(surface, points[uneven], step, _SAMPLES)
    lowest = fine.min(axis=1, initial=NO_CONTACT_MM)
    part = (fine <= lowest[:, None] + _LOWEST * step.min()) & (fine < NO_CONTACT_MM)
    covered[uneven] = part.mean(axis=1)
    centre[uneven] = part @ _places(_SAMPLES) / np.maximum(part.sum(axis=1), 1)[:, None]
    heights = heights.copy()
    heights[uneven] = lowest
    return heights, covered, centre, uneven


def _tips(heights, grid):
    """Which rectangles hold a tip: something lower than in all their neighbours, however small."""
    around = np.pad(heights.reshape(grid.shape), 1, constant_values=NO_CONTACT_MM)
    rows, columns = grid.shape
    beside = [around[dj:dj + rows, di:di + columns] for dj in range(3) for di in range(3) if (dj, di) != (1, 1)]
    return heights < np.min(beside, axis=0).ravel() - 1e-9


def _places(samples):
    """Sample places (samples^2, 2) in a rectangle, in shares of its sides from its centre; of three samples on its sides."""
    side = np.linspace(-0.5, 0.5, 3) if samples == 3 else (np.arange(samples) + 0.5) / samples - 0.5
    return np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)


def _sampled(surface, points, step, samples):
    where = points[:, None] + _places(samples) * step * (1 - 1e-9)
    return surface(*where.reshape(-1, 2).T)[0].reshape(len(points), samples**2)


def _gap_and_slope(surface, grid, nodes, lowest, centre):
    """Height at the points (c,), the rectangle's lowest where they miss the object, and its slope (c, 2) there."""
    height, normal = surface(*(grid.points[nodes] + centre * grid.step).T)
    missed = height >= NO_CONTACT_MM
    slope = np.where(missed[:, None], 0.0, -normal[:, :2] / np.where(missed, 1.0, normal[:, 2])[:, None])
    return np.where(missed, lowest, height), slope


def _beside_nothing(grid, nodes, heights):
    """Which of the nodes have a neighbour in x or y where the object is missing or jumps."""
    around = np.pad(heights.reshape(grid.shape), 1, mode="edge")
    j, i = np.divmod(nodes, grid.shape[1])
    jump = [np.abs(around[j + 1 + dj, i + 1 + di] - heights[nodes]) > 2 * _SMOOTH * grid.step.min()
            for dj, di in ((0, 1), (0, -1), (1, 0), (-1, 0))]
    return np.any(jump, axis=0)


def _side(grid, nodes, centre, heights):
    """Towards which neighbours (e, 2) the points at edges lie: the centroid's side, or away from where nothing is."""
    around = np.pad(heights.reshape(grid.shape), 1, constant_values=NO_CONTACT_MM)
    j, i = np.divmod(nodes, grid.shape[1])
    side = np.zeros((len(nodes), 2), dtype=np.int64)
    for axis, (dj, di) in enumerate(((0, 1), (1, 0))):
        jump = [around[j + 1 + s * dj, i + 1 + s * di] - heights[nodes] > 2 * _SMOOTH * grid.step.min() for s in (-1, 1)]
        away = jump[0].astype(int) - jump[1].astype(int)     # nothing on the lower side: towards the upper one
        lies = np.where(np.abs(centre[:, axis]) > 1e-9, np.sign(centre[:, axis]), away).astype(np.int64)
        place = (i, j)[axis] + lies
        side[:, axis] = np.where((place >= 0) & (place < grid.shape[1 - axis]), lies, 0)
    return side


def _supports(grid, nodes, edge, toward):
    """Places (e, 4) of the supports' nodes, and the nodes among these that have no point of their own."""
    width = grid.shape[1]
    own, (dx, dy) = nodes[edge], toward.T
    wanted = np.stack([own, own + dx, own + width * dy, own + dx + width * dy], axis=1)
    others = np.setdiff1d(wanted, nodes)
    place = np.full(grid.shape[0] * width, -1)
    place[nodes], place[others] = np.arange(len(nodes)), len(nodes) + np.arange(len(others))
    return place[wanted], others
