"""The completed load steps of a press, for `on_step`, and for an error or an interruption that ends the press early."""

import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from softtact.errors import ConvergenceError
from softtact.progress import progress

if TYPE_CHECKING:
    from softtact.press.result import PressResult


class Reached:
    """The completed load steps of a press, their times in s, and the functions that make a `PressResult` of them.

    on_step: called with the partial result after each completed step except the last
    """

    def __init__(self, on_step: "Callable[[PressResult], None] | None" = None) -> None:
        self.on_step = on_step
        self.times: list[float] = []
        self.finish: Callable[[PressResult], PressResult] = lambda result: result
        """Completes each result of the press: flags, and the placed object."""
        self._so_far: Callable[[], PressResult] | None = None

    def follow(self, load_steps: Iterable[Any], count: int, so_far: "Callable[[], PressResult]", *, label: str = "",
               start: float | None = None) -> None:
        """Iterate over `count` load steps and record the time of each; the solver's preparation counts to the first.

        so_far: makes the result of the steps whose times are recorded: an interruption may come just before that
        label: of the progress on stderr;  start: time at which the preparation began, by `time.perf_counter`
        """
        self.times.clear()
        self._so_far = so_far
        last = start or time.perf_counter()
        for _ in progress(load_steps, label=label, total=count):
            now = time.perf_counter()
            self.times.append(now - last)
            last = now
            if self.on_step and len(self.times) < count:
                with warnings.catch_warnings():     # the last result gives them
                    warnings.simplefilter("ignore")
                    self.on_step(self.finish(so_far()))

    def result(self) -> "PressResult | None":
        """The result of the completed steps; None without any."""
        return self.finish(self._so_far()) if self._so_far is not None and self.times else None

    @contextmanager
    def kept(self) -> Iterator[None]:
        """A context in which a ConvergenceError, including a time limit, and a KeyboardInterrupt get the result of the completed
        steps as their `result`; None without any.
        """
        try:
            yield
        except (ConvergenceError, KeyboardInterrupt) as error:
            error.result = self.result()     # type: ignore[union-attr]
            raise
