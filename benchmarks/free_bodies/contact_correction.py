"""Contact apart from the factor: the object's contact changes with every step, the rubber's tangent hardly does.

With the rubber's factored tangent K0, a residual r and the contact's nodal forces c(u), a step s is to fulfil
K0 s + r + c(u + s) - c(u) = 0: linear in the rubber, exact in the contact. Of c only the components along one direction per node
enter here (N: the object's normal there), so that s = -K0^-1 r - W p with W = K0^-1 N, and p = N^T (c(u + s) - c(u)) is a small
system: as many unknowns as nodes touch. Columns of W are solved for when a node touches for the first time, and kept when the
factor is renewed: they cost more than a factor, and what they miss is a residual like any other.
"""

from typing import TYPE_CHECKING

import numpy as np

from softtact.linalg.block_tridiagonal import BlockTridiagonalSolver
from softtact.linalg.direct import PardisoSolver, SuperLUSolver

if TYPE_CHECKING:
    from free_bodies.free_body import FreeState, RigidContact

_INNER_ITERATIONS = 15
_INNER_TOLERANCE = 0.02   # of the residual that the step is to cut


class ContactCorrection:
    """Steps with the contact solved exactly over a linear rubber.

    number (n, 3): unknowns of the nodes, -1 where held; contact: the moving `RigidContact`; normals (n, 3): N's directions.
    """

    def __init__(self, solver: PardisoSolver | BlockTridiagonalSolver | SuperLUSolver, number: np.ndarray,
                 contact: "RigidContact", normals: np.ndarray) -> None:
        self._solver, self._contact = solver, contact
        self._size = int(number.max()) + 1
        # Of the whole body only the contact's own nodes matter inside a step; `row` is a node's place among those touched.
        self._near = contact.near_nodes
        self._number, self._normals = number[self._near], normals[self._near]
        self._row = np.full(len(self._near), -1)
        self._touched = np.zeros(0, dtype=np.int64)
        self._columns, self._near_columns = np.zeros((0, self._size)), np.zeros((0, len(self._near), 3))
        self._compliance = np.zeros((0, 0))     # S = N^T W

    def step(self, state: "FreeState", residual: np.ndarray) -> np.ndarray:
        """s (unknowns,) in mm from a `FreeState` and its residual (unknowns,) in N."""
        free = -self._solver.solve(residual)
        now, depth = state.displacement[self._near], state.indentation
        before, away = self._contact.near_force(now, depth), self._at_near(free[None])[0]
        p = self._with_all_that_touch(now, depth, np.zeros(len(self._touched)))
        p = p + self._correction(now, depth, self._stiffness(now, depth) @ self._along(away))
        enough = _INNER_TOLERANCE * float(np.abs(residual).max())
        for _ in range(_INNER_ITERATIONS):
            displacement = now + away - np.tensordot(p, self._near_columns, 1)
            p = self._with_all_that_touch(displacement, depth, p)
            missing = self._along(self._contact.near_force(displacement, depth) - before) - p
            if not np.abs(missing).max(initial=0.0) > enough:
                break
            p = p + self._correction(displacement, depth, missing)
        return free - p @ self._columns

    def _correction(self, displacement, depth, missing):
        """Newton's step of p, whose equation misses `missing` (t,)."""
        return np.linalg.solve(np.eye(len(missing)) + self._stiffness(displacement, depth) @ self._compliance, missing)

    def _at_near(self, fields):
        """Fields (k, unknowns) at the contact's nodes (k, c, 3), zero where held."""
        return np.where(self._number >= 0, fields[:, self._number], 0.0)

    def _along(self, field):
        """Components (t,) of a field (c, 3) along N at the touched nodes, held ones left out."""
        here = self._touched
        return np.where(self._number[here] >= 0, field[here] * self._normals[here], 0.0).sum(axis=1)

    def _with_all_that_touch(self, displacement, depth, p):
        """p with zeros for nodes that touch for the first time, whose columns are solved for."""
        faces, _, _ = self._contact.near_touching(displacement, depth)
        fresh = np.setdiff1d(faces, self._touched)
        if not len(fresh):
            return p
        right = np.zeros((self._size, len(fresh)))
        for axis in range(3):
            rows = self._number[fresh, axis]
            here = np.flatnonzero(rows >= 0)
            right[rows[here], here] = self._normals[fresh[here], axis]
        columns = self._solver.solve(right).T
        self._row[fresh] = len(self._touched) + np.arange(len(fresh))
        self._touched = np.concatenate([self._touched, fresh])
        self._columns = np.vstack([self._columns, columns])
        self._near_columns = np.concatenate([self._near_columns, self._at_near(columns)])
        self._compliance = np.einsum("kcd,cd->ck", self._near_columns[:, self._touched], self._normals[self._touched])
        return np.concatenate([p, np.zeros(len(fresh))])

    def _stiffness(self, displacement, depth):
        """C (t, t) in N/mm: the contact's stiffness between the touched nodes along N."""
        faces, shapes, stiffness = self._contact.near_touching(displacement, depth)
        along = np.einsum("fgmd,fmd->fgm", shapes, self._normals[faces])
        blocks = np.matmul((along * stiffness[..., None]).transpose(0, 2, 1), along)
        C, rows = np.zeros((len(self._touched),) * 2), self._row[faces]
        np.add.at(C, (rows[:, :, None], rows[:, None, :]), blocks)
        return C
