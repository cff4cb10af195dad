"""The numbers of a slab's nodes: which of them the sheet's nodes are or follow, and the cover's underside that its top lies on."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from softtact.fem.elements import QUAD8
from softtact.fem.extruded_mesh import HexMesh, SheetMesh2D
from softtact.fem.graded_mesh import CoverMesh

_NO_WEIGHT = 1e-12


@dataclass(frozen=True)
class SheetNodes:
    """Nodes (p,) of the sheet's mesh among those of a slab. The mesh's top follows the cover, the rest has its own unknowns.

    masters (p, w), weights (p, w): numbers of the slab's nodes that each follows; unused places have weight 0
    own (k,): the nodes that follow no others;  number (p,): the slab's number of each of these, -1 for the others
    """

    masters: np.ndarray
    weights: np.ndarray
    own: np.ndarray
    number: np.ndarray

    def like_cells(self, cells: np.ndarray) -> list[np.ndarray]:
        """Numbers of like cells, kind by kind, of cells with nodes (c, k): those whose nodes follow others in the same way."""
        used = np.abs(self.weights) > _NO_WEIGHT
        kinds: dict[bytes, list[int]] = {}
        for number, cell in enumerate(cells):
            _, local = np.unique(np.where(used[cell], self.masters[cell], -1), return_inverse=True)
            signature = local.tobytes() + np.round(self.weights[cell] * used[cell], 9).tobytes()
            kinds.setdefault(signature, []).append(number)
        return [np.array(numbers) for numbers in kinds.values()]


def sheet_nodes(mesh: HexMesh, sheet_2d: SheetMesh2D, *, first: int, above: sp.csr_matrix,
                constrained: bool | np.ndarray | Callable[[np.ndarray], np.ndarray]) -> SheetNodes:
    """`SheetNodes` of the sheet's mesh, lifted from a `SheetMesh2D`.

    first: number of the first node of its own;  above (plane's points, cover's nodes): how its top follows the cover
    constrained: where the edges between cells are curves: everywhere (True), nowhere, or where a function of places (n, 2) says

    Along such an edge, two elements a side, the sheet moves as one quadratic curve: the nodes at the quarters follow the corner,
    the middle and the next corner. (Free quarters: half as many unknowns again, and 1 % softer.)
    """
    top, planes = mesh.planes[-1], mesh.inner_planes
    curve, curve_weights = sheet_2d.quarters
    if callable(constrained):
        constrained = constrained(sheet_2d.mesh_2d.points[curve[:, 0]])
    curve = curve[np.broadcast_to(constrained, len(curve))]
    follows = np.zeros(len(mesh.points), dtype=bool)
    follows[top] = True
    follows[planes[:, curve[:, 0]]] = True
    own = np.flatnonzero(~follows)
    number = np.full(len(mesh.points), -1, dtype=np.int64)
    number[own] = first + np.arange(len(own))
    width = max(int(np.diff(above.indptr).max()), 3)
    masters, weights = np.zeros((len(mesh.points), width), dtype=np.int64), np.zeros((len(mesh.points), width))
    masters[own, 0], weights[own, 0] = number[own], 1.0
    row = np.repeat(np.arange(len(top)), np.diff(above.indptr))
    place = np.arange(above.nnz) - above.indptr[row]
    masters[top[row], place], weights[top[row], place] = above.indices, above.data
    for plane in planes:
        masters[plane[curve[:, 0]], :3] = number[plane[curve[:, 1:]]]
        weights[plane[curve[:, 0]], :3] = curve_weights
    return SheetNodes(masters, weights, own, number)


class CoverSide:
    """The lower or the upper side of a `CoverMesh` between grid lines (mm)."""

    def __init__(self, mesh: CoverMesh, faces: np.ndarray, cells: np.ndarray, x_lines: np.ndarray, y_lines: np.ndarray) -> None:
        """faces (t, 8): of the side;  cells (ny 2^m, nx 2^m): which of them is where"""
        self._mesh, self._faces, self._cells, self._lines = mesh, faces, cells, (x_lines, y_lines)

    def locate(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Faces (p,) of the side and shape values (p, 8) at points (p, 2); points on a line belong to the lower face."""
        cells = self._cells
        fine = cells.shape[0] // (len(self._lines[1]) - 1)
        i, j = (_place(value, lines, fine) for value, lines in zip(points.T, self._lines, strict=True))
        faces = cells[j, i]
        low, _, high, _ = self._mesh.points[self._faces[faces, :4], :2].transpose(1, 0, 2)
        return faces, QUAD8.shape(2 * (points - low) / (high - low) - 1)[0]

    def interpolation(self, points: np.ndarray) -> sp.csr_matrix:
        """Sparse matrix (p, free nodes of the cover) that interpolates on the side at points (p, 2)."""
        mesh, (faces, values) = self._mesh, self.locate(points)
        rows = np.repeat(np.arange(len(points)), 8)
        all_nodes = sp.csr_matrix((values.ravel(), (rows, self._faces[faces].ravel())), shape=(len(points), len(mesh.points)))
        return without_zeros(all_nodes @ mesh.follow)


def _place(value, lines, fine):
    """Which interval of lines, each cut into `fine` equal parts, values (p,) lie in."""
    grid = np.interp(np.arange(fine * (len(lines) - 1) + 1), fine * np.arange(len(lines)), lines)
    return np.clip(np.searchsorted(grid, value - 1e-9) - 1, 0, len(grid) - 2)


def without_zeros(matrix: sp.spmatrix) -> sp.csr_matrix:
    """A sparse matrix without what is round-off of 0, as csr."""
    matrix.data[np.abs(matrix.data) < _NO_WEIGHT] = 0.0
    matrix.eliminate_zeros()
    return matrix.tocsr()
