"""Progress of long work: a line on stderr now and then, readable in a log as on a screen."""

import sys
import time
from collections.abc import Iterable, Iterator
from typing import TypeVar

_Item = TypeVar("_Item")


def progress(iterable: Iterable[_Item], *, label: str, total: int | None = None, interval_s: float = 2.0) -> Iterator[_Item]:
    """Yield the items of `iterable`; write `label: 3/20, 12 s` on stderr at most every `interval_s` seconds.

    An empty label writes nothing: the work is part of some other that tells its progress.
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
    """Say on stderr what begins now and may take a while."""
    print(text, file=sys.stderr, flush=True)
