"""The free nodes of a sensor's surface as a grid that is symmetric about both axes; free sides belong to the grid.

`Stencil`   Approximate inverse of a surface's compliance: nodal forces at a node and its neighbours under prescribed displacements
of all surface nodes. They decay within about an element, so a few neighbours make a good preconditioner.
`patches_of`   Patches of contact points with one pressure: fewer unknowns where a contact is large.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from softtact.compiled import compiled
from softtact.contact.object_points import ObjectPoints

_LEVEL_MM = 0.02     # range of heights among the points of a patch
_WHOLE = 0.999        # covered share from which on a point may share a patch
_MANY_POINTS = 800   # number of points from which patches save time; a small contact needs all of its points


@dataclass(frozen=True)
class NodeGrid:
    """Free nodes of a surface on lines x (nx,), y (ny,) in mm, symmetric about 0; numbered x fastest.

    sides: whether the outermost nodes lie on the surface's free sides; otherwise the sides are fixed, one step beyond the grid
    """

    x: np.ndarray
    y: np.ndarray
    sides: bool = False

    def arrays(self) -> dict[str, np.ndarray]:
        """The grid as arrays by name, for a file; `of` reads them back."""
        return {"x": self.x, "y": self.y, "sides": np.array(self.sides)}

    @classmethod
    def of(cls, arrays: Mapping[str, np.ndarray]) -> "NodeGrid":
        """The grid from its `arrays`."""
        return cls(arrays["x"], arrays["y"], bool(arrays["sides"]))

    @property
    def step(self) -> np.ndarray:
        """Distances (2,) of nodes in x and y."""
        return np.array([self.x[1] - self.x[0], self.y[1] - self.y[0]])

    @property
    def shape(self) -> tuple[int, int]:
        """(ny, nx)."""
        return len(self.y), len(self.x)

    @property
    def points(self) -> np.ndarray:
        """All nodes (n, 2)."""
        return np.stack(np.meshgrid(self.x, self.y), axis=-1).reshape(-1, 2)

    @property
    def count(self) -> int:
        return len(self.x) * len(self.y)

    @property
    def every_second(self) -> "NodeGrid":
        """The grid of every second node that contains the middle one: the map's points, without the fixed nodes on its sides."""
        first = self.first_of_second
        return NodeGrid(self.x[first::2], self.y[first::2], self.sides)

    @property
    def first_of_second(self) -> int:
        """Index along both lines at which `every_second` begins."""
        return 0 if self.sides else 1

    @property
    def second_nodes(self) -> np.ndarray:
        """Numbers (m,) in this grid of the nodes of `every_second`."""
        first = self.first_of_second
        return np.arange(self.count).reshape(self.shape)[first::2, first::2].ravel()

    def areas(self, nodes: np.ndarray) -> np.ndarray:
        """Area (n,) in mm2 of the surface around nodes (n,): a rectangle of one step along x and y, within the surface's sides."""
        return np.prod(self.step) * self.share_inside(nodes)

    def share_inside(self, nodes: np.ndarray) -> np.ndarray:
        """Share (n,) of a node's rectangle that lies on the surface: a half at a side, a quarter at a corner, else 1."""
        if not self.sides:
            return np.ones(len(nodes))
        j, i = np.divmod(nodes, len(self.x))
        return np.where((i == 0) | (i == len(self.x) - 1), 0.5, 1.0) * np.where((j == 0) | (j == len(self.y) - 1), 0.5, 1.0)

    def with_held_sides(self, fields: np.ndarray) -> np.ndarray:
        """Fields (..., ny, nx) of this grid on the map's points: with a border of zeros where the sides are fixed."""
        if self.sides:
            return fields
        return np.pad(fields, [(0, 0)] * (fields.ndim - 2) + [(1, 1), (1, 1)])

    def from_middle(self, nodes: np.ndarray) -> np.ndarray:
        """Offsets (n, 2) in steps along x and y from the middle to nodes (n,)."""
        j, i = np.divmod(nodes, len(self.x))
        return np.column_stack([i - len(self.x) // 2, j - len(self.y) // 2])

    def quarter(self, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (n,) of nodes (n,) mirrored into the quarter x, y >= 0, from the middle, x fastest; signs (n, 2) of x and y."""
        place = self.from_middle(nodes)
        away = np.abs(place)
        return away[:, 1] * (len(self.x) // 2 + 1) + away[:, 0], np.where(place < 0, -1, 1)


@dataclass(frozen=True)
class Stencil:
    """values (2, 2, 2 k + 1, 2 k + 1) in N/mm: by the parities of a node's row and column from the middle, and the offset.

    The four parities are the nodes at corners, on the two kinds of mid-sides, and at centres of elements.
    """

    values: np.ndarray

    def on(self, grid: NodeGrid, nodes: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """The stencil's product with values (n, load steps) at nodes (n,) of a `NodeGrid`; all other nodes are zero."""
        neighbours, weights = self.around(grid, nodes)
        return lambda x: apply_stencil(np.ascontiguousarray(x, dtype=np.float32), neighbours, weights)

    def around(self, grid: NodeGrid, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """For nodes (n,) of a `NodeGrid`: indices (n, k) of their neighbours among these, -1 for none, and the weights (n, k)."""
        reach = self.values.shape[2] // 2
        j, i = np.divmod(nodes, grid.shape[1])
        place = np.full((grid.shape[0] + 2 * reach, grid.shape[1] + 2 * reach), -1)
        place[j + reach, i + reach] = np.arange(len(nodes))
        kind = (j - grid.shape[0] // 2) % 2, (i - grid.shape[1] // 2) % 2
        offsets = [(dj, di) for dj in range(2 * reach + 1) for di in range(2 * reach + 1)]
        neighbours = np.stack([place[j + dj, i + di] for dj, di in offsets], axis=1)
        return neighbours, np.stack([self.values[(*kind, dj, di)] for dj, di in offsets], axis=1).astype(np.float32)


@compiled
def apply_stencil(x: np.ndarray, neighbours: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Sums (n, m) over values (n, m) of the neighbours (n, k) with weights (n, k); an index of -1 is none."""
    out = np.zeros_like(x)
    for n in range(len(neighbours)):
        for k in range(neighbours.shape[1]):
            m = neighbours[n, k]
            if m >= 0:
                for l in range(x.shape[1]):
                    out[n, l] += weights[n, k] * x[m, l]
    return out


def patches_of(points: ObjectPoints, grid: NodeGrid, shared: bool, *, beside_edge: int = 0) -> sp.csr_matrix:
    """Matrix (patches, c) of the points' shares in patches: four fully covered points of a square at like heights, or one point.

    Squares are counted in pairs of rows and columns from the middle, so that a symmetric contact remains symmetric.
    beside_edge: number of rows of points along the edge of all points that keep a separate pressure
    """
    label = np.arange(points.count)
    if shared and points.count > _MANY_POINTS:
        place = grid.from_middle(points.nodes)
        full = np.where(place == 0, 1, 2).prod(axis=1)
        _, square = np.unique(np.sign(place) * ((np.abs(place) + 1) // 2), axis=0, return_inverse=True)
        square = square.ravel()
        whole = np.minimum(points.covered, points.as_deep(0.0).covered) > _WHOLE
        if beside_edge:
            from scipy.ndimage import binary_erosion

            whole &= binary_erosion(_mask(points, grid), np.ones((3, 3)), iterations=beside_edge).ravel()[points.nodes]
        count = np.bincount(square, weights=whole)
        low, high = np.full(len(count), np.inf), np.full(len(count), -np.inf)
        np.minimum.at(low, square, points.gap)
        np.maximum.at(high, square, points.gap)
        together = (count[square] == full) & (high - low <= _LEVEL_MM)[square]
        label = np.where(together, points.count + square, label)
    _, label = np.unique(label, return_inverse=True)
    weight = pressure_weights(points, grid)
    return sp.csr_matrix((weight / np.bincount(label, weights=weight)[label], (label, np.arange(points.count))))


def _mask(points, grid):
    """Which nodes (ny, nx) of the grid are contact points."""
    there = np.zeros(grid.count, dtype=bool)
    there[points.nodes] = True
    return there.reshape(grid.shape)


def pressure_weights(points: ObjectPoints, grid: NodeGrid) -> np.ndarray:
    """Nodal forces (c,) of a uniform pressure on quadratic elements, whose corners are every second node from the middle."""
    return np.where(grid.from_middle(points.nodes) % 2, 2.0, 1.0).prod(axis=1) * grid.share_inside(points.nodes)
