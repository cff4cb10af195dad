"""Dense kernels in single precision: LAPACK and BLAS for compiled loops, products with one row, a Cholesky factor on all threads.

Compiled loops call scipy's LAPACK and BLAS for thousands of small matrices without Python in between. A compiled function takes the
addresses of the routines that it needs as arguments: numba caches it then, which it would not with an address in it. (Numba's type
for functions as arguments takes 20 us to recognise at every call; a number takes none.)

A triangular solve goes row by row, in single precision or in 16 bits. As separate functions these loops over one row are compiled
to vector instructions and read at nearly the speed of memory. Loops over several rows at once are not, and BLAS's triangular solves
of some hundred unknowns take four times as long (docs/notebook/2026-11-25-linear-solver.md).

SciPy's BLAS uses as many threads as its user has set. Cholesky's method here uses the caller's threads, each on other blocks.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import get_cython_function_address, intrinsic

from softtact.compiled import compiled
from softtact.linalg.workers import SERIAL, Workers, slices

_BLOCK = 384


def _address_of(module, name):
    """The address of a routine of scipy.linalg.cython_lapack or cython_blas."""
    return get_cython_function_address(f"scipy.linalg.{module}", name)


class Routines(NamedTuple):
    """The routines' addresses, and their constant arguments in memory: letters L, N, R, T, and factors 1, -1, 0."""

    letters: np.ndarray
    factors: np.ndarray
    potrf: int
    trsm: int
    syrk: int
    gemm: int


ROUTINES = Routines(letters=np.array([ord(letter) for letter in "LNRT"], dtype=np.uint8),
                    factors=np.array([1.0, -1.0, 0.0], dtype=np.float32),
                    potrf=_address_of("cython_lapack", "spotrf"), trsm=_address_of("cython_blas", "strsm"),
                    syrk=_address_of("cython_blas", "ssyrk"), gemm=_address_of("cython_blas", "sgemm"))


@intrinsic
def call(typing_context: Any, routine: types.Type, arguments: types.BaseTuple) -> tuple[Any, Callable[..., Any]]:
    """Call a routine by its address with a tuple of arguments, each of them an address as well, as in Fortran."""
    def generate(context, builder, signature, values):
        word = ir.IntType(64)
        function = ir.FunctionType(ir.VoidType(), [word] * len(signature.args[1]))
        pointer = builder.inttoptr(values[0], function.as_pointer())
        builder.call(pointer, [builder.extract_value(values[1], k) for k in range(len(signature.args[1]))])
        return context.get_dummy_value()

    return types.void(routine, arguments), generate


@compiled(inline="always")
def address(array: np.ndarray, place: int) -> np.uintp:
    """Address of an entry of a flat array."""
    return np.uintp(array.ctypes.data) + np.uintp(place * array.itemsize)


@compiled(inline="never")
def keep_alive(array: np.ndarray) -> np.number:
    """Use an array whose address a routine was given, so that it is not freed before."""
    return array[0]


@compiled(fastmath=True)
def add_row(row: np.ndarray, share: float, out: np.ndarray) -> None:
    """Add a share of a row (k,) to `out` (k,)."""
    for j in range(len(row)):
        out[j] += share * np.float32(row[j])


@compiled(fastmath=True)
def row_product(row: np.ndarray, x: np.ndarray) -> np.float32:
    """The product of a row (k,) with x (k,)."""
    total = np.float32(0.0)
    for j in range(len(row)):
        total += np.float32(row[j]) * x[j]
    return total


def factor_in_place(matrix: np.ndarray, *, workers: Workers = SERIAL) -> bool:
    """Overwrite the upper triangle of a matrix A (n, n), row by row, by R of A = R'.R; False if A is not positive definite."""
    size = len(matrix)
    for block in slices(size, _BLOCK):
        if not _factor_diagonal(matrix, block.start, block.stop, ROUTINES):
            return False
        rest = [(block.stop + part.start, block.stop + part.stop) for part in slices(size - block.stop, _BLOCK)]
        workers.map(lambda part, b=block: _solve_rows(matrix, b.start, b.stop, *part, ROUTINES), rest)     # type: ignore[misc, call-arg]
        workers.map(lambda part, b=block: _update_rows(matrix, b.start, b.stop, *part, ROUTINES), rest)     # type: ignore[misc, call-arg]
    return True


@compiled
def _factor_diagonal(matrix, start, stop, blas):
    """Factor the diagonal block from `start` to `stop`; False if it is not positive definite."""
    letters = blas.letters
    size = np.array([stop - start, len(matrix), 0], dtype=np.int32)
    corner = matrix[start:, start:].ctypes.data
    call(blas.potrf, (address(letters, 0), address(size, 0), corner, address(size, 1), address(size, 2)))
    return size[2] == 0 and np.isfinite(matrix[stop - 1, stop - 1])


@compiled
def _solve_rows(matrix, start, stop, first, end, blas):
    """The factor's rows from `start` to `stop` in the columns from `first` to `end`."""
    letters, factors = blas.letters, blas.factors
    size = np.array([stop - start, len(matrix), end - first], dtype=np.int32)
    call(blas.trsm, (address(letters, 2), address(letters, 0), address(letters, 3), address(letters, 1), address(size, 2),
                address(size, 0), address(factors, 0), matrix[start:, start:].ctypes.data, address(size, 1),
                matrix[start:, first:].ctypes.data, address(size, 1)))
    keep_alive(size)


@compiled
def _update_rows(matrix, start, stop, first, end, blas):
    """Subtract from the rows from `first` to `end` their product with the factor's rows from `start` to `stop`."""
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
