"""What preconditions a step's Newton systems A + B'.W.B, bordered by the object's indentation increment, for one contact after the
other.

How the object touches changes some seven times within a step and much, the rubber's tangent A hardly in several steps: with A of
a step or two before and the contact of now, conjugate gradients take one to three iterations, the other way round twenty. So the
surface nodes' movements along the object's normals and the indentation increment come last in the elimination. What is left on them
is a dense matrix, small beside the whole; the contact changes that matrix alone, as far as its normals are the nodes' own.
"""

from typing import TYPE_CHECKING

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numba import njit

from softtact.linalg.block_tridiagonal import BlockTridiagonalSolver
from softtact.linalg.direct import PardisoSolver, SuperLUSolver
from softtact.linalg.lapack import factor_in_place
from softtact.linalg.multifrontal_solver import Bordered, DissectedSolver
from softtact.linalg.nodal_frames import NodeFrames
from softtact.linalg.workers import SERIAL, Workers

if TYPE_CHECKING:
    from softtact.models.hyperelastic.newton_step import LinearGaps, _Problem

_ALIKE = 0.002               # of all points' stiffness together: contacts that differ by less are taken for one
_LEAST_CORNER = 1e-9         # N/mm: rounding must not turn the object's own stiffness negative


class ContactFactor:
    """With any solver of `linear_solvers`: a new factor for each contact."""

    def __init__(self, solver: PardisoSolver | BlockTridiagonalSolver | SuperLUSolver | DissectedSolver) -> None:
        self.solver = solver

    def reset(self) -> None:
        """Nothing is kept from one factor to the next."""

    def renew(self, problem: "_Problem", slope: np.ndarray) -> bool:
        """Factor with the rubber's tangent and the points' stiffness (p,) of now; False if that is not positive definite."""
        rows, indentation_increment = problem.points.rows, problem.points.indentation_increment
        border, corner = problem.friction_border
        upper = (problem.rubber + sp.triu(rows.T @ sp.diags_array(slope) @ rows)).tocsr()
        upper.sort_indices()
        if not self.solver.factor(upper):
            return False
        self._border = rows.T @ (slope * indentation_increment) + border
        self._along = self.solver.solve(self._border)
        self._corner = max(slope @ indentation_increment**2 + corner - self._border @ self._along, _LEAST_CORNER)
        return True

    def follow(self, problem: "_Problem", slope: np.ndarray) -> bool:
        """Take over the points' stiffness alone; False if that cannot be done."""
        return self.renew(problem, slope)

    def solve(self, right: np.ndarray, *, held: bool) -> np.ndarray:
        """Solution for forces on the unknowns (n,), or on them and a free object (n + 1,); held: the object stays where it is."""
        inner = self.solver.solve(right[:len(self._border)])
        if len(right) == len(inner):
            return inner
        lowered = 0.0 if held else (right[-1] - self._border @ inner) / self._corner
        return np.append(inner - lowered * self._along, lowered)


class DissectedContact:
    """With a `DissectedSolver`, which leaves what the contact changes for last."""

    _frames: NodeFrames | None
    _points: "LinearGaps | None"
    _slope: np.ndarray | None

    def __init__(self, solver: DissectedSolver, *, workers: Workers = SERIAL) -> None:
        self.solver, self._workers = solver, workers
        self.reset()

    def reset(self) -> None:
        """Forget the nodes' frames, which a factor otherwise takes over from the last one."""
        self._frames, self._points, self._slope = None, None, None

    def renew(self, problem: "_Problem", slope: np.ndarray) -> bool:
        """Factor with the rubber's tangent and the points' stiffness (p,) of now; False if that is not positive definite."""
        self._frames, self._points, self._slope = problem.contact.frames(self._frames), None, None
        border, corner = problem.friction_border
        column = np.append(np.broadcast_to(border, self.solver.unknowns), corner)
        if not self.solver.factor_bordered(Bordered(upper=problem.rubber, column=column, frames=self._frames)):
            return False
        return self.follow(problem, slope)

    def follow(self, problem: "_Problem", slope: np.ndarray) -> bool:
        """Take over the points' stiffness (p,) alone, as far as it acts on what was left; False if not positive definite."""
        if self._slope is not None and np.abs(slope - self._slope).sum() <= _ALIKE * slope.sum():
            return True
        left, border, corner = self._left_with(problem.points, slope)
        self._slope = slope if factor_in_place(left, workers=self._workers) else None
        if self._slope is None:
            return False
        self._lower = left.T
        self._border = self._halfway(border)
        self._corner = max(corner - float(self._border @ self._border), _LEAST_CORNER)
        return True

    def solve(self, right: np.ndarray, *, held: bool) -> np.ndarray:
        """Solution for forces on the unknowns (n,), or on them and a free object (n + 1,); held: the object stays where it is."""
        free = len(right) > self.solver.unknowns
        whole, held = right if free else np.append(right, 0.0), held or not free
        found = self.solver.solve_bordered(whole, lambda rest: self._finish(rest, held))
        return found if free else found[:-1]

    def _finish(self, rest, held):
        half = self._halfway(rest[:-1])
        lowered = 0.0 if held else (float(rest[-1]) - float(self._border @ half)) / self._corner
        inner, _ = scipy.linalg.lapack.strtrs(self._lower, half - np.float32(lowered) * self._border, lower=True, trans=1)
        return np.append(inner, lowered)

    def _halfway(self, right):
        return scipy.linalg.lapack.strtrs(self._lower, right.astype(np.float32), lower=True)[0]

    def _left_with(self, points, slope):
        """What is left with points of a stiffness (p,): the upper triangle on the k movements, the object's column and corner."""
        if self._points is not points:
            self._points, self._rows = points, points.rows @ self._frames.movements(self.solver.unknowns)
        left = self.solver.left
        matrix, border = left[:-1, :-1].copy(), left[:-1, -1] + self._rows.T @ (slope * points.indentation_increment)
        _add_points(matrix, self._rows.indptr, self._rows.indices, self._rows.data, slope)
        return matrix, border, float(left[-1, -1]) + slope @ points.indentation_increment**2


@njit(cache=True, nogil=True)
def _add_points(out, indptr, indices, data, slope):
    """Add the stiffness (p,) of points, whose gaps change with the unknowns by rows (csr), to an upper triangle."""
    for p in range(len(slope)):
        if slope[p] == 0.0:
            continue
        for e in range(indptr[p], indptr[p + 1]):
            weighted, row = slope[p] * data[e], indices[e]
            for f in range(indptr[p], indptr[p + 1]):
                if indices[f] >= row:
                    out[row, indices[f]] += weighted * data[f]
