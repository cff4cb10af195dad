"""Recordings of the TSF-85 as files: the maker's recorder, read and written, and the authors' extension, read.

    recorder    Time(ms);D0_0;D0_1;S0_0..S27_0;S0_1..S27_1;Ax0;Ay0;Az0;Ax1..Az1;Gx0..Gz1     `;` between whole numbers
    extension   time_sec,frame,pred_0..pred_27     readings of its network;   time_sec,frame,dz_0..dz_399     its 25 x 16 nodes

Columns are found by the header, in any order; dynamic and inertial ones may be missing together. The recorder's first row is the
baseline, with 0 in the columns D, A and G; in the others the baseline is taken off, unless it was started with `--keep-baseline`,
which is not noted in the file. Format: github.com/robotiq/tactile_sensors, sensor_quickstart/record_data.py; extension:
github.com/Lab-CORO/TSF-85, TSF_85_Ext (facts only). Assumed order of the taxels: `softtact.readout.recording`.
"""

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from softtact.errors import InputError
from softtact.files import atomic_path
from softtact.readout.recording import (
    AXES,
    COLUMNS,
    FINGERS,
    LARGEST_RAW,
    ROWS,
    TAXELS,
    make_recording,
    running_forward,
    taxel_in_words,
)
from softtact.tables import Table, read_table

if TYPE_CHECKING:
    import xarray

TIME = "Time(ms)"
RECORDER = "recorder of the TSF-85"       # source of its recordings
BASELINES = ("auto", "subtracted", "kept")
_STATIC = re.compile(r"S(\d+)_(\d+)")
_LOW = 0.02             # share of a taxel's readings that is taken for readings at rest, wherever they are in the recording
_FEW = 0.01             # share of the frames that may hold impossible readings: these are faults, not another form of the file
_CLEARLY = 0.5          # largest ratio of the distances from the two forms of baseline for a clear decision
_BASELINE_MISSING = "the baseline is missing: put the recorder's first row back, or record again."
_NODES = (25, 16)       # of the extension's mesh, rows along the longer side: assumed, as their order is documented nowhere


def read_recording(path: str | Path, *, baseline: str = "auto") -> "xarray.Dataset":
    """The recording (`softtact.readout.recording`) in a file of the maker's recorder, or of the authors' extension.

    baseline: whether the recorder has `subtracted` it from the readings, or `kept` it in them; `auto` decides by the lowest
    readings, and refuses a file that allows both. The extension's file of nodes gives `dz` (time, node_y, node_x) in place of
    counts. Raises InputError that names the file, its row and the remedy.
    """
    path = Path(path)
    if baseline not in BASELINES:
        raise InputError(f"baseline={baseline!r} is unknown; write {', '.join(BASELINES)}.")
    table = read_table(path, what="recording")
    if TIME in table.header:
        return _of_recorder(path, table, baseline)
    if "time_sec" in table.header:
        return _of_extension(path, table)
    raise InputError(f"{path}, row 1: no column is named {TIME!r}, as the maker's recorder writes it, or 'time_sec', as the "
                     "extension does; give the file as it was recorded.")


def write_recording(path: str | Path, recording: "xarray.Dataset", *, keep_baseline: bool = False) -> None:
    """Write a recording as the maker's recorder does, so that tools for it can read it; time is rounded to 1 ms.

    keep_baseline: leave the baseline in the readings. Missing values (dynamic, inertial) are written as 0. The format has no
    `force_n`: write it to a separate file (`recording.with_force` reads it back).
    Raises InputError for another number of fingers or taxels, for counts that are not whole numbers or do not fit in 16 bits.
    """
    shape = (FINGERS, ROWS, COLUMNS)
    if recording.counts.shape[1:] != shape:
        raise InputError(f"{path}: the recording has {recording.counts.shape[1:]} fingers, rows and columns; the format takes "
                         f"{shape}.")
    count, base = len(recording.time), recording.baseline.values
    time = recording.attrs["start_ms"] + 1e3 * recording.time.values
    static = recording.counts.values + (base if keep_baseline else 0)
    readings = [np.round(time)[:, None], _known(recording, "dynamic", (count, FINGERS)), static.reshape(count, -1),
                _known(recording, "acceleration", (count, 3 * FINGERS)), _known(recording, "angular_rate", (count, 3 * FINGERS))]
    rest = [[np.round(time[0])], np.zeros(FINGERS), base.ravel(), np.zeros(6 * FINGERS)]
    table = np.vstack([np.concatenate(rest), np.hstack(readings)])
    _check_whole(path, table, recording.counts.values + base)
    lines = [";".join(_header()), *(";".join(map(str, row)) for row in table.astype(np.int64).tolist())]
    with atomic_path(path) as temporary:
        temporary.write_text("\r\n".join([*lines, ""]), encoding="utf-8", newline="")     # as Python's csv module ends lines


