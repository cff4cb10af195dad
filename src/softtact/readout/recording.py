"""A recording of a sensor's two fingers over time as one labelled data set, and its faults.

Variables: counts (time, finger, row, column) over the baseline; baseline (finger, row, column); row_of_file (time); where known
dynamic (time, finger), acceleration and angular_rate (time, finger, axis), force_n (time, finger). Coordinate: time in s from the
first reading. Attributes: source, file, start_ms, repairs (sentences on what was put right while the file was read).

Order of the taxels. The maker's protocol sends 28 numbers a finger row by row, 7 rows of 4 columns; taxel k is row k // 4, column
k % 4. That row 0 lies at the lowest y and column 0 at the lowest x of the sensor frame, and that each finger has a frame, z out of
its sensing surface, is documented nowhere and assumed. A press off the centre shows it: `softtact calibrate` reports
when a recording fits a press better with rows or columns reversed.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypedDict, Unpack

import numpy as np
from scipy.ndimage import maximum_filter, rank_filter, uniform_filter1d

from softtact.errors import InputError
from softtact.readout.frames import noise
from softtact.tables import read_table

if TYPE_CHECKING:
    import xarray

FINGERS, ROWS, COLUMNS = 2, 7, 4
TAXELS = ROWS * COLUMNS
LARGEST_RAW = 65535                 # of the 16 bits of a taxel
AXES = ("x", "y", "z")
MOVES = 30.0                        # counts: least change of a pressed finger; five standard deviations of the virtual noise
_SLOW, _DEAF = 15, 0.02             # readings of a mean; its change over that of two taxels beside it, less than a press spreads
_AROUND = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], dtype=bool)
NOISY = 1.0                         # counts: noise that is no rounding, so that a taxel, or a frame, does not stand by chance
LATE_S = 0.05                       # by which a log of forces may begin late or end early: a few rows of the log
_GAP, _GAP_S = 6.0, 0.1             # a gap in a log: times the usual distance of its rows, and s
_SLOWEST_S = 0.5                    # distance of rows from which on a log may be one in ms
_WRAPS_MS = (2.0**32, 2.0**31, 2.0**24, 2.0**16, 2.0**32 / 1000)     # where counters of ms, the last of us, start anew
_WRAP_STEPS = 20                    # most usual steps of a time where a counter starts anew
_STEP_BACK_S = 10.0                 # largest step back of a clock that is set; larger ones are other recordings
_ROWS_OF_A_CLOCK = 10               # fewest rows from which the usual distance of times is known

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
                   start_ms: int = 0, file: str = "", repairs: Sequence[str] = (),
                   **arrays: Unpack[RecordedArrays]) -> "xarray.Dataset":
    """A recording (see this module) of counts (time, finger, row, column) over the baseline at times (time,) in s.

    source: origin of the numbers, such as "simulated: softtact";  baseline (finger, row, column): raw counts at rest, 0 by default
    start_ms: the recorder's clock at time 0;  file: source file of the recording;  repairs: sentences on what was put right in it
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
                              attrs={"source": source, "file": file, "start_ms": int(start_ms), "repairs": tuple(repairs)})
    except ValueError as error:
        raise InputError(f"A recording's arrays do not fit each other ({error}); see make_recording for their shapes.") from None


def clipped(recording: "xarray.Dataset", *, largest: float | None = None) -> np.ndarray:
    """Where (time, finger, row, column) a taxel reads the end of its range, so that the true value may be larger.

    largest: counts over the baseline at which the readout ends, beside the 16 bits; ignored where the recording exceeds it
    """
    counts, baseline = recording.counts.values, recording.baseline.values
    at_end = counts + baseline == LARGEST_RAW
    if largest is not None and counts.max() <= largest:
        at_end |= counts >= largest
    return at_end


def dead(recording: "xarray.Dataset") -> np.ndarray:
    """Taxels (finger, row, column) that never change while one beside them is pressed, or most of a pressed finger are noisy.

    Also those that change by noise only while two beside them are pressed.
    """
    moved = np.ptp(recording.counts.values, axis=0)
    beside = maximum_filter(moved, size=(1, 3, 3), mode="constant")
    noises = noise(recording.counts.values.reshape(len(recording.time), -1)).reshape(moved.shape)
    noisy = np.median(noises, axis=(1, 2), keepdims=True) >= NOISY
    pressed = moved.max(axis=(1, 2), keepdims=True) >= MOVES
    slow = np.ptp(uniform_filter1d(recording.counts.values.astype(float), _SLOW, axis=0), axis=0)
    second = rank_filter(slow, -2, footprint=_AROUND[None], mode="constant")
    deaf = (slow < _DEAF * second) & (second >= 5 * MOVES)
    return (moved == 0) & pressed & ((beside >= MOVES) | noisy) | deaf


