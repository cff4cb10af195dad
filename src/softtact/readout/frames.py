"""Statistics of frames of taxels (n, taxel) that need no model: runs of equal frames, new frames, noise, single odd values."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.ndimage import median_filter

_OF_MEDIAN = 1.4826        # standard deviation over median absolute value of a normal distribution
_FEWEST = 20               # distinct frames from which the usual length of their runs is known
_USUAL = 0.9               # quantile of the lengths of runs that counts as their usual length


@dataclass(frozen=True)
class Runs:
    """Runs of equal rows of an array: first row (r,) and length (r,) of each."""

    first: np.ndarray
    length: np.ndarray

    @classmethod
    def of(cls, frames: np.ndarray) -> "Runs":
        """The runs of `frames` (n, ...), n at least 1."""
        changed = (np.diff(frames, axis=0) != 0).any(axis=tuple(range(1, frames.ndim)))
        first = np.r_[0, np.flatnonzero(changed) + 1]
        return cls(first, np.diff(np.r_[first, len(frames)]))

    @cached_property
    def usual(self) -> int:
        """Number of rows for which a frame usually stands: above 1 where rows are written more often than frames are renewed.

        1 where too few frames differ to tell: they stand because nothing changes.
        """
        return int(np.quantile(self.length, _USUAL, method="lower")) if len(self.length) >= _FEWEST else 1


def new_frames(frames: np.ndarray) -> np.ndarray:
    """Rows (m,) at which a frame of (n, ...) was renewed. A run longer than usual counts as several equal frames."""
    runs = Runs.of(frames)
    since = np.arange(len(frames)) - np.repeat(runs.first, runs.length)
    return np.flatnonzero(since % runs.usual == 0)


def noise(frames: np.ndarray) -> np.ndarray:
    """Standard deviation (taxel,) of a reading, from second differences of distinct frames (n, taxel): a steady rise has none.

    Repeated frames tell nothing and are passed over; fewer than four distinct ones give 0.
    """
    distinct = frames[Runs.of(frames).first] if len(frames) else frames
    if len(distinct) < 4:
        return np.zeros(frames.shape[1])
    return _OF_MEDIAN * np.median(np.abs(np.diff(distinct, n=2, axis=0)), axis=0) / np.sqrt(6)


def deviations(values: np.ndarray, *, window: int = 7, around: int = 15) -> tuple[np.ndarray, np.ndarray]:
    """Distance of each of `values` (n, taxel) from the median of its neighbours in time, and how large it usually is around there.

    A value that stands for fewer than half of `window` rows keeps its whole distance; steps and ramps have hardly any.
    """
    off = values - median_filter(values, size=(window, 1), mode="reflect")
    return off, _OF_MEDIAN * median_filter(np.abs(off), size=(around, 1), mode="reflect")


def longest_run(values: np.ndarray) -> tuple[int, int]:
    """First index and length of the longest run of equal values (n,), n at least 1."""
    runs = Runs.of(values)
    longest = int(np.argmax(runs.length))
    return int(runs.first[longest]), int(runs.length[longest])
