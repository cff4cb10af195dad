"""A preconditioner for matrices of quadratic elements: a factor for their corners, with Chebyshev smoothing before and after.

That is p-multigrid with two levels. The corners hold an eighth of a spatial body's unknowns, so that the factor takes a fiftieth of
the operations of a whole one. Errors that vary between neighbouring corners have large eigenvalues, and a Chebyshev polynomial of
low degree in the scaled matrix reduces them.
Measured in docs/notebook/2026-11-27-large-solids.md.
References: Ronquist and Patera, J. Sci. Comput. 2 (1987) 389; Saad, Iterative Methods for Sparse Linear Systems, 2nd ed. (2003),
section 12.3.
"""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp

from softtact.linalg.multifrontal_solver import DissectedSolver
from softtact.linalg.workers import SERIAL, Workers

_DEGREE = 3       # of the polynomial, before the corners and after them
_LOWEST = 0.1     # of the largest eigenvalue: the polynomial reduces errors above
_POWERS = 8       # iterations for the largest eigenvalue from one matrix to the next; three times as many at first
_MARGIN = 1.15    # on that eigenvalue, which is approximated from below


class TwoLevels:
    """One V-cycle: symmetric, and positive definite where the matrix is."""

    name = "two levels of nodes"

    def __init__(self, places: np.ndarray, lift: sp.csr_matrix, *, workers: Workers = SERIAL) -> None:
        """places (n, 2 or 3): position of each unknown in mm;  lift (n, c): prolongation from the c corners to all unknowns"""
        self._lift, self._restrict = lift, sp.csr_matrix(lift.T)
        entries = sp.coo_matrix(lift)
        corner = entries.data == 1.0     # weights of midside nodes are smaller
        at = np.empty((lift.shape[1], places.shape[1]))
        at[entries.col[corner]] = places[entries.row[corner]]
        self._corners = DissectedSolver(at, workers=workers)
        self._eigenvector: np.ndarray | None = None     # of the largest eigenvalue, approximate

    def factor(self, upper: sp.csr_matrix, product: Callable[[np.ndarray], np.ndarray]) -> bool:
        """Prepare for a matrix, given by its upper triangle and by its product with a vector; False if not positive definite."""
        diagonal = upper.data[upper.indptr[:-1]]
        if diagonal.min() <= 0 or not self._corners.factor(self._on_corners(upper, diagonal)):
            return False
        self._product, self._scale = product, 1.0 / diagonal
        self._highest = _MARGIN * self._largest_eigenvalue(len(diagonal))
        return True

    def _on_corners(self, upper, diagonal):
        """The upper triangle of lift' A lift."""
        half = self._restrict @ (upper @ self._lift)
        whole = half + half.T - self._restrict @ sp.diags(diagonal) @ self._lift
        corners = sp.csr_matrix(sp.triu(whole))
        corners.sort_indices()
        corners.indices, corners.indptr = corners.indices.astype(np.int32), corners.indptr.astype(np.int32)
        return corners

    def _largest_eigenvalue(self, n):
        """Largest eigenvalue of the matrix scaled by its diagonal, from below, by power iteration."""
        powers = _POWERS
        if self._eigenvector is None:
            self._eigenvector, powers = np.random.default_rng(0).standard_normal(n), 3 * _POWERS
        for _ in range(powers):
            self._eigenvector = self._scale * self._product(self._eigenvector / np.linalg.norm(self._eigenvector))
        return float(np.linalg.norm(self._eigenvector))

    def solve(self, right: np.ndarray) -> np.ndarray:
        """An approximate solution (n,) for a right-hand side (n,)."""
        found = self._smoothed(right)
        found += self._lift @ self._corners.solve(self._restrict @ (right - self._product(found)))
        return found + self._smoothed(right - self._product(found))

    def _smoothed(self, rest):
        """Chebyshev's polynomial of the scaled matrix applied to a residual (n,)."""
        middle, half = 0.5 * (1 + _LOWEST) * self._highest, 0.5 * (1 - _LOWEST) * self._highest
        sigma = middle / half
        share, found = 1.0 / sigma, self._scale * rest / middle
        step = found
        for _ in range(_DEGREE - 1):
            rest = rest - self._product(step)
            after = 1.0 / (2.0 * sigma - share)
            step = after * share * step + (2.0 * after / half) * self._scale * rest
            share, found = after, found + step
        return found

    def close(self) -> None:
        """Forget the factor."""
        self._corners.close()
