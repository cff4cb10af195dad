"""Cholesky's method by layers of the matrix' graph, in dense blocks of LAPACK: a direct solver where MKL is missing.

Unknowns at the same distance from one end of the body form a layer. A layer couples to the next one only, so the matrix is block
tridiagonal (A. George, J. W. Liu, Computer Solution of Large Sparse Positive Definite Systems, 1981, ch. 4):

    L_i L_i^T = D_i - C_(i-1)^T C_(i-1),    C_i = L_i^-1 A_(i,i+1)

Unknowns that couple to the next layer come last in their own, so that C_i has rows for them alone. It serves long bodies, whose
layers hold some thousand unknowns, and many right-hand sides: all of it is matrix products.
"""

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components, dijkstra


class BlockTridiagonalSolver:
    """The interface of `softtact.linalg.direct`."""

    name = "block tridiagonal Cholesky"

    def factor(self, upper):
        """Factor the matrix whose upper triangle (csr, with its diagonal) is given; False if not positive definite."""
        full = (upper + sp.triu(upper, 1).T).tocsr().astype(float)
        layer = layers(full)
        entries = full.tocoo()
        forward = np.zeros(len(layer), dtype=bool)
        forward[entries.row[layer[entries.row] < layer[entries.col]]] = True
        self._order = np.lexsort((forward, layer))
        ends = np.cumsum(np.bincount(layer))
        self._parts = [slice(start, end) for start, end in zip([0, *ends[:-1]], ends, strict=True)]
        self._tails = np.bincount(layer, weights=forward).astype(int)      # unknowns of each layer that couple to the next one
        return self._factor(full[self._order][:, self._order].tocsr())

    def _factor(self, ordered):
        self._factors, self._couplings, update = [], [], 0.0
        for own, after, tail in zip(self._parts, [*self._parts[1:], None], self._tails, strict=True):
            factor, fault = sla.lapack.dpotrf(np.asfortranarray(ordered[own, own].toarray() - update), lower=1, overwrite_a=1)
            if fault:
                return False
            self._factors.append(factor)
            if after is not None:
                last = factor[len(factor) - tail:, len(factor) - tail:]
                self._couplings.append(_lower(last, ordered[own.stop - tail:own.stop, after].toarray()))
                update = self._couplings[-1].T @ self._couplings[-1]
        return True

    def solve(self, right):
        """Solve for one (n,) or several (n, k) right-hand sides."""
        found = np.array(right, dtype=float).reshape(len(right), -1)[self._order]
        for number, own in enumerate(self._parts):
            found[own] = _lower(self._factors[number], found[own])
            self._pass_on(number, found, slice(None))
        for number, own in reversed(list(enumerate(self._parts))):
            if number < len(self._couplings):
                found[own.stop - self._tails[number]:own.stop] -= self._couplings[number] @ found[self._parts[number + 1]]
            found[own] = sla.solve_triangular(self._factors[number], found[own], lower=True, trans="T", check_finite=False)
        out = np.empty_like(found)
        out[self._order] = found
        return out.reshape(right.shape)

    def inverse_among(self, kept):
        """Rows and columns `kept` (k,) of the inverse, (k, k): Y^T Y with L Y = their columns of the unit matrix."""
        place = np.empty(len(self._order), dtype=int)
        place[self._order] = np.arange(len(self._order))
        rows, by_layer = np.sort(place[kept]), np.argsort(place[kept])
        columns = np.zeros((len(self._order), len(kept)))
        columns[rows, np.arange(len(kept))] = 1.0
        inverse = np.zeros((len(kept), len(kept)))
        for number, own in enumerate(self._parts):
            begun = slice(0, np.searchsorted(rows, own.stop))      # columns that are no longer zero
            columns[own, begun] = _lower(self._factors[number], columns[own, begun])
            inverse[begun, begun] += columns[own, begun].T @ columns[own, begun]
            self._pass_on(number, columns, begun)
        out = np.empty_like(inverse)
        out[np.ix_(by_layer, by_layer)] = inverse
        return out

    def _pass_on(self, number, columns, begun):
        """Take what a layer's solution asks of the next layer off its right-hand side."""
        if number < len(self._couplings):
            own, after = self._parts[number], self._parts[number + 1]
            columns[after, begun] -= self._couplings[number].T @ columns[own.stop - self._tails[number]:own.stop, begun]

    def close(self):
        """Forget the factors."""
        self._factors, self._couplings = [], []


def layers(matrix):
    """Layer (n,) of each unknown of a symmetric sparse matrix: its distance from one end of its part of the matrix' graph."""
    graph = sp.csr_matrix((np.ones(matrix.nnz), matrix.indices, matrix.indptr), shape=matrix.shape)
    _, part = connected_components(graph, directed=False)
    out, offset = np.empty(matrix.shape[0], dtype=int), 0
    for own in range(part.max() + 1):
        members = np.flatnonzero(part == own)
        own_graph = graph[members][:, members]
        distance = _distance(own_graph, [0])
        for _ in range(2):     # from the far end as a whole: from one point layers would bend
            distance = _distance(own_graph, np.flatnonzero(distance == distance.max()))
        out[members] = distance + offset
        offset += distance.max() + 1
    return out


def _distance(graph, starts):
    return dijkstra(graph, directed=False, indices=starts, unweighted=True, min_only=True).astype(int)


def _lower(factor, right):
    return sla.solve_triangular(factor, right, lower=True, check_finite=False)
