"""Cholesky's method for the matrix of a body of which the places of the unknowns are known, in plan or in space.

In single precision, and solved from 16 bits, for steps that are corrected by a residual in double precision. What it gains over a
general solver: docs/notebook/2026-11-25-linear-solver.md.

Some unknowns may be left for last, what nodes of the surface do along given directions: the factor ends before them, and leaves a
small dense matrix on them. What stiffens them, like a contact, can then change without a new factor.
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
from softtact.linalg.symbolic import Piece, dissect, lay_out, with_room
from softtact.linalg.workers import SERIAL, Workers, slices

_PARTS = 32              # of all operations: what takes less than such a share is one thread's, from its first piece to its last
_SOLVED_APART = 4        # parts that are each solved on a thread
_SLACK = 1.05            # of arrays, for the next pattern
_SLOWER = 20             # an operation of a solution, which waits for memory, beside one of a factor
_COLUMNS = 256           # of a large front that one thread couples at once


@dataclass(frozen=True)
class Bordered:
    """A matrix bordered by one more unknown: its upper triangle (csr), and a column (n + 1,) with the diagonal's entry at its end.

    frames: the nodes whose movements along their directions are left for last; the bordering unknown comes behind them
    """

    upper: sp.csr_matrix
    column: np.ndarray
    frames: NodeFrames


class DissectedSolver:
    """The interface of `linear_solvers`; a solution is off by some 3e-4 of its energy norm: it serves conjugate gradients."""

    name = "dissected Cholesky, single precision"
    precision = np.float32
    _frames: Any     # `NodeFrames` while a bordered matrix is factored, else None
    _store: Any      # `Store`, None before the first factor

    def __init__(self, places: np.ndarray, *, workers: Workers = SERIAL) -> None:
        """places (n, 2 or 3): place of each unknown, in plan where the body is wide and thin, or in space; in mm"""
        self._places, self._workers, self._pattern, self._frames = places, workers, None, None
        self._store = None

    @property
    def unknowns(self) -> int:
        return len(self._places)

    @property
    def solves_per_factor(self) -> float:
        """How many solutions take as long as a factor, by their operations."""
        own, bound = np.diff(self._fronts.own_at).astype(float), np.diff(self._fronts.bound_at)
        return float(_operations(self._fronts).sum() / (own * (own / 2 + bound)).sum()) / _SLOWER

    def factor(self, upper: sp.csr_matrix) -> bool:
        """Factor the matrix whose upper triangle (csr, sorted, with its diagonal) is given; False if not positive definite."""
        self._frames = None
        return self._factor((upper.indptr, upper.indices), upper.data, None)

    def factor_bordered(self, matrix: Bordered) -> bool:
        """Factor a `Bordered` matrix but for its last unknowns; False if what comes before them is not positive definite."""
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
            kernels.sum_up(len(self._fronts.own_at) - 2, *of_pieces)
        return True

    def _factor_large(self, of_pieces, pieces, blocks):
        """Factor pieces that do not wait for each other, by blocks (piece, start, end) on all threads.

        False where one is not positive definite.
        """
        (fronts, store, _), workers = of_pieces, self._workers
        if not all(workers.map(lambda p: kernels.begin(p, *of_pieces, ROUTINES), pieces)):
            return False
        workers.map(lambda block: kernels.couple(*block, fronts, store, ROUTINES), blocks)
        workers.map(lambda p: kernels.keep(p, fronts, store), pieces)
        workers.map(lambda block: kernels.update(*block, fronts, store, ROUTINES), blocks)
        return True

    @property
    def left(self) -> np.ndarray:
        """What the factor leaves on the k nodes' movements and the bordering unknown: (k + 1, k + 1), its upper triangle."""
        size = len(self._frames.last) + 1
        start = self._fronts.panel_at[-1]
        return self._store.work[start:start + size * size].reshape(size, size)

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve for one (n,) or several (n, k) right-hand sides, scaled to the range of single precision: see the class.

        All operations come in the same order, whatever the number of threads.
        """
        if right.ndim > 1:
            return np.column_stack([self.solve(column) for column in right.T])
        return self._solved(right, lambda rest: rest)

    def solve_bordered(self, right: np.ndarray, finish: Callable[[np.ndarray], np.ndarray]) -> np.ndarray:
        """Solve for a right-hand side (n + 1,), if `finish` solves for what is left of it on the last unknowns (k + 1,)."""
        return self._frames.turned_back(self._solved(self._frames.turned(right), finish))

    def _solved(self, right, finish):
        size = float(np.abs(right).max()) or 1.0
        x = (right[self._order] / size).astype(np.float32)
        factor, first, last = (self._fronts, self._store), self._first_shared, self._first_last
        beyond = np.zeros((len(self._apart), len(x) - first), dtype=np.float32)
        self._workers.map(lambda k: kernels.forward(self._apart[k], *factor, x, beyond[k], first),
                          range(len(self._apart)))
        x[first:] += beyond.sum(axis=0)
        kernels.forward(self._shared, *factor, x, beyond[0], len(x))
        x[last:] = finish(x[last:])
        kernels.backward(self._shared, *factor, x)
        self._workers.map(lambda pieces: kernels.backward(pieces, *factor, x), self._apart)
        out = np.empty(len(x))
        out[self._order] = x
        return size * out

    def _analyse(self, indptr, indices, last):
        pieces = dissect(indptr, indices, self._places, without=last)
        if last is not None:
            pieces.append(Piece(own=np.append(last, self.unknowns), before=(len(pieces) - 1,)))
        pieces, self._apart, shared = _apart_first(pieces, _SOLVED_APART)
        fronts, self._order = lay_out(indptr, indices, pieces, bordered=last is not None)
        self._parts, levels = _share_out(pieces, fronts)
        if self._places.shape[1] == 3:     # large fronts: sparing memory comes before sharing out evenly
            self._parts = _in_lanes(self._parts, fronts, self._workers.threads)
            levels = [np.array([p]) for level in levels for p in level]
        self._fronts, room = with_room(fronts, self._parts, levels)
        self._first_shared, self._first_last = int(fronts.own_at[len(pieces) - len(shared)]), len(self._order)
        self._shared = shared
        if last is not None:     # the last piece is not factored here
            self._shared, levels, self._first_last = shared[:-1], levels[:-1], int(fronts.own_at[-2])
        bound = np.diff(fronts.bound_at)
        self._large = [(level, [(p, part.start, part.stop) for p in level for part in slices(int(bound[p]), _COLUMNS)])
                       for level in levels]
        self._store = self._stored(work=room, triangles=int(fronts.triangle_at[-1 if last is None else -2]),
                                   short=int(fronts.short_at[-1]), scale=len(self._order))
        self._pattern = (indptr, indices, last)

    def _stored(self, **sizes):
        """`Store` with arrays of these sizes, those of before where they are as large: new memory costs as much as a factor."""
        old, self._store = self._store._asdict() if self._store else {}, None
        for name, size in sizes.items():
            if name not in old or len(old[name]) < size:
                old.pop(name, None)     # before there is a new one
                old[name] = np.empty(int(_SLACK * size), dtype=np.int16 if name == "short" else np.float32)
        return Store(**old)

    def close(self) -> None:
        """Forget the factors."""
        self._pattern = self._fronts = self._store = None


def _same(one, other):
    return one is other or np.array_equal(one, other)


def _apart_first(pieces, count):
    """The pieces in an order in which some parts of the tree, of like size and at most so many, come first, part by part.

    Also the numbers of each part's pieces in that order, and those of the pieces behind them all, which the parts share.
    """
    tops, shared = [len(pieces) - 1], []
    weight = [np.sum([len(pieces[k].own) for k in _below(pieces, p)]) for p in range(len(pieces))]
    while len(tops) < count:
        heaviest = max(tops, key=lambda p: weight[p] if pieces[p].before else -1)
        if not pieces[heaviest].before:
            break
        tops.remove(heaviest)
        tops += pieces[heaviest].before
        shared.append(heaviest)
    groups = [_below(pieces, top) for top in sorted(tops)] + [sorted(shared)]
    order = np.concatenate(groups).astype(np.int64)
    number = np.argsort(order)
    renumbered = [replace(pieces[p], before=tuple(int(number[k]) for k in pieces[p].before)) for p in order]
    *apart, behind = np.split(np.arange(len(order)), np.cumsum([len(group) for group in groups])[:-1])
    return renumbered, apart, behind


def _below(pieces, top):
    """A piece and all before it, in their order."""
    return [k for child in pieces[top].before for k in _below(pieces, child)] + [top]


def _share_out(pieces, fronts):
    """What one thread factors alone, and what all do after it, of the tree.

    Pieces (k,) of each part of the former, the costliest part first; pieces (k,) of the latter that do not wait for each other, in
    the order in which these groups do.
    """
    operations = _operations(fronts)
    whole = [operations[_below(pieces, p)].sum() for p in range(len(pieces))]
    large = {p for p in range(len(pieces)) if pieces[p].before and whole[p] > operations.sum() / _PARTS}
    parents = {child: p for p, piece in enumerate(pieces) for child in piece.before}
    tops = [p for p in range(len(pieces)) if p not in large and parents.get(p, p) in large | {p}]
    waits = {}
    for p in sorted(large):
        waits[p] = 1 + max(waits.get(child, 0) for child in pieces[p].before)
    levels = [np.array([p for p in waits if waits[p] == level]) for level in sorted(set(waits.values()))]
    return [np.array(_below(pieces, p)) for p in sorted(tops, key=lambda p: -whole[p])], levels


def _in_lanes(parts, fronts, count):
    """Parts (k,) one behind the other in so many lanes of like cost, which take each other's room as they end."""
    operations = _operations(fronts)
    lanes: list[list] = [[] for _ in range(count)]
    for part in parts:
        min(lanes, key=lambda lane: sum(operations[own].sum() for own in lane)).append(part)
    return [np.concatenate(lane) for lane in lanes if lane]


def _operations(fronts):
    """Of each piece's factor (p,)."""
    own, bound = np.diff(fronts.own_at).astype(float), np.diff(fronts.bound_at)
    return own**3 / 3 + own**2 * bound + own * bound**2
