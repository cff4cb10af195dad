"""One small interface to sparse direct solvers for symmetric matrices: analyse once, factor often.

PARDISO (MKL) where it is installed, dense blocks of LAPACK elsewhere; `solver.name` names the one in use. A press takes
`multifrontal_solver`, which uses the positions of the unknowns.

PARDISO's Cholesky factor in single precision takes half the time and memory, for steps that are corrected by a residual in double
precision. It suffices where the matrix's condition stays well below 1e7; else these steps do not reduce the residual.
"""

import ctypes
import importlib.metadata
import os
import weakref

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from softtact.linalg.block_tridiagonal import BlockTridiagonalSolver

_ORDERING, _SINGLE = 2, 28   # numbers of PARDISO's input parameters, counted from 1
_MINIMUM_DEGREE = 0


def make_solver(*, threads: int = 1) -> "PardisoSolver | BlockTridiagonalSolver":
    """The fastest direct solver for any matrix that this machine offers."""
    try:
        return PardisoSolver(threads=threads)
    except (ImportError, OSError):   # MKL is not installed, or not made for this processor
        return BlockTridiagonalSolver()


def _pypardiso(mtype):
    """A solver of pypardiso, which searches all folders for MKL each time (about a second) unless its path is given."""
    from pypardiso import PyPardisoSolver

    point_at_mkl()
    solver = PyPardisoSolver(mtype=mtype)
    os.environ.setdefault("PYPARDISO_MKL_RT", solver.libmkl._name)
    return solver


class PardisoSolver:
    """MKL PARDISO's Cholesky; the analysis is reused while the pattern stays."""

    name = "pardiso"
    precision: type[np.floating] = np.float64
    _POSITIVE, _FACTOR, _SOLVE, _ANALYSE_AND_FACTOR, _NO_MEMORY = 2, 22, 33, 12, -2
    # Entries of iparm, counted from 0: no default values, METIS on one thread (the same order whatever the number of threads), and
    # no iterative refinement, which makes a solve four times as long for digits that Newton's method does not need.
    _PARAMETERS = {0: 1, 1: 2, 7: 0, 17: -1, 18: -1}
    _REPRODUCIBLE_ON = 33     # the entry of iparm with the number of threads on which each run makes its sums in the same order
    _FROM_ZERO = 34     # the entry of iparm that lets rows and columns be counted from 0
    _pattern: tuple[np.ndarray, np.ndarray] | None

    def __init__(self, *, threads: int = 1) -> None:
        self._solver, self._pattern, self._upper, self._converted = _pypardiso(self._POSITIVE), None, None, None
        self._threads = threads
        for entry, value in self._PARAMETERS.items():
            self._solver.set_iparm(entry + 1, value)
        self._solver.set_iparm(self._FROM_ZERO + 1, 1)
        if threads > 1:
            self._solver.set_iparm(self._REPRODUCIBLE_ON + 1, threads)
        # Factors live outside Python's memory, where they would outlive a solver that nobody closed.
        weakref.finalize(self, self._solver.free_memory, everything=True).atexit = False

    def factor(self, upper: sp.csr_matrix) -> bool:
        """Factor the matrix whose upper triangle (csr, sorted, with its diagonal) is given; False if not positive definite."""
        pattern = (upper.indptr, upper.indices)
        if any(array.dtype != np.int32 for array in pattern):
            raise TypeError(f"PARDISO takes indices of 32 bits, not {upper.indptr.dtype} and {upper.indices.dtype}.")
        upper = self._upper = self._in_precision(upper)
        same = self._pattern is not None and all(a is b for a, b in zip(pattern, self._pattern, strict=True))
        _, fault = self._call(self._FACTOR if same else self._ANALYSE_AND_FACTOR, np.zeros((upper.shape[0], 1), self.precision))
        if fault == self._NO_MEMORY:
            raise MemoryError(f"There is no memory for PARDISO's factor of {upper.shape[0]} unknowns. Press with a coarser mesh.")
        if fault:
            return False
        self._pattern = pattern
        return True

    def _in_precision(self, upper):
        """The matrix with values as the solver takes them, the same object for each matrix that has to be converted."""
        if upper.dtype == self.precision:
            return upper
        if self._converted is None or self._converted.nnz != upper.nnz:
            self._converted = sp.csr_matrix((upper.data.astype(self.precision), upper.indices, upper.indptr), shape=upper.shape)
        self._converted.data[:] = upper.data
        return self._converted

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve for one (n,) or several (n, k) right-hand sides."""
        found, fault = self._call(self._SOLVE, np.asfortranarray(right.reshape(len(right), -1), dtype=self.precision))
        if fault:
            raise ArithmeticError(f"PARDISO could not solve with its factor (its error {fault}).")
        return np.ascontiguousarray(found).reshape(right.shape)

    def _call(self, phase, columns):
        """PARDISO's solution for columns (n, k), in Fortran's order, and its error.

        It runs on `threads` threads, whatever limit holds for the small products around it. The call of pypardiso is avoided: it
        copies the pattern twice each time, which takes half of the time of a solve.
        """
        solver, upper = self._solver, self._upper
        found, fault = np.empty_like(columns), ctypes.c_int32(0)
        numbers = [ctypes.byref(ctypes.c_int32(n)) for n in (1, 1, solver.mtype, phase, len(columns), columns.shape[1], 0)]
        pt, values, starts, places, order, iparm, right, out = (
            array.ctypes.data_as(kind) for array, kind in zip(
                (solver.pt, upper.data, upper.indptr, upper.indices, solver.perm, solver.iparm, columns, found),
                [solver._mkl_pardiso.argtypes[k] for k in (0, 6, 7, 8, 9, 11, 13, 14)], strict=True))
        before = solver.libmkl.MKL_Set_Num_Threads_Local(self._threads)
        solver._mkl_pardiso(pt, *numbers[:5], values, starts, places, order, numbers[5], iparm, numbers[6], right, out,
                            ctypes.byref(fault))
        solver.libmkl.MKL_Set_Num_Threads_Local(before)
        return found, fault.value

    def close(self) -> None:
        """Free the factors, which live outside Python's memory."""
        self._solver.free_memory(everything=True)
        self._pattern, self._upper = None, None


