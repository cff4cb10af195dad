"""Loops over one row of a matrix in single precision or in 16 bits: what a triangular solve does, row by row.

In functions of their own they become vector instructions and read at nearly memory's speed. Loops over several rows at once do
not, and BLAS's triangular solves of some hundred unknowns take four times as long
(docs/notebook/2026-11-25-linear-solver.md).
"""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, fastmath=True)
def add_row(row: np.ndarray, share: float, out: np.ndarray) -> None:
    """Add a share of a row (k,) to `out` (k,)."""
    for j in range(len(row)):
        out[j] += share * np.float32(row[j])


@njit(cache=True, nogil=True, fastmath=True)
def row_product(row: np.ndarray, x: np.ndarray) -> np.float32:
    """The product of a row (k,) with x (k,)."""
    total = np.float32(0.0)
    for j in range(len(row)):
        total += np.float32(row[j]) * x[j]
    return total
