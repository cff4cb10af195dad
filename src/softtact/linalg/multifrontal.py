"""Cholesky's method on the fronts of a dissection, in single precision: compiled loops around BLAS and LAPACK.

A piece's front is a dense matrix over its k pivots, the unknowns that it eliminates, and its boundary: the b later unknowns that
they are coupled with. Its panel is the first k rows (k, k + b), which become rows of the factor. Its update is what remains of the
other rows (b, b), which later fronts add to theirs (Duff and Reid, ACM Trans. Math. Softw. 9, 1983). Of both only the upper
triangle is used, row by row; to Fortran that is a lower one.

A solve reads the factor twice and does little else. So the panels' boundary columns are stored in 16 bits, as shares of each row's
largest entry: half as much to read, and a solution off by 3e-4 of its energy norm, where single precision leaves 6e-6. It goes
through them row by row, for the reason in `lapack`.
"""

from collections import namedtuple

import numpy as np

from softtact.compiled import compiled
from softtact.linalg.lapack import Routines, add_row, address, call, keep_alive, row_product

# Arrays of all pieces, concatenated: those of piece p go from at[p] to at[p + 1]. Unknowns are numbered as they are eliminated.
#   pivot_at (p + 1,): its pivots;  boundary_at (p + 1,), boundary: the later unknowns of its front, rising
#   child_at (p + 1,), child: pieces whose updates are added to its front
#   place: rows of its boundary in the front that its update is added to
#   entry_at (p + 1,), source, target: numbers of the matrix' values that belong to its panel, and their places in it
#   triangle_at, short_at (p + 1,): the triangle of its pivots, row after row (k (k + 1) / 2,), and its panel's boundary columns
#   (k, b) in 16 bits
#   panel_at, update_at (p,): where in `work` its panel and its update begin
Fronts = namedtuple("Fronts", "pivot_at boundary_at boundary child_at child place entry_at source target triangle_at short_at "
                              "panel_at update_at")
#   work: panels and updates while they are needed;  triangles, short: as above, flat; diagonals are inverted
#   scale (n,): value of a unit in a row of `short`
Store = namedtuple("Store", "work triangles short scale")

_LONGEST = 32767                     # number in 16 bits
_FIRST = np.int64(0)                 # for a plain 0 numba would compile a function once more


@compiled
def factor_pieces(pieces: np.ndarray, fronts: Fronts, store: Store, values: np.ndarray, blas: Routines) -> bool:
    """Factor pieces of a matrix, whose values are given, one after the other; False where one is not positive definite.

    blas: `lapack.Routines`
    """
    for p in pieces:
        if not factor_pivots(p, fronts, store, values, blas):
            return False
        boundary = fronts.boundary_at[p + 1] - fronts.boundary_at[p]
        solve_columns(p, _FIRST, boundary, fronts, store, blas)
        store_panel(p, fronts, store)
        update_rows(p, _FIRST, boundary, fronts, store, blas)
    return True


@compiled
def assemble_panel(p: int, fronts: Fronts, store: Store, values: np.ndarray) -> None:
    """Sum up a piece's panel (k, k + b): the matrix' values, and the updates of earlier pieces."""
    pivots, width = _shape(p, fronts)
    panel = _panel_of(p, fronts, store)
    panel[:] = 0.0
    for e in range(fronts.entry_at[p], fronts.entry_at[p + 1]):
        panel[fronts.target[e]] = values[fronts.source[e]]
    for c in fronts.child[fronts.child_at[p]:fronts.child_at[p + 1]]:
        _extend_add(c, _FIRST, pivots, fronts, store, panel, _FIRST, width)


@compiled
def factor_pivots(p: int, fronts: Fronts, store: Store, values: np.ndarray, blas: Routines) -> bool:
    """Assemble a piece's panel and factor the triangle of its pivots; False if that is not positive definite."""
    assemble_panel(p, fronts, store, values)
    pivots, width = _shape(p, fronts)
    if pivots == 0:     # a cut where nothing is coupled
        return True
    panel = _panel_of(p, fronts, store)
    size = np.array([pivots, width, 0], dtype=np.int32)
    call(blas.potrf, (address(blas.letters, 0), address(size, 0), address(panel, 0), address(size, 1), address(size, 2)))     # type: ignore[call-arg, arg-type]
    # BLAS libraries differ in whether they report a nan; it reaches the last pivot.
    return size[2] == 0 and np.isfinite(panel[(pivots - 1) * (width + 1)])


