"""One small interface to sparse direct solvers for symmetric matrices: analyse once, factor often.

PARDISO (MKL) where it installs (x86), SuperLU of scipy elsewhere. `solver.name` tells which one it was.
"""

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla


def make_solver():
    """The fastest direct solver that this machine offers."""
    try:
        return PardisoSolver()
    except (ImportError, OSError):   # no MKL for this processor
        return SuperLUSolver()


class PardisoSolver:
    """MKL PARDISO: Cholesky, or Bunch-Kaufman where a matrix is indefinite; the analysis is reused while the pattern stays."""

    name = "pardiso"
    _POSITIVE, _INDEFINITE = 2, -2
    _FACTOR, _SOLVE, _ANALYSE_AND_FACTOR = 22, 33, 12

    def __init__(self):
        self._solvers, self._patterns, self._upper = {}, {}, None
        self._start(self._POSITIVE)

    def _start(self, kind):
        from pypardiso import PyPardisoSolver

        if kind not in self._solvers:
            self._solvers[kind] = PyPardisoSolver(mtype=kind)
        self._current = kind

    def factor(self, upper):
        """Factor the matrix whose upper triangle (csr, sorted, with its diagonal) is given."""
        from pypardiso.pardiso_wrapper import PyPardisoError

        self._upper = upper
        self._start(self._POSITIVE)
        try:
            self._factor()
        except PyPardisoError:
            self._start(self._INDEFINITE)
            self._factor()

    def _factor(self):
        known = self._patterns.get(self._current)
        same = known is not None and known[0] is self._upper.indptr and known[1] is self._upper.indices
        solver = self._solvers[self._current]
        solver.set_phase(self._FACTOR if same else self._ANALYSE_AND_FACTOR)
        solver._call_pardiso(self._upper, np.zeros((self._upper.shape[0], 1)))
        self._patterns[self._current] = (self._upper.indptr, self._upper.indices)

    def solve(self, right):
        """Solve for one (n,) or several (n, k) right-hand sides."""
        solver = self._solvers[self._current]
        solver.set_phase(self._SOLVE)
        columns = np.asfortranarray(right.reshape(len(right), -1))
        return solver._call_pardiso(self._upper, columns).reshape(right.shape)

    def close(self):
        """Free the factors, which live outside Python's memory."""
        for solver in self._solvers.values():
            solver.free_memory(everything=True)
        self._patterns, self._upper = {}, None


class SuperLUSolver:
    """scipy's SuperLU: slower and without a reusable analysis, but everywhere."""

    name = "superlu"

    def factor(self, upper):
        """Factor the matrix whose upper triangle (csr) is given."""
        full = upper + sp.triu(upper, 1).T
        self._lu = spla.splu(full.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.001,
                             options={"SymmetricMode": True})

    def solve(self, right):
        """Solve for one (n,) or several (n, k) right-hand sides."""
        return self._lu.solve(right)

    def close(self):
        """Forget the factors."""
        self._lu = None
