"""The inverse of a sparse positive definite matrix between given functionals: how a surface moves under forces on it.

G = A K^-1 A' of a stiffness K and functionals A is the negative Schur complement of the bordered matrix [[K, A'], [A, 0]] on the
border. So all of K is eliminated, piece by piece of a nested dissection (`symbolic`), in dense fronts as in `multifrontal` but in
double precision, and no factor is stored. A front carries only the functionals of its part of the body: there is no dense inverse,
and no solution for each load. Of all matrices only the upper triangle is used, row by row.
Compared with PARDISO's Schur complement and LAPACK's inverse: docs/notebook/2026-11-27-compliance-of-large-pads.md.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numba.extending import get_cython_function_address

from softtact.compiled import compiled
from softtact.linalg.multifrontal import add_to, runs_of
from softtact.linalg.symbolic import Piece, dissect
from softtact.linalg.workers import threads_of_blas


def inverse_between(upper: sp.csr_matrix, functionals: sp.csr_matrix, places: np.ndarray, *, threads: int = 1,
                    dtype: type = np.float64) -> np.ndarray:
    """G = A K^-1 A' (m, m) of a matrix K (n, n) and functionals A (m, n); rows of A that are zero give zeros.

    upper: K's upper triangle (csr, sorted);  dtype: of the result; all is computed in double precision
    places (n, 2 or 3): position of each unknown, in plan where the body is wide and thin, or in space; in mm
    Raises LinAlgError for a matrix that is not positive definite.
    """
    pieces = dissect(upper.indptr, upper.indices, places)
    with threads_of_blas(threads):
        border = _schur_complement(upper, functionals, pieces)
    out: np.ndarray = np.empty(border.shape, dtype=dtype)
    _negate_and_mirror(border, out)
    return out


@compiled
def _negate_and_mirror(triangle, out):
    """Set `out` (m, m) to the negative of the symmetric matrix whose upper triangle (m, m) is given."""
    for i in range(len(triangle)):
        for j in range(i, len(triangle)):
            out[i, j] = out[j, i] = -triangle[i, j]


def _routine(module: str, name: str, arguments: int) -> Any:
    """A routine of SciPy's LAPACK or BLAS as a function of so many addresses. Unlike SciPy's own it runs without Python's lock, so
    several inverses can be computed at once.
    """
    return ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * arguments)(get_cython_function_address(f"scipy.linalg.{module}", name))


_POTRF = _routine("cython_lapack", "dpotrf", 5)
_TRSM, _SYRK = _routine("cython_blas", "dtrsm", 11), _routine("cython_blas", "dsyrk", 10)


def _called(routine: Any, *arguments: str | int | float | np.ndarray) -> int:
    """Call a routine with letters, whole numbers, factors and arrays; return its last whole number, which LAPACK's sets."""
    memory: list[Any] = [value.ctypes if isinstance(value, np.ndarray) else ctypes.c_char(value.encode()) if isinstance(value, str)
                         else ctypes.c_int(value) if isinstance(value, int) else ctypes.c_double(value) for value in arguments]
    routine(*(value.data if hasattr(value, "data") else ctypes.byref(value) for value in memory))
    return next(value.value for value in reversed(memory) if isinstance(value, ctypes.c_int))


def _refuse(fault):
    if fault:
        raise np.linalg.LinAlgError("The stiffness is not positive definite: a part of the body may be held by nothing.")


@dataclass(frozen=True)
class _Front:
    """The upper triangle of a piece's front, in three parts.

    pivots (k, k): of the unknowns that it eliminates;  coupling (k, b): of these with later unknowns;  update (b, b): of the later
    unknowns, passed on
    """

    pivots: np.ndarray
    coupling: np.ndarray
    update: np.ndarray

    @classmethod
    def of(cls, pivots: int, boundary: int) -> "_Front":
        return cls(*(np.zeros(shape) for shape in ((pivots, pivots), (pivots, boundary), (boundary, boundary))))

    def eliminate(self) -> np.ndarray:
        """Eliminate the pivots; return the update matrix."""
        if not self.pivots.size:
            return self.update
        k, b = self.coupling.shape
        fault = _called(_POTRF, "L", k, self.pivots, k, 0)     # lower to Fortran
        _refuse(fault or not np.isfinite(self.pivots[-1, -1]))     # a nan anywhere reaches the last pivot
        if self.update.size:
            _called(_TRSM, "R", "L", "T", "N", b, k, 1.0, self.pivots, k, self.coupling, b)
            _called(_SYRK, "L", "N", b, k, -1.0, self.coupling, b, 1.0, self.update, b)
        return self.update


