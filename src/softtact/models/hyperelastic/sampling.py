"""Where points lie on the upper and the lower side of a `CoverMesh` over a grid, and what interpolates a field there."""

import numpy as np
import scipy.sparse as sp

from softtact.fem.elements import QUAD8


def located(mesh, faces, cells, lines, points):
    """Numbers (p,) among `faces` (t, 8) of a side and shape values (p, 8) at points (p, 2); those on a line are the lower face's.

    cells (ny 2^m, nx 2^m): which face is where;  lines: the grid's, along x and along y
    """
    fine = cells.shape[0] // (len(lines[1]) - 1)
    i, j = (_place(value, line, fine) for value, line in zip(points.T, lines, strict=True))
    there = cells[j, i]
    low, _, high, _ = mesh.points[faces[there, :4], :2].transpose(1, 0, 2)
    return there, QUAD8.shape(2 * (points - low) / (high - low) - 1)[0]


def interpolation_on_side(mesh, faces, cells, lines, points):
    """Sparse matrix (p, free nodes of the mesh) that interpolates at points (p, 2) on a side; arguments as for `located`."""
    there, values = located(mesh, faces, cells, lines, points)
    rows = np.repeat(np.arange(len(points)), 8)
    all_nodes = sp.csr_matrix((values.ravel(), (rows, faces[there].ravel())), shape=(len(points), len(mesh.points)))
    return without_zeros(all_nodes @ mesh.follow)


def without_zeros(matrix):
    """The sparse matrix without entries that are zero but for rounding."""
    matrix.data[np.abs(matrix.data) < 1e-12] = 0.0
    matrix.eliminate_zeros()
    return matrix.tocsr()


def _place(value, lines, fine):
    """Which interval of lines, each cut into `fine` equal parts, values (p,) lie in."""
    grid = np.interp(np.arange(fine * (len(lines) - 1) + 1), fine * np.arange(len(lines)), lines)
    return np.clip(np.searchsorted(grid, value - 1e-9) - 1, 0, len(grid) - 2)
