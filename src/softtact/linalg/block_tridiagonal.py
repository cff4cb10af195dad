"""Cholesky's method by layers of the matrix' graph, in dense blocks of LAPACK: a direct solver where MKL is missing.

Unknowns at the same distance from one end of the body form a layer. A layer couples to the next one only, so the matrix is block
tridiagonal (A. George, J. W. Liu, Computer Solution of Large Sparse Positive Definite Systems, 1981, ch. 4):

    L_i L_i^T = D_i - C_(i-1)^T C_(i-1),    C_i = L_i^-1 A_(i,i+1)

Unknowns that couple to the next layer are the last ones of their layer, so that C_i has rows for these alone. The method suits long
bodies, whose layers have about a thousand unknowns, and many right-hand sides: it consists of matrix products.
"""

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components, dijkstra


class BlockTridiagonalSolver:
    """A direct solver with the interface of `softtact.linalg.direct`."""

    name = "block tridiagonal Cholesky"

    def factor(self, upper: sp.csr_matrix) -> bool:
        """Factor the matrix whose upper triangle (csr, with its diagonal) is given; False if not positive definite."""
        self._blocks = _Blocks(upper)
        self._factors = list(self._blocks.factors())
        return len(self._factors) == len(self._blocks.parts)

    def solve(self, right: np.ndarray) -> np.ndarray:
        """Solve for one (n,) or several (n, k) right-hand sides."""
        blocks = self._blocks
        found = np.array(right, dtype=float).reshape(len(right), -1)[blocks.order]
        for number, (factor, coupling) in enumerate(self._factors):
            layer = blocks.parts[number]
            found[layer] = _lower(factor, found[layer])
            if coupling is not None:
                found[blocks.parts[number + 1]] -= coupling.T @ found[blocks.tail(number)]
        for number, (factor, coupling) in reversed(list(enumerate(self._factors))):
            layer = blocks.parts[number]
            if coupling is not None:
                found[blocks.tail(number)] -= coupling @ found[blocks.parts[number + 1]]
            found[layer] = sla.solve_triangular(factor, found[layer], lower=True, trans="T", check_finite=False)
        out = np.empty_like(found)
        out[blocks.order] = found
        return out.reshape(right.shape)

    def close(self) -> None:
        """Free the factors."""
        self._factors = []


class _Blocks:
    """A matrix in the order of its layers: `order` (n,), and the `parts` (slices) of the layers in it."""

    def __init__(self, upper):
        full = (upper + sp.triu(upper, 1).T).tocsr().astype(float)
        layer, entries = layers(full), full.tocoo()
        forward = np.zeros(len(layer), dtype=bool)
        forward[entries.row[layer[entries.row] < layer[entries.col]]] = True
        self.order = np.lexsort((forward, layer))
        ends = np.cumsum(np.bincount(layer))
        self.parts = [slice(start, end) for start, end in zip([0, *ends[:-1]], ends, strict=True)]
        self._tails = np.bincount(layer, weights=forward).astype(int)
        self._ordered = full[self.order][:, self.order].tocsr()

    def tail(self, number):
        """The unknowns of a layer that couple to the next one, its last ones."""
        stop = self.parts[number].stop
        return slice(stop - self._tails[number], stop)

    def factors(self):
        """(L_i, C_i) of one layer after the other, C_i by its nonzero rows, None for the last; stops at an indefinite block."""
        update = 0.0
        for number, layer in enumerate(self.parts):
            diagonal = np.asfortranarray(self._ordered[layer, layer].toarray() - update)
            factor, fault = sla.lapack.dpotrf(diagonal, lower=1, overwrite_a=1)
            if fault:
                return
            if number + 1 == len(self.parts):
                yield factor, None
                return
            size, tail = len(factor), self.tail(number)
            last = factor[size - (tail.stop - tail.start):, size - (tail.stop - tail.start):]
            coupling = _lower(last, self._ordered[tail, self.parts[number + 1]].toarray())
            update = coupling.T @ coupling
            yield factor, coupling


def layers(matrix: sp.csr_matrix) -> np.ndarray:
    """Layer (n,) of each unknown of a symmetric sparse matrix: its distance from one end of its component of the matrix' graph."""
    graph = sp.csr_matrix((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)
    _, component = connected_components(graph, directed=False)
    out, offset = np.empty(matrix.shape[0], dtype=int), 0
    for number in range(component.max() + 1):
        members = np.flatnonzero(component == number)
        within = graph[members][:, members]
        distance = _distance(within, [0])
        for _ in range(2):     # from all unknowns of the far end: from a single one, layers would be curved
            distance = _distance(within, np.flatnonzero(distance == distance.max()))
        out[members] = distance + offset
        offset += distance.max() + 1
    return out


def _distance(graph, starts):
    return dijkstra(graph, directed=False, indices=starts, unweighted=True, min_only=True).astype(int)


def _lower(factor, right):
    return sla.solve_triangular(factor, right, lower=True, check_finite=False)
