"""A recording of a sensor's two fingers over time as one labelled data set, and its faults.

Variables: counts (time, finger, row, column) over the baseline; baseline (finger, row, column); row_of_file (time); where known
dynamic (time, finger), acceleration and angular_rate (time, finger, axis), force_n (time, finger). Coordinate: time in s from the
first reading. Attributes: source, file, start_ms.

Order of the taxels. The maker's protocol sends 28 numbers a finger row by row, 7 rows of 4 columns; taxel k is row k // 4, column
k % 4. That row 0 lies at the lowest y and column 0 at the lowest x of the sensor frame, and that each finger has a frame, z out of
its sensing surface, is documented nowhere and assumed. A press off the centre shows it: `softtact calibrate` reports
when a recording fits a press better with rows or columns reversed.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import numpy as np

from softtact.errors import InputError
from softtact.tables import read_table

if TYPE_CHECKING:
    import xarray

FINGERS, ROWS, COLUMNS = 2, 7, 4
TAXELS = ROWS * COLUMNS
LARGEST_RAW = 65535                 # of the 16 bits of a taxel
AXES = ("x", "y", "z")
_MOVES = 30.0                       # counts: least change of a pressed finger; five standard deviations of the virtual noise
_LATE_S = 0.05                      # by which a log of forces may begin late or end early: a few rows of the log

_DIMENSIONS = {"counts": ("time", "finger", "row", "column"), "baseline": ("finger", "row", "column"),
               "dynamic": ("time", "finger"), "acceleration": ("time", "finger", "axis"),
               "angular_rate": ("time", "finger", "axis"), "force_n": ("time", "finger"), "row_of_file": ("time",)}
_ORDER = ("counts", "dynamic", "acceleration", "angular_rate", "force_n", "row_of_file", "baseline")     # in data sets
_UNITS = {"counts": "counts", "baseline": "counts", "dynamic": "raw", "acceleration": "raw", "angular_rate": "raw", "force_n": "N",
          "row_of_file": "1"}


class RecordedArrays(TypedDict, total=False):
    """Optional arrays of a recording."""

    dynamic: np.ndarray
    """(time, finger): raw, as the maker's electronics send it."""
    acceleration: np.ndarray
    """(time, finger, 3): raw, as the maker's electronics send it."""
    angular_rate: np.ndarray
    """(time, finger, 3): raw, as the maker's electronics send it."""
    force_n: np.ndarray
    """(time, finger): normal force on each finger in N."""
    row_of_file: np.ndarray
    """(time,): rows of the file, for messages."""


def make_recording(time_s: np.ndarray | Sequence[float], counts: np.ndarray, *, source: str, baseline: np.ndarray | None = None,
                   start_ms: int = 0, file: str = "", **arrays: Unpack[RecordedArrays]) -> "xarray.Dataset":
    """A recording (see this module) of counts (time, finger, row, column) over the baseline at times (time,) in s.

    source: origin of the numbers, such as "simulated: softtact";  baseline (finger, row, column): raw counts at rest, 0 by default
    start_ms: the recorder's clock at time 0;  file: source file of the recording
    Raises InputError where shapes do not fit or time runs back.
    """
    import xarray

    time, counts = np.asarray(time_s, dtype=float), np.asarray(counts)
    if counts.ndim != 4 or time.shape != counts.shape[:1] or not len(time):
        raise InputError(f"A recording's counts have the shape {counts.shape} and its times {time.shape}; give (time, finger, row, "
                         "column) and (time,), with at least one reading.")
    if (np.diff(time) < 0).any():
        at = int(np.argmax(np.diff(time) < 0)) + 1
        raise InputError(f"A recording's time runs back at reading {at}, from {time[at - 1]:g} to {time[at]:g} s; sort it.")
    given: dict[str, Any] = {"counts": counts, **arrays,
                             "baseline": np.zeros(counts.shape[1:], dtype=int) if baseline is None else baseline}
    variables = {name: (_DIMENSIONS[name], np.asarray(given[name]), {"units": _UNITS[name]})
                 for name in _ORDER if given.get(name) is not None}
    try:
        return xarray.Dataset(variables, coords={"time": ("time", time, {"units": "s"})},
                              attrs={"source": source, "file": file, "start_ms": int(start_ms)})
    except ValueError as error:
        raise InputError(f"A recording's arrays do not fit each other ({error}); see make_recording for their shapes.") from None


