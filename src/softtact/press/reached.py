"""What a press has reached: kept in this one place, for `on_step`, and for the error or the interruption that ends it early."""

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
    """The load steps of a press that are reached, the seconds that each took, and what makes a `PressResult` of them.

    on_step: called with the result so far at each step that is reached but the last
    """

    def __init__(self, on_step: "Callable[[PressResult], None] | None" = None) -> None:
        self.on_step = on_step
        self.times: list[float] = []
        self.finish: Callable[[PressResult], PressResult] = lambda result: result
        """What is done to any result of the press: flags, and the object where it is."""
        self._so_far: Callable[[], PressResult] | None = None

    def follow(self, load_steps: Iterable[Any], count: int, so_far: "Callable[[], PressResult]", *, label: str = "",
               start: float | None = None) -> None:
        """Go through `count` load steps, and note the seconds of each; the solver's preparation counts to the first.

        so_far: makes the result of the steps whose times are noted: an interruption may come just before one is
        label: of the progress on stderr;  start: when the preparation began, by `time.perf_counter`
        """
        self.times.clear()
        self._so_far = so_far
        last = start or time.perf_counter()
        for _ in progress(load_steps, label=label, total=count):
            now = time.perf_counter()
            self.times.append(now - last)
            last = now
            if self.on_step and len(self.times) < count:
                with warnings.catch_warnings():     # they are left to the last result
                    warnings.simplefilter("ignore")
                    self.on_step(self.finish(so_far()))

    def keep(self, times: list[float], so_far: "Callable[[], PressResult]") -> None:
        """Keep steps that a model went through by itself."""
        self.times, self._so_far = times, so_far

    def result(self) -> "PressResult | None":
        """The result of the steps that are reached; None where there is none."""
        return self.finish(self._so_far()) if self._so_far is not None and self.times else None

    @contextmanager
    def kept(self) -> Iterator[None]:
        """While this lasts, a ConvergenceError, of which a time limit is one, and a KeyboardInterrupt take with them as their
        `result` what is reached; None where that is nothing.
        """
        try:
            yield
        except (ConvergenceError, KeyboardInterrupt) as error:
            error.result = self.result()     # type: ignore[union-attr]
            raise
