"""The upper triangle of a symmetric matrix over a mesh: its pattern, and where each element's entries stand in it.

Built by nodes, not by unknowns: nine times less to sort. An unknown is a free component of a node, numbered node by node.
"""

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numba import njit

from softtact.linalg.workers import SERIAL, Workers


class SymmetricPattern:
    """Pattern of the unknowns that meet in an element.

    free (n, 3): which components of the nodes are unknown; elements: arrays (e, m) of node numbers, one per kind.
    """

    def __init__(self, free: np.ndarray, elements: Sequence[np.ndarray]) -> None:
        counts = free.sum(axis=1)
        self.number = np.where(free, np.cumsum(free.ravel()).reshape(free.shape) - 1, -1)
        self.size = int(counts.sum())
        self._rank = np.where(free, np.cumsum(free, axis=1) - 1, -1)
        offsets, members = _ragged(elements)
        self._starts, self._neighbours = _node_graph(counts, offsets, members)
        self._before = _columns_before(self._starts, self._neighbours, counts)
        self.indptr, self.indices = _expand(self.number, counts, self._starts, self._neighbours)

    def matrix(self) -> sp.csr_matrix:
        """A csr matrix of zeros with this pattern."""
        return sp.csr_matrix((np.zeros(len(self.indices)), self.indices, self.indptr), shape=(self.size, self.size))

    def positions(self, nodes: np.ndarray) -> np.ndarray:
        """Places (e, k (k + 1) / 2) in the values of the entries (i, j >= i) of elements (e, m), k = 3 m; -1 where held."""
        return _positions(np.ascontiguousarray(nodes), self.number, self._rank, self._starts, self._neighbours, self._before,
                          self.indptr)


