"""The upper triangle of a symmetric matrix over a mesh: its sparsity pattern, and the positions of each element's entries.

The pattern is built from the graph of the nodes, with a ninth of the entries to sort. Unknowns are the free components of nodes,
numbered node by node."""

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp

from softtact.compiled import compiled


class SymmetricPattern:
    """Pattern of the unknowns that share an element.

    free (n, 3): which components of the nodes are unknowns; elements: arrays (e, m) of node numbers, one per kind.
    """

    def __init__(self, free: np.ndarray, elements: Sequence[np.ndarray]) -> None:
        counts = free.sum(axis=1)
        self.number = np.where(free, np.cumsum(free.ravel()).reshape(free.shape) - 1, -1)
        self.size = int(counts.sum())
        self._rank = np.where(free, np.cumsum(free, axis=1) - 1, -1)
        offsets, members = _ragged(elements)
        self._starts, self._neighbours = _with_sorted_rows(*_node_graph(counts, offsets, members))
        self._before = _columns_before(self._starts, self._neighbours, counts)
        self.indptr, self.indices = _expand(self.number, counts, self._starts, self._neighbours)

    def matrix(self) -> sp.csr_matrix:
        """A csr matrix of zeros with this pattern."""
        return sp.csr_matrix((np.zeros(len(self.indices)), self.indices, self.indptr), shape=(self.size, self.size))

    def positions(self, nodes: np.ndarray) -> np.ndarray:
        """Positions (e, k (k + 1) / 2) of the entries (i, j >= i) of elements (e, m) in the values, k = 3 m; -1 where fixed."""
        return _positions(np.ascontiguousarray(nodes), self.number, self._rank, self._starts, self._neighbours, self._before,
                          self.indptr)


def _ragged(elements):
    """Node numbers of elements of all kinds in one array, and the offset of each element."""
    sizes = np.concatenate([np.full(len(nodes), nodes.shape[1]) for nodes in elements])
    return np.concatenate([[0], np.cumsum(sizes)]), np.concatenate([nodes.ravel() for nodes in elements])


def _with_sorted_rows(starts, neighbours):
    """Compressed rows with rising neighbours."""
    nodes = len(starts) - 1
    graph = sp.csr_matrix((np.ones(len(neighbours), dtype=bool), neighbours, starts), shape=(nodes, nodes))
    graph.sort_indices()
    return starts, graph.indices.astype(np.int64)


@compiled
def _node_graph(counts, offsets, members):
    """Compressed rows of the nodes b >= a that share an element with node a, in any order; nodes without unknowns are left out."""
    nodes = len(counts)
    begin = np.zeros(nodes + 1, np.int64)
    for node in members:
        begin[node + 1] += 1
    begin = np.cumsum(begin)
    elements_of, fill = np.empty(len(members), np.int64), begin[:-1].copy()
    for e in range(len(offsets) - 1):
        for k in range(offsets[e], offsets[e + 1]):
            elements_of[fill[members[k]]] = e
            fill[members[k]] += 1
    starts, seen = np.zeros(nodes + 1, np.int64), np.full(nodes, -1)
    neighbours, used = np.empty(16 * nodes, np.int64), 0
    for a in range(nodes):
        if used + nodes > len(neighbours):
            longer = np.empty(2 * (used + nodes), np.int64)
            for t in range(used):
                longer[t] = neighbours[t]
            neighbours = longer
        for t in range(begin[a], begin[a + 1] if counts[a] else begin[a]):
            e = elements_of[t]
            for k in range(offsets[e], offsets[e + 1]):
                b = members[k]
                if b >= a and counts[b] and seen[b] != a:
                    seen[b] = a
                    neighbours[used] = b
                    used += 1
        starts[a + 1] = used
    return starts, neighbours[:used].copy()


@compiled
def _columns_before(starts, neighbours, counts):
    """Number of unknowns in a node's row before each of its neighbours."""
    before = np.empty(len(neighbours), np.int64)
    for a in range(len(starts) - 1):
        total = 0
        for t in range(starts[a], starts[a + 1]):
            before[t] = total
            total += counts[neighbours[t]]
    return before