@compiled
def solve_columns(p: int, start: int | np.int64, end: int, fronts: Fronts, store: Store, blas: Routines) -> None:
    """Make the panel's boundary columns from `start` to `end` those of the factor."""
    pivots, width = _shape(p, fronts)
    if pivots == 0 or start == end:
        return
    panel = _panel_of(p, fronts, store)
    size = np.array([pivots, width, end - start], dtype=np.int32)
    letters, factors = blas.letters, blas.factors
    L, N, R, T = address(letters, 0), address(letters, 1), address(letters, 2), address(letters, 3)
    call(blas.trsm, (R, L, T, N, address(size, 2), address(size, 0), address(factors, 0), address(panel, 0), address(size, 1),     # type: ignore[call-arg, arg-type]
                address(panel, pivots + start), address(size, 1)))
    keep_alive(size)


@compiled(fastmath=True)
def store_panel(p: int, fronts: Fronts, store: Store) -> None:
    """Store what a solve needs of a panel: the triangle of the pivots, the boundary columns in 16 bits, and each row's unit."""
    pivots, width = _shape(p, fronts)
    boundary, panel = width - pivots, _panel_of(p, fronts, store)
    triangle, at = _triangle_of(p, fronts, store), 0
    for k in range(pivots):
        triangle[at] = np.float32(1.0) / panel[k * width + k]
        for j in range(1, pivots - k):
            triangle[at + j] = panel[k * width + k + j]
        at += pivots - k
    for k in range(pivots):
        row = panel[k * width + pivots:(k + 1) * width]
        out = store.short[fronts.short_at[p] + k * boundary:fronts.short_at[p] + (k + 1) * boundary]
        largest = np.float32(0.0)
        for j in range(boundary):
            largest = max(largest, abs(row[j]))
        per_unit = np.float32(_LONGEST) / max(largest, np.float32(1e-30))
        for j in range(boundary):
            out[j] = np.int16(np.rint(row[j] * per_unit))
        store.scale[fronts.pivot_at[p] + k] = np.float32(1.0) / per_unit


@compiled
def update_rows(p: int, start: int | np.int64, end: int, fronts: Fronts, store: Store, blas: Routines) -> None:
    """Compute the update's rows from `start` to `end`."""
    if start == end:
        return
    pivots, width = _shape(p, fronts)
    boundary, panel, out = width - pivots, _panel_of(p, fronts, store), _update_of(p, fronts, store)
    size = np.array([pivots, width, end - start, boundary, boundary - end], dtype=np.int32)
    letters, factors = blas.letters, blas.factors
    L, N, T = address(letters, 0), address(letters, 1), address(letters, 3)
    minus_one, zero, rows = address(factors, 1), address(factors, 2), address(panel, pivots + start)
    call(blas.syrk, (L, N, address(size, 2), address(size, 0), minus_one, rows, address(size, 1), zero,     # type: ignore[call-arg, arg-type]
                address(out, start * boundary + start), address(size, 3)))
    if boundary > end:
        call(blas.gemm, (N, T, address(size, 4), address(size, 2), address(size, 0), minus_one, address(panel, pivots + end),
                    address(size, 1), rows, address(size, 1), zero, address(out, start * boundary + end), address(size, 3)))
    keep_alive(size)
    for c in fronts.child[fronts.child_at[p]:fronts.child_at[p + 1]]:
        _extend_add(c, pivots + start, pivots + end, fronts, store, out, pivots, boundary)


@compiled
def _extend_add(c, start, end, fronts, store, out, skipped, width):
    """Add the rows of a piece's update that belong to the rows from `start` to `end` of a front.

    out: the front's rows, `width` wide, without the first `skipped` rows and columns
    """
    place, child_update = _boundary_of(c, fronts, fronts.place), _update_of(c, fronts, store)
    boundary, runs = len(place), runs_of(place)
    for i in range(np.searchsorted(place, start), np.searchsorted(place, end)):
        row = (place[i] - skipped) * width - skipped
        for r in range(len(runs) - 1):
            first, last = max(runs[r], i), runs[r + 1]
            if first < last:
                add_to(out[row + place[first]:], child_update[i * boundary + first:i * boundary + last])


@compiled
def add_to(out: np.ndarray, values: np.ndarray) -> None:
    """Add values (k,) to the first of `out`."""
    for j in range(len(values)):
        out[j] += values[j]