def name_of(recording: "xarray.Dataset") -> str:
    """The file of a recording for a message."""
    return recording.attrs["file"] or "the recording"


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
    rows = [row for row, _ in table.rows]
    if clock == "Time(ms)":
        time, repairs = running_forward(Path(path), time, rows, unit="ms")
        time = 1e-3 * (time - recording.attrs["start_ms"])
    else:
        time, repairs = running_forward(Path(path), time, rows, unit="s")
    return with_forces_at(recording, time, np.stack(forces, axis=1), log=str(path), repairs=repairs)


def with_forces_at(recording: "xarray.Dataset", time_s: np.ndarray, force_n: np.ndarray, *, log: str,
                   repairs: Sequence[str] = ()) -> "xarray.Dataset":
    """The recording with `force_n` (time, finger) from forces (n, finger) in N at times (n,) in s from its first reading on.

    log: name of their source for messages;  repairs: sentences on what was put right in it
    The attributes force_log, force_gaps_s (gap, 2) and force_spacing_s say where the log has no row for unusually long.
    Raises InputError where the forces do not cover the recording.
    """
    at = recording.time.values
    _refuse_other_unit(log, time_s, at)
    if not (len(time_s) and time_s[0] <= at[0] + LATE_S and time_s[-1] >= at[-1] - LATE_S):
        raise InputError(f"{log}: its times {_span(time_s)} do not cover those of {name_of(recording)}, {_span(at)}; give forces "
                         "from before its first reading until after its last.")
    force = np.stack([np.interp(at, time_s, one) for one in force_n.T], axis=1)
    steps = np.diff(time_s)
    usual = max(np.median(steps), np.quantile(steps, 0.9)) if len(steps) else 0.0
    gaps = np.flatnonzero(steps > max(_GAP * usual, _GAP_S))
    attributes = {"force_log": log, "force_gaps_s": np.stack([time_s[gaps], time_s[gaps + 1]], axis=1),
                  "force_spacing_s": float(usual), "repairs": (*recording.attrs["repairs"], *repairs)}
    return recording.assign(force_n=(_DIMENSIONS["force_n"], force[:, :recording.sizes["finger"]], {"units": "N"})
                            ).assign_attrs(attributes)


def _refuse_other_unit(log, time, at):
    """Refuse times whose rows lie too far apart for a press, and that would cover just the recording in ms or us."""
    if len(time) < _ROWS_OF_A_CLOCK or np.median(np.diff(time)) < _SLOWEST_S:
        return
    for unit, factor in (("ms", 1e3), ("us", 1e6)):
        if 0.5 <= (time[-1] - time[0]) / factor / max(at[-1] - at[0], 1e-9) <= 2:
            raise InputError(f"{log}: it is some {factor:,.0f} times as long as the recording, {_span(time)} for {_span(at)}; is "
                             f"its time in {unit}? Give time_s in seconds.")


def _span(time):
    return f"{time[0]:g} to {time[-1]:g} s" if len(time) else "(none)"


def running_forward(path: Path, time: np.ndarray, rows: Sequence[int], *, unit: str) -> tuple[np.ndarray, list[str]]:
    """Times (n,), in `unit` (ms or s), that run forward, and a sentence for each step back that was taken out.

    A counter that starts anew is counted on. A clock that is set back by a little goes on after its usual step. Raises InputError,
    with the file's row, for other steps back: they are of two recordings in one file.
    """
    stated = np.array(time, dtype=float)
    time, told = stated.copy(), []
    if len(time) >= _ROWS_OF_A_CLOCK and np.ptp(time) == 0:
        raise InputError(f"{path}, rows {rows[0]} to {rows[-1]}: all have the time {time[0]:.15g} {unit}; record again with the "
                         "clock running.")
    for at in map(int, np.flatnonzero(np.diff(time) < 0)):
        before, after = stated[at], stated[at + 1]
        steps = np.diff(time)
        usual = float(np.median(steps[steps > 0])) if len(time) >= _ROWS_OF_A_CLOCK and (steps > 0).any() else 0.0
        where, back = f"{path}, row {rows[at + 1]}", before - after
        wrap = next((one for one in _WRAPS_MS if unit == "ms" and before < one and 0 <= one - back <= _WRAP_STEPS * usual), None)
        if wrap is not None:
            told.append(f"{where}: the time starts anew after {before:.15g} {unit}, as a counter does that ends at {wrap:.15g}; "
                        "it is counted on.")
            time[at + 1:] += wrap
        elif (usual and time[at + 1] > time[0]
              and back <= min(_STEP_BACK_S * (1e3 if unit == "ms" else 1), 0.5 * (time[at] - time[0]))):
            told.append(f"{where}: the time falls from {before:.15g} to {after:.15g} {unit}, as a clock does that is set back by "
                        f"{back + usual:.6g} {unit}; later times are taken so much later.")
            time[at + 1:] += back + usual
        else:
            raise InputError(f"{where}: time runs back from {before:.15g} to {after:.15g} {unit}; are these two recordings in one "
                             "file? Give one that runs forward.")
    return time, told
