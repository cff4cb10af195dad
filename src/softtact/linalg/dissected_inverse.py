"""What a sparse positive definite matrix' inverse does between some functionals: how a surface moves under forces on it.

G = A K^-1 A' of a stiffness K and functionals A is the negative Schur complement of the bordered matrix [[K, A'], [A, 0]] on the
border. So all of K is eliminated piece by piece of a dissection (`nested_dissection`), in dense fronts as in `multifrontal` but in
double precision, and no factor is kept. A front carries the functionals of its part of the body alone: no dense inverse and no
solution for each load. Of all matrices the upper triangle counts, row by row.
Against PARDISO's Schur complement and LAPACK's inverse: docs/notebook/2026-11-27-compliance-of-large-pads.md.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numba import njit
from scipy.linalg import blas, lapack

from softtact.linalg.multifrontal import runs_of
from softtact.linalg.symbolic import Piece, dissect
from softtact.linalg.workers import threads_of_blas


def inverse_between(upper: sp.csr_matrix, functionals: sp.csr_matrix, places: np.ndarray, *, threads: int = 1,
                    dtype: type = np.float64) -> np.ndarray:
    """G = A K^-1 A' (m, m) of a matrix K (n, n) and functionals A (m, n); rows of A that are zero give zeros.

    upper: K's upper triangle (csr, sorted);  dtype: of the result, all is computed in double precision
    places (n, 2 or 3): place of each unknown, in plan where the body is wide and thin, or in space; in mm
    Raises LinAlgError for a matrix that is not positive definite.
    """
    pieces = dissect(upper.indptr, upper.indices, places)
    with threads_of_blas(threads):
        left = _left_on_border(upper, functionals, pieces)
    out: np.ndarray = np.empty(left.shape, dtype=dtype)
    _negate_and_mirror(left, out)
    return out


@njit(cache=True, nogil=True)
def _negate_and_mirror(triangle, out):
    """`out` (m, m) becomes minus the symmetric matrix of which the upper triangle (m, m) is given."""
    for i in range(len(triangle)):
        for j in range(i, len(triangle)):
            out[i, j] = out[j, i] = -triangle[i, j]


def _refuse(fault):
    if fault:
        raise np.linalg.LinAlgError("The stiffness is not positive definite: something may be held by nothing.")


@dataclass(frozen=True)
class _Front:
    """A piece's upper triangle, in three parts.

    own (k, k): of what it eliminates;  coupled (k, b): what that is coupled with;  rest (b, b): among these, passed on
    """

    own: np.ndarray
    coupled: np.ndarray
    rest: np.ndarray

    @classmethod
    def of(cls, own: int, bound: int) -> "_Front":
        return cls(*(np.zeros(shape) for shape in ((own, own), (own, bound), (bound, bound))))

    def eliminate(self) -> np.ndarray:
        """The rest, less what the piece's unknowns did to it."""
        if not self.own.size:
            return self.rest
        factor, fault = lapack.dpotrf(self.own.T, lower=1, clean=0, overwrite_a=1)     # row by row is a lower one to Fortran
        _refuse(fault or not np.isfinite(factor[-1, -1]))     # what is no number goes through to the last pivot
        if not self.rest.size:
            return self.rest
        coupled = blas.dtrsm(1.0, factor, self.coupled.T, side=1, lower=1, trans_a=1, overwrite_b=1)
        return blas.dsyrk(-1.0, coupled, beta=1.0, c=self.rest.T, lower=1, overwrite_c=1).T


def _left_on_border(upper, functionals, pieces: Sequence[Piece]):
    """The Schur complement on the bordering unknowns (m, m), its upper triangle; they come behind all pieces."""
    size, border = upper.shape[0], functionals.shape[0]
    pieces = [*pieces, Piece(own=np.arange(size, size + border), before=(len(pieces) - 1,))]
    starts = np.cumsum([0, *(len(piece.own) for piece in pieces)])
    rows = _in_order(upper, functionals, np.concatenate([piece.own for piece in pieces]))
    place = np.zeros(size + border, dtype=np.int64)
    passed_on: dict[int, tuple[np.ndarray, np.ndarray]] = {}
    for number, piece in enumerate(pieces):
        first, end = starts[number:number + 2]
        given = [passed_on.pop(child) for child in piece.before]
        bound = _bound(rows, first, end, [ranks for ranks, _ in given])
        front = _Front.of(end - first, len(bound))
        place[first:end], place[bound] = np.arange(end - first), end - first + np.arange(len(bound))
        _take_up(rows.indptr, rows.indices, rows.data, first, end, place, front.own, front.coupled)
        while given:
            ranks, rest = given.pop()
            _take_over(rest, place[ranks], front.own, front.coupled, front.rest)
        if number == len(pieces) - 1:
            return front.own
        passed_on[number] = bound, front.eliminate()


def _in_order(upper, functionals, order):
    """The bordered matrix' upper triangle (csr) with its unknowns in the order (n + m,) of elimination."""
    rank = np.empty(len(order), dtype=np.int32)
    rank[order] = np.arange(len(order))
    size, border = upper.shape[0], functionals.tocoo()
    row, column = np.repeat(rank[:size], np.diff(upper.indptr)), rank[upper.indices]
    places = [np.concatenate([find(row, column), of_border]) for find, of_border in (
        (np.minimum, rank[border.col]), (np.maximum, (size + border.row).astype(np.int32)))]
    return sp.csr_matrix((np.concatenate([upper.data, border.data]), places), shape=(len(order), len(order)))


def _bound(rows, first, end, given):
    """Ranks (b,), rising, of later unknowns that those from `first` to `end` are coupled with, by the matrix or what is given."""
    coupled = np.unique(rows.indices[rows.indptr[first]:rows.indptr[end]])
    return np.unique(np.concatenate([ranks[ranks >= end] for ranks in (coupled, *given)]))


@njit(cache=True, nogil=True)
def _take_up(indptr, indices, values, first, end, place, own, coupled):
    """Add the matrix' rows from `first` to `end` to a front, in which each unknown has its `place`."""
    count = len(own)
    for i in range(end - first):
        for e in range(indptr[first + i], indptr[first + i + 1]):
            j = place[indices[e]]
            if j < count:
                own[i, j] += values[e]
            else:
                coupled[i, j - count] += values[e]


@njit(cache=True, nogil=True)
def _take_over(given, place, own, coupled, rest):
    """Add an upper triangle (c, c) to a front's rows and columns `place` (c,), which rise."""
    count = len(own)
    split = np.searchsorted(place, count)
    mine, others = runs_of(place[:split]), split + runs_of(place[split:])
    for i in range(len(place)):
        if i < split:
            _add(given[i], place, mine, i, 0, own[place[i]])
            _add(given[i], place, others, i, count, coupled[place[i]])
        else:
            _add(given[i], place, others, i, count, rest[place[i] - count])


@njit(cache=True, nogil=True)
def _add(given, place, runs, start, skipped, out):
    """Add what a row (c,) has from `start` on in `runs` of places; `out` lacks the first `skipped` places."""
    for r in range(len(runs) - 1):
        first, last = max(runs[r], start), runs[r + 1]
        if first < last:
            to = place[first] - skipped
            out[to:to + last - first] += given[first:last]