def _header():
    return [TIME, *_dynamic(), *_static(), *_inertial("A"), *_inertial("G")]


def _static():
    return [f"S{taxel}_{finger}" for finger in range(FINGERS) for taxel in range(TAXELS)]


def _dynamic():
    return [f"D0_{finger}" for finger in range(FINGERS)]


def _inertial(kind):
    return [f"{kind}{axis}{finger}" for finger in range(FINGERS) for axis in AXES]


def _known(recording, name, shape):
    return recording[name].values.reshape(shape) if name in recording else np.zeros(shape)


def _check_whole(path, table, raw):
    """Refuse numbers that the format's 16 bits cannot hold."""
    if not (np.isfinite(table).all() and (table == np.round(table)).all()):
        value = table[~(np.isfinite(table) & (table == np.round(table)))][0]
        raise InputError(f"{path}: the recording holds {value:g}, but the recorder's format takes whole numbers; round the counts "
                         "as the sensor's converter does.")
    if raw.min() < 0 or raw.max() > LARGEST_RAW:
        value = raw.min() if raw.min() < 0 else raw.max()
        raise InputError(f"{path}: counts and baseline together come to {value:g}, which 16 bits (0 to {LARGEST_RAW}) cannot hold; "
                         "give the recording a baseline that keeps them within.")


def _of_recorder(path, table, baseline):
    """A recording of the maker's recorder."""
    _check_header(path, table.header)
    if len(table.rows) < 2:
        raise InputError(f"{path}: it has {len(table.rows)} row{'s' * (len(table.rows) != 1)} below its header, and a recording "
                         "has its baseline and readings; record again.")
    columns = dict(zip(table.header, np.array(table.numbers(table.header)), strict=True))
    rows = np.array([row for row, _ in table.rows])
    _check_values(path, columns, rows)
    base, counts, repairs = _baseline_off(path, columns, baseline, rows)
    time, of_clock = running_forward(path, columns[TIME][1:], rows[1:].tolist(), unit="ms")
    others = {name: np.stack([columns[one][1:] for one in group], axis=1).astype(int)
              for name, group in _optional().items() if group[0] in columns}
    shape = (len(time), FINGERS, len(AXES))
    others = {name: values if name == "dynamic" else values.reshape(shape) for name, values in others.items()}
    return make_recording(1e-3 * (time - time[0]), counts, baseline=base, row_of_file=rows[1:], start_ms=int(time[0]),
                          source=RECORDER, file=str(path), repairs=[*repairs, *of_clock], **others)


def _optional():
    return {"dynamic": _dynamic(), "acceleration": _inertial("A"), "angular_rate": _inertial("G")}


