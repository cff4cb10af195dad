"""Progress of long work: lines on stderr at intervals, readable on a screen and in a log."""

import sys
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

from softtact.errors import TimeLimitError

_Item = TypeVar("_Item")
_ON_SCREEN_S, _IN_A_LOG_S = 0.5, 10.0     # between two lines; on a screen each overwrites the last


def progress(iterable: Iterable[_Item], *, label: str, total: int | str | None = None, interval_s: float = 2.0) -> Iterator[_Item]:
    """Yield the items of `iterable`; write `label: 3/20, 12 s` on stderr at most every `interval_s` seconds.

    An empty label writes nothing, for work inside a larger task that reports its progress itself.
    """
    total = total if total is not None else len(iterable)     # type: ignore[arg-type]
    start = shown = time.monotonic()
    for done, item in enumerate(iterable, start=1):
        yield item
        now = time.monotonic()
        if label and now - shown >= interval_s:
            print(f"{label}: {done}/{total}, {now - start:.0f} s", file=sys.stderr, flush=True)
            shown = now


def announce(text: str) -> None:
    """Report on stderr the start of work that may take a while."""
    print(text, file=sys.stderr, flush=True)


class Watch:
    """Progress of one long computation on one line of stderr, and its time limit.

    label: start of the line; with an empty one nothing is reported;  limit_s: wall-clock seconds from now, or None
    """

    def __init__(self, label: str = "", *, limit_s: float | None = None) -> None:
        self._label, self._limit_s, self._start = label, limit_s, time.monotonic()
        self._screen = sys.stderr.isatty()
        self._shown, self._open = self._start, False

    def report(self, where: str) -> None:
        """Report at intervals `where` the computation is; raise TimeLimitError once the time limit is reached."""
        now = time.monotonic()
        spent = now - self._start
        if self._limit_s is not None and spent > self._limit_s:
            self.end()
            raise TimeLimitError(f"The time limit of {self._limit_s:g} s was reached: {where}; the steps before are kept: give "
                                 "more time (--time-limit, time_limit_s), or ask for smaller forces.")
        if self._label and now - self._shown >= (_ON_SCREEN_S if self._screen else _IN_A_LOG_S):
            print(f"{chr(13) if self._screen else ''}{self._label}: {where}, {spent:.0f} s", file=sys.stderr, flush=True,
                  end="\x1b[K" if self._screen else "\n")
            self._shown, self._open = now, self._screen

    def end(self) -> None:
        """End the line, if one was written."""
        if self._open:
            print(file=sys.stderr, flush=True)
            self._open = False
