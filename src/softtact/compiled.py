"""The options of all functions that numba compiles, and two rules that halve the time it takes.

Helpers that only compiled functions call carry `inline="always"` where they are small or have one caller: as functions of their
own they would be compiled, optimised and stored once more. Parts of arrays are set in loops: with `a[i] = b` numba compiles, into
each function, the sentence with which it would refuse another shape.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar, overload

from numba import njit

from softtact.kernel_files import KernelFiles

_Function = TypeVar("_Function", bound=Callable[..., Any])


@overload
def compiled(function: _Function) -> _Function: ...


@overload
def compiled(**options: Any) -> Callable[[_Function], _Function]: ...


def compiled(function: Any = None, **options: Any) -> Any:
    """Decorate a function to be compiled: kept on disk (`KernelFiles`), without Python's lock, and with numba's further options.

    It gets no entry for callers in C, which would take a tenth of the time to compile.
    """
    if function is None:
        return partial(compiled, **options)
    every: Any = {"cache": True, "nogil": True, "no_cfunc_wrapper": True} | options
    kernel = njit(function, **every)
    if (files := getattr(getattr(kernel, "_cache", None), "_cache_file", None)) is not None:     # not where numba is switched off
        files.__class__ = KernelFiles
    return kernel
