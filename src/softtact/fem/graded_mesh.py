"""The cover's mesh: layers of 20-node hexahedra on a grid, in each of which cells can be split into four, repeatedly.

Where a small element meets a larger one, its hanging nodes are constrained to the larger one's face. A quarter of a serendipity
face reproduces the functions of the whole face; so the displacement is continuous, and hanging nodes are not unknowns.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from softtact.fem.elements import HEX20
from softtact.fem.extruded_mesh import grid_mesh_2d
from softtact.fem.quadrature import densest_rule

# Derivatives of the shape functions where elements may be folded: points of all rules, and corners and middles of their sides.
_SLOPES = HEX20.shape(densest_rule(3).points)[1]
_ROUNDS = 20   # masters of hanging nodes may hang themselves; each round resolves one level


@dataclass(frozen=True)
class CoverMesh:
    """points (n, 3) in mm, of which the free ones come first; hexes (e, 20), layer by layer from below.

    follow (n, free): matrix of the hanging-node constraints: displacements of all points from those of the free ones
    top, bottom (t, 8): faces in the order of QUAD8_NODES;  bottom_cells, top_cells (ny 2^m, nx 2^m): index of the face
    on each cell of the finest grid
    """

    points: np.ndarray
    hexes: np.ndarray
    follow: sp.csr_matrix
    top: np.ndarray
    bottom: np.ndarray
    bottom_cells: np.ndarray
    top_cells: np.ndarray

    @property
    def free(self) -> int:
        """Number of free points, which are the first ones; the others are hanging nodes."""
        return self.follow.shape[1]

    @property
    def top_nodes(self) -> np.ndarray:
        """Free points on the top."""
        nodes = np.unique(self.top)
        return nodes[nodes < self.free]

    @property
    def bottom_nodes(self) -> np.ndarray:
        """Free points on the lower side."""
        nodes = np.unique(self.bottom)
        return nodes[nodes < self.free]

    def least_volume_ratio(self, displacement: np.ndarray) -> float:
        """Least deformed over undeformed volume, at integration points and corners of the elements.

        displacement (n, 3) in mm, of the free points first. An element is folded where it is 0 or less, which quadrature does not
        see at a corner; nan without elements.
        """
        if not len(self.hexes):
            return np.nan
        moved = self.points + self.follow @ displacement[:self.free]
        rest, deformed = (np.linalg.det(np.einsum("emi,gmj->egij", points[self.hexes], _SLOPES, optimize=True))
                          for points in (self.points, moved))
        return float((deformed / rest).min())

    def masters(self) -> tuple[np.ndarray, np.ndarray]:
        """Master nodes (n, w) of each point and their weights (n, w); unused entries have weight 0."""
        width = int(np.diff(self.follow.indptr).max())
        nodes, weights = np.zeros((len(self.points), width), dtype=np.int64), np.zeros((len(self.points), width))
        row = np.repeat(np.arange(len(self.points)), np.diff(self.follow.indptr))
        place = np.arange(self.follow.nnz) - self.follow.indptr[row]
        nodes[row, place], weights[row, place] = self.follow.indices, self.follow.data
        return nodes, weights


def split_depths(shape: tuple[int, int], wanted: Callable[[np.ndarray, float, int], np.ndarray], most: int) -> np.ndarray:
    """Split depths (ny 2^most, nx 2^most) on the finest grid, for a grid of `shape` (nx, ny).

    `wanted(low, size, depth)` returns which cells to split, given their lower corners (c, 2) and size in units of the grid.
    """
    nx, ny = shape
    depth = np.zeros((ny << most, nx << most), dtype=np.int64)
    for current in range(most):
        block = 1 << (most - current)
        j, i = np.nonzero(depth[::block, ::block] == current)
        chosen = wanted(np.column_stack([i, j]) / (1 << current), 1.0 / (1 << current), current)
        for row, column in zip(j[chosen] * block, i[chosen] * block, strict=True):
            depth[row:row + block, column:column + block] = current + 1
    return depth


def cover_mesh(x_lines: np.ndarray, y_lines: np.ndarray, heights: np.ndarray, splits: np.ndarray) -> CoverMesh:
    """Hexahedra between `heights` (k + 1,) in mm over a grid.

    splits (k, ny 2^m, nx 2^m): split depth of each cell of the finest grid, layer by layer from below.
    A single height gives a mesh of faces only.
    """
    if len(heights) == 1:
        return _faces_alone(x_lines, y_lines, heights[0])
    most = int(np.log2(splits.shape[2] // (len(x_lines) - 1)))
    cells = [_leaves(layer, most) for layer in splits]
    low = np.vstack([np.column_stack([leaf[:, :2], np.full(len(leaf), 2 * k)]) for k, leaf in enumerate(cells)])
    size = np.concatenate([leaf[:, 2] for leaf in cells])
    # Places are whole numbers: 2 in x and y for the side of the smallest cell, 2 in z for a layer.
    half = np.column_stack([size, size, np.ones_like(size)])
    nodes = low[:, None] + ((HEX20.nodes[None] + 1) * half[:, None]).astype(np.int64)
    places, hexes = np.unique(nodes.reshape(-1, 3), axis=0, return_inverse=True)
    hexes = hexes.reshape(-1, 20)
    rows, masters, weights = _hanging(places, hexes, low, half, cells)
    free, follow = _resolve(len(places), rows, masters, weights)
    order = np.concatenate([np.flatnonzero(free), np.flatnonzero(~free)])
    number = np.empty(len(order), dtype=np.int64)
    number[order] = np.arange(len(order))
    lines = [_subdivided(x_lines, 2 << most), _subdivided(y_lines, 2 << most), _subdivided(heights, 2)]
    points = np.column_stack([line[places[order, axis]] for axis, line in enumerate(lines)])
    layer = low[:, 2] // 2
    return CoverMesh(points=points, hexes=number[hexes], follow=follow[order].tocsr(),
                     top=number[hexes[layer == len(splits) - 1][:, HEX20.top]], bottom=number[hexes[layer == 0][:, HEX20.bottom]],
                     bottom_cells=_owners(cells[0], splits[0].shape), top_cells=_owners(cells[-1], splits[-1].shape))


def _faces_alone(x_lines, y_lines, height):
    mesh_2d = grid_mesh_2d(np.asarray(x_lines), np.asarray(y_lines))
    points = np.column_stack([mesh_2d.points, np.full(len(mesh_2d.points), float(height))])
    cells = np.arange(len(mesh_2d.quads)).reshape(len(y_lines) - 1, len(x_lines) - 1)
    return CoverMesh(points=points, hexes=np.zeros((0, 20), dtype=np.int64), follow=sp.eye(len(points), format="csr"),
                     top=mesh_2d.quads, bottom=mesh_2d.quads, bottom_cells=cells, top_cells=cells)


def _owners(leaves, shape):
    """Index of a layer's cell at each cell of the finest grid."""
    owner = np.empty(shape, dtype=np.int64)
    for number, (x, y, block) in enumerate(leaves):
        owner[y // 2:y // 2 + block, x // 2:x // 2 + block] = number
    return owner


def _subdivided(lines, parts):
    """Each interval between lines cut into equal parts."""
    lines = np.asarray(lines, dtype=float)
    return np.interp(np.arange(parts * (len(lines) - 1) + 1), parts * np.arange(len(lines)), lines)


def _leaves(depth, most):
    """Cells (c, 3) of one layer: lower corner in half sides of the smallest cell, and half their side in the same unit."""
    leaves = []
    for current in range(most + 1):
        block = 1 << (most - current)
        j, i = np.nonzero(depth[::block, ::block] == current)
        leaves.append(np.column_stack([2 * block * i, 2 * block * j, np.full(len(i), block)]))
    return np.vstack(leaves)


def _hanging(places, hexes, low, half, cells):
    """Hanging nodes (h,): on an element without belonging to it; the largest such element's nodes (h, 20) and weights (h, 20)."""
    starts = np.cumsum([0, *map(len, cells)])
    extent = (low + 2 * half).max(axis=0)
    owner = np.stack([starts[k] + _owners(leaves, (extent[1] // 2, extent[0] // 2)) for k, leaves in enumerate(cells)])
    best = np.full(len(places), -1)
    for dz in (-1, 0):
        layer = (places[:, 2] + dz) // 2
        for dx in (-1, 0):
            for dy in (-1, 0):
                i, j = (places[:, 0] + dx) // 2, (places[:, 1] + dy) // 2
                inside = (layer >= 0) & (layer < len(cells)) & (i >= 0) & (j >= 0) & (i < extent[0] // 2) & (j < extent[1] // 2)
                here = np.flatnonzero(inside)
                element = owner[layer[here], j[here], i[here]]
                foreign = ~(hexes[element] == here[:, None]).any(axis=1)
                larger = foreign & ((best[here] < 0) | (half[element, 0] > half[best[here], 0]))
                best[here[larger]] = element[larger]
    rows = np.flatnonzero(best >= 0)
    element = best[rows]
    parent = (places[rows] - low[element]) / half[element] - 1.0
    return rows, hexes[element], HEX20.shape(parent)[0]


def _resolve(count, rows, masters, weights):
    """Which nodes are free (n,), and the constraint matrix (n, free) from the free nodes to all nodes."""
    free = np.ones(count, dtype=bool)
    free[rows] = False
    small = np.abs(weights) < 1e-12
    entries = (np.where(small, 0.0, weights).ravel(), (np.repeat(rows, masters.shape[1]), masters.ravel()))
    once = sp.csr_matrix(entries, shape=(count, count))
    once.eliminate_zeros()
    once = once + sp.diags(free.astype(float))
    follow = once
    for _ in range(_ROUNDS):
        if not follow[:, ~free].nnz:
            break
        follow = (follow @ once).tocsr()
        follow.data[np.abs(follow.data) < 1e-12] = 0.0
        follow.eliminate_zeros()
    return free, follow[:, free]
