"""Cholesky's method on the fronts of a dissection, in single precision: compiled loops around BLAS and LAPACK.

A piece's front is a dense matrix over its k unknowns and the b later ones that they are coupled with. Its panel are the first
k rows (k, k + b), in the end the factor's; its update is what is left of the others (b, b), which later fronts take over (Duff and
Reid, ACM Trans. Math. Softw. 9, 1983). Of both only the upper triangle counts, row by row; to Fortran that is a lower one.

A solve reads the factor twice and does little else. So the panels' bound columns are kept in 16 bits, as shares of each row's
largest entry: half as much to read, and a solution off by 3e-4 of its energy norm, where single precision leaves 6e-6. It goes
through them row by row: loops over several rows at once are not made of vector instructions, and BLAS's own triangular solves
read a quarter as fast (`row_loops`).
"""

from collections import namedtuple

import numpy as np
from numba import njit

from softtact.linalg.lapack import Routines, add_row, address, call, keep_alive, row_product

# Of all pieces one behind the other: piece p has those from at[p] to at[p + 1]. Unknowns are numbered as they are eliminated.
#   own_at (p + 1,): its unknowns;  bound_at (p + 1,), bound: later unknowns of its front, rising
#   child_at (p + 1,), child: pieces whose updates it takes over
#   place: where its bound stand in the front that takes over its update
#   entry_at (p + 1,), source, target: which of the matrix' values are its own, and where in its panel they stand
#   triangle_at, short_at (p + 1,): its own triangle, row after row (k (k + 1) / 2,), its panel's bound columns (k, b) in 16 bits
#   panel_at, update_at (p,): where in `work` its panel and its update are
Fronts = namedtuple("Fronts", "own_at bound_at bound child_at child place entry_at source target triangle_at short_at panel_at "
                              "update_at")
#   work: panels and updates, each as long as it is needed;  triangles, short: as above, flat; diagonals are inverted
#   scale (n,): what a unit in a row of `short` stands for
Store = namedtuple("Store", "work triangles short scale")

_LONGEST = 32767                     # of a number in 16 bits


@njit(cache=True, nogil=True)
def factor_pieces(pieces: np.ndarray, fronts: Fronts, store: Store, values: np.ndarray, blas: Routines) -> bool:
    """Factor pieces of a matrix, whose values are given, one after the other; False where one is not positive definite.

    blas: `lapack.Routines`
    """
    for p in pieces:
        if not begin(p, fronts, store, values, blas):
            return False
        bound = fronts.bound_at[p + 1] - fronts.bound_at[p]
        couple(p, 0, bound, fronts, store, blas)
        keep(p, fronts, store)
        update(p, 0, bound, fronts, store, blas)
    return True


@njit(cache=True, nogil=True)
def sum_up(p: int, fronts: Fronts, store: Store, values: np.ndarray) -> None:
    """Sum up a piece's panel (k, k + b): the matrix' values, and what earlier pieces have left."""
    own, width = _shape(p, fronts)
    panel = _panel_of(p, fronts, store)
    panel[:] = 0.0
    for e in range(fronts.entry_at[p], fronts.entry_at[p + 1]):
        panel[fronts.target[e]] = values[fronts.source[e]]
    for c in fronts.child[fronts.child_at[p]:fronts.child_at[p + 1]]:
        _take_over(c, 0, own, fronts, store, panel, 0, width)


@njit(cache=True, nogil=True)
def begin(p: int, fronts: Fronts, store: Store, values: np.ndarray, blas: Routines) -> bool:
    """`sum_up` a piece's panel, and factor its own unknowns; False if they are not positive definite."""
    sum_up(p, fronts, store, values)
    own, width = _shape(p, fronts)
    if own == 0:     # a cut where nothing is coupled
        return True
    panel = _panel_of(p, fronts, store)
    size = np.array([own, width, 0], dtype=np.int32)
    call(blas.potrf, (address(blas.letters, 0), address(size, 0), address(panel, 0), address(size, 1), address(size, 2)))     # type: ignore[call-arg, arg-type]
    # BLAS libraries differ in whether they tell of what is not a number; it goes through to the last pivot.
    return size[2] == 0 and np.isfinite(panel[(own - 1) * (width + 1)])