def _check_header(path, header):
    """Refuse a header with a repeated, an unknown or a missing column: of a finger, a taxel or a group."""
    twice = next((name for name in header if header.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"{path}, row 1: two columns are named {twice!r}; keep one.")
    found: dict[int, set[int]] = {}
    for taxel, finger in (map(int, match.groups()) for match in map(_STATIC.fullmatch, header) if match):
        found.setdefault(finger, set()).add(taxel)
    for finger in range(FINGERS):
        if finger not in found:
            raise InputError(f"{path}, row 1: finger {finger} is missing, as no column is named S0_{finger}; give a recording of "
                             "both fingers, as the recorder writes it.")
        if found[finger] != set(range(TAXELS)):
            odd = min(found[finger] ^ set(range(TAXELS)))
            raise InputError(f"{path}, row 1: finger {finger} has {len(found[finger])} taxels (S{odd}_{finger} is "
                             f"{'missing' if odd < TAXELS else 'one too many'}), where the TSF-85 has {TAXELS}; is it of another "
                             "sensor?")
    for group in _optional().values():
        missing = [name for name in group if name not in header]
        if missing and len(missing) < len(group):
            there = next(name for name in group if name in header)
            raise InputError(f"{path}, row 1: the column {missing[0]!r} is missing beside {there!r}; give all of a kind, or none.")
    known = {TIME, *_header()}
    unknown = [name for name in header if name not in known]
    if unknown:
        raise InputError(f"{path}, row 1: the column {unknown[0]!r} is none that the recorder writes; take it out.")


def _check_values(path, columns, rows):
    """Refuse numbers that are not whole, or larger than 16 bits less a baseline."""
    for name, values in columns.items():
        odd = values != np.round(values)
        if name != TIME:
            odd |= np.abs(values) > LARGEST_RAW
        if odd.any():
            at = int(np.argmax(odd))
            raise InputError(f"{path}, row {rows[at]}: {name} is {values[at]:g}, which is no whole number of 16 bits; correct the "
                             "row or record again.")


def _baseline_off(path, columns, baseline, rows):
    """Baseline (finger, row, column), whole counts over it (time, finger, row, column), and sentences on what was put right."""
    placeholders = [name for group in _optional().values() for name in group if name in columns]
    if any(columns[name][0] for name in placeholders):
        name = next(name for name in placeholders if columns[name][0])
        raise InputError(f"{path}, row {rows[0]}: it is no baseline, as {name} is {columns[name][0]:g} and the recorder writes 0 "
                         f"there; {_BASELINE_MISSING}")
    static = np.stack([columns[name] for name in _static()], axis=1).astype(int).reshape(-1, FINGERS, ROWS, COLUMNS)
    base, readings = static[0], static[1:]
    if base.min() < 0:
        raise InputError(f"{path}, row {rows[0]}: its baseline has {base.min()} counts, and raw counts are not negative; "
                         f"{_BASELINE_MISSING}")
    signed = _with_signs(base, readings) if baseline != "kept" else readings
    if baseline == "auto":
        baseline = _form_of_baseline(path, base, readings, signed)
    counts = readings - base if baseline == "kept" else signed
    _refuse_other_form(path, base, counts, baseline, rows[1:])
    if baseline == "kept" or signed is readings:
        return base, counts, []
    first, *taxel = np.argwhere(signed != readings)[0]
    return base, counts, [f"{path}, row {rows[1 + first]}: {taxel_in_words(*map(int, taxel))} reads {readings[first, *taxel]}, and "
                          f"{(signed != readings).sum() - 1} other readings lie as high: negative ones without their sign; they "
                          "are read as such, 65536 less."]


def _with_signs(base, readings):
    """Readings of which some are negative but written without a sign, with it; the same array where none is.

    Such readings cannot be raw counts over the baseline, they are no few, and no reading has a sign.
    """
    high = readings > LARGEST_RAW // 2
    beyond = high & (readings + base > LARGEST_RAW)
    signed = np.where(high, readings - (LARGEST_RAW + 1), readings)
    unsigned = readings.min() >= 0 and beyond.any(axis=(1, 2, 3)).mean() > _FEW and (signed + base).min() >= 0
    return signed if unsigned else readings


def _refuse_other_form(path, base, counts, baseline, rows):
    """Refuse counts that 16 bits do not hold together with the baseline; a few are wrong readings, which the checks name."""
    beyond = (counts + base < 0) | (counts + base > LARGEST_RAW)
    frames = beyond.any(axis=(1, 2, 3))
    if frames.mean() > _FEW:
        other = "subtracted" if baseline == "kept" else "kept"
        raise InputError(f"{path}, row {rows[int(np.argmax(frames))]}: with the baseline {baseline} a taxel's raw counts are not "
                         f"within 0 and {LARGEST_RAW}; is the baseline {other} (--baseline {other})?")


def _form_of_baseline(path, base, readings, signed):
    """Whether the baseline is subtracted from the readings or kept in them, by their lowest values."""
    if not base.any():
        return "subtracted"
    off, on = (float(np.sqrt(np.mean(np.quantile(values, _LOW, axis=0)**2))) for values in (signed, readings - base))
    if readings.min() < 0 and off < on:
        return "subtracted"
    if min(off, on) > _CLEARLY * max(off, on):
        raise InputError(f"{path}: whether the baseline is subtracted from its readings is not clear, as the lowest are {off:.0f} "
                         f"counts from 0 and {on:.0f} from the baseline; state it (`baseline`, --baseline: subtracted, or kept).")
    return "subtracted" if off < on else "kept"


def _of_extension(path: Path, table: Table) -> "xarray.Dataset":
    """The readings, or the nodes, that the authors' extension writes of one finger."""
    kind, count = ("pred", TAXELS) if any(name.startswith("pred_") for name in table.header) else ("dz", int(np.prod(_NODES)))
    found = sum(name.startswith(f"{kind}_") for name in table.header)
    if found != count:
        raise InputError(f"{path}, row 1: it has {found} columns {kind}_..., where the extension writes {count}; is it of another "
                         "sensor?")
    if not table.rows:
        raise InputError(f"{path}: it has a header and no reading; record again.")
    time = np.array(table.numbers(["time_sec"])[0])
    rows = np.array([row for row, _ in table.rows])
    time, repairs = running_forward(path, time, rows.tolist(), unit="s")
    values = np.array(table.numbers([f"{kind}_{k}" for k in range(count)])).T
    source = "extension of the paper's authors, a network's reading"
    counts = values.reshape(-1, 1, ROWS, COLUMNS) if kind == "pred" else np.zeros((len(time), 1, ROWS, COLUMNS), dtype=int)
    recording = make_recording(time - time[0], counts, row_of_file=rows, start_ms=round(1e3 * time[0]), source=source,
                               file=str(path), repairs=repairs)
    if kind == "pred":
        return recording
    nodes = (("time", "node_y", "node_x"), values.reshape(-1, *_NODES), {"units": "as the extension writes it"})
    source = "extension of the paper's authors, nodes of its mesh"
    return recording.drop_vars(["counts", "baseline"]).assign(dz=nodes).assign_attrs(source=source)
