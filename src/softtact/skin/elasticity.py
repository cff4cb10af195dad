"""Deformation of a layer of elastomer: linear elasticity, bonded to its board, with free sides.

The analysis of the papers: small strains, with a secant modulus at the load (Le et al. 2011, sec. III).
"""

from functools import cached_property

import numpy as np
import scipy.sparse as sp
from skfem import BilinearForm

from softtact.linalg.direct import make_solver
from softtact.skin.layer_mesh import LayerMesh
from softtact.skin.loads import Load


class BondedLayer:
    """A layer of one Poisson's ratio, factorised once for all loads and moduli.

    Displacements are inversely proportional to Young's modulus, so stiffness and factors are those of 1 MPa.
    """

    def __init__(self, mesh: LayerMesh, *, poisson: float) -> None:
        self.mesh, self.poisson = mesh, poisson
        nodes = len(mesh.nodes_mm)
        free = np.setdiff1d(np.arange(nodes), mesh.floor)
        self._free = (free + nodes * np.arange(3)[:, None]).ravel()  # first x of all nodes, then y, then z

    def displacement(self, load: Load, *, young_mpa: float) -> np.ndarray:
        """Displacement (node, 3) in mm of the nodes."""
        nodal = np.zeros_like(self.mesh.nodes_mm)
        nodal[:, 2] = -(self.under(load.points_mm).T @ load.force_n)
        return self.respond(nodal) / young_mpa

    def respond(self, nodal_n: np.ndarray) -> np.ndarray:
        """Displacement (node, 3) in mm under forces (node, 3) in N, or several of both as (node, 3, k), for a modulus of 1 MPa."""
        right = np.moveaxis(nodal_n, 1, 0).reshape(nodal_n.shape[0] * 3, -1)
        found = np.zeros_like(right)
        found[self._free] = self._solver.solve(np.ascontiguousarray(right[self._free]))
        return np.moveaxis(found.reshape(3, nodal_n.shape[0], *nodal_n.shape[2:]), 0, 1)

    def at(self, points_mm: np.ndarray, displacement_mm: np.ndarray) -> np.ndarray:
        """Displacement (n, 3) at points (n, 3), interpolated from that of the nodes."""
        return self.mesh.interpolation(points_mm) @ displacement_mm

    def under(self, points_mm: np.ndarray) -> sp.csr_matrix:
        """Matrix (n, node) that interpolates values from the nodes to points (n, 2) of the upper side."""
        return self.mesh.interpolation(np.column_stack([points_mm, np.full(len(points_mm), self.mesh.levels_mm[-1])]))

    @cached_property
    def _solver(self):
        solver = make_solver()     # on one thread: on more, its sums, and so the last digits, depend on their number
        if not solver.factor(upper_triangle(self._stiffness[self._free][:, self._free])):
            raise ArithmeticError("The layer's stiffness is not positive definite.")
        return solver

    @cached_property
    def _stiffness(self):
        """For a modulus of 1 MPa: (lam (div u)(div v) + 2 mu e(u) : e(v)), from products of derivatives along x, y, z."""
        mu, lam = 0.5 / (1 + self.poisson), self.poisson / ((1 + self.poisson) * (1 - 2 * self.poisson))
        along = {(i, j): BilinearForm(_product(i, j)).assemble(self.mesh.basis) for i in range(3) for j in range(i, 3)}
        along |= {(j, i): matrix.T for (i, j), matrix in along.items() if i != j}
        shear = mu * sum(along[i, i] for i in range(3))
        return sp.bmat(
            [[lam * along[i, j] + mu * along[j, i] + (shear if i == j else 0 * shear) for j in range(3)] for i in range(3)]
        ).tocsr()


def _product(i, j):
    """Integrand of row v, column u: derivative of v along i times that of u along j."""
    return lambda u, v, w: v.grad[i] * u.grad[j]


def upper_triangle(matrix: sp.csr_matrix) -> sp.csr_matrix:
    """The upper triangle, in the format that `softtact.linalg.direct` takes."""
    upper = sp.triu(matrix).tocsr()
    upper.sort_indices()
    return sp.csr_matrix((upper.data, upper.indices.astype(np.int32), upper.indptr.astype(np.int32)), shape=upper.shape)
