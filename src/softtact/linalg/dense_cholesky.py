"""Cholesky's method for one dense matrix in single precision, block by block on all threads.

SciPy's BLAS may use threads of its own or not, as its user has set it; here the caller's threads are used, on blocks of their own.
"""

import numpy as np
from numba import njit

from softtact.linalg.lapack import ROUTINES, address, call, keep_alive
from softtact.linalg.workers import SERIAL, Workers, slices

_BLOCK = 384


def factor_in_place(matrix: np.ndarray, *, workers: Workers = SERIAL) -> bool:
    """Overwrite the upper triangle of a matrix A (n, n), row by row, by R of A = R'.R; False if A is not positive definite."""
    size = len(matrix)
    for block in slices(size, _BLOCK):
        if not _begin(matrix, block.start, block.stop, ROUTINES):
            return False
        rest = [(block.stop + part.start, block.stop + part.stop) for part in slices(size - block.stop, _BLOCK)]
        workers.map(lambda part, b=block: _couple(matrix, b.start, b.stop, *part, ROUTINES), rest)     # type: ignore[misc, call-arg]
        workers.map(lambda part, b=block: _update(matrix, b.start, b.stop, *part, ROUTINES), rest)     # type: ignore[misc, call-arg]
    return True


@njit(cache=True, nogil=True)
def _begin(matrix, start, stop, blas):
    letters = blas.letters
    size = np.array([stop - start, len(matrix), 0], dtype=np.int32)
    corner = matrix[start:, start:].ctypes.data
    call(blas.potrf, (address(letters, 0), address(size, 0), corner, address(size, 1), address(size, 2)))
    return size[2] == 0 and np.isfinite(matrix[stop - 1, stop - 1])


@njit(cache=True, nogil=True)
def _couple(matrix, start, stop, first, end, blas):
    """Columns from `first` to `end` of the rows from `start` to `stop`."""
    letters, factors = blas.letters, blas.factors
    size = np.array([stop - start, len(matrix), end - first], dtype=np.int32)
    call(blas.trsm, (address(letters, 2), address(letters, 0), address(letters, 3), address(letters, 1), address(size, 2),
                address(size, 0), address(factors, 0), matrix[start:, start:].ctypes.data, address(size, 1),
                matrix[start:, first:].ctypes.data, address(size, 1)))
    keep_alive(size)


@njit(cache=True, nogil=True)
def _update(matrix, start, stop, first, end, blas):
    """Subtract from the rows from `first` to `end` what the rows from `start` to `stop` give."""
    letters, factors = blas.letters, blas.factors
    size = np.array([stop - start, len(matrix), end - first, len(matrix) - end], dtype=np.int32)
    L, N, T, minus_one, one = (address(letters, 0), address(letters, 1), address(letters, 3), address(factors, 1),
                               address(factors, 0))
    rows = matrix[start:, first:].ctypes.data
    call(blas.syrk, (L, N, address(size, 2), address(size, 0), minus_one, rows, address(size, 1), one,
                matrix[first:, first:].ctypes.data, address(size, 1)))
    if size[3] > 0:
        call(blas.gemm, (N, T, address(size, 3), address(size, 2), address(size, 0), minus_one, matrix[start:, end:].ctypes.data,
                    address(size, 1), rows, address(size, 1), one, matrix[first:, end:].ctypes.data, address(size, 1)))
    keep_alive(size)
