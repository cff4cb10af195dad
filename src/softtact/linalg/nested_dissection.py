"""Nested dissection of a body by the places of its nodes: it is cut along lines or planes, recursively, and the cuts come last.

On a plane no order needs fewer operations, but for a factor (George, SIAM J. Numer. Anal. 10, 1973). A general ordering has to find
the lines first: it takes five times as long for a third more operations on a wide and thin sensor's lattice
(docs/notebook/2026-11-25-linear-solver.md). In space the cuts begin as planes and are then shortened node by node: on a body of
irregular tetrahedra that saves more than half of the operations (docs/notebook/2026-11-26-solids-in-single-precision.md).

A cut along a plane through irregular tetrahedra takes with it a layer of elements' nodes. Of the edges between the two sides, the
fewest nodes that touch all of them are a cut, too, mostly one sheet of nodes; and which nodes of a cut count to either side may be
chosen anew until nothing is gained.
Reference: Pothen and Fan, ACM Trans. Math. Softw. 16 (1990), on covers by Koenig's theorem.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numba import njit
from scipy.sparse.csgraph import maximum_bipartite_matching

_LEAST_SHARE = 0.1           # of the unknowns on either side of a cut
_PRICE_OF_IMBALANCE = {2: 2.0, 3: 1.0}   # in plan, in space: a cut between unlike parts counts as so much longer
_SMALLEST = 200              # unknowns: what has fewer is not cut; smaller ones have fewer operations, in slower pieces
_GRID_MM = 1e-6              # nodes are one column where their places round to the same
_ROUNDS = 8


@dataclass(frozen=True)
class Piece:
    """A cut, or a part that was not cut further: unknowns (k,) that it eliminates, and the pieces that come before it."""

    own: np.ndarray
    before: tuple


def dissect(indptr: np.ndarray, indices: np.ndarray, places: np.ndarray, *, without: np.ndarray | None = None) -> list[Piece]:
    """`Piece`s of a symmetric matrix, each behind those before it; the first cut is the last piece.

    indptr, indices: pattern of its upper triangle (csr);  places (n, 2 or 3): place of each unknown, in plan or in
    space, in mm;  without: unknowns (k,) that are to be in none
    """
    columns, column_of = np.unique(np.round(places / _GRID_MM).astype(np.int64), axis=0, return_inverse=True)
    column_of = column_of.ravel()
    if without is not None:
        column_of[without] = -1
    members = np.argsort(column_of, kind="stable")[np.count_nonzero(column_of < 0):]
    weight = np.bincount(column_of[members], minlength=len(columns))
    member_at = np.cumsum([0, *weight])
    pieces: list[Piece] = []
    _cut(_graph_of_columns(indptr, indices, column_of, members, member_at), columns, weight, np.flatnonzero(weight), pieces)
    return [Piece(own=_members_of(piece.own, members, member_at), before=piece.before) for piece in pieces]


def _members_of(columns, members, member_at):
    return np.concatenate([np.zeros(0, dtype=np.int64), *(members[member_at[c]:member_at[c + 1]] for c in columns)])


def _graph_of_columns(indptr, indices, column_of, members, member_at):
    """Which columns the pattern couples, in both directions, as a sparse matrix of ones."""
    pairs, size = _neighbours(indptr, indices, column_of, members, member_at), len(member_at) - 1
    graph = sp.csr_matrix((np.ones(len(pairs), dtype=np.float32), pairs.T), shape=(size, size))
    return (graph + graph.T).tocsr()


@njit(cache=True, nogil=True)
def _neighbours(indptr, indices, column_of, members, member_at):
    """Pairs (e, 2) of columns of which the first one's rows have entries in the second, each once."""
    pairs, count, seen = np.empty((len(members), 2), np.int64), 0, np.full(len(member_at) - 1, -1, np.int64)
    for column in range(len(member_at) - 1):
        for row in members[member_at[column]:member_at[column + 1]]:
            for e in range(indptr[row], indptr[row + 1]):
                other = column_of[indices[e]]
                if other >= 0 and seen[other] != column:
                    seen[other] = column
                    if count == len(pairs):
                        pairs = np.concatenate((pairs, np.empty_like(pairs)))
                    pairs[count] = column, other
                    count += 1
    return pairs[:count]


