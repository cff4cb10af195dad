"""LAPACK and BLAS routines of scipy in single precision that compiled loops can call: thousands of small matrices without
Python in between.

A compiled function takes the routines it needs as arguments: numba caches it then, which it would not with an address in it.
"""

import numba.experimental.function_type  # noqa: F401  teaches numba the type of such arguments
import numpy as np
from numba import njit, types
from numba.extending import get_cython_function_address


class Routine(types.WrapperAddressProtocol):
    """A routine of scipy.linalg.cython_lapack or cython_blas; every argument is an address, as in Fortran."""

    def __init__(self, module, name, arguments):
        self._address = get_cython_function_address(f"scipy.linalg.{module}", name)
        self._arguments = arguments

    def __wrapper_address__(self):
        return self._address

    def signature(self):
        return types.void(*[types.uintp] * self._arguments)


POTRF = Routine("cython_lapack", "spotrf", 5)
TRSM = Routine("cython_blas", "strsm", 11)
SYRK = Routine("cython_blas", "ssyrk", 10)
GEMM = Routine("cython_blas", "sgemm", 13)

# What the routines are told, as memory that they can point at.
LETTERS = np.array([ord(letter) for letter in "LNRT"], dtype=np.uint8)
FACTORS = np.array([1.0, -1.0, 0.0], dtype=np.float32)


@njit(cache=True, nogil=True)
def address(array, place):
    """Where an entry of a flat array stands in memory."""
    return np.uintp(array.ctypes.data) + np.uintp(place * array.itemsize)


@njit(cache=True, nogil=True, inline="never")
def keep_alive(array):
    """Use an array that a routine was pointed at: until here it must not be freed."""
    return array[0]