def _schur_complement(upper, functionals, pieces: Sequence[Piece]):
    """The upper triangle (m, m) of the Schur complement on the bordering unknowns, which are eliminated after all pieces."""
    size, border = upper.shape[0], functionals.shape[0]
    pieces = [*pieces, Piece(pivots=np.arange(size, size + border), before=(len(pieces) - 1,))]
    starts = np.cumsum([0, *(len(piece.pivots) for piece in pieces)])
    rows = _in_order(upper, functionals, np.concatenate([piece.pivots for piece in pieces]))
    place = np.zeros(size + border, dtype=np.int64)
    passed_on: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    for number, piece in enumerate(pieces):
        first, end = starts[number:number + 2]
        updates = [passed_on.pop(child) for child in piece.before]
        boundary = _boundary(rows, first, end, [ranks for ranks, _ in updates])
        front = _Front.of(end - first, len(boundary))
        place[first:end], place[boundary] = np.arange(end - first), end - first + np.arange(len(boundary))
        _add_entries(rows.indptr, rows.indices, rows.data, first, end, place, front.pivots, front.coupling)
        while updates:
            ranks, update = updates.pop()
            _extend_add(update, place[ranks], front.pivots, front.coupling, front.update)
        if number == len(pieces) - 1:
            return front.pivots
        passed_on[number] = boundary, front.eliminate()


def _in_order(upper, functionals, order):
    """The bordered matrix' upper triangle (csr) with its unknowns in the order (n + m,) of elimination."""
    rank = np.empty(len(order), dtype=np.int32)
    rank[order] = np.arange(len(order))
    size, border = upper.shape[0], functionals.tocoo()
    row, column = np.repeat(rank[:size], np.diff(upper.indptr)), rank[upper.indices]
    places = [np.concatenate([find(row, column), of_border]) for find, of_border in (
        (np.minimum, rank[border.col]), (np.maximum, (size + border.row).astype(np.int32)))]
    return sp.csr_matrix((np.concatenate([upper.data, border.data]), places), shape=(len(order), len(order)))


def _boundary(rows, first, end, of_updates):
    """Ranks (b,), rising, of later unknowns that those from `first` to `end` are coupled with, by the matrix or by updates."""
    coupled = np.unique(rows.indices[rows.indptr[first]:rows.indptr[end]])
    return np.unique(np.concatenate([ranks[ranks >= end] for ranks in (coupled, *of_updates)]))


@compiled
def _add_entries(indptr, indices, values, first, end, place, pivots, coupling):
    """Add the matrix' rows from `first` to `end` to a front, in which each unknown has its `place`."""
    count = len(pivots)
    for i in range(end - first):
        for e in range(indptr[first + i], indptr[first + i + 1]):
            j = place[indices[e]]
            if j < count:
                pivots[i, j] += values[e]
            else:
                coupling[i, j - count] += values[e]


@compiled
def _extend_add(triangle, place, pivots, coupling, update):
    """Add an earlier piece's update, its upper triangle (c, c), to a front's rows and columns `place` (c,), which rise."""
    count, first = len(pivots), np.int64(0)     # a plain 0 would have numba compile `_add_row` for it alone
    split = np.searchsorted(place, count)
    of_pivots, later = runs_of(place[:split]), split + runs_of(place[split:])
    for i in range(len(place)):
        if i < split:
            _add_row(triangle[i], place, of_pivots, i, first, pivots[place[i]])
            _add_row(triangle[i], place, later, i, count, coupling[place[i]])
        else:
            _add_row(triangle[i], place, later, i, count, update[place[i] - count])


@compiled
def _add_row(row, place, runs, start, skipped, out):
    """Add the entries of a row (c,) from `start` on, run by run of places; `out` begins at the place `skipped`."""
    for r in range(len(runs) - 1):
        first, last = max(runs[r], start), runs[r + 1]
        if first < last:
            add_to(out[place[first] - skipped:], row[first:last])
