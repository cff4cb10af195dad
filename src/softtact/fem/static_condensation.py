"""Static condensation: elimination of the inner unknowns of many small bodies, body by body, exact within Newton's method.

The matrix (n + m, n + m) of a body has n inner unknowns first, then m outer ones, which are shared. Only its upper triangle is
filled, row by row; for Fortran this is a lower triangle, column by column.

`TangentCache` keeps an element's tangent until its nodes have moved relative to each other: most cells are condensed anew because a
frustum's contact changed, while their elements' tangents, half of the cost, are still valid. `make_positive` removes the modes of
negative stiffness from tangents, so that Newton steps still decrease the energy where rubber folds.
Reference: H. Chen et al., Stabler Neo-Hookean Simulation: Absolute Eigenvalue Filtering for Projected Newton, SIGGRAPH 2024: for
nearly incompressible elements, absolute values of negative eigenvalues need fewer steps than zeros.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from softtact.compiled import compiled
from softtact.fem.solid_block import SolidBlock
from softtact.linalg.lapack import ROUTINES, add_row, address, call, keep_alive, row_product
from softtact.linalg.workers import SERIAL, Workers, slices

_AT_ONCE = 60                # bodies that one thread reduces or recovers at once
_SMALLEST_STIFFNESS = 0.02   # N/mm of a mode of a folding body; the softest mode of a frustum at rest has 0.03
_ROUNDING = float(np.finfo(np.float32).eps)
_NOTHING = 2e-5     # of the largest stiffness: rounding errors of the zero eigenvalues (rigid motions) in single precision

class Springs(NamedTuple):
    """Stiffness (b, s) in N/mm of weighted sums of unknowns: rows `places` (s, c) of the matrix, -1 where fixed, weights (s, c)."""

    stiffness: np.ndarray
    places: np.ndarray
    weights: np.ndarray

    def with_others(self, others: "Springs") -> "Springs":
        """The union of both; the others must act on at least as many unknowns per spring."""
        more = ((0, 0), (0, others.places.shape[1] - self.places.shape[1]))
        return Springs(np.hstack([self.stiffness, others.stiffness]),
                       np.vstack([np.pad(self.places, more, constant_values=-1), others.places]),
                       np.vstack([np.pad(self.weights, more), others.weights]))


class _Store(NamedTuple):
    """For n inner and m outer unknowns: rows (bodies, n, n + m), the factor L' and the coupling L^-1 K_inner,outer side by side;
    outer (bodies, m, m), the condensed matrices; modified (bodies,), whether the inner matrix was not positive definite.
    """

    rows: np.ndarray
    outer: np.ndarray
    modified: np.ndarray


class Condensation:
    """Bodies of n inner and m outer unknowns; `outer` (bodies, m, m) are their condensed matrices.

    element_dofs: for each group of like elements the rows (k, w) of their unknowns in a body's matrix, -1 where fixed.
    All in single precision: it is used for steps that are corrected by a residual in double precision.
    """

    def __init__(self, bodies: int, inner: int, outer: int, element_dofs: Iterable[np.ndarray]) -> None:
        groups = tuple(element_dofs)
        self._unknowns = np.concatenate([dofs.ravel() for dofs in groups])      # of one element after the other ...
        self._widths = np.repeat([dofs.shape[1] for dofs in groups], [len(dofs) for dofs in groups])     # ... so many each
        self._store = _Store(rows=np.zeros((bodies, inner, inner + outer), dtype=np.float32),
                             outer=np.zeros((bodies, outer, outer), dtype=np.float32), modified=np.zeros(bodies, dtype=bool))
        self._judged = np.zeros(bodies, dtype=bool)     # whether `make_positive` has checked a body since it was set ...
        self._positive: dict[int, np.ndarray] = {}      # ... and its positive definite matrices of the indefinite bodies

    @property
    def outer(self) -> np.ndarray:
        """The condensed matrices (bodies, m, m) in N/mm."""
        return self._store.outer

    def set(self, bodies: np.ndarray, tangents: Iterable[np.ndarray], springs: Springs | None = None, *,
            damping: np.ndarray | None = None) -> None:
        """Assemble, factor and condense the matrices of the given bodies (b,).

        tangents: for each group of elements (b, k, w (w + 1) / 2) in N/mm, in the form of `packed`;  springs: `Springs` of these
        bodies;  damping: stiffness (b,) in N/mm to add on each inner unknown, which shortens steps along soft modes (Levenberg and
        Marquardt)

        Where folding made a matrix indefinite, the absolute values of its eigenvalues are used: every Newton step then
        decreases the energy, with the same step length along modes of negative and positive stiffness. The equilibrium does not
        depend on it, only the rate of convergence. Nocedal and Wright, Numerical Optimization, sec. 3.4.
        """
        springs = springs or Springs(np.zeros((len(bodies), 0)), np.zeros((0, 1), dtype=np.int64), np.zeros((0, 1)))
        damping = np.zeros(len(bodies)) if damping is None else damping
        springs = springs._replace(stiffness=np.ascontiguousarray(springs.stiffness))
        stiffness = np.concatenate([group.reshape(len(bodies), -1) for group in tangents], axis=1)
        _set(bodies, damping, stiffness, self._unknowns, self._widths, springs, self._store, ROUTINES)
        self._judged[bodies] = False
        for body in bodies:
            self._positive.pop(int(body), None)

    def residual(self, inner: np.ndarray, *, bodies: np.ndarray | None = None,
                 workers: Workers = SERIAL) -> tuple[np.ndarray, np.ndarray]:
        """Contributions (b, m) of the inner residuals (b, n) of some bodies (b,), or of all, to the outer residual, and the
        forward-solved right-hand sides that `recover` needs."""
        forward_solved, bodies = np.array(inner, dtype=np.float32, order="C"), self._chosen(bodies)
        passed_on = np.empty((len(forward_solved), self.outer.shape[1]), dtype=np.float32)
        workers.map(lambda part: _reduce(self._store.rows, bodies[part], forward_solved[part], passed_on[part]),
                    slices(len(forward_solved), _AT_ONCE))
        return passed_on, forward_solved

    def recover(self, forward_solved: np.ndarray, outer_step: np.ndarray, *, bodies: np.ndarray | None = None,
                workers: Workers = SERIAL) -> np.ndarray:
        """Newton step (b, n) of the inner unknowns of some bodies (b,), or of all, for the step (b, m) of their outer ones."""
        step, bodies = forward_solved.astype(np.float32), self._chosen(bodies)     # a copy; scaled ones are in double precision
        outer = np.ascontiguousarray(outer_step, dtype=np.float32)
        workers.map(lambda part: _recover(self._store.rows, bodies[part], step[part], outer[part]), slices(len(step), _AT_ONCE))
        return -step

    def _chosen(self, bodies):
        return np.arange(len(self._store.rows)) if bodies is None else bodies

    @property
    def not_judged(self) -> np.ndarray:
        """Bodies (b,) that `make_positive` has not checked since they were last set."""
        return np.flatnonzero(~self._judged)

    def make_positive(self, bodies: np.ndarray) -> None:
        """Prepare `positive_outer` of some bodies (b,); several threads may do so for different bodies."""
        made, changed = np.empty((len(bodies), *self.outer.shape[1:]), dtype=np.float32), np.zeros(len(bodies), dtype=bool)
        _make_outer_positive(self.outer, bodies, made, changed, ROUTINES)
        self._positive.update({int(bodies[k]): made[k].copy() for k in np.flatnonzero(changed)})
        self._judged[bodies] = True

    def positive_outer(self) -> np.ndarray:
        """The condensed matrices, the indefinite ones with the absolute values of their eigenvalues, as in `set`.

        With zeros instead, only the rest of the body would limit a step along these modes.
        """
        self.make_positive(self.not_judged)
        out = self.outer.copy()
        for body, positive in self._positive.items():
            out[body] = positive
        return out

    @property
    def modified(self) -> int:
        """Number of bodies with modes of negative stiffness."""
        return int(self._store.modified.sum())


def packed(matrices: np.ndarray) -> np.ndarray:
    """Upper triangles (..., w (w + 1) / 2) of symmetric matrices (..., w, w), row after row, in single precision."""
    *like, width, _ = matrices.shape
    out = np.empty((int(np.prod(like)), width * (width + 1) // 2), dtype=np.float32)
    _pack(matrices.reshape(-1, width, width), out)
    return out.reshape(*like, -1)


@compiled
def _pack(matrices, out):
    width = matrices.shape[1]
    for k in range(len(matrices)):
        start = 0
        for i in range(width):
            for j in range(width - i):
                out[k, start + j] = matrices[k, i, i + j]
            start += width - i


@compiled
def _set(bodies, damping, tangents, unknowns, widths, springs, store, blas):
    """Set bodies (b,) from their elements' packed tangents (b, w), which belong to `widths` (k,) of the unknowns each."""
    n, m = store.rows.shape[1], store.outer.shape[1]
    matrix = np.empty((n + m, n + m), np.float32)
    for b in range(len(bodies)):
        for i in range(n + m):
            matrix[i, i:] = 0.0
        first, start = 0, 0
        for width in widths:
            _add_element(matrix, tangents[b, start:start + width * (width + 1) // 2], unknowns[first:first + width])
            first, start = first + width, start + width * (width + 1) // 2
        _add_springs(matrix, springs.stiffness[b], springs.places, springs.weights)
        for i in range(n):
            matrix[i, i] += damping[b]
        body = bodies[b]
        store.modified[body] = _condense(matrix, store.rows[body], store.outer[body], blas)


@compiled(inline="always")
def _add_element(matrix, tangent, dofs):
    """Add a packed tangent to an upper triangle; several nodes of an element may have the same unknown."""
    first = 0
    for i in range(len(dofs)):
        row = dofs[i]
        if row >= 0:
            matrix[row, row] += tangent[first]
            for j in range(i + 1, len(dofs)):
                column, value = dofs[j], tangent[first + j - i]
                if column > row:
                    matrix[row, column] += value
                elif column == row:
                    matrix[row, row] += 2 * value
                elif column >= 0:
                    matrix[column, row] += value
        first += len(dofs) - i


@compiled(inline="always")
def _add_springs(matrix, stiffness, places, weights):
    for s in range(len(stiffness)):
        if stiffness[s] == 0.0:
            continue
        for i in range(places.shape[1]):
            row = places[s, i]
            if row < 0:
                continue
            for j in range(places.shape[1]):
                if places[s, j] >= row:
                    matrix[row, places[s, j]] += stiffness[s] * weights[s, i] * weights[s, j]


@compiled(inline="always")
def _condense(matrix, rows, outer, blas):
    """Fill a body's rows and outer matrix; returns whether its inner matrix was not positive definite."""
    n, m = len(rows), len(outer)
    size, letters, factors = np.array([n, m, n + m, 0], dtype=np.int32), blas.letters, blas.factors
    L, N, R, T = address(letters, 0), address(letters, 1), address(letters, 2), address(letters, 3)
    one, minus_one = address(factors, 0), address(factors, 1)
    _n, _m, _lead, info = address(size, 0), address(size, 1), address(size, 2), address(size, 3)
    for i in range(n):
        for j in range(n + m):
            rows[i, j] = matrix[i, j]
    for i in range(m):
        for j in range(m):
            outer[i, j] = matrix[n + i, n + j]
    call(blas.potrf, (L, _n, rows.ctypes.data, _lead, info))
    modified = size[3] != 0
    if modified:
        _make_positive_definite(matrix[:n, :n].astype(np.float64), rows)
        call(blas.potrf, (L, _n, rows.ctypes.data, _lead, info))
    coupling = rows[:, n:].ctypes.data
    call(blas.trsm, (R, L, T, N, _m, _n, one, rows.ctypes.data, _lead, coupling, _lead))
    call(blas.syrk, (L, N, _m, _n, minus_one, coupling, _lead, one, outer.ctypes.data, _m))
    keep_alive(size)
    for i in range(m):
        for j in range(i):
            outer[i, j] = outer[j, i]
    return modified


@compiled
def _make_outer_positive(outer, bodies, made, changed, blas):
    """Make the condensed matrices of the indefinite bodies positive definite; a Cholesky factorisation finds these quickly."""
    size = np.array([outer.shape[1], 0], dtype=np.int32)
    lower, count, info = address(blas.letters, 0), address(size, 0), address(size, 1)
    for b in range(len(bodies)):
        _write(outer[bodies[b]], made[b])
        call(blas.potrf, (lower, count, made[b].ctypes.data, count, info))
        changed[b] = size[1] != 0 and np.isfinite(outer[bodies[b]]).all()
        if changed[b]:
            _make_positive_definite(outer[bodies[b]].astype(np.float64), made[b])
    keep_alive(size)


@compiled
def _make_positive_definite(matrix, out):
    """Write a matrix (n, n), given by its upper triangle, with the absolute values of its eigenvalues into `out` (n, n or more)."""
    for i in range(len(matrix)):
        for j in range(i):
            matrix[i, j] = matrix[j, i]
    values, vectors = np.linalg.eigh(matrix)
    # The previous layer's contribution may be so stiff near an instability that rounding makes softer modes negative.
    least = max(_SMALLEST_STIFFNESS, len(matrix) * _ROUNDING * np.abs(values).max())
    _write((vectors * np.maximum(np.abs(values), least)) @ vectors.T, out)


@compiled
def _write(matrix, out):
    """Round a matrix (n, n) into the first columns of `out` (n, n or more)."""
    for i in range(len(matrix)):
        for j in range(len(matrix)):
            out[i, j] = matrix[i, j]


@compiled
def _reduce(rows, bodies, forward_solved, passed_on):
    n, whole = rows.shape[1], np.zeros(rows.shape[2], np.float32)
    for b in range(len(bodies)):
        for i in range(len(whole)):
            whole[i] = forward_solved[b, i] if i < n else 0.0
        for i in range(n):
            row = rows[bodies[b], i]
            whole[i] /= row[i]
            add_row(row[i + 1:], -whole[i], whole[i + 1:])
        for i in range(n):
            forward_solved[b, i] = whole[i]
        for i in range(n, len(whole)):
            passed_on[b, i - n] = whole[i]


@compiled
def _recover(rows, bodies, step, outer_step):
    n, whole = rows.shape[1], np.zeros(rows.shape[2], np.float32)
    for b in range(len(bodies)):
        for i in range(len(whole)):
            whole[i] = step[b, i] if i < n else -outer_step[b, i - n]
        for i in range(n - 1, -1, -1):
            row = rows[bodies[b], i]
            whole[i] = (whole[i] - row_product(row[i + 1:], whole[i + 1:])) / row[i]
        for i in range(n):
            step[b, i] = whole[i]


class TangentCache:
    """The last tangents of the elements (e,) of a `SolidBlock`: upper triangles in the form of `packed`, in single precision."""

    def __init__(self, block: SolidBlock) -> None:
        elements, nodes = len(block.at_rest.shapes), block.at_rest.gradients.shape[3]
        self._block = block
        self._found_at = np.full((elements, nodes, 3), np.nan, dtype=np.float32)
        self._tangents = np.empty((elements, 3 * nodes * (3 * nodes + 1) // 2), dtype=np.float32)

    def at(self, displacement: np.ndarray, elements: np.ndarray, *, kept_mm: float) -> np.ndarray:
        """Tangents (b, w) of elements (b,) whose nodes' displacement (b, m, 3) is given.

        kept_mm: elements whose nodes moved by at most that much since their last tangent, without the translation, keep it
        """
        shape = (displacement - displacement.mean(axis=1, keepdims=True)).astype(np.float32)
        same = np.abs(shape - self._found_at[elements]).max(axis=(1, 2)) <= kept_mm     # False without a tangent: nan
        if not same.all():
            anew = elements[~same]
            self._tangents[anew] = packed(self._block.tangent(displacement[~same], anew, precision=np.float32))
            self._found_at[anew] = shape[~same]
        return self._tangents[elements]

    def forget(self) -> None:
        """Discard all tangents, so that each is recomputed at its next use."""
        self._found_at[:] = np.nan


def make_positive(tangents: np.ndarray) -> int:
    """Replace the eigenvalues of indefinite symmetric tangents (e, k, k), in single precision, by their absolute values, in place.

    Returns the number of indefinite ones. Tangents that are not finite are left unchanged; their factorisation fails later.
    """
    return int(_make_positive(tangents, np.empty(tangents.shape[1:], dtype=np.float32), ROUTINES))


@compiled
def _make_positive(tangents, scratch, blas):
    size = np.array([tangents.shape[1], 0], dtype=np.int32)
    lower, count, info, changed = address(blas.letters, 0), address(size, 0), address(size, 1), 0
    for tangent in tangents:
        _write(tangent, scratch)
        nothing = _NOTHING * np.abs(np.diag(tangent)).max()
        for i in range(len(tangent)):
            scratch[i, i] += nothing
        call(blas.potrf, (lower, count, scratch.ctypes.data, count, info))
        if size[1] != 0 and np.isfinite(tangent).all():
            values, vectors = np.linalg.eigh(tangent.astype(np.float64))
            _write((vectors * np.abs(values)) @ vectors.T, tangent)
            changed += 1
    keep_alive(size)
    return changed