@njit(cache=True, nogil=True)
def couple(p: int, start: int, end: int, fronts: Fronts, store: Store, blas: Routines) -> None:
    """The panel's columns from `start` to `end` of the bound unknowns."""
    own, width = _shape(p, fronts)
    if own == 0 or start == end:
        return
    panel = _panel_of(p, fronts, store)
    size = np.array([own, width, end - start], dtype=np.int32)
    letters, factors = blas.letters, blas.factors
    L, N, R, T = address(letters, 0), address(letters, 1), address(letters, 2), address(letters, 3)
    call(blas.trsm, (R, L, T, N, address(size, 2), address(size, 0), address(factors, 0), address(panel, 0), address(size, 1),     # type: ignore[call-arg, arg-type]
                address(panel, own + start), address(size, 1)))
    keep_alive(size)


@njit(cache=True, nogil=True, fastmath=True)
def keep(p: int, fronts: Fronts, store: Store) -> None:
    """Keep what a solve needs of a panel: the own triangle, the bound columns in 16 bits, and the size of a unit in each row."""
    own, width = _shape(p, fronts)
    bound, panel = width - own, _panel_of(p, fronts, store)
    triangle, at = _triangle_of(p, fronts, store), 0
    for k in range(own):
        triangle[at] = np.float32(1.0) / panel[k * width + k]
        triangle[at + 1:at + own - k] = panel[k * width + k + 1:k * width + own]
        at += own - k
    for k in range(own):
        row = panel[k * width + own:(k + 1) * width]
        out = store.short[fronts.short_at[p] + k * bound:fronts.short_at[p] + (k + 1) * bound]
        largest = np.float32(0.0)
        for j in range(bound):
            largest = max(largest, abs(row[j]))
        per_unit = np.float32(_LONGEST) / max(largest, np.float32(1e-30))
        for j in range(bound):
            out[j] = np.int16(np.rint(row[j] * per_unit))
        store.scale[fronts.own_at[p] + k] = np.float32(1.0) / per_unit


@njit(cache=True, nogil=True)
def update(p: int, start: int, end: int, fronts: Fronts, store: Store, blas: Routines) -> None:
    """The update's rows from `start` to `end`."""
    if start == end:
        return
    own, width = _shape(p, fronts)
    bound, panel, out = width - own, _panel_of(p, fronts, store), _update_of(p, fronts, store)
    size = np.array([own, width, end - start, bound, bound - end], dtype=np.int32)
    letters, factors = blas.letters, blas.factors
    L, N, T = address(letters, 0), address(letters, 1), address(letters, 3)
    minus_one, zero, rows = address(factors, 1), address(factors, 2), address(panel, own + start)
    call(blas.syrk, (L, N, address(size, 2), address(size, 0), minus_one, rows, address(size, 1), zero,     # type: ignore[call-arg, arg-type]
                address(out, start * bound + start), address(size, 3)))
    if bound > end:
        call(blas.gemm, (N, T, address(size, 4), address(size, 2), address(size, 0), minus_one, address(panel, own + end),
                    address(size, 1), rows, address(size, 1), zero, address(out, start * bound + end), address(size, 3)))
    keep_alive(size)
    for c in fronts.child[fronts.child_at[p]:fronts.child_at[p + 1]]:
        _take_over(c, own + start, own + end, fronts, store, out, own, bound)


@njit(cache=True, nogil=True)
def _take_over(c, start, end, fronts, store, out, skipped, width):
    """Add the rows of a piece's update that stand from `start` to `end` in a front.

    out: the front's rows, `width` wide, without those and the columns that are `skipped`
    """
    place, given = _bound_of(c, fronts, fronts.place), _update_of(c, fronts, store)
    bound, runs = len(place), runs_of(place)
    for i in range(np.searchsorted(place, start), np.searchsorted(place, end)):
        row = (place[i] - skipped) * width - skipped
        for r in range(len(runs) - 1):
            first, last = max(runs[r], i), runs[r + 1]
            if first < last:
                to = row + place[first]
                out[to:to + last - first] += given[i * bound + first:i * bound + last]