def _cut(graph, places, weight, here, pieces):
    """Append the pieces of some columns (c,), and return the number of the last."""
    part = _best_cut(graph[here][:, here], places[here], weight[here]) if weight[here].sum() > _SMALLEST else None
    before = () if part is None else tuple(_cut(graph, places, weight, here[part == side], pieces) for side in (-1, 1))
    pieces.append(Piece(own=here if part is None else here[part == 0], before=before))
    return len(pieces) - 1


def _best_cut(graph, places, weight):
    """For each column (c,) whether it lies on the cut (0) or on which side of it (-1, 1); None where nothing can be cut."""
    best, part, per_imbalance = np.inf, None, _PRICE_OF_IMBALANCE[places.shape[1]]
    for place in places.T:
        # A column is on the cut at a line where it does not lie beyond, but one of its neighbours does.
        reach, lines = np.maximum.reduceat(place[graph.indices], graph.indptr[:-1]), np.unique(place)
        near, not_beyond = (np.bincount(np.searchsorted(lines, x), weight, len(lines)).cumsum() for x in (reach, place))
        cost = _price(near, not_beyond - near, weight.sum() - not_beyond, per_imbalance)
        if cost.min() < best:
            best, line = cost.min(), lines[cost.argmin()]
            part = np.where(place > line, 1, np.where(reach > line, 0, -1))
    if part is None or places.shape[1] == 2:
        return part
    return shortened(graph, part, lambda side: _price(*np.bincount(side + 1, weight, 3), per_imbalance))


def _price(near, cut, far, per_imbalance):
    """What a cut of such a weight costs: more the less alike its sides, and infinite where one of them is too small."""
    whole = near + cut + far
    cost = cut * (1 + per_imbalance * np.abs(far - near) / whole)
    return np.where(np.minimum(near, far) >= _LEAST_SHARE * whole, cost, np.inf)


def shortened(graph: sp.csr_matrix, side: np.ndarray, cost: Callable[[np.ndarray], float]) -> np.ndarray:
    """A cut of lower cost next to a given one, or that one. Of each node (n,): 0 on the cut, -1 and 1 on its sides.

    graph: symmetric pattern (n, n), whatever its values;  cost: of such an array; infinite where it may not be
    """
    best = cost(side)
    for _ in range(_ROUNDS):
        before = best
        for beyond in (side > 0, side >= 0):
            trial = least_cover(graph, beyond)
            if (price := cost(trial)) < best:
                best, side = price, trial
        if best == before:
            break
    return side


def least_cover(graph: sp.csr_matrix, beyond: np.ndarray) -> np.ndarray:
    """Of each node (n,): 0 for the fewest that touch every edge between two sides, else 1 where it lies `beyond` (n,), else -1."""
    near, far = np.flatnonzero(~beyond), np.flatnonzero(beyond)
    edges = graph[near][:, far].tocsr()
    rows, columns = np.flatnonzero(np.diff(edges.indptr)), np.unique(edges.indices)
    edges = edges[rows][:, columns]
    covered = _cover(edges.indptr, edges.indices, maximum_bipartite_matching(edges, perm_type="column"), len(columns))
    side = np.where(beyond, 1, -1)
    side[near[rows[covered[:len(rows)]]]] = 0
    side[far[columns[covered[len(rows):]]]] = 0
    return side


@njit(cache=True, nogil=True)
def _cover(indptr, indices, matched, columns):
    """Which rows and columns (rows + columns,) touch all entries, from a largest matching {row: column}, by Koenig's theorem."""
    rows = len(matched)
    covered, row_of = np.zeros(rows + columns, np.bool_), np.full(columns, -1, np.int64)
    covered[:rows] = True
    stack, count = np.empty(rows, np.int64), 0
    for row in range(rows):
        if matched[row] >= 0:
            row_of[matched[row]] = row
        else:
            covered[row] = False
            stack[count] = row
            count += 1
    while count:
        count -= 1
        row = stack[count]
        for column in indices[indptr[row]:indptr[row + 1]]:
            if not covered[rows + column]:
                covered[rows + column] = True
                other = row_of[column]
                if covered[other]:
                    covered[other] = False
                    stack[count] = other
                    count += 1
    return covered