class SuperLUSolver:
    """scipy's SuperLU: slow, but for any matrix and on any machine; the reference for the other solvers."""

    name = "superlu"

    def factor(self, upper: sp.csr_matrix) -> bool:
        """Factor the matrix whose upper triangle (csr) is given; False if not positive definite."""
        full = (upper + sp.triu(upper, 1).T).astype(float)
        self._lu = spla.splu(full.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                             options={"SymmetricMode": True})
        # Pivots from the diagonal, whose signs are those of the eigenvalues (Sylvester's law of inertia).
        return bool((self._lu.U.diagonal() > 0).all())

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve for one (n,) or several (n, k) right-hand sides."""
        return self._lu.solve(right)

    def close(self) -> None:
        """Forget the factors."""
        self._lu = None


class PardisoSingle(PardisoSolver):
    """A `PardisoSolver` with factors and solutions of about seven digits."""

    name = "pardiso, single precision"
    precision = np.float32

    def __init__(self, *, threads: int = 1, quick_analysis: bool = False) -> None:
        """quick_analysis: order by minimum degree: for a layer of small elements as little fill as by dissection, in two thirds of
        the time; for cells of many unknowns half as many operations more."""
        super().__init__(threads=threads)
        self._solver.set_iparm(_SINGLE, 1)
        if quick_analysis:
            self._solver.set_iparm(_ORDERING, _MINIMUM_DEGREE)

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve for one (n,) or several (n, k) right-hand sides, scaled to the range of single precision."""
        size = float(np.abs(right).max()) or 1.0
        return size * super().solve((right / size).astype(np.float32)).astype(float)


def point_at_mkl() -> None:
    """Give pypardiso the path of MKL, as its search through the installation takes half a second for each solver.

    Where no package `mkl` is installed, pypardiso searches; where it finds none, another solver takes PARDISO's place.
    """
    if "PYPARDISO_MKL_RT" not in os.environ:
        try:
            files = importlib.metadata.files("mkl") or []
        except importlib.metadata.PackageNotFoundError:
            return
        found = [str(file.locate()) for file in files if "libmkl_rt" in file.name]
        os.environ.update({"PYPARDISO_MKL_RT": found[0]} if found else {})
