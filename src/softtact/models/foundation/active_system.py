"""The forces of the active patches and frusta of a load step: a dense system that changes little from one step to the next.

Solved by conjugate gradients, preconditioned with the Cholesky factor of an earlier step's system. Rows that have come or gone
since then, or whose spring is quite another, border the factor, so that smaller changes of the springs are left to the iterations.
The total force is kept by the preconditioner, with the object's depth as the multiplier of this constraint (projected conjugate
gradients: Gould, Hribar and Nocedal, SIAM J. Sci. Comput. 23 (2001) 1376).
The matrix is in single precision; displacements are summed up from products with changes of the forces.
"""

import numpy as np
import scipy.linalg as sla
from scipy.linalg.blas import strsv

_ITERATIONS = 12       # after which the system is factored anew; from a fresh factor two suffice
_BORDER = 0.1          # of the rows: changes from which on a new factor is cheaper than a border
_RESOLVED = 1e-7       # of the total force: single precision resolves no smaller error
_SPRING = 2.0          # of a row's own compliance: change of its spring from which on it counts as another row


class ActiveSystem:
    """Solves (A + diag(spring)) x = right + depth e,  e.x = total, for the active rows of a matrix A (n, n) in mm/N.

    e is 1 for the rows before `first_frustum`, the patches, which the object loads, and 0 for others
    """

    def __init__(self, matrix: np.ndarray, first_frustum: int) -> None:
        self._matrix, self._own = matrix, np.diag(matrix).astype(float)
        self._factor: _Factor | None = None
        self._loaded = np.arange(len(matrix)) < first_frustum

    def solve(self, rows: np.ndarray, spring: np.ndarray, right: np.ndarray, start: np.ndarray, total: float,
              enough: float) -> tuple[np.ndarray, np.ndarray, float]:
        """Forces x (n,) in N, to within about `enough` N, their displacements A x (n,) in mm, and the depth in mm.

        rows (r,): those that are active, rising; others carry no force;  spring (n,): in mm/N;  right (n,): in mm
        start (n,): forces near the solution. Raises LinAlgError where the system is not positive definite.
        """
        factor, enough = None if self._factor is None else self._factor.bordered(rows, spring), max(enough, _RESOLVED * total)
        if factor is not None and (found := self._iterate(factor, rows, spring, right, start, total, enough)):
            return found
        self._factor = factor = _Factor(self._matrix, self._own, rows, spring)
        if (found := self._iterate(factor, rows, spring, right, start, total, enough)) is None:
            raise sla.LinAlgError("The system is too far from positive definite for single precision.")
        return found

    def _iterate(self, factor, rows, spring, right, start, total, enough):
        """What `solve` returns, or None where too many iterations would be needed."""
        spring, loaded, right = spring[rows], self._loaded[rows].astype(float), right[rows]
        per_depth = factor.solve(loaded)
        if not (stiffness := loaded @ per_depth) > 0:
            return None
        x = start[rows] + (total - loaded @ start[rows]) / stiffness * per_depth
        moved = self._product(rows, x)
        residual, direction, before, depth = right - moved[rows] - spring * x, np.zeros(len(x)), 1.0, 0.0
        for _ in range(_ITERATIONS):
            step = factor.solve(residual)
            further_down = -(loaded @ step) / stiffness
            step += further_down * per_depth
            depth, residual = depth + further_down, residual + further_down * loaded     # what is left is small in single precision
            if np.abs(step).max() <= enough:
                forces = np.zeros(len(moved))
                forces[rows] = x
                return forces, moved, depth
            now = residual @ step
            direction = step + now / before * direction
            further = self._product(rows, direction)
            resisted = further[rows] + spring * direction
            if not (now > 0 and (curvature := direction @ resisted) > 0):
                return None
            share, before = now / curvature, now
            x, moved, residual = x + share * direction, moved + share * further, residual - share * resisted
        return None

    def _product(self, rows, x):
        """Displacements (n,) under forces x (r,) of some rows."""
        forces = np.zeros(len(self._matrix), dtype=np.float32)
        forces[rows] = x
        return (self._matrix @ forces).astype(float)


class _Factor:
    """The inverse of the system of some rows and springs, by its Cholesky factor in single precision."""

    def __init__(self, matrix, own, rows, spring):
        self.matrix, self.rows, self._spring, self._own = matrix, rows, spring, own
        system, place = matrix[np.ix_(rows, rows)], np.arange(len(rows))
        system[place, place] += spring[rows].astype(np.float32)
        self._upper, _ = sla.cho_factor(system.T, lower=False, overwrite_a=True, check_finite=False)     # in LAPACK's order
        self._borders: dict[int, tuple[np.ndarray, np.ndarray]] = {}

    def solve(self, right):
        """The solution (r,), in single precision."""
        return strsv(self._upper, strsv(self._upper, right.astype(np.float32), trans=1)).astype(float)

    def bordered(self, rows, spring):
        """The inverse for other rows and springs, or None where too many of them have changed."""
        alike = np.abs(spring - self._spring) <= _SPRING * (self._own + np.minimum(spring, self._spring))
        kept = np.isin(self.rows, rows) & alike[self.rows]
        old = np.isin(rows, self.rows[kept])
        if (~old).sum() + (~kept).sum() > _BORDER * len(self.rows):
            return None
        return self if old.all() and kept.all() else _Bordered(self, rows, kept, old, spring)

    def borders(self, new, gone):
        """Columns (r, k) that border the system, and the solutions (r, k) for them: those of new rows (j,) of the matrix, and unit
        vectors for the places of rows that are gone. Both are kept, as most serve several steps.
        """
        keys = [*new.tolist(), *(-1 - gone).tolist()]
        if missing := [key for key in keys if key not in self._borders]:
            columns = np.zeros((len(self.rows), len(missing)), dtype=np.float32, order="F")
            for column, key in zip(columns.T, missing, strict=True):
                if key >= 0:
                    column[:] = self.matrix[key, self.rows]
                else:
                    column[-1 - key] = 1.0
            solved = sla.cho_solve((self._upper, False), columns, check_finite=False)
            self._borders |= zip(missing, zip(columns.T, solved.T, strict=True), strict=True)
        return (np.stack([self._borders[key][part] for key in keys], axis=1) for part in (0, 1))


class _Bordered:
    """The inverse of a factored system to which new rows have come, and whose rows that are gone are held at no force."""

    def __init__(self, factor, rows, kept, old, spring):
        self._factor, self._kept, self._old, new, gone = factor, kept, old, rows[~old], np.flatnonzero(~kept)
        self._border, self._inside = factor.borders(new, gone)
        corner, self._new = -self._border.T @ self._inside, slice(len(new))
        corner[self._new, self._new] += factor.matrix[np.ix_(new, new)] + np.diag(spring[new])
        self._corner = sla.lu_factor(corner, check_finite=False)

    def solve(self, right):
        """The solution (r,)."""
        inner, outer = np.zeros(len(self._border)), np.zeros(self._border.shape[1])
        inner[self._kept], outer[self._new] = right[self._old], right[~self._old]
        inner = self._factor.solve(inner)
        outer = sla.lu_solve(self._corner, outer - self._border.T @ inner, check_finite=False)
        out = np.empty(len(right))
        out[self._old], out[~self._old] = (inner - self._inside @ outer)[self._kept], outer[self._new]
        return out
