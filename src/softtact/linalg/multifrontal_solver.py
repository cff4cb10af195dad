"""Cholesky's method for the matrix of a body whose unknowns have known positions, in plan or in space.

The factor has single precision, and 16 bits for solves, for steps that are corrected by a residual in double precision. Its gain
over a general solver: docs/notebook/2026-11-25-linear-solver.md.

Some unknowns may be left to the last: displacements of surface nodes along given directions. The factor ends before them and leaves
their Schur complement, a small dense matrix. Stiffness on them, such as that of a contact, can then change without a new factor.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import scipy.sparse as sp

from softtact.linalg import multifrontal as kernels
from softtact.linalg.lapack import ROUTINES
from softtact.linalg.multifrontal import Store
from softtact.linalg.nodal_frames import NodeFrames
from softtact.linalg.symbolic import Piece, dissect, lay_out, with_storage
from softtact.linalg.workers import SERIAL, Workers, slices

_PARTS = 32              # a subtree with less than this part of all operations is factored by one thread
_SUBTREES = 4            # subtrees that are solved in parallel
_SLACK = 1.05            # of arrays, for the next pattern
_SLOWER = 20             # time of an operation of a solve, which waits for memory, over that of one of a factor
_COLUMNS = 256           # of a large front, one thread's at a time


@dataclass(frozen=True)
class Bordered:
    """A matrix bordered by one more unknown: its upper triangle (csr), and a column (n + 1,) with the diagonal's entry at its end.

    frames: the nodes whose displacements along their directions are left to the last; the bordering unknown follows them
    """

    upper: sp.csr_matrix
    column: np.ndarray
    frames: NodeFrames


class DissectedSolver:
    """The interface of `linalg.direct`; a solution is off by about 3e-4 of its energy norm, as a preconditioner may be."""

    name = "dissected Cholesky, single precision"
    precision = np.float32
    _frames: Any     # `NodeFrames` while a bordered matrix is factored, else None
    _store: Any      # `Store`, None before the first factor

    def __init__(self, places: np.ndarray, *, workers: Workers = SERIAL) -> None:
        """places (n, 2 or 3): position of each unknown, in plan where the body is wide and thin, or in space; in mm"""
        self._places, self._workers, self._pattern, self._frames = places, workers, None, None
        self._store = None

    @property
    def unknowns(self) -> int:
        return len(self._places)

    @property
    def solves_per_factor(self) -> float:
        """Number of solves that take as long as a factor, by their operations."""
        pivots, boundary = np.diff(self._fronts.pivot_at).astype(float), np.diff(self._fronts.boundary_at)
        return float(_operations(self._fronts).sum() / (pivots * (pivots / 2 + boundary)).sum()) / _SLOWER

    def factor(self, upper: sp.csr_matrix) -> bool:
        """Factor the matrix whose upper triangle (csr, sorted, with its diagonal) is given; False if not positive definite."""
        self._frames = None
        return self._factor((upper.indptr, upper.indices), upper.data, None)

    def factor_bordered(self, matrix: Bordered) -> bool:
        """Factor a `Bordered` matrix except for its last unknowns; False if the part before them is not positive definite."""
        upper, self._frames = matrix.upper, matrix.frames
        column = self._frames.turned(matrix.column).astype(np.float32)
        values = np.concatenate([self._frames.turned_matrix(upper).astype(np.float32, copy=False), column])
        return self._factor((upper.indptr, upper.indices), values, self._frames.last)

    def _factor(self, pattern, values, last):
        if self._pattern is None or not all(map(_same, (*pattern, last), self._pattern)):
            self._analyse(*pattern, last)
        of_pieces = self._fronts, self._store, values.astype(np.float32, copy=False)
        done = self._workers.map(lambda pieces: kernels.factor_pieces(pieces, *of_pieces, ROUTINES), self._parts)
        if not (all(done) and all(self._factor_large(of_pieces, pieces, blocks) for pieces, blocks in self._large)):
            return False
        if last is not None:
            kernels.assemble_panel(len(self._fronts.pivot_at) - 2, *of_pieces)
        return True

    def _factor_large(self, of_pieces, pieces, blocks):
        """Factor independent pieces, by blocks (piece, start, end) on all threads.

        False where one is not positive definite.
        """
        (fronts, store, _), workers = of_pieces, self._workers
        if not all(workers.map(lambda p: kernels.factor_pivots(p, *of_pieces, ROUTINES), pieces)):
            return False
        workers.map(lambda block: kernels.solve_columns(*block, fronts, store, ROUTINES), blocks)
        workers.map(lambda p: kernels.store_panel(p, fronts, store), pieces)
        workers.map(lambda block: kernels.update_rows(*block, fronts, store, ROUTINES), blocks)
        return True

    @property
    def schur_complement(self) -> np.ndarray:
        """The upper triangle (k + 1, k + 1) of the Schur complement on the k last displacements and the bordering unknown."""
        size = len(self._frames.last) + 1
        start = self._fronts.panel_at[-1]
        return self._store.work[start:start + size * size].reshape(size, size)

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve for one (n,) or several (n, k) right-hand sides, scaled to the range of single precision; accuracy: see the class.

        The order of all operations does not depend on the number of threads.
        """
        if right.ndim > 1:
            return np.column_stack([self.solve(column) for column in right.T])
        return self._solved(right, lambda rest: rest)

    def solve_bordered(self, right: np.ndarray, finish: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Solve for a right-hand side (n + 1,); `finish` solves with the Schur complement for the last unknowns (k + 1,)."""
        return self._frames.turned_back(self._solved(self._frames.turned(right), finish))

    def _solved(self, right, finish):
        size = float(np.abs(right).max()) or 1.0
        x = (right[self._order] / size).astype(np.float32)
        factor, first, last = (self._fronts, self._store), self._first_shared, self._first_last
        beyond = np.zeros((len(self._subtrees), len(x) - first), dtype=np.float32)
        self._workers.map(lambda k: kernels.forward(self._subtrees[k], *factor, x, beyond[k], first),
                          range(len(self._subtrees)))
        x[first:] += beyond.sum(axis=0)
        kernels.forward(self._shared, *factor, x, beyond[0], len(x))
        x[last:] = finish(x[last:])
        kernels.backward(self._shared, *factor, x)
        self._workers.map(lambda pieces: kernels.backward(pieces, *factor, x), self._subtrees)
        out = np.empty(len(x))
        out[self._order] = x
        return size * out

    def _analyse(self, indptr, indices, last):
        pieces = dissect(indptr, indices, self._places, without=last)
        if last is not None:
            pieces.append(Piece(pivots=np.append(last, self.unknowns), before=(len(pieces) - 1,)))
        pieces, self._subtrees, shared = _subtrees_first(pieces, _SUBTREES)
        fronts, self._order = lay_out(indptr, indices, pieces, bordered=last is not None)
        self._parts, levels = _distributed(pieces, fronts)
        if self._places.shape[1] == 3:     # large fronts: saving memory comes before an even distribution
            self._parts = _joined(self._parts, fronts, self._workers.threads)
            levels = [np.array([p]) for level in levels for p in level]
        self._fronts, room = with_storage(fronts, self._parts, levels)
        self._first_shared, self._first_last = int(fronts.pivot_at[len(pieces) - len(shared)]), len(self._order)
        self._shared = shared
        if last is not None:     # the last piece is not factored here
            self._shared, levels, self._first_last = shared[:-1], levels[:-1], int(fronts.pivot_at[-2])
        boundary = np.diff(fronts.boundary_at)
        self._large = [(level, [(p, part.start, part.stop) for p in level for part in slices(int(boundary[p]), _COLUMNS)])
                       for level in levels]
        self._store = self._allocated(work=room, triangles=int(fronts.triangle_at[-1 if last is None else -2]),
                                   short=int(fronts.short_at[-1]), scale=len(self._order))
        self._pattern = (indptr, indices, last)

    def _allocated(self, **sizes):
        """A `Store` with arrays of these sizes, earlier ones if they are large enough: new memory costs as much as a factor."""
        old, self._store = self._store._asdict() if self._store else {}, None
        for name, size in sizes.items():
            if name not in old or len(old[name]) < size:
                old.pop(name, None)     # freed before the new one is allocated
                old[name] = np.empty(int(_SLACK * size), dtype=np.int16 if name == "short" else np.float32)
        return Store(**old)

    def close(self) -> None:
        """Forget the factors."""
        self._pattern = self._fronts = self._store = None


def _same(one, other):
    return one is other or np.array_equal(one, other)


def _subtrees_first(pieces, count):
    """The pieces in an order in which at most `count` subtrees of similar size come first, one after the other.

    Also the numbers of each subtree's pieces in that order, and those of the pieces after them, which the subtrees share.
    """
    tops, shared = [len(pieces) - 1], []
    weight = [np.sum([len(pieces[k].pivots) for k in _subtree(pieces, p)]) for p in range(len(pieces))]
    while len(tops) < count:
        heaviest = max(tops, key=lambda p: weight[p] if pieces[p].before else -1)
        if not pieces[heaviest].before:
            break
        tops.remove(heaviest)
        tops += pieces[heaviest].before
        shared.append(heaviest)
    groups = [_subtree(pieces, top) for top in sorted(tops)] + [sorted(shared)]
    order = np.concatenate(groups).astype(np.int64)
    number = np.argsort(order)
    renumbered = [replace(pieces[p], before=tuple(int(number[k]) for k in pieces[p].before)) for p in order]
    *subtrees, remaining = np.split(np.arange(len(order)), np.cumsum([len(group) for group in groups])[:-1])
    return renumbered, subtrees, remaining


def _subtree(pieces, top):
    """Numbers of the pieces of the subtree below a piece, and of that piece, in order."""
    return [k for child in pieces[top].before for k in _subtree(pieces, child)] + [top]


def _distributed(pieces, fronts):
    """The subtrees that one thread factors each, and the levels of large pieces that all threads factor afterwards.

    Pieces (k,) of each of these subtrees, the costliest first; independent pieces (k,) of each level, in the order of the levels.
    """
    operations = _operations(fronts)
    whole = [operations[_subtree(pieces, p)].sum() for p in range(len(pieces))]
    large = {p for p in range(len(pieces)) if pieces[p].before and whole[p] > operations.sum() / _PARTS}
    parents = {child: p for p, piece in enumerate(pieces) for child in piece.before}
    tops = [p for p in range(len(pieces)) if p not in large and parents.get(p, p) in large | {p}]
    depth = {}
    for p in sorted(large):
        depth[p] = 1 + max(depth.get(child, 0) for child in pieces[p].before)
    levels = [np.array([p for p in depth if depth[p] == level]) for level in sorted(set(depth.values()))]
    return [np.array(_subtree(pieces, p)) for p in sorted(tops, key=lambda p: -whole[p])], levels


def _joined(parts, fronts, count):
    """Parts (k,) joined to `count` parts of similar cost; in each of them, one subtree reuses the memory of those before."""
    operations = _operations(fronts)
    joined: list[list] = [[] for _ in range(count)]
    for part in parts:
        min(joined, key=lambda parts: sum(operations[one].sum() for one in parts)).append(part)
    return [np.concatenate(parts) for parts in joined if parts]


def _operations(fronts):
    """Number of operations (p,) of each piece's factor."""
    pivots, boundary = np.diff(fronts.pivot_at).astype(float), np.diff(fronts.boundary_at)
    return pivots**3 / 3 + pivots**2 * boundary + pivots * boundary**2
