"""Symbolic factorisation: the places of everything in a sparse matrix's fronts, found once for a pattern."""

from collections.abc import Sequence

import numpy as np
from numba import njit

from softtact.linalg.multifrontal import Fronts
from softtact.linalg.nested_dissection import Piece


def lay_out(indptr: np.ndarray, indices: np.ndarray, pieces: Sequence[Piece], *,
            bordered: bool = False) -> tuple[Fronts, np.ndarray]:
    """`Fronts` of a matrix whose upper triangle (csr) has this pattern, for `Piece`s of a dissection in the order of elimination.

    bordered: one more unknown, coupled with all and in the last piece; its column's entries come behind those of the pattern
    Also the unknowns (n,) in that order. Where panels and updates lie while they are needed depends on who works on which when:
    `with_room` gives them their places.
    """
    order = np.concatenate([piece.own for piece in pieces])
    own_at = _starts([len(piece.own) for piece in pieces])
    rank = np.empty(len(order), dtype=np.int32)
    rank[order] = np.arange(len(order))
    owner = np.repeat(np.arange(len(pieces)), np.diff(own_at))
    entry_at, source, low, high = _entries(indptr, indices, bordered, rank, owner, len(pieces))
    bound = _bound(pieces, own_at, entry_at, high)
    bound_at, flat = _starts(map(len, bound)), np.concatenate(bound)
    fronts = Fronts(
        own_at=own_at, bound_at=bound_at, bound=flat, child_at=_starts(len(piece.before) for piece in pieces),
        child=np.array([child for piece in pieces for child in piece.before], dtype=np.int64),
        place=_places_in_parents(pieces, bound, own_at), entry_at=entry_at, source=source,
        target=_targets(own_at, bound_at, flat, entry_at, low, high),
        triangle_at=_starts(np.diff(own_at) * (np.diff(own_at) + 1) // 2),
        short_at=_starts(np.diff(own_at) * np.diff(bound_at)), panel_at=None, update_at=None)
    return fronts, order


def with_room(fronts: Fronts, parts: Sequence[np.ndarray], levels: Sequence[np.ndarray]) -> tuple[Fronts, int]:
    """Fronts with places for their panels and updates, and how much room these take together.

    parts: pieces (k,) that are worked on one after the other, the parts at the same time;  levels: pieces (k,), behind all parts
    and one level after the other
    A panel is needed while its piece is worked on, an update until it is taken over.
    """
    own, bound = np.diff(fronts.own_at), np.diff(fronts.bound_at)
    panel_at, update_at = np.zeros(len(own), dtype=np.int64), np.zeros(len(own), dtype=np.int64)
    panels, updates, room = own * (own + bound), bound**2, _Room(0)

    def enter(pieces, room):
        for p in pieces:
            panel_at[p], update_at[p] = room.take(panels[p]), room.take(updates[p])

    def leave(pieces, room):
        for p in pieces:
            room.give_back(panel_at[p], panels[p])
            for child in fronts.child[fronts.child_at[p]:fronts.child_at[p + 1]]:
                room.give_back(update_at[child], updates[child])

    ended: list[tuple[int, int]] = []
    for part in parts:
        own_room = _Room(room.most)
        for p in part:
            enter([p], own_room)
            leave([p], own_room)
        ended, room = ended + own_room.taken, own_room
    room.start, room.taken = 0, sorted(ended)
    for level in levels:
        enter(level, room)
        leave(level, room)
    return fronts._replace(panel_at=panel_at, update_at=update_at), room.most


class _Room:
    """Places on a line: what is taken as (start, end), rising, and the farthest end so far."""

    def __init__(self, start):
        self.start, self.most, self.taken = start, start, []

    def take(self, size):
        """The first place behind `start` with so much room."""
        place, behind = self.start, 0
        while size and behind < len(self.taken) and self.taken[behind][0] - place < size:
            place, behind = self.taken[behind][1], behind + 1
        if size:
            self.taken.insert(behind, (place, place + int(size)))
        self.most = max(self.most, place + int(size))
        return place

    def give_back(self, place, size):
        """What was taken from this place on."""
        if size:
            self.taken.remove((place, place + size))


def _starts(counts):
    return np.cumsum([0, *counts], dtype=np.int64)


@njit(cache=True, nogil=True)
def _entries(indptr, indices, bordered, rank, owner, pieces):
    """Which entries (e,) each piece takes up, piece by piece from `entry_at` (pieces + 1,) on, and their two unknowns' ranks.

    owner: of each rank; an entry is of the piece that eliminates the first of its unknowns.
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


def _bound(pieces, own_at, entry_at, high):
    """Piece by piece the later unknowns (b,) that it is coupled with, by the matrix or by what came before it; rising."""
    bound, seen = [], np.full(own_at[-1], -1, dtype=np.int64)
    for p, piece in enumerate(pieces):
        passed_on = np.concatenate([np.zeros(0, dtype=np.int64), *(bound[child] for child in piece.before)])
        bound.append(np.sort(_later(p, own_at[p + 1], high[entry_at[p]:entry_at[p + 1]], passed_on, seen)))
    return bound


@njit(cache=True, nogil=True)
def _later(p, end, high, passed_on, seen):
    """The ranks from `end` on among two lists, each once; `seen` (n,): the last piece that met a rank."""
    out, count = np.empty(len(seen) - end, np.int64), 0
    for some in (high.astype(np.int64), passed_on):
        for k in some:
            if k >= end and seen[k] != p:
                seen[k] = p
                out[count] = k
                count += 1
    return out[:count]


def _places_in_parents(pieces, bound, own_at):
    places = [np.zeros(0, dtype=np.int64)] * len(pieces)
    for p, piece in enumerate(pieces):
        for child in piece.before:
            mine = bound[child] < own_at[p + 1]
            places[child] = np.where(mine, bound[child] - own_at[p],
                                     own_at[p + 1] - own_at[p] + np.searchsorted(bound[p], bound[child]))
    return np.concatenate(places).astype(np.int32)


@njit(cache=True)
def _targets(own_at, bound_at, bound, entry_at, low, high):
    """Place of each entry in its piece's panel, of the unknowns `low` and `high`."""
    out, place = np.empty(len(low), np.int32), np.zeros(own_at[-1], np.int64)
    for p in range(len(own_at) - 1):
        first, own = own_at[p], own_at[p + 1] - own_at[p]
        width = own + bound_at[p + 1] - bound_at[p]
        for k in range(own):
            place[first + k] = k
        for k in range(bound_at[p + 1] - bound_at[p]):
            place[bound[bound_at[p] + k]] = own + k
        for e in range(entry_at[p], entry_at[p + 1]):
            out[e] = (low[e] - first) * width + place[high[e]]
    return out
