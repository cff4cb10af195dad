"""How a layer of elastomer deforms: linear elasticity, bonded to its board, its sides free.

The papers' own analysis: a secant modulus at the load (Le et al. 2011, sec. III), small strains. `Deforms` is what another model of
the solid has to offer in its place.
"""

from functools import cached_property
from typing import Protocol

import numpy as np
import scipy.sparse as sp
from skfem import BilinearForm

from softtact.linalg.direct import make_solver
from softtact.skin.layer_mesh import LayerMesh
from softtact.skin.loads import Load


class Deforms(Protocol):
    """A layer that gives way to a load."""

    def displacement(self, load: Load, *, young_mpa: float) -> np.ndarray:
        """Displacement (node, 3) in mm of the nodes of its mesh."""

    def at(self, points_mm: np.ndarray, displacement_mm: np.ndarray) -> np.ndarray:
        """Displacement (n, 3) at points (n, 3), of that of the nodes."""


class ElasticLayer:
    """A layer of one Poisson's ratio; factored once, for any load and any modulus.

    Displacements are inversely proportional to Young's modulus, so that all is kept for 1 MPa.
    """

    def __init__(self, mesh: LayerMesh, *, poisson: float, threads: int = 1) -> None:
        self.mesh, self.poisson, self._threads = mesh, poisson, threads
        nodes = len(mesh.nodes_mm)
        free = np.setdiff1d(np.arange(nodes), mesh.floor)
        self._free = (free + nodes * np.arange(3)[:, None]).ravel()  # all along x, then y, then z

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
        """Displacement (n, 3) at points (n, 3), of that of the nodes."""
        return self.mesh.interpolation(points_mm) @ displacement_mm

    def under(self, points_mm: np.ndarray) -> sp.csr_matrix:
        """Values at points (n, 2) of the upper side from those at the nodes, as a matrix (n, node)."""
        return self.mesh.interpolation(np.column_stack([points_mm, np.full(len(points_mm), self.mesh.levels_mm[-1])]))

    @cached_property
    def _solver(self):
        solver = make_solver(threads=self._threads)
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
    """The upper triangle, as `softtact.linalg.direct` takes it."""
    upper = sp.triu(matrix).tocsr()
    upper.sort_indices()
    return sp.csr_matrix((upper.data, upper.indices.astype(np.int32), upper.indptr.astype(np.int32)), shape=upper.shape)