@njit(cache=True, nogil=True)
def runs_of(places: np.ndarray) -> np.ndarray:
    """Where places (k,) begin that do not follow on the ones before, and the end."""
    starts = np.empty(len(places) + 1, np.int64)
    count = 0
    for k in range(len(places)):
        if k == 0 or places[k] != places[k - 1] + 1:
            starts[count] = k
            count += 1
    starts[count] = len(places)
    return starts[:count + 1]


@njit(cache=True, nogil=True)
def forward(pieces: np.ndarray, fronts: Fronts, store: Store, right: np.ndarray, beyond: np.ndarray, first: int) -> None:
    """Eliminate the pieces' unknowns from a right-hand side (n,), in place.

    What is left on unknowns from `first` on, which other pieces may change at the same time, goes to `beyond`.
    """
    for p in pieces:
        bound, x, rows = _bound_of(p, fronts, fronts.bound), _own_of(p, fronts, right), _short_of(p, fronts, store)
        _eliminate_own(_triangle_of(p, fronts, store), x)
        scale, b, passed_on = _own_of(p, fronts, store.scale), len(bound), np.zeros(len(bound), np.float32)
        for k in range(len(x)):
            add_row(rows[k * b:(k + 1) * b], x[k] * scale[k], passed_on)
        for i in range(b):
            if bound[i] < first:
                right[bound[i]] -= passed_on[i]
            else:
                beyond[bound[i] - first] -= passed_on[i]


@njit(cache=True, nogil=True)
def backward(pieces: np.ndarray, fronts: Fronts, store: Store, right: np.ndarray) -> None:
    """The pieces' unknowns, from the last on, in place; later ones are known."""
    for p in pieces[::-1]:
        x, known, rows = _own_of(p, fronts, right), right[_bound_of(p, fronts, fronts.bound)], _short_of(p, fronts, store)
        scale, b = _own_of(p, fronts, store.scale), len(known)
        for k in range(len(x)):
            x[k] -= scale[k] * row_product(rows[k * b:(k + 1) * b], known)
        _recover_own(_triangle_of(p, fronts, store), x)


@njit(cache=True, nogil=True)
def _eliminate_own(triangle, x):
    """Solve R'.y = x (k,) in place for a triangle R, row after row with its diagonal inverted."""
    at = 0
    for k in range(len(x)):
        rest = len(x) - k - 1
        x[k] *= triangle[at]
        add_row(triangle[at + 1:at + 1 + rest], -x[k], x[k + 1:])
        at += rest + 1


@njit(cache=True, nogil=True)
def _recover_own(triangle, x):
    """Solve R.y = x (k,) in place."""
    at = len(triangle)
    for k in range(len(x) - 1, -1, -1):
        rest = len(x) - k - 1
        at -= rest + 1
        x[k] = (x[k] - row_product(triangle[at + 1:at + 1 + rest], x[k + 1:])) * triangle[at]


@njit(cache=True, nogil=True)
def _shape(p, fronts):
    """How many unknowns a piece eliminates, and how many its front has."""
    own = fronts.own_at[p + 1] - fronts.own_at[p]
    return own, own + fronts.bound_at[p + 1] - fronts.bound_at[p]


@njit(cache=True, nogil=True)
def _panel_of(p, fronts, store):
    own, width = _shape(p, fronts)
    return store.work[fronts.panel_at[p]:fronts.panel_at[p] + own * width]


@njit(cache=True, nogil=True)
def _update_of(p, fronts, store):
    bound = fronts.bound_at[p + 1] - fronts.bound_at[p]
    return store.work[fronts.update_at[p]:fronts.update_at[p] + bound * bound]


@njit(cache=True, nogil=True)
def _own_of(p, fronts, values):
    """Those of a piece's own unknowns, of values (n,)."""
    return values[fronts.own_at[p]:fronts.own_at[p + 1]]


@njit(cache=True, nogil=True)
def _bound_of(p, fronts, values):
    """Those of a piece's bound unknowns, of values as `bound`."""
    return values[fronts.bound_at[p]:fronts.bound_at[p + 1]]


@njit(cache=True, nogil=True)
def _short_of(p, fronts, store):
    return store.short[fronts.short_at[p]:fronts.short_at[p + 1]]


@njit(cache=True, nogil=True)
def _triangle_of(p, fronts, store):
    return store.triangles[fronts.triangle_at[p]:fronts.triangle_at[p + 1]]
