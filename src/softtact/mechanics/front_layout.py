"""Where everything of a sparse matrix' fronts stands: found once for a pattern."""

import numpy as np
import scipy.sparse as sp
from numba import njit

from softtact.mechanics.fronts import Fronts


def lay_out(indptr, indices, pieces):
    """`Fronts` of a matrix whose upper triangle (csr) has this pattern, for `Piece`s of a dissection in the order of elimination.

    Also the unknowns (n,) in that order, and for each entry of the fronts which of the matrix' values it is (nnz,).
    """
    order = np.concatenate([piece.own for piece in pieces])
    own_at = _starts([len(piece.own) for piece in pieces])
    rank = np.empty(len(order), dtype=np.int64)
    owner = np.repeat(np.arange(len(pieces), dtype=np.min_scalar_type(len(pieces))), np.diff(own_at))     # short: sorted below
    rank[order] = np.arange(len(order))
    bound = _bound(indptr, indices, pieces, rank, own_at)
    bound_at, widths = _starts(map(len, bound)), np.diff(own_at) + [len(b) for b in bound]
    one, other = rank[np.repeat(np.arange(len(order)), np.diff(indptr))], rank[indices]
    low, high = np.minimum(one, other), np.maximum(one, other)
    source = np.argsort(owner[low], kind="stable").astype(np.int32)
    entry_at = np.searchsorted(owner[low[source]], np.arange(len(pieces) + 1))
    flat = np.concatenate(bound)
    fronts = Fronts(
        own_at=own_at, bound_at=bound_at, bound=flat, panel_at=_starts(np.diff(own_at) * widths),
        update_at=_starts([len(b)**2 for b in bound]), child_at=_starts(len(piece.before) for piece in pieces),
        child=np.array([child for piece in pieces for child in piece.before], dtype=np.int64),
        place=_places_in_parents(pieces, bound, own_at), entry_at=entry_at,
        target=_targets(own_at, bound_at, flat, entry_at, low[source], high[source]),
        short_at=_starts(np.diff(own_at) * np.diff(bound_at)))
    return fronts, order, source


def _starts(counts):
    return np.cumsum([0, *counts], dtype=np.int64)


def _bound(indptr, indices, pieces, rank, own_at):
    """Piece by piece the later unknowns (b,) that it is coupled with, by the matrix or by what came before it; rising."""
    n = len(rank)
    pattern = sp.csr_matrix((np.ones(len(indices), dtype=np.float32), indices, indptr), shape=(n, n))
    of_pieces = sp.csr_matrix((np.ones(n, dtype=np.float32), np.concatenate([piece.own for piece in pieces]), own_at),
                              shape=(len(pieces), n))
    coupled = (of_pieces @ pattern + of_pieces @ pattern.T).tocsr()
    bound = []
    for p, piece in enumerate(pieces):
        here = rank[coupled.indices[coupled.indptr[p]:coupled.indptr[p + 1]]]
        here = np.unique(np.concatenate([here, *(bound[child] for child in piece.before)]))
        bound.append(here[here >= own_at[p + 1]])
    return bound


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
    """Where in its piece's panel each entry stands, of the unknowns `low` and `high`."""
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
