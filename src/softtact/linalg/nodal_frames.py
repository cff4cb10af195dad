"""Local frames of nodes, so that displacements along given directions are unknowns of a system."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from softtact.compiled import compiled


@dataclass(frozen=True)
class NodeFrames:
    """Selected directions at nodes, and other selected unknowns.

    first (k,): the first of each node's three unknowns x, y, z, rising;  turns (k, 3, 3): unit vectors in columns
    wanted (k,): number of selected vectors, 1 to 3, counted from the last;  others (o,): other selected unknowns
    """

    first: np.ndarray
    turns: np.ndarray
    wanted: np.ndarray
    others: np.ndarray

    @cached_property
    def _selected(self):
        """Nodes (m,) and their vectors (m,)."""
        return np.nonzero(np.arange(3) >= 3 - self.wanted[:, None])

    @cached_property
    def last(self) -> np.ndarray:
        """The selected unknowns (m + o,) in the local frames: displacements along the vectors, and the others."""
        node, vector = self._selected
        return np.append(self.first[node] + vector, self.others)

    def movements(self, unknowns: int) -> sp.csr_matrix:
        """Sparse matrix (unknowns, m + o): a unit of each of the selected displacements."""
        (node, vector), along, (m, o) = self._selected, np.arange(3), (len(self._selected[0]), len(self.others))
        rows = np.append(self.first[node, None] + along, self.others)
        values = np.append(self.turns[node[:, None], along, vector[:, None]], np.ones(o))
        return sp.csr_matrix((values, (rows, np.append(np.repeat(np.arange(m), 3), m + np.arange(o)))), shape=(unknowns, m + o))

    def covers(self, others: "NodeFrames") -> bool:
        """Whether all that other frames select is selected here, too, whatever the directions of the vectors."""
        if not (np.isin(others.first, self.first).all() and np.isin(others.others, self.others).all()):
            return False
        return bool((others.wanted <= self.wanted[np.searchsorted(self.first, others.first)]).all())

    def turned_as(self, others: "NodeFrames") -> "NodeFrames":
        """These frames with the vectors of other frames that they cover."""
        turns = self.turns.copy()
        turns[np.searchsorted(self.first, others.first)] = others.turns
        return replace(self, turns=turns)

    @cached_property
    def _aligned(self):
        return bool((self.turns == np.eye(3)).all())

    def turned(self, vector: np.ndarray) -> np.ndarray:
        """Components of a vector (unknowns,) in the local frames."""
        return self._rotated(vector, "kji,kj->ki")

    def turned_back(self, vector: np.ndarray) -> np.ndarray:
        """The inverse of `turned`."""
        return self._rotated(vector, "kij,kj->ki")

    def _rotated(self, vector, how):
        if self._aligned:
            return vector
        out, places = vector.copy(), self.first[:, None] + np.arange(3)
        out[places] = np.einsum(how, self.turns, vector[places])
        return out

    def turned_matrix(self, upper: sp.csr_matrix) -> np.ndarray:
        """Values of an upper triangle (csr, sorted) in the local frames; the three rows of a node have the same columns."""
        if self._aligned:
            return upper.data
        frame = np.full(upper.shape[0], -1, dtype=np.int64)
        frame[self.first] = np.arange(len(self.first))
        values = upper.data.copy()
        _turn(upper.indptr, upper.indices, values, frame, self.turns.astype(values.dtype))
        return values


@compiled
def _turn(indptr, indices, values, frame, turns):
    for row in range(len(indptr) - 1):
        e = indptr[row]
        while e < indptr[row + 1]:
            k = frame[indices[e]]
            if k >= 0 and indices[e] > row:     # off the diagonal block: three columns of one node
                values[e], values[e + 1], values[e + 2] = _times(values[e], values[e + 1], values[e + 2], turns[k])
                e += 3
            else:
                e += 1
    for row in range(len(indptr) - 1):
        if frame[row] >= 0:
            _turn_rows(indptr[row], indptr[row + 1], indptr[row + 2], indptr[row + 1] - indptr[row] - 3, values, turns[frame[row]])


@compiled(inline="always")
def _times(x, y, z, turn):
    return (x * turn[0, 0] + y * turn[1, 0] + z * turn[2, 0], x * turn[0, 1] + y * turn[1, 1] + z * turn[2, 1],
            x * turn[0, 2] + y * turn[1, 2] + z * turn[2, 2])


@compiled(inline="always")
def _turn_rows(x, y, z, others, values, turn):
    """Turn a node's three rows, which begin at x, y and z with the upper half of the diagonal block, before `others` columns."""
    block = np.empty((3, 3), values.dtype)
    for i, row in enumerate((x, y, z)):
        for j in range(i, 3):
            block[i, j] = block[j, i] = values[row + j - i]
    block = turn.T @ block @ turn
    for i, row in enumerate((x, y, z)):
        for j in range(i, 3):
            values[row + j - i] = block[i, j]
    for k in range(others):
        a, b, c = x + 3 + k, y + 2 + k, z + 1 + k
        values[a], values[b], values[c] = _times(values[a], values[b], values[c], turn)
