"""A recording of a real sensor that plays beside the press that is simulated."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.readout.recording import FINGERS
from softtact.readout.sources import recording_of, with_force_of

_ROUND_N, _ROUND = 0.01, 1e-3     # in N, to which the page rounds a recorded force, and the share within which a press balances it


@dataclass(frozen=True)
class Recorded:
    """Readings of one finger over time."""

    name: str
    """The file's name."""
    time_s: np.ndarray
    """(t,) from the first reading on."""
    counts: np.ndarray
    """(t, rows, columns) over the baseline."""
    force_n: np.ndarray | None
    """(t,) normal force on the finger, where a log of forces was given."""
    finger: int = 0
    """The finger's number."""

    @classmethod
    def read(cls, path: str | Path, *, log: str | Path | None = None, finger: int = 0) -> "Recorded":
        """The recording in a file or bag; log: of forces. Raises InputError for a file that cannot be read, or another finger."""
        if not 0 <= finger < FINGERS:
            raise InputError(f"finger {finger} is unknown; give a number from 0 to {FINGERS - 1}.")
        data = recording_of(path)
        if log is not None:
            data = with_force_of(data, log)
        return cls(Path(path).name, data.time.values.astype(float), data.counts.values[:, finger].astype(float),
                   data.force_n.values[:, finger].astype(float) if "force_n" in data else None, finger)

    @property
    def duration_s(self) -> float:
        """Time of the last reading."""
        return float(self.time_s[-1])

    def at(self, time_s: float) -> "Reading":
        """The newest reading at a time in s; the first one before it."""
        place = max(int(np.searchsorted(self.time_s, time_s, side="right")) - 1, 0)
        return Reading(float(self.time_s[place]), self.counts[place],
                       None if self.force_n is None else float(self.force_n[place]))

    def in_words(self, time_s: float, simulated: np.ndarray | None, pressed_n: float) -> str:
        """The reading at a time in s beside simulated counts (rows, columns) of a press with a force in N, as a sentence."""
        reading = self.at(time_s)
        force = "" if reading.force_n is None else f", {reading.force_n:.4g} N"
        words = f"{self.name} at {reading.time_s:.2f} s{force}: {reading.counts.sum():.0f} counts in all"
        if simulated is None or simulated.shape != reading.counts.shape:
            return f"{words}."
        if not reading.has_force(pressed_n):
            return f"{words}; not pressed with this force."
        apart = float(np.abs(simulated - reading.counts).mean())
        return f"{words}; simulated {simulated.sum():.0f}, and {apart:.0f} apart in the mean over taxels."


@dataclass(frozen=True)
class Reading:
    """One reading of a recording."""

    time_s: float
    """From the first reading on."""
    counts: np.ndarray
    """(rows, columns) over the baseline."""
    force_n: float | None
    """Where it is known."""

    def has_force(self, pressed_n: float) -> bool:
        """Whether a press with a normal force in N has this reading's force, or that is not known.

        It has not where the page cannot press so: at a reading without contact, or beyond the sensor's range.
        """
        return self.force_n is None or abs(pressed_n - self.force_n) <= _ROUND_N + _ROUND * abs(self.force_n)
