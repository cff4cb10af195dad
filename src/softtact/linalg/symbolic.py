"""Symbolic factorisation, once for a pattern: the order of elimination by nested dissection, and the layout of the fronts.

A body is cut along lines or planes by the positions of its nodes, recursively; the cuts are eliminated last. In the plane this
order is optimal up to a constant factor (George, SIAM J. Numer. Anal. 10, 1973). A general ordering has to find the lines first: it
takes five times as long for a third more operations on a wide and thin sensor's lattice
(docs/notebook/2026-11-25-linear-solver.md). In space the cuts begin as planes and are then shortened node by node: on a body of
irregular tetrahedra that saves more than half of the operations (docs/notebook/2026-11-26-solids-in-single-precision.md).

A cut along a plane through irregular tetrahedra holds the nodes of a layer of elements. The fewest nodes that touch all edges
between the two sides are a cut, too, mostly a single sheet of nodes. The nodes of a cut can be counted to either side, so this is
repeated until nothing is gained.
Reference: Pothen and Fan, ACM Trans. Math. Softw. 16 (1990), on covers by Koenig's theorem.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import maximum_bipartite_matching

from softtact.compiled import compiled
from softtact.linalg.multifrontal import Fronts

_LEAST_SHARE = 0.1           # of the unknowns, on the smaller side of a cut
_PRICE_OF_IMBALANCE = {2: 2.0, 3: 1.0}   # in plan, in space: a cut between parts of unequal size counts as longer
_SMALLEST = 200              # unknowns: parts with fewer are not cut; smaller parts mean fewer but slower operations
_GRID_MM = 1e-6              # nodes whose positions round to the same are one column
_ROUNDS = 8


@dataclass(frozen=True)
class Piece:
    """A cut, or a part that was not cut further: its pivots, the unknowns (k,) that it eliminates, and the pieces before it."""

    pivots: np.ndarray
    before: tuple


def dissect(indptr: np.ndarray, indices: np.ndarray, places: np.ndarray, *, without: np.ndarray | None = None) -> list[Piece]:
    """`Piece`s of a symmetric matrix, each after those that it depends on; the first cut is the last piece.

    indptr, indices: pattern of its upper triangle (csr);  places (n, 2 or 3): position of each unknown, in plan or in
    space, in mm;  without: unknowns (k,) that belong to no piece
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
    return [Piece(pivots=_members_of(piece.pivots, members, member_at), before=piece.before) for piece in pieces]


def _members_of(columns, members, member_at):
    return np.concatenate([np.zeros(0, dtype=np.int64), *(members[member_at[c]:member_at[c + 1]] for c in columns)])


def _graph_of_columns(indptr, indices, column_of, members, member_at):
    """The symmetric graph of columns that the pattern couples, as a sparse matrix of ones."""
    pairs, size = _neighbours(indptr, indices, column_of, members, member_at), len(member_at) - 1
    graph = sp.csr_matrix((np.ones(len(pairs), dtype=np.float32), pairs.T), shape=(size, size))
    return (graph + graph.T).tocsr()


@compiled
def _neighbours(indptr, indices, column_of, members, member_at):
    """Pairs (e, 2) of columns such that a row of the first has an entry in the second, each pair once."""
    pairs, count, seen = np.empty((len(members), 2), np.int64), 0, np.full(len(member_at) - 1, -1, np.int64)
    for column in range(len(member_at) - 1):
        for row in members[member_at[column]:member_at[column + 1]]:
            for e in range(indptr[row], indptr[row + 1]):
                other = column_of[indices[e]]
                if other >= 0 and seen[other] != column:
                    seen[other] = column
                    if count == len(pairs):
                        pairs = np.concatenate((pairs, np.empty_like(pairs)))
                    pairs[count, 0], pairs[count, 1] = column, other
                    count += 1
    return pairs[:count]


def _cut(graph, places, weight, here, pieces):
    """Append the pieces of columns `here` (c,), and return the number of the last."""
    part = _best_cut(graph[here][:, here], places[here], weight[here]) if weight[here].sum() > _SMALLEST else None
    before = () if part is None else tuple(_cut(graph, places, weight, here[part == side], pieces) for side in (-1, 1))
    pieces.append(Piece(pivots=here if part is None else here[part == 0], before=before))
    return len(pieces) - 1


def _best_cut(graph, places, weight):
    """For each column (c,) whether it lies on the cut (0) or on which side of it (-1, 1); None where nothing can be cut."""
    best, part, per_imbalance = np.inf, None, _PRICE_OF_IMBALANCE[places.shape[1]]
    for place in places.T:
        # A column is on the cut at a line if it does not lie beyond the line but one of its neighbours does.
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
    """Cost of a cut by its weight and the weights of its sides: larger for unequal sides, infinite where one is too small."""
    whole = near + cut + far
    cost = cut * (1 + per_imbalance * np.abs(far - near) / whole)
    return np.where(np.minimum(near, far) >= _LEAST_SHARE * whole, cost, np.inf)


