"""Recordings of the TSF-85: what is written is read back, columns are found by the header, faults are named by file and row."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from softtact.errors import InputError
from softtact.readout.checks.recording import check_recording
from softtact.readout.recording import clipped, dead, make_recording, with_force
from softtact.readout.tsf85 import read_recording, write_recording

SHAPE = (2, 7, 4)
TIME = np.arange(5) * 0.016
BASE = np.arange(56).reshape(SHAPE) + 9000
COUNTS = np.zeros((5, *SHAPE), dtype=int)
COUNTS[2:, 0, 3, 1] = 500
COUNTS[2:, 1, 0, 2] = 40
RECORDING = make_recording(TIME, COUNTS, source="a test's", baseline=BASE, dynamic=np.arange(10).reshape(5, 2),
                           acceleration=np.arange(30).reshape(5, 2, 3), angular_rate=-np.arange(30).reshape(5, 2, 3), start_ms=1000)


@pytest.fixture
def rows(tmp_path):
    """(path, cells of each row) of a sound file."""
    path = tmp_path / "press.csv"
    write_recording(path, RECORDING)
    return path, [line.split(";") for line in path.read_text().splitlines()]


def written(path, rows, *, separator=";"):
    path.write_text("".join(separator.join(map(str, row)) + "\n" for row in rows))
    return path


whole = st.integers(0, 2400)


@settings(max_examples=30, deadline=None)
@given(counts=hnp.arrays(int, (3, *SHAPE), elements=whole), base=hnp.arrays(int, SHAPE, elements=st.integers(0, 60000)),
       dynamic=hnp.arrays(int, (3, 2), elements=st.integers(-32768, 32767)),
       steps=st.lists(st.integers(0, 40), min_size=2, max_size=2), kept=st.booleans())
def test_what_is_written_is_read_back_to_the_last_count(tmp_path_factory, counts, base, dynamic, steps, kept):
    time = 1e-3 * np.cumsum([0, *steps])
    one = make_recording(time, counts, source="x", baseline=base, dynamic=dynamic, start_ms=1_700_000_000_000)
    path = tmp_path_factory.mktemp("r") / "r.csv"
    write_recording(path, one, keep_baseline=kept)
    again = read_recording(path, baseline="kept" if kept else "subtracted")
    assert (again.counts.values == counts).all() and (again.baseline.values == base).all()
    assert (again.dynamic.values == dynamic).all() and again.attrs["start_ms"] == 1_700_000_000_000
    assert again.time.values == pytest.approx(time, abs=1e-9)


def test_the_file_is_laid_out_as_the_makers_recorder_writes_it(rows):
    _, (header, base, *readings) = rows
    assert header[:4] == ["Time(ms)", "D0_0", "D0_1", "S0_0"] and header[30:32] == ["S27_0", "S0_1"]
    assert header[59:] == [f"{kind}{axis}{finger}" for kind in "AG" for finger in (0, 1) for axis in "xyz"]
    assert base == ["1000", "0", "0", *map(str, BASE.ravel()), *["0"] * 12]
    assert readings[2][3 + 3 * 4 + 1] == "500" and readings[1][0] == "1016"


def test_columns_are_found_by_the_header_in_any_order(rows):
    path, lines = rows
    order = np.random.default_rng(0).permutation(len(lines[0]))
    again = read_recording(written(path, [[line[k] for k in order] for line in lines]))
    for name in ("counts", "baseline", "dynamic", "acceleration", "angular_rate"):
        assert (again[name].values == RECORDING[name].values).all(), name


def test_a_kept_baseline_is_told_by_the_lowest_readings(tmp_path):
    path = tmp_path / "kept.csv"
    write_recording(path, RECORDING, keep_baseline=True)
    assert (read_recording(path).counts.values == COUNTS).all()


def test_a_recording_that_is_never_at_rest_must_state_its_baseline(tmp_path):
    path = tmp_path / "held.csv"
    write_recording(path, make_recording(TIME, COUNTS + 5000, source="x", baseline=BASE))
    with pytest.raises(InputError, match="whether the baseline is subtracted from its readings is not clear.*--baseline"):
        read_recording(path)
    assert (read_recording(path, baseline="subtracted").counts.values == COUNTS + 5000).all()


def without(header, name):
    at = header.index(name)
    return lambda line: line[:at] + line[at + 1:]


@pytest.mark.parametrize(("change", "sentence"), [
    (lambda lines: [["t", *line[1:]] for line in lines], "row 1: no column is named 'Time(ms)'"),
    (lambda lines: [line[:31] + line[59:] for line in lines], "row 1: finger 1 is missing"),
    (lambda lines: [without(lines[0], "S13_1")(line) for line in lines], "finger 1 has 27 taxels (S13_1 is missing)"),
    (lambda lines: [[*line, "S28_0" if k == 0 else 0] for k, line in enumerate(lines)], "finger 0 has 29 taxels (S28_0 is one too"),
    (lambda lines: [without(lines[0], "Gy1")(line) for line in lines], "the column 'Gy1' is missing beside 'Gx0'"),
    (lambda lines: [[*line, "Q" if k == 0 else 0] for k, line in enumerate(lines)], "the column 'Q' is none that the recorder"),
    (lambda lines: lines[:1] + lines[2:], "row 2: it is no baseline, as D0_1 is 1"),
    (lambda lines: lines[:2] + [lines[4], lines[3]], "row 4: time runs back from 1032 to 1016 ms"),
    (lambda lines: lines[:2], "it has 1 row below its header"),
    (lambda lines: lines[:3] + [[*lines[3][:5], "7.5", *lines[3][6:]]] + lines[4:], "row 4: S2_0 is 7.5, which is no whole number"),
    (lambda lines: lines[:3] + [[*lines[3][:5], "x", *lines[3][6:]]] + lines[4:], "row 4: 'x' is not a number"),
    (lambda lines: lines[:3] + [[*lines[3][:5], "99999", *lines[3][6:]]] + lines[4:], "row 4: S2_0 is 99999"),
    (lambda lines: lines[:3] + [lines[3][:-2]] + lines[4:], "row 4: it has 69 fields where 71 are named"),
    (lambda lines: lines[:1] + [[",".join(line)] for line in lines[1:]], "row 2: it has 1 field where 71 are named, with semicol"),
])
def test_a_fault_is_refused_by_its_file_and_row(rows, change, sentence):
    path, lines = rows
    with pytest.raises(InputError) as refused:
        read_recording(written(path, change(lines)))
    assert str(path) in str(refused.value) and sentence in str(refused.value)


def test_clipped_and_dead_taxels_are_named_by_row(tmp_path):
    counts = COUNTS.copy()
    counts[3:, 0, 3, 1] = 65535 - BASE[0, 3, 1]
    write_recording(tmp_path / "r.csv", make_recording(TIME, counts, source="x", baseline=BASE))
    one = read_recording(tmp_path / "r.csv", baseline="subtracted")
    beside = [8, 9, 10, 12, 14, 16, 17, 18]
    assert clipped(one).sum() == 2 and np.flatnonzero(dead(one)[0]).tolist() == beside
    assert np.flatnonzero(dead(one)[1]).tolist() == [1, 3, 5, 6, 7]
    said = [found.sentence for found in check_recording(one)]
    assert "r.csv, row 6: finger 0, taxel 13 (row 3, column 1) reads 56522 counts, the end of its range; 2 readings" in said[0]
    assert "finger 0, taxel 8 (row 2, column 0) reads 0 counts in all 5 readings while others" in said[1]


def test_a_readouts_own_end_clips_only_where_the_recording_does_not_exceed_it():
    assert clipped(RECORDING, largest=500.0).sum() == 3 and not clipped(RECORDING, largest=499.0).any()


def test_a_finger_that_nothing_presses_has_no_dead_taxel():
    still = make_recording(TIME, np.zeros((5, *SHAPE), dtype=int), source="x")
    assert not dead(still).any() and check_recording(still) == []


@pytest.mark.parametrize(("change", "sentence"), [
    ({"counts": COUNTS + 0.5}, "the recording holds 0.5, but the recorder's format takes whole numbers"),
    ({"counts": COUNTS - 9001}, "come to -1, which 16 bits"),
    ({"counts": COUNTS[:, :1], "baseline": BASE[:1]}, "has (1, 7, 4) fingers, rows and columns"),
])
def test_what_the_format_cannot_hold_is_not_written(tmp_path, change, sentence):
    one = make_recording(TIME, source="x", **({"counts": COUNTS, "baseline": BASE} | change))
    with pytest.raises(InputError) as refused:
        write_recording(tmp_path / "r.csv", one)
    assert sentence in str(refused.value) and not list(tmp_path.iterdir())


def test_the_extensions_readings_and_nodes_are_read(tmp_path):
    for kind, count in (("pred", 28), ("dz", 400)):
        lines = [["time_sec", "frame", *(f"{kind}_{k}" for k in range(count))]]
        lines += [[f"{7.5 + 0.1 * t:.6f}", t, *(t + 0.25 * np.arange(count))] for t in range(3)]
        one = read_recording(written(tmp_path / f"{kind}.csv", lines, separator=","))
        assert one.time.values == pytest.approx([0, 0.1, 0.2]) and one.attrs["start_ms"] == 7500
        if kind == "pred":
            assert one.counts.shape == (3, 1, 7, 4) and one.counts[2, 0, 1, 1] == 2 + 0.25 * 5
        else:
            assert one.dz.shape == (3, 25, 16) and one.dz[1, 2, 3] == 1 + 0.25 * 35 and "counts" not in one
        with pytest.raises(InputError, match=f"has {count - 1} columns {kind}_"):
            read_recording(written(tmp_path / "short.csv", [line[:-1] for line in lines], separator=","))
        lines[3][0] = "7.55"      # the extension appends a second run to the same file
        with pytest.raises(InputError, match="row 4: time runs back from 7.6 to 7.55 s"):
            read_recording(written(tmp_path / "twice.csv", lines, separator=","))


def test_a_log_of_forces_is_laid_on_the_recordings_clock(tmp_path):
    log = written(tmp_path / "f.csv", [["Time(ms)", "force_n_0", "force_n_1"], [990, 0, 1], [1100, 11, 1]], separator=",")
    force = with_force(RECORDING, log).force_n.values
    assert force[:, 0] == pytest.approx(0.1 * (10 + 1e3 * TIME)) and (force[:, 1] == 1).all()
    short = written(tmp_path / "g.csv", [["time_s", "force_n"], [0, 0], [0.001, 1]], separator=",")
    with pytest.raises(InputError, match="g.csv: its times 0 to 0.001 s do not cover those of the recording, 0 to 0.064 s"):
        with_force(RECORDING, short)
