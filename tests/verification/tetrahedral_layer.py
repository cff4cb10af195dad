"""A linear layer of structured tetrahedra: a second discretisation, beside the elastic model's hexahedra, and as plain as can be.

The whole layer is solved, no symmetry used; the compliance is a dense matrix, which `active_set` takes as it is.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from softtact.linalg.direct import make_solver


@dataclass(frozen=True)
class DenseCompliance:
    """points (n, 2): the top's free nodes in mm; compliance (n, n) downwards in mm/N; area (n,) in mm2 that each stands for."""

    points: np.ndarray
    compliance: np.ndarray
    area: np.ndarray


def tetrahedra(x, y, z):
    """A box of grid lines cut into six tetrahedra a cell (Kuhn): points (n, 3), tetrahedra (t, 4). z ends at 0."""
    gz, gy, gx = np.meshgrid(z, y, x, indexing="ij")
    points = np.column_stack([gx.ravel(), gy.ravel(), gz.ravel()])
    number = np.arange(len(points)).reshape(gx.shape)
    corner = [number[k:len(z) - 1 + k, j:len(y) - 1 + j, i:len(x) - 1 + i].ravel()
              for k in (0, 1) for j in (0, 1) for i in (0, 1)]
    paths = [(0, 1, 3, 7), (0, 3, 2, 7), (0, 2, 6, 7), (0, 6, 4, 7), (0, 4, 5, 7), (0, 5, 1, 7)]
    return points, np.vstack([np.stack([corner[c] for c in path], axis=1) for path in paths])


def layer_compliance(x, y, z, *, young, poisson):
    """Compliance of a box of grid lines, held at base and sides as the elastic model has it."""
    points, tets = tetrahedra(x, y, z)
    return surface_compliance(points, tets, young_mpa=young, poisson=poisson)


def linear_stiffness(points, tets, *, young_mpa, poisson):
    """Stiffness matrix (3 n, 3 n) in N/mm of linear tetrahedra (constant strain, Hooke's law)."""
    edges = points[tets[:, 1:]] - points[tets[:, :1]]
    volume = np.linalg.det(edges) / 6
    gradients = np.linalg.inv(edges).transpose(0, 2, 1)                      # rows: grad N_1..3
    gradients = np.concatenate([-gradients.sum(axis=1, keepdims=True), gradients], axis=1)
    mu = young_mpa / (2 * (1 + poisson))
    lam = young_mpa * poisson / ((1 + poisson) * (1 - 2 * poisson))
    outer = np.einsum("tai,tbj->taibj", gradients, gradients)
    blocks = lam * outer + mu * outer.transpose(0, 1, 4, 3, 2)
    blocks += mu * np.einsum("tak,tbk,ij->taibj", gradients, gradients, np.eye(3))
    blocks *= volume[:, None, None, None, None]
    dofs = (3 * tets[:, :, None] + np.arange(3)).reshape(len(tets), 12)
    rows, columns = np.repeat(dofs, 12, axis=1), np.tile(dofs, (1, 12))
    size = 3 * len(points)
    return sp.csr_matrix((blocks.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))


def surface_compliance(points, tets, *, young_mpa, poisson, chunk=256):
    """`DenseCompliance` of a layer's top (z = 0), one solution for each of its free nodes."""
    low, high = points.min(axis=0), points.max(axis=0)
    tolerance = 1e-6 * (high - low).max()
    held = (points[:, 2] < low[2] + tolerance)
    held |= ((points < low + tolerance) | (points > high - tolerance))[:, :2].any(axis=1)
    top = np.flatnonzero((points[:, 2] > high[2] - tolerance) & ~held)
    free = np.flatnonzero(np.repeat(~held, 3))
    upper = sp.triu(linear_stiffness(points, tets, young_mpa=young_mpa, poisson=poisson)[free][:, free], format="csr")
    upper.sort_indices()
    solver = make_solver()
    solver.factor(upper)
    position = np.searchsorted(free, 3 * top + 2)
    compliance = np.empty((len(top), len(top)))
    for start in range(0, len(top), chunk):
        part = position[start:start + chunk]
        right = np.zeros((len(free), len(part)))
        right[part, np.arange(len(part))] = 1.0
        compliance[:, start:start + chunk] = solver.solve(right)[position]
    solver.close()
    return DenseCompliance(points[top, :2], 0.5 * (compliance + compliance.T), _top_areas(points, tets, high[2] - tolerance)[top])


def _top_areas(points, tets, height):
    """Area (n,) of a node's share of the triangles above `height`."""
    faces = tets[:, [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]].reshape(-1, 3)
    faces = faces[(points[faces, 2] > height).all(axis=1)]
    a, b = (points[faces[:, k], :2] - points[faces[:, 0], :2] for k in (1, 2))
    area = np.zeros(len(points))
    np.add.at(area, faces.ravel(), np.repeat(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 6, 3))
    return area