def clipped(recording: "xarray.Dataset", *, largest: float | None = None) -> np.ndarray:
    """Where (time, finger, row, column) a taxel reads the end of its range, so that the true value may be larger.

    largest: counts over the baseline at which the readout ends, beside the 16 bits; ignored where the recording exceeds it
    """
    counts, baseline = recording.counts.values, recording.baseline.values
    at_end = counts + baseline >= LARGEST_RAW
    if largest is not None and counts.max() <= largest:
        at_end |= counts >= largest
    return at_end


def dead(recording: "xarray.Dataset") -> np.ndarray:
    """Taxels (finger, row, column) that never change while others of their finger do."""
    moved = np.ptp(recording.counts.values, axis=0)
    return (moved == 0) & (moved.max(axis=(1, 2), keepdims=True) >= _MOVES)


def findings(recording: "xarray.Dataset", *, largest: float | None = None) -> list[str]:
    """A sentence for each clipped or dead taxel, with the file and its first row; arguments as for `clipped`."""
    at_end, stuck = clipped(recording, largest=largest), dead(recording)
    file, counts = recording.attrs["file"] or "the recording", recording.counts.values
    found = []
    for finger, row, column in np.argwhere(at_end.any(axis=0)):
        first = int(np.argmax(at_end[:, finger, row, column]))
        found.append(f"{file}, row {row_of(recording, first)}: {taxel_in_words(finger, row, column)} reads "
                    f"{counts[first, finger, row, column]:g} counts, the end of its range; "
                    f"{at_end[:, finger, row, column].sum()} readings of it are clipped.")
    for finger, row, column in np.argwhere(stuck):
        found.append(f"{file}, row {row_of(recording, 0)}: {taxel_in_words(finger, row, column)} reads "
                    f"{counts[0, finger, row, column]:g} counts in all {len(counts)} readings while others of its finger move; it "
                    "may be dead.")
    return found


def row_of(recording: "xarray.Dataset", reading: int) -> int:
    """Row of a reading in its file, or its number where there is no file."""
    return int(recording.row_of_file[reading]) if "row_of_file" in recording else reading


def taxel_in_words(finger: int, row: int, column: int) -> str:
    """A taxel for a message."""
    return f"finger {finger}, taxel {row * COLUMNS + column} (row {row}, column {column})"


def with_force(recording: "xarray.Dataset", path: str | Path) -> "xarray.Dataset":
    """The recording with `force_n` (time, finger) from a CSV of a load cell or a gripper, linear between its rows.

    Its columns: `time_s`, from the recording's first reading on, or `Time(ms)`, of the recorder's clock; and `force_n`, for both
    fingers, or `force_n_0` and `force_n_1`. Raises InputError where it does not cover the recording.
    """
    table = read_table(path, what="log of forces")
    clock = "Time(ms)" if "Time(ms)" in table.header else "time_s"
    names = ["force_n"] * FINGERS if "force_n" in table.header else [f"force_n_{finger}" for finger in range(FINGERS)]
    time, *forces = map(np.array, table.numbers([clock, *names]))
    if clock == "Time(ms)":
        time = 1e-3 * (time - recording.attrs["start_ms"])
    refuse_running_back(Path(path), time, [row for row, _ in table.rows], unit="s")
    at = recording.time.values
    if not (len(time) and time[0] <= at[0] + _LATE_S and time[-1] >= at[-1] - _LATE_S):
        raise InputError(f"{path}: its times {_span(time)} do not cover those of {recording.attrs['file'] or 'the recording'}, "
                         f"{_span(at)}; give forces from before its first reading until after its last.")
    force = np.stack([np.interp(at, time, one) for one in forces], axis=1)
    return recording.assign(force_n=(_DIMENSIONS["force_n"], force[:, :recording.sizes["finger"]], {"units": "N"}))


def _span(time):
    return f"{time[0]:g} to {time[-1]:g} s" if len(time) else "(none)"


def refuse_running_back(path: Path, time: np.ndarray, rows: Sequence[int], *, unit: str) -> None:
    """Refuse times (n,) that fall; the message names the file's row."""
    back = np.flatnonzero(np.diff(time) < 0)
    if len(back):
        at = int(back[0])
        raise InputError(f"{path}, row {rows[at + 1]}: time runs back from {time[at]:.15g} to {time[at + 1]:.15g} {unit}; are "
                         "these two recordings in one file? Give one that runs forward.")
