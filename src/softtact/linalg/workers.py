"""Work in parallel on slices of arrays, on a given number of threads. The kernels release Python's lock."""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from functools import cache, wraps
from typing import ParamSpec, TypeVar

import numpy as np
from threadpoolctl import ThreadpoolController

_Item = TypeVar("_Item")
_Result = TypeVar("_Result")
_Given = ParamSpec("_Given")


class Workers:
    """Runs a function over items in order; one thread means that of the caller."""

    def __init__(self, threads: int = 1) -> None:
        self.threads = threads
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def map(self, function: Callable[[_Item], _Result], items: Iterable[_Item]) -> list[_Result]:
        """The function's results, in the items' order."""
        return [function(item) for item in items] if self._pool is None else list(self._pool.map(function, items))

    def close(self) -> None:
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()


SERIAL = Workers()


def one_thread_each() -> AbstractContextManager:
    """A context in which BLAS runs on the thread that calls it: otherwise threads that call it wait for each other's threads."""
    return threads_of_blas(1)


def on_one_thread(function: Callable[_Given, _Result]) -> Callable[_Given, _Result]:
    """A function that runs BLAS on the thread that calls it.

    The products of a fast press have some hundred rows. On idle cores a second thread saves next to nothing; where other programs
    want the cores, the threads wait for each other in each product: a press takes up to twice as long, a gradient four times
    (`benchmarks/busy_cores.py`), and more beside programs that use much memory.
    """
    @wraps(function)
    def run(*args: _Given.args, **kwargs: _Given.kwargs) -> _Result:
        with one_thread_each():
            return function(*args, **kwargs)

    return run


def threads_of_blas(count: int) -> AbstractContextManager:
    """A context in which BLAS runs on `count` threads."""
    return _libraries().limit(limits=count)


@cache
def _libraries():
    return ThreadpoolController()     # takes milliseconds, and needs the libraries loaded


def slices(count: int, size: int) -> list[slice]:
    """Slices of at most `size` that cover `count` things."""
    return [slice(start, min(start + size, count)) for start in range(0, count, size)]


def chunks(numbers: np.ndarray, size: int) -> list[np.ndarray]:
    """Arrays of at most `size` of the given numbers (n,)."""
    return [numbers[part] for part in slices(len(numbers), size)]


def unique_rows(table: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (u,) of the distinct rows of a table (n, k), and for each row (n,) which of these it equals.

    Equal means to 1e-9 of the largest entry. Rows are compared by two random projections, which are the same for equal rows.
    """
    scale = max(np.abs(table).max(), 1e-300)
    directions = np.random.default_rng(0).standard_normal((table.shape[1], 2))
    keys = np.round(table @ directions / scale * 1e9 / np.sqrt(table.shape[1])).astype(np.int64)
    _, first, which = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return first, which.ravel()
