"""Systems with a sequence of symmetric matrices: conjugate gradients, preconditioned by a factor in single precision.

A factor in single precision takes a fraction of the time and memory of one in double precision. A solve with it leaves an error of
3e-4 in the energy norm (`multifrontal`), two leave 1e-7. A solve takes a fiftieth of a factor's time or less. So the factor of an
earlier matrix is used as long as its additional solves take less time than a new factor
(docs/notebook/2026-11-26-solids-in-single-precision.md).
Where single precision has too few digits, as for a stiff plate on a soft gel, factors have double precision.
Large matrices of quadratic elements are solved without a factor of the whole (`two_levels`) as long as that takes few steps.
Reference: Saad, Iterative Methods for Sparse Linear Systems, 2nd ed. (2003), section 9.2.
"""

from functools import partial

import numpy as np
import scipy.sparse as sp

from softtact.linalg.block_tridiagonal import BlockTridiagonalSolver
from softtact.linalg.direct import PardisoSolver, make_solver
from softtact.linalg.multifrontal_solver import DissectedSolver
from softtact.linalg.symmetric_product import SymmetricProduct
from softtact.linalg.two_levels import TwoLevels
from softtact.linalg.workers import SERIAL, Workers

_LAST_CORRECTION = 1e-3  # of the solution's energy norm; the error left is that times the error of a solve
_OLD_FACTOR = 0.6   # of a factor's time: solves with an old factor that take more are given up
_MOST_STEPS = 30    # with the factor of the same matrix; a matrix that takes more needs double precision
_MOST_CYCLES = 30   # of two levels; a matrix that takes more is factored


class _Indefinite(Exception):
    """The matrix has a direction of negative curvature."""


class RefinedSolver:
    """Solves on two levels of nodes, with a factor of this or an earlier matrix in single precision, or in double precision."""

    _exact: PardisoSolver | BlockTridiagonalSolver | None
    _levels: TwoLevels | None     # None once they failed
    _product: tuple[tuple[np.ndarray, np.ndarray], SymmetricProduct] | None     # of the last pattern

    def __init__(self, places: np.ndarray, *, lift: sp.csr_matrix | None = None, workers: Workers = SERIAL) -> None:
        """places (n, 2 or 3): position of each unknown in mm;  lift (n, c): prolongation from the corners of quadratic elements to
        all unknowns, where the systems are to be solved on these two levels"""
        self._workers, self._product = workers, None
        self._quick, self._exact = DissectedSolver(places, workers=workers), None
        self._levels = TwoLevels(places, lift, workers=workers) if lift is not None else None
        self._factor_use: _FactorUse | None = None     # of the current factor

    @property
    def name(self) -> str:
        if self._levels is not None:
            return "conjugate gradients, " + self._levels.name
        return "conjugate gradients, " + self._quick.name if self._exact is None else self._exact.name

    def solve(self, upper: sp.csr_matrix, right: np.ndarray, *, doubt: bool = False, factored: bool = False) -> np.ndarray | None:
        """Solve a matrix, given by its upper triangle (csr, sorted, with its diagonal), for right-hand sides (n, k).

        None if it is not positive definite;  doubt: whether that is to be confirmed in double precision;  factored: whether
        `precondition` is to be as good as a factor
        """
        if self._exact is not None:
            return self._exact.solve(right) if self._exact.factor(upper) else None
        try:
            found = None if factored else self._with_levels(upper, right, doubt)
            if found is None:
                found = self._with_old_factor(upper, right)
            if found is None:
                found = self._with_new_factor(upper, right)
        except _Indefinite:
            return None
        if found is None and (doubt or self._factor_use is not None):
            found = self._in_double(upper, right)
        return found

    def _with_levels(self, upper, right, doubt):
        """The solutions on two levels, None where these fail or take too many steps; then they are not used again."""
        if self._levels is None:
            return None
        found, product = None, partial(self.product, upper)
        if self._levels.factor(upper, product):
            found, _ = self._refined(product, right, self._levels.solve, _MOST_CYCLES * right.shape[1])
        elif not doubt:
            raise _Indefinite
        if found is None:
            self._levels.close()
            self._levels = None
        return found

    def _with_old_factor(self, upper, right):
        if self._factor_use is None or self._factor_use.renewal_due:
            return None
        return self._with_factor(upper, right, int(_OLD_FACTOR * self._quick.solves_per_factor))

    def _with_new_factor(self, upper, right):
        self._factor_use = _FactorUse(self._quick.solves_per_factor) if self._quick.factor(upper) else None
        return None if self._factor_use is None else self._with_factor(upper, right, _MOST_STEPS * right.shape[1])

    def _with_factor(self, upper, right, most):
        found, steps = self._refined(partial(self.product, upper), right, self._quick.solve, most)
        self._factor_use.add(steps)
        return found

    def _in_double(self, upper, right):
        """The solutions with a factor in double precision, which all later systems get, too, if the matrix is positive definite."""
        exact = make_solver(threads=self._workers.threads)
        if not exact.factor(upper):
            exact.close()
            return None
        self.close()
        self._exact = exact
        return exact.solve(right)

    def product(self, upper: sp.csr_matrix, x: np.ndarray) -> np.ndarray:
        """Product (n,) of a matrix, given by its upper triangle as for `solve`, and x (n,)."""
        pattern = upper.indptr, upper.indices
        if self._product is None or not all(a is b for a, b in zip(pattern, self._product[0], strict=True)):
            self._product = pattern, SymmetricProduct(*pattern)
        return self._product[1](upper.data, x, workers=self._workers)

    def precondition(self, right: np.ndarray) -> np.ndarray:
        """An approximate solution (n,) with the last matrix, by the current factor."""
        return self._quick.solve(right) if self._exact is None else self._exact.solve(right)

    @staticmethod
    def _refined(product, right, precondition, most):
        """The solutions (n, k) by conjugate gradients, None where they take more than `most` steps together; and the steps."""
        found, steps = np.empty_like(right), 0
        for k in range(right.shape[1]):
            one, taken = _conjugate_gradients(product, right[:, k], precondition, most - steps)
            steps += taken
            if one is None:
                return None, steps
            found[:, k] = one
        return found, steps

    def close(self) -> None:
        """Forget the factors."""
        for solver in (self._levels, self._quick, self._exact):
            if solver is not None:
                solver.close()
        self._factor_use = None


class _FactorUse:
    """The cost of the systems since a factor: a new one is due when the last system took more than the average, factor included."""

    def __init__(self, factor):
        """factor: its cost in solves"""
        self.spent, self.systems, self.renewal_due = factor, 0, False

    def add(self, solves):
        self.spent, self.systems = self.spent + solves, self.systems + 1
        self.renewal_due = solves * self.systems > self.spent


def _conjugate_gradients(product, right, precondition, most):
    """The solution (n,), None if it has not converged after `most` steps; and the steps."""
    found, rest, direction, before, first = np.zeros_like(right), right.copy(), np.zeros_like(right), 1.0, 0.0
    for step in range(most):
        correction = precondition(rest)
        size = float(rest @ correction)     # square of the error's energy norm, estimated by the factor
        first = first or size
        if size > 0.0:
            direction = correction + (size / before) * direction
            force = product(direction)
            stiffness = float(direction @ force)
            if stiffness <= 0.0:
                raise _Indefinite
            found += (size / stiffness) * direction
            rest -= (size / stiffness) * force
            before = size
        if size <= _LAST_CORRECTION**2 * first:
            return found, step + 1
    return None, most