@compiled
def runs_of(places: np.ndarray) -> np.ndarray:
    """Where runs of consecutive places begin among places (k,), and the end."""
    starts = np.empty(len(places) + 1, np.int64)
    count = 0
    for k in range(len(places)):
        if k == 0 or places[k] != places[k - 1] + 1:
            starts[count] = k
            count += 1
    starts[count] = len(places)
    return starts[:count + 1]


@compiled
def forward(pieces: np.ndarray, fronts: Fronts, store: Store, right: np.ndarray, beyond: np.ndarray, first: int) -> None:
    """Forward substitution with the pieces for a right-hand side (n,), in place.

    Contributions to unknowns from `first` on, which other pieces may change at the same time, go to `beyond`.
    """
    for p in pieces:
        boundary, x, rows = _boundary_of(p, fronts, fronts.boundary), _pivots_of(p, fronts, right), _short_of(p, fronts, store)
        _solve_transposed(_triangle_of(p, fronts, store), x)
        scale, b, passed_on = _pivots_of(p, fronts, store.scale), len(boundary), np.zeros(len(boundary), np.float32)
        for k in range(len(x)):
            add_row(rows[k * b:(k + 1) * b], x[k] * scale[k], passed_on)
        for i in range(b):
            if boundary[i] < first:
                right[boundary[i]] -= passed_on[i]
            else:
                beyond[boundary[i] - first] -= passed_on[i]


@compiled
def backward(pieces: np.ndarray, fronts: Fronts, store: Store, right: np.ndarray) -> None:
    """Back substitution with the pieces from the last on, in place; later unknowns are known."""
    for p in pieces[::-1]:
        x, known, rows = _pivots_of(p, fronts, right), right[_boundary_of(p, fronts, fronts.boundary)], _short_of(p, fronts, store)
        scale, b = _pivots_of(p, fronts, store.scale), len(known)
        for k in range(len(x)):
            x[k] -= scale[k] * row_product(rows[k * b:(k + 1) * b], known)
        _solve_triangle(_triangle_of(p, fronts, store), x)


@compiled(inline="always")
def _solve_transposed(triangle, x):
    """Solve R'.y = x (k,) in place for a triangle R, row after row with its diagonal inverted."""
    at = 0
    for k in range(len(x)):
        rest = len(x) - k - 1
        x[k] *= triangle[at]
        add_row(triangle[at + 1:at + 1 + rest], -x[k], x[k + 1:])
        at += rest + 1


@compiled(inline="always")
def _solve_triangle(triangle, x):
    """Solve R.y = x (k,) in place."""
    at = len(triangle)
    for k in range(len(x) - 1, -1, -1):
        rest = len(x) - k - 1
        at -= rest + 1
        x[k] = (x[k] - row_product(triangle[at + 1:at + 1 + rest], x[k + 1:])) * triangle[at]


@compiled(inline="always")
def _shape(p, fronts):
    """Number of a piece's pivots, and of all unknowns of its front."""
    pivots = fronts.pivot_at[p + 1] - fronts.pivot_at[p]
    return pivots, pivots + fronts.boundary_at[p + 1] - fronts.boundary_at[p]


@compiled(inline="always")
def _panel_of(p, fronts, store):
    pivots, width = _shape(p, fronts)
    return store.work[fronts.panel_at[p]:fronts.panel_at[p] + pivots * width]


@compiled(inline="always")
def _update_of(p, fronts, store):
    boundary = fronts.boundary_at[p + 1] - fronts.boundary_at[p]
    return store.work[fronts.update_at[p]:fronts.update_at[p] + boundary * boundary]


@compiled(inline="always")
def _pivots_of(p, fronts, values):
    """The part of values (n,) that belongs to a piece's pivots."""
    return values[fronts.pivot_at[p]:fronts.pivot_at[p + 1]]


@compiled(inline="always")
def _boundary_of(p, fronts, values):
    """The part of values, concatenated as `boundary`, that belongs to a piece's boundary."""
    return values[fronts.boundary_at[p]:fronts.boundary_at[p + 1]]


@compiled(inline="always")
def _short_of(p, fronts, store):
    return store.short[fronts.short_at[p]:fronts.short_at[p + 1]]


@compiled(inline="always")
def _triangle_of(p, fronts, store):
    return store.triangles[fronts.triangle_at[p]:fronts.triangle_at[p + 1]]
