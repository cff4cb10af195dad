"""Static condensation: inner unknowns of many small bodies eliminated one body at a time, exact within Newton's method."""

import numpy as np
from scipy.linalg import blas, lapack

_SMALLEST_STIFFNESS = 0.02   # N/mm of a mode of a folding body; the softest mode of a frustum at rest has 0.03


class Condensation:
    """Bodies whose matrix (n + m, n + m) lists n inner unknowns first, then m outer ones that others share.

    `outer` (bodies, m, m) are the condensed matrices.
    """

    def __init__(self, bodies, inner, outer):
        self.inner = inner
        self._factors = [None] * bodies
        self._coupling = np.zeros((bodies, inner, outer), order="C")
        self.outer = np.zeros((bodies, outer, outer))

    def set(self, body, matrix):
        """Factor the inner part of one body's matrix, given by its upper triangle, and condense."""
        n = self.inner
        factor = Factor(matrix[:n, :n])
        coupling = factor.forward(matrix[:n, n:])
        self._factors[body], self._coupling[body] = factor, coupling
        outer = matrix[n:, n:]
        self.outer[body] = np.triu(outer) + np.triu(outer, 1).T - coupling.T @ coupling

    def residual(self, inner):
        """What the inner residuals (bodies, n) leave on the outer unknowns (bodies, m), and the part to keep for `recover`."""
        half = np.stack([factor.forward(r) for factor, r in zip(self._factors, inner, strict=True)])
        return -np.matmul(half[:, None, :], self._coupling)[:, 0], half

    def recover(self, half, outer_step):
        """Newton step (bodies, n) of the inner unknowns for that of the outer ones (bodies, m)."""
        right = half + np.matmul(self._coupling, outer_step[..., None])[..., 0]
        return -np.stack([factor.backward(r) for factor, r in zip(self._factors, right, strict=True)])

    def positive_outer(self):
        """The condensed matrices without their modes of negative stiffness."""
        values, vectors = np.linalg.eigh(self.outer)
        return np.matmul(vectors * np.maximum(values, 0.0)[:, None, :], vectors.transpose(0, 2, 1))

    @property
    def modified(self):
        """How many bodies had modes of negative stiffness."""
        return sum(factor is not None and factor.modified for factor in self._factors)


class Factor:
    """Cholesky factor L of a matrix; where folding made it indefinite, of |matrix|, its eigenvalues made positive.

    With |matrix| every Newton step lowers the energy, and goes as far along a mode of negative stiffness as along one of
    positive; at equilibrium only the rate of convergence depends on it. Nocedal and Wright, Numerical Optimization, sec. 3.4.
    """

    def __init__(self, matrix):
        """From the upper triangle of a matrix stored row by row."""
        self._lower, info = lapack.dpotrf(matrix.T, lower=1, clean=0)   # .T: column by column, without a copy in between
        self.modified = info != 0
        if self.modified:
            values, vectors = np.linalg.eigh(matrix, UPLO="U")
            matrix = (vectors * np.maximum(np.abs(values), _SMALLEST_STIFFNESS)) @ vectors.T
            self._lower, _ = lapack.dpotrf(matrix, lower=1, clean=0)

    def forward(self, right):
        """Solve L x = right."""
        return blas.dtrsm(1.0, self._lower, right, lower=1) if right.ndim == 2 else blas.dtrsv(self._lower, right, lower=1)

    def backward(self, right):
        """Solve L^T x = right."""
        return blas.dtrsv(self._lower, right, lower=1, trans=1)
