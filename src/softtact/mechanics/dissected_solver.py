"""Cholesky's method for the matrix of a wide and thin body, of which it is known where each unknown stands.

In single precision, and solved from 16 bits, for steps that are corrected by a residual in double precision. What did not change
since the last factor is not factored again. What it gains over a general solver: docs/performance.md.
"""

from dataclasses import replace

import numpy as np

from softtact.mechanics import fronts as kernels
from softtact.mechanics.dissection import dissect
from softtact.mechanics.front_layout import lay_out
from softtact.mechanics.fronts import Store
from softtact.mechanics.parallel import SERIAL, slices

_PARTS = 32              # of all operations: what takes less than such a share is one thread's, from its first piece to its last
_SOLVED_APART = 4        # parts that are solved on threads of their own
_COLUMNS = 256           # of a large front that one thread couples at once


class DissectedSolver:
    """The interface of `linear_solvers`; a solution is off by some 3e-4 of its energy norm: it serves conjugate gradients."""

    name = "dissected Cholesky, single precision"
    precision = np.float32

    def __init__(self, places, *, workers=SERIAL):
        """places (n, 2): where each unknown stands in plan, in mm"""
        self._places, self._workers, self._pattern = places, workers, None

    def factor(self, upper):
        """Factor the matrix whose upper triangle (csr, sorted, with its diagonal) is given; False if not positive definite."""
        pattern = (upper.indptr, upper.indices)
        if self._pattern is None or not all(map(_same, pattern, self._pattern)):
            self._analyse(*pattern)
        fronts, store, workers = self._fronts, self._store, self._workers
        store.state[:] = kernels.AS_BEFORE if self._valid else kernels.NEW
        kernels.mark_changed(fronts, store, upper.data.astype(np.float32, copy=False), self._source)
        self._valid = all(workers.map(lambda pieces: kernels.factor_pieces(pieces, fronts, store, *kernels.BLAS), self._parts)) \
            and all(self._factor_large(pieces, blocks) for pieces, blocks in self._large)
        return self._valid

    def _factor_large(self, pieces, blocks):
        """Factor pieces that do not wait for each other, by blocks (piece, start, end) on all threads.

        False where one is not positive definite.
        """
        fronts, store, workers = self._fronts, self._store, self._workers
        letters, factors, potrf, trsm, syrk, gemm = kernels.BLAS
        states = workers.map(lambda p: kernels.begin(p, fronts, store, letters, potrf), pieces)
        if kernels.FAILED in states:
            return False
        workers.map(lambda block: kernels.couple(*block, fronts, store, letters, factors, trsm), blocks)
        workers.map(lambda p: kernels.shorten(p, fronts, store), pieces)
        workers.map(lambda block: kernels.update(*block, fronts, store, letters, factors, syrk, gemm), blocks)
        return True

    def solve(self, right):
        """Solve for one (n,) or several (n, k) right-hand sides, scaled to the range of single precision: see the class.

        All operations come in the same order, whatever the number of threads.
        """
        if right.ndim > 1:
            return np.column_stack([self.solve(column) for column in right.T])
        size = float(np.abs(right).max()) or 1.0
        x = (right[self._order] / size).astype(np.float32)
        factor, first = (self._fronts, self._store), self._first_shared
        beyond = np.zeros((len(self._apart), len(x) - first), dtype=np.float32)
        self._workers.map(lambda k: kernels.forward(self._apart[k], *factor, x, beyond[k], first, *kernels.SOLVES),
                          range(len(self._apart)))
        x[first:] += beyond.sum(axis=0)
        kernels.forward(self._shared, *factor, x, beyond[0], len(x), *kernels.SOLVES)
        kernels.backward(self._shared, *factor, x, *kernels.SOLVES)
        self._workers.map(lambda pieces: kernels.backward(pieces, *factor, x, *kernels.SOLVES), self._apart)
        out = np.empty(len(x))
        out[self._order] = x
        return size * out

    def _analyse(self, indptr, indices):
        pieces = dissect(indptr, indices, self._places)
        pieces, self._apart, self._shared = _apart_first(pieces, _SOLVED_APART)
        self._fronts, self._order, self._source = fronts, order, source = lay_out(indptr, indices, pieces)
        self._first_shared = int(fronts.own_at[len(pieces) - len(self._shared)])
        self._parts, large = _share_out(pieces, fronts)
        bound = np.diff(fronts.bound_at)
        self._large = [(level, [(p, part.start, part.stop) for p in level for part in slices(int(bound[p]), _COLUMNS)])
                       for level in large]
        self._store = Store(
            values=np.zeros(len(source), dtype=np.float32), state=np.zeros(len(pieces), dtype=np.int8),
            panels=np.zeros(int(fronts.panel_at[-1]), dtype=np.float32), short=np.zeros(int(fronts.short_at[-1]), dtype=np.int16),
            scale=np.zeros(len(order), dtype=np.float32), updates=np.zeros(int(fronts.update_at[-1]), dtype=np.float32))
        self._pattern, self._valid = (indptr, indices), False

    def close(self):
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
    own, bound = np.diff(fronts.own_at).astype(float), np.diff(fronts.bound_at)
    operations = own**3 / 3 + own**2 * bound + own * bound**2
    whole = [operations[_below(pieces, p)].sum() for p in range(len(pieces))]
    large = {p for p in range(len(pieces)) if pieces[p].before and whole[p] > operations.sum() / _PARTS}
    parents = {child: p for p, piece in enumerate(pieces) for child in piece.before}
    tops = [p for p in range(len(pieces)) if p not in large and parents.get(p, p) in large | {p}]
    waits = {}
    for p in sorted(large):
        waits[p] = 1 + max(waits.get(child, 0) for child in pieces[p].before)
    levels = [np.array([p for p in waits if waits[p] == level]) for level in sorted(set(waits.values()))]
    return [np.array(_below(pieces, p)) for p in sorted(tops, key=lambda p: -whole[p])], levels