class SymmetricProduct:
    """A x for symmetric matrices of one pattern, given by their upper triangles (csr, sorted, with their diagonals).

    Values are read once, not once for each triangle, and the columns of rows that have the same ones (a node's three) once for all.
    """

    _parts: list[tuple[int, np.ndarray]]

    def __init__(self, indptr: np.ndarray, indices: np.ndarray) -> None:
        self._indptr, self._indices = indptr, indices
        alike = _rows_alike(indptr, indices)
        first = np.cumsum([0, *alike])
        half = np.searchsorted(indptr[first], indptr[-1] // 2)
        self._parts = [(0, alike[:half]), (first[half], alike[half:])]     # as many values in each; sums do not depend on threads

    def __call__(self, data: np.ndarray, x: np.ndarray, *, workers: Workers = SERIAL) -> np.ndarray:
        """A x (n,) in double precision, whatever that of the values."""
        one, other = workers.map(lambda part: _symmetric_product(self._indptr, self._indices, data, *part, x), self._parts)
        return one + other


@njit(cache=True, nogil=True)
def _rows_alike(indptr, indices):
    """How many rows, one after the other, have the same columns from their diagonals on, all of them in threes: else ones."""
    alike, count, row = np.empty(len(indptr) - 1, np.int8), 0, 0
    while row < len(indptr) - 1:
        together = row + 2 < len(indptr) - 1
        for later in range(1, 3):
            if together:
                first, second, end = indptr[row] + later, indptr[row + later], indptr[row + later + 1]
                together = indptr[row + 1] - first == end - second and (indices[first:indptr[row + 1]] == indices[second:end]).all()
        together = together and _in_threes(indices[indptr[row]:indptr[row + 1]])
        alike[count] = 3 if together else 1
        row += alike[count]
        count += 1
    return alike[:count].copy()


@njit(cache=True, nogil=True)
def _in_threes(columns):
    """Whether columns come in groups of three that follow on each other."""
    if len(columns) % 3:
        return False
    for k in range(0, len(columns), 3):
        if columns[k + 1] != columns[k] + 1 or columns[k + 2] != columns[k] + 2:
            return False
    return True


@njit(cache=True, nogil=True)
def _symmetric_product(indptr, indices, data, row, alike, x):
    """What the rows from `row` on give, by their upper halves."""
    out = np.zeros(len(x))
    for rows in alike:
        if rows == 3:
            _add_three_rows(row, indptr, indices, data, x, out)
        else:
            own, total = x[row], 0.0
            for k in range(indptr[row], indptr[row + 1]):
                column, value = indices[k], data[k]
                total += value * x[column]
                if column != row:
                    out[column] += value * own
            out[row] += total
        row += rows
    return out


@njit(cache=True, nogil=True, fastmath=True)
def _add_three_rows(row, indptr, indices, data, x, out):
    # Unsigned places: numba asks of signed ones whether they count from the end.
    one, two, three = np.uintp(1), np.uintp(2), np.uintp(3)
    columns = indices[indptr[row]:indptr[row + 1]]
    first, second, third = (data[indptr[row]:indptr[row + 1]], data[indptr[row + 1]:indptr[row + 2]],
                            data[indptr[row + 2]:indptr[row + 3]])
    x0, x1, x2 = x[row], x[row + 1], x[row + 2]
    total0 = first[0] * x0 + first[1] * x1 + first[2] * x2
    total1 = first[1] * x0 + second[0] * x1 + second[1] * x2
    total2 = first[2] * x0 + second[1] * x1 + third[0] * x2
    k, end = three, np.uintp(len(columns))
    while k < end:
        c = np.uintp(columns[k])
        a0, a1, a2 = first[k], first[k + one], first[k + two]
        b0, b1, b2 = second[k - one], second[k], second[k + one]
        c0, c1, c2 = third[k - two], third[k - one], third[k]
        y0, y1, y2 = x[c], x[c + one], x[c + two]
        total0 += a0 * y0 + a1 * y1 + a2 * y2
        total1 += b0 * y0 + b1 * y1 + b2 * y2
        total2 += c0 * y0 + c1 * y1 + c2 * y2
        out[c] += a0 * x0 + b0 * x1 + c0 * x2
        out[c + one] += a1 * x0 + b1 * x1 + c1 * x2
        out[c + two] += a2 * x0 + b2 * x1 + c2 * x2
        k += three
    out[row] += total0
    out[row + 1] += total1
    out[row + 2] += total2


def _ragged(elements):
    """Node numbers of elements of all kinds in one array, and where each element begins."""
    sizes = np.concatenate([np.full(len(nodes), nodes.shape[1]) for nodes in elements])
    return np.concatenate([[0], np.cumsum(sizes)]), np.concatenate([nodes.ravel() for nodes in elements])


@njit(cache=True, nogil=True)
def _node_graph(counts, offsets, members):
    """Compressed rows of the nodes b >= a that share an element with node a; nodes without unknowns are left out."""
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
    row, neighbours, used = np.empty(nodes, np.int64), np.empty(16 * nodes, np.int64), 0
    for a in range(nodes):
        length = 0
        for t in range(begin[a], begin[a + 1] if counts[a] else begin[a]):
            e = elements_of[t]
            for k in range(offsets[e], offsets[e + 1]):
                b = members[k]
                if b >= a and counts[b] and seen[b] != a:
                    seen[b] = a
                    row[length] = b
                    length += 1
        if used + length > len(neighbours):
            longer = np.empty(2 * (used + length), np.int64)
            longer[:used] = neighbours[:used]
            neighbours = longer
        neighbours[used:used + length] = np.sort(row[:length])
        used += length
        starts[a + 1] = used
    return starts, neighbours[:used].copy()


@njit(cache=True, nogil=True)
def _columns_before(starts, neighbours, counts):
    """How many unknowns stand in a node's row before each of its neighbours."""
    before = np.empty(len(neighbours), np.int64)
    for a in range(len(starts) - 1):
        total = 0
        for t in range(starts[a], starts[a + 1]):
            before[t] = total
            total += counts[neighbours[t]]
    return before


@njit(cache=True, nogil=True)
def _expand(number, counts, starts, neighbours):
    """indptr and indices (int32) of the unknowns from the graph of the nodes."""
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


@njit(cache=True, nogil=True)
def _place_of(value, low, high, wanted):
    """Where in the rising values from low to high the wanted one stands."""
    while high - low > 1:
        middle = (low + high) // 2
        if value[middle] <= wanted:
            low = middle
        else:
            high = middle
    return low


@njit(cache=True, nogil=True)
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


@njit(cache=True, nogil=True, inline="always")
def _entries_before(row, size):
    """Where column 0 of a row would stand among the entries (i, j >= i) of a matrix, row by row."""
    return row * size - row * (row - 1) // 2 - row


@njit(cache=True, nogil=True)
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
    """indptr, indices of the upper triangle of all unknowns that meet in an element; members (e, k), -1 where held."""
    starts = np.cumsum([0, *map(len, members)])
    rows = np.concatenate([np.repeat(np.arange(first, first + len(dofs)), dofs.shape[1])
                           for first, dofs in zip(starts, members, strict=False)])
    columns = np.concatenate([dofs.ravel() for dofs in members])
    here = columns >= 0
    incidence = sp.csr_matrix((np.ones(here.sum(), dtype=bool), (rows[here], columns[here])), shape=(starts[-1], size))
    pattern = sp.triu(incidence.T @ incidence, format="csr")
    pattern.sort_indices()
    return pattern.indptr, pattern.indices


@njit(cache=True, nogil=True)
def upper_positions(indptr: np.ndarray, indices: np.ndarray, dofs: np.ndarray) -> np.ndarray:
    """Places (e, k (k + 1) / 2) in the values of the upper triangle for entries (i, j >= i) of matrices of unknowns (e, k).

    -1 where one is held.
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
