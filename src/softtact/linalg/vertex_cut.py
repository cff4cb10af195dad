"""Fewest nodes that part two sides of a graph, next to a cut that is known.

A cut along a plane through irregular tetrahedra takes with it a layer of elements' nodes. Of the edges between the two sides, the
fewest nodes that touch all of them are a cut, too, mostly one sheet of nodes; and which nodes of a cut count to either side may be
chosen anew until nothing is gained.
Reference: Pothen and Fan, ACM Trans. Math. Softw. 16 (1990), on covers by Koenig's theorem.
"""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from numba import njit
from scipy.sparse.csgraph import maximum_bipartite_matching

_ROUNDS = 8


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
