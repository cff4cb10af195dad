"""LAPACK and BLAS routines of scipy in single precision that compiled loops can call: thousands of small matrices without
Python in between.

A compiled function takes the addresses of the routines that it needs as arguments: numba caches it then, which it would not with an
address in it. (Numba's own type for functions as arguments takes 20 us to recognise at every call; a number takes none.)
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import njit, types
from numba.extending import get_cython_function_address, intrinsic


def _address_of(module, name):
    """The address of a routine of scipy.linalg.cython_lapack or cython_blas."""
    return get_cython_function_address(f"scipy.linalg.{module}", name)


class Routines(NamedTuple):
    """The routines' addresses, and what they are told as memory that they can point at: letters L, N, R, T; factors 1, -1, 0."""

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
    """Call a routine by its address with a tuple of arguments, each an address itself, as in Fortran."""
    def generate(context, builder, signature, values):
        word = ir.IntType(64)
        function = ir.FunctionType(ir.VoidType(), [word] * len(signature.args[1]))
        pointer = builder.inttoptr(values[0], function.as_pointer())
        builder.call(pointer, [builder.extract_value(values[1], k) for k in range(len(signature.args[1]))])
        return context.get_dummy_value()

    return types.void(routine, arguments), generate


@njit(cache=True, nogil=True)
def address(array: np.ndarray, place: int) -> np.uintp:
    """Where an entry of a flat array stands in memory."""
    return np.uintp(array.ctypes.data) + np.uintp(place * array.itemsize)


@njit(cache=True, nogil=True, inline="never")
def keep_alive(array: np.ndarray) -> np.number:
    """Use an array that a routine was pointed at: until here it must not be freed."""
    return array[0]