@compiled
def _expand(number, counts, starts, neighbours):
    """indptr and indices (int32) of the unknowns' pattern from the graph of the nodes."""
    size = counts.sum()
    indptr = np.zeros(size + 1, np.int32)
    for a in range(len(counts)):
        width, rank = 0, 0
        for t in range(starts[a], starts[a + 1]):
            width += counts[neighbours[t]]
        for i in range(3):
            if number[a, i] >= 0:
                indptr[number[a, i] + 1] = width - rank
                rank += 1
    indptr = np.cumsum(indptr).astype(np.int32)
    indices = np.empty(indptr[-1], np.int32)
    for a in range(len(counts)):
        for i in range(3):
            row = number[a, i]
            if row >= 0:
                place = indptr[row]
                for t in range(starts[a], starts[a + 1]):
                    for k in range(3):
                        column = number[neighbours[t], k]
                        if column >= row:
                            indices[place] = column
                            place += 1
    return indptr, indices


@compiled(inline="always")
def _place_of(value, low, high, wanted):
    """Index of the wanted value among the rising values from low to high (binary search)."""
    while high - low > 1:
        middle = (low + high) // 2
        if value[middle] <= wanted:
            low = middle
        else:
            high = middle
    return low


@compiled
def _positions(nodes, number, rank, starts, neighbours, before, indptr):
    elements, m = nodes.shape
    k = 3 * m
    out = np.empty((elements, k * (k + 1) // 2), np.int32)
    for e in range(elements):
        for p in range(m):
            for q in range(p, m):
                a, b = nodes[e, p], nodes[e, q]
                low, high = min(a, b), max(a, b)
                columns = before[_place_of(neighbours, starts[low], starts[low + 1], high)]
                for i in range(3):
                    n = _entries_before(3 * p + i, k) + 3 * q
                    one, its_rank = number[a, i], rank[a, i]
                    for j in range(i if p == q else 0, 3):
                        other = number[b, j]
                        if one < 0 or other < 0:
                            out[e, n + j] = -1
                        elif one <= other:
                            out[e, n + j] = indptr[one] + columns - its_rank + rank[b, j]
                        else:
                            out[e, n + j] = indptr[other] + columns - rank[b, j] + its_rank
    return out


@compiled(inline="always")
def _entries_before(row, size):
    """The position that column 0 of a row would have among the entries (i, j >= i) of a matrix, row by row."""
    return row * size - row * (row - 1) // 2 - row


@compiled
def add_upper(values: np.ndarray, matrices: np.ndarray, positions: np.ndarray) -> None:
    """Add symmetric element matrices (e, k, k) at their `positions`."""
    k = matrices.shape[1]
    for e in range(len(matrices)):
        n = 0
        for i in range(k):
            for j in range(i, k):
                place = positions[e, n]
                if place >= 0:
                    values[place] += matrices[e, i, j]
                n += 1


def upper_pattern(members: Sequence[np.ndarray], size: int) -> tuple[np.ndarray, np.ndarray]:
    """indptr, indices of the upper triangle of all unknowns that share an element; members (e, k), -1 where fixed."""
    starts = np.cumsum([0, *map(len, members)])
    rows = np.concatenate([np.repeat(np.arange(first, first + len(dofs)), dofs.shape[1])
                           for first, dofs in zip(starts, members, strict=False)])
    columns = np.concatenate([dofs.ravel() for dofs in members])
    here = columns >= 0
    incidence = sp.csr_matrix((np.ones(here.sum(), dtype=bool), (rows[here], columns[here])), shape=(starts[-1], size))
    pattern = sp.triu(incidence.T @ incidence, format="csr")
    pattern.sort_indices()
    return pattern.indptr, pattern.indices


@compiled
def upper_positions(indptr: np.ndarray, indices: np.ndarray, dofs: np.ndarray) -> np.ndarray:
    """Positions (e, k (k + 1) / 2) in the upper triangle's values of the entries (i, j >= i) of element matrices, unknowns (e, k).

    -1 where one is fixed.
    """
    elements, size = dofs.shape
    out = np.full((elements, size * (size + 1) // 2), -1, np.int32)
    for e in range(elements):
        n = -1
        for i in range(size):
            for j in range(i, size):
                n += 1
                row, column = min(dofs[e, i], dofs[e, j]), max(dofs[e, i], dofs[e, j])
                if row >= 0:
                    out[e, n] = _place_of(indices, indptr[row], indptr[row + 1], column)
    return out