def shortened(graph: sp.csr_matrix, side: np.ndarray, cost: Callable[[np.ndarray], float]) -> np.ndarray:
    """A cut near a given one with a lower cost, else the given one. For each node (n,): 0 on the cut, -1 and 1 on its sides.

    graph: symmetric pattern (n, n), whatever its values;  cost: of such an array; infinite for a cut that is not allowed
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
    """For each node (n,): 0 in the smallest set that touches every edge between two sides, else 1 where `beyond` (n,), else -1."""
    near, far = np.flatnonzero(~beyond), np.flatnonzero(beyond)
    edges = graph[near][:, far].tocsr()
    rows, columns = np.flatnonzero(np.diff(edges.indptr)), np.unique(edges.indices)
    edges = edges[rows][:, columns]
    covered = _cover(edges.indptr, edges.indices, maximum_bipartite_matching(edges, perm_type="column"), len(columns))
    side = np.where(beyond, 1, -1)
    side[near[rows[covered[:len(rows)]]]] = 0
    side[far[columns[covered[len(rows):]]]] = 0
    return side


@compiled
def _cover(indptr, indices, matched, columns):
    """The smallest cover of all entries by rows and columns (rows + columns,), from a largest matching (Koenig's theorem)."""
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


def lay_out(indptr: np.ndarray, indices: np.ndarray, pieces: Sequence[Piece], *,
            bordered: bool = False) -> tuple[Fronts, np.ndarray]:
    """`Fronts` of a matrix whose upper triangle (csr) has this pattern, for `Piece`s of a dissection in the order of elimination.

    bordered: one more unknown, coupled with all and in the last piece; its column's entries follow those of the pattern
    Also the unknowns (n,) in that order. `with_storage` places panels and updates in memory, as that depends on the distribution of
    the work.
    """
    order = np.concatenate([piece.pivots for piece in pieces])
    pivot_at = _starts([len(piece.pivots) for piece in pieces])
    rank = np.empty(len(order), dtype=np.int32)
    rank[order] = np.arange(len(order))
    owner = np.repeat(np.arange(len(pieces)), np.diff(pivot_at))
    entry_at, source, low, high = _entries(indptr, indices, bordered, rank, owner, len(pieces))
    boundary = _boundary(pieces, pivot_at, entry_at, high)
    boundary_at, flat = _starts(map(len, boundary)), np.concatenate(boundary)
    fronts = Fronts(
        pivot_at=pivot_at, boundary_at=boundary_at, boundary=flat, child_at=_starts(len(piece.before) for piece in pieces),
        child=np.array([child for piece in pieces for child in piece.before], dtype=np.int64),
        place=_places_in_parents(pieces, boundary, pivot_at), entry_at=entry_at, source=source,
        target=_targets(pivot_at, boundary_at, flat, entry_at, low, high),
        triangle_at=_starts(np.diff(pivot_at) * (np.diff(pivot_at) + 1) // 2),
        short_at=_starts(np.diff(pivot_at) * np.diff(boundary_at)), panel_at=None, update_at=None)
    return fronts, order


def with_storage(fronts: Fronts, parts: Sequence[np.ndarray], levels: Sequence[np.ndarray]) -> tuple[Fronts, int]:
    """Fronts with places for their panels and updates in one array, and the length of that array.

    parts: pieces (k,) that are factored one after the other, the parts in parallel;  levels: pieces (k,), after all parts and one
    level after the other
    A panel is needed while its piece is factored, an update until it is added to a later front.
    """
    pivots, boundary = np.diff(fronts.pivot_at), np.diff(fronts.boundary_at)
    panel_at, update_at = np.zeros(len(pivots), dtype=np.int64), np.zeros(len(pivots), dtype=np.int64)
    panels, updates, memory = pivots * (pivots + boundary), boundary**2, _Memory(0)

    def allocate(pieces, memory):
        for p in pieces:
            panel_at[p], update_at[p] = memory.allocate(panels[p]), memory.allocate(updates[p])

    def free(pieces, memory):
        for p in pieces:
            memory.free(panel_at[p], panels[p])
            for child in fronts.child[fronts.child_at[p]:fronts.child_at[p + 1]]:
                memory.free(update_at[child], updates[child])

    still_used: list[tuple[int, int]] = []
    for part in parts:
        part_memory = _Memory(memory.end)
        for p in part:
            allocate([p], part_memory)
            free([p], part_memory)
        still_used, memory = still_used + part_memory.used, part_memory
    memory.start, memory.used = 0, sorted(still_used)
    for level in levels:
        allocate(level, memory)
        free(level, memory)
    return fronts._replace(panel_at=panel_at, update_at=update_at), memory.end


class _Memory:
    """First-fit allocation in an array: the intervals (start, end) in use, rising, and the largest end so far."""

    def __init__(self, start):
        self.start, self.end, self.used = start, start, []

    def allocate(self, size):
        """The first gap from `start` on with `size` entries."""
        place, number = self.start, 0
        while size and number < len(self.used) and self.used[number][0] - place < size:
            place, number = self.used[number][1], number + 1
        if size:
            self.used.insert(number, (place, place + int(size)))
        self.end = max(self.end, place + int(size))
        return place

    def free(self, place, size):
        """Free the interval that was allocated at this place."""
        if size:
            self.used.remove((place, place + size))


def _starts(counts):
    return np.cumsum([0, *counts], dtype=np.int64)


@compiled
def _entries(indptr, indices, bordered, rank, owner, pieces):
    """Numbers of the matrix' entries (e,), piece by piece from `entry_at` (pieces + 1,) on, and the ranks of their two unknowns.

    owner: piece of each rank; an entry belongs to the piece that eliminates the first of its unknowns.
    """
    counts, rows = np.zeros(pieces + 1, np.int64), len(indptr) - 1
    for row in range(rows):
        for e in range(indptr[row], indptr[row + 1]):
            counts[owner[min(rank[row], rank[indices[e]])] + 1] += 1
        if bordered:
            counts[owner[rank[row]] + 1] += 1
    if bordered:
        counts[pieces] += 1
    entry_at = np.cumsum(counts)
    count, at = entry_at[-1], entry_at.copy()
    source, low, high = np.empty(count, np.int32), np.empty(count, np.int32), np.empty(count, np.int32)
    for row in range(rows + bordered):
        end = indptr[row + 1] if row < rows else indptr[row]
        for e in range(indptr[row], end + bordered):
            border = e == end
            one, other = rank[row], rank[rows if border else indices[e]]
            first = min(one, other)
            place = at[owner[first]]
            at[owner[first]] += 1
            source[place], low[place], high[place] = indptr[rows] + row if border else e, first, max(one, other)
    return entry_at, source, low, high


def _boundary(pieces, pivot_at, entry_at, high):
    """For each piece the later unknowns (b,) that it is coupled with, by the matrix or by updates before it; rising."""
    boundary, seen = [], np.full(pivot_at[-1], -1, dtype=np.int64)
    for p, piece in enumerate(pieces):
        passed_on = np.concatenate([np.zeros(0, dtype=np.int64), *(boundary[child] for child in piece.before)])
        boundary.append(np.sort(_later(p, pivot_at[p + 1], high[entry_at[p]:entry_at[p + 1]], passed_on, seen)))
    return boundary


@compiled
def _later(p, end, high, passed_on, seen):
    """The ranks from `end` on in two lists, each once; `seen` (n,): the last piece that listed a rank."""
    out, count = np.empty(len(seen) - end, np.int64), 0
    for some in (high.astype(np.int64), passed_on):
        for k in some:
            if k >= end and seen[k] != p:
                seen[k] = p
                out[count] = k
                count += 1
    return out[:count]


def _places_in_parents(pieces, boundary, pivot_at):
    """Rows of the pieces' boundaries in the fronts that their updates are added to, concatenated."""
    places = [np.zeros(0, dtype=np.int64)] * len(pieces)
    for p, piece in enumerate(pieces):
        for child in piece.before:
            is_pivot = boundary[child] < pivot_at[p + 1]
            places[child] = np.where(is_pivot, boundary[child] - pivot_at[p],
                                     pivot_at[p + 1] - pivot_at[p] + np.searchsorted(boundary[p], boundary[child]))
    return np.concatenate(places).astype(np.int32)


@compiled
def _targets(pivot_at, boundary_at, boundary, entry_at, low, high):
    """Place in its piece's panel of each entry, whose unknowns are `low` and `high`."""
    out, place = np.empty(len(low), np.int32), np.zeros(pivot_at[-1], np.int64)
    for p in range(len(pivot_at) - 1):
        first, pivots = pivot_at[p], pivot_at[p + 1] - pivot_at[p]
        width = pivots + boundary_at[p + 1] - boundary_at[p]
        for k in range(pivots):
            place[first + k] = k
        for k in range(boundary_at[p + 1] - boundary_at[p]):
            place[boundary[boundary_at[p] + k]] = pivots + k
        for e in range(entry_at[p], entry_at[p + 1]):
            out[e] = (low[e] - first) * width + place[high[e]]
    return out
