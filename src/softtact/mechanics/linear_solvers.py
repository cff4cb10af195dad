"""One small interface to sparse direct solvers for symmetric matrices: analyse once, factor often.

PARDISO (MKL) where it installs (x86), SuperLU of scipy elsewhere. `solver.name` tells which one it was.
"""

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla


def make_solver(*, threads=1, rough=False):
    """The fastest direct solver that this machine offers; `rough`: seven digits will do, for steps that are corrected."""
    try:
        if rough:
            from softtact.mechanics.rough_solver import RoughSolver

            return RoughSolver(threads=threads)
        return PardisoSolver(threads=threads)
    except (ImportError, OSError):   # no MKL for this processor
        return SuperLUSolver()


class PardisoSolver:
    """MKL PARDISO's Cholesky; the analysis is reused while the pattern stays."""

    name = "pardiso"
    _POSITIVE, _FACTOR, _SOLVE, _ANALYSE_AND_FACTOR = 2, 22, 33, 12
    # Entries of iparm, counted from 0: own values, METIS on one thread (the same order whatever the number of threads), and no
    # iterative refinement, which makes a solve four times as long for digits that Newton's method does not need.
    _PARAMETERS = {0: 1, 1: 2, 7: 0, 17: -1, 18: -1}

    def __init__(self, *, threads=1):
        from pypardiso import PyPardisoSolver

        self._solver, self._pattern, self._upper = PyPardisoSolver(mtype=self._POSITIVE), None, None
        self._threads = threads
        for entry, value in self._PARAMETERS.items():
            self._solver.set_iparm(entry + 1, value)

    def factor(self, upper):
        """Factor the matrix whose upper triangle (csr, sorted, with its diagonal) is given; False if not positive definite."""
        from pypardiso.pardiso_wrapper import PyPardisoError

        self._upper = upper
        pattern = (upper.indptr, upper.indices)
        same = self._pattern is not None and all(a is b for a, b in zip(pattern, self._pattern, strict=True))
        self._solver.set_phase(self._FACTOR if same else self._ANALYSE_AND_FACTOR)
        try:
            self._call(upper, np.zeros((upper.shape[0], 1)))
        except PyPardisoError:
            return False
        self._pattern = pattern
        return True

    def solve(self, right):
        """Solve for one (n,) or several (n, k) right-hand sides."""
        self._solver.set_phase(self._SOLVE)
        columns = np.asfortranarray(right.reshape(len(right), -1))
        return self._call(self._upper, columns).reshape(right.shape)

    def _call(self, upper, columns):
        """PARDISO on its own number of threads, whatever limit holds for the small products around it."""
        before = self._solver.libmkl.MKL_Set_Num_Threads_Local(self._threads)
        try:
            return self._solver._call_pardiso(upper, columns)
        finally:
            self._solver.libmkl.MKL_Set_Num_Threads_Local(before)

    def close(self):
        """Free the factors, which live outside Python's memory."""
        self._solver.free_memory(everything=True)
        self._pattern, self._upper = None, None


class SuperLUSolver:
    """scipy's SuperLU: slower and without a reusable analysis, but everywhere."""

    name = "superlu"

    def factor(self, upper):
        """Factor the matrix whose upper triangle (csr) is given; False if not positive definite."""
        full = upper + sp.triu(upper, 1).T
        self._lu = spla.splu(full.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                             options={"SymmetricMode": True})
        # Pivots from the diagonal, whose signs are those of the eigenvalues (Sylvester's law of inertia).
        return bool((self._lu.U.diagonal() > 0).all())

    def solve(self, right):
        """Solve for one (n,) or several (n, k) right-hand sides."""
        return self._lu.solve(right)

    def close(self):
        """Forget the factors."""
        self._lu = None
