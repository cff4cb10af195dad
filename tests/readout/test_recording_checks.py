"""Faults of recordings and of logs of forces: each is told with its place; sound recordings give no finding."""

import numpy as np
import pytest
from support.sound_recordings import drawn, ramp

from softtact.errors import InputError
from softtact.readout.checks.finding import left_out, refuse_unsafe, zeroed
from softtact.readout.checks.recording import check_recording
from softtact.readout.frames import new_frames, noise
from softtact.readout.recording import running_forward
from softtact.readout.tsf85 import read_recording, write_recording


@pytest.mark.parametrize("seed", range(16))
def test_a_sound_recording_gives_no_finding(seed):
    bench = drawn(seed, rates=(30, 60, 100))
    assert [one.sentence for one in check_recording(bench.recording())] == []


@pytest.mark.parametrize("seed", [1, 7])
def test_rows_that_repeat_a_frame_are_no_frozen_ones(seed):
    bench = drawn(seed, presses=1, rates=(1000,))
    assert [one.sentence for one in check_recording(bench.recording())] == []


def test_frames_that_are_renewed_each_third_of_a_second_are_no_frozen_ones():
    bench = ramp()
    bench.time_s, bench.log_s = 3 * bench.time_s, 3 * bench.log_s
    bench.counts = bench.counts[np.arange(400) // 10 * 10]
    assert "frozen" not in {one.check for one in check_recording(bench.recording())}


def told(bench, check, *, log=True):
    """The findings of a check, which must be the only ones."""
    found = check_recording(bench.recording() if log else bench.alone())
    assert {one.check for one in found} == {check}, [one.sentence for one in found]
    return found


@pytest.mark.parametrize("log", [True, False])
@pytest.mark.parametrize(("fingers", "whom"), [(slice(None), "both fingers"), (slice(1), "finger 0")])
def test_a_frame_that_stands_still_is_left_out_but_for_its_first_reading(log, fingers, whom):
    bench = ramp()
    bench.counts[150:210, fingers] = bench.counts[150, fingers]
    found, = told(bench, "frozen", log=log)
    assert "press.csv, rows 150 to 209: 60 readings" in found.sentence and f"in all taxels of {whom}" in found.sentence
    assert ("while the force goes from" in found.sentence) == log
    assert np.flatnonzero(found.left_out[:, 0, 0, 0]).tolist() == list(range(151, 210)) and found.safe


@pytest.mark.parametrize(("row", "value"), [(0, 30000), (123, -30000), (123, 900), (399, 4096)])
def test_one_wrong_reading_is_left_out(row, value):
    bench = ramp()
    bench.counts[row, 0, 3, 1] += value
    found, = told(bench, "wrong reading")
    assert f"press.csv, row {row}: finger 0, taxel 13 (row 3, column 1) reads {bench.counts[row, 0, 3, 1]} counts" in found.sentence
    assert np.argwhere(found.left_out).tolist() == [[row, 0, 3, 1]]


@pytest.mark.parametrize("frame", [0, "random"])
def test_a_frame_that_is_lost_or_garbled_is_left_out(frame):
    bench = ramp()
    bench.counts[200, 0] = 0 if frame == 0 else np.random.default_rng(0).integers(-9000, 50000, (7, 4))
    found, = told(bench, "wrong reading")
    assert "row 200: the whole frame of finger 0" in found.sentence and found.left_out.sum() == 28


def test_a_tap_of_two_frames_is_no_wrong_reading():
    bench = ramp()
    y, x = np.mgrid[:7, :4]
    bench.counts[20:22, 0] += np.round(800 * np.exp(-((y - 3) ** 2 + (x - 1) ** 2) / 1.5)).astype(int)
    assert check_recording(bench.alone()) == []


@pytest.mark.parametrize(("first", "last", "until"), [(120, 400, "to the end"), (0, 200, "to row 199"), (120, 260, "to row 259")])
def test_a_taxel_that_hangs_is_left_out_while_it_does(first, last, until):
    bench = ramp()
    bench.counts[first:last, 0, 0, 3] = bench.counts[first, 0, 0, 3]
    found, = told(bench, "hanging")
    assert f"row {first}: finger 0, taxel 3 " in found.sentence and until in found.sentence
    assert np.flatnonzero(found.left_out[:, 0, 0, 3]).tolist() == list(range(first, last)) and found.left_out.sum() == last - first


def test_readings_in_a_gap_of_the_log_are_left_out():
    bench = ramp()
    there = (bench.log_s < 1.2) | (bench.log_s > 2.6)
    bench.log_s, bench.log_n = bench.log_s[there], bench.log_n[there]
    found, = told(bench, "gap in the log")
    assert "log.csv: it has no row from 1.19 to 2.61 s (its rows are 0.01 s apart)" in found.sentence
    assert np.flatnonzero(found.left_out[:, 1, 6, 3]).tolist() == list(range(120, 261))


@pytest.mark.parametrize("zero", [1.5, -0.6])
def test_what_the_load_cell_reads_at_rest_is_taken_off(zero):
    bench = ramp()
    bench.log_n = bench.log_n + zero
    found, = told(bench, "zero of the load cell")
    assert f"at rest, while no taxel of finger 0 is pressed, it reads {zero:g} N" in found.sentence
    force = zeroed(bench.recording(), [found]).force_n.values[:, 0]
    assert force == pytest.approx(ramp().recording().force_n.values[:, 0], abs=0.02)


@pytest.mark.parametrize(("change", "check", "sentence"), [
    (lambda b: setattr(b, "log_n", b.log_n + 0.3 * b.log_s), "zero of the load cell", "N before the press and 1."),
    (lambda b: setattr(b, "log_n", 101.97 * b.log_n), "unit of the forces", "its largest force is 2039 N"),
    (lambda b: setattr(b, "log_n", -b.log_n), "sign of the forces", "its forces are negative, down to -20 N"),
    (lambda b: setattr(b, "log_n", 1.5 - b.log_n), "sign of the forces", "turn their sign"),
    (lambda b: setattr(b, "log_n", np.interp(b.log_s - 0.3, b.log_s, b.log_n)), "delay of the log", "taken 0.3 s earlier"),
    (lambda b: setattr(b, "log_n", np.interp(b.log_s + 0.2, b.log_s, b.log_n)), "delay of the log", "taken 0.2 s later"),
    (lambda b: b.add(15 * b.time_s), "drift", "at the end at rest the taxels of finger 0 read 5"),
    (lambda b: b.add(-15 * b.time_s), "drift", "read -57 to -55 counts"),
])
def test_what_would_make_the_gains_wrong_is_refused(change, check, sentence):
    bench = ramp()
    change(bench)
    found = check_recording(bench.recording())
    assert check in {one.check for one in found}
    with pytest.raises(InputError) as refused:
        refuse_unsafe(found)
    assert sentence in str(refused.value) or any(sentence in one.sentence for one in found)


@pytest.mark.parametrize("drift", [15, -15])
def test_a_drift_of_all_taxels_is_told_without_forces(drift):
    bench = ramp()
    bench.add(drift * bench.time_s)
    found, = told(bench, "drift", log=False)
    assert f"at the end all taxels have moved alike, by {np.sign(drift) * 5}" in found.sentence and not found.safe


def test_plates_that_stay_on_both_fingers_are_no_drift():
    bench = ramp()
    bench.counts[150:] = bench.counts[150:] + 300 * np.random.default_rng(1).normal(1, 0.05, (2, 7, 4)).round(3)
    assert check_recording(bench.alone()) == []


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "ms"), (1e6, "us")])
def test_a_log_in_another_unit_of_time_is_refused(factor, unit):
    bench = ramp()
    bench.log_s = factor * bench.log_s
    with pytest.raises(InputError, match=f"it is some {factor:,.0f} times as long as the recording.*is its time in {unit}"):
        bench.recording()


def test_a_log_of_an_hour_covers_a_recording_of_seconds():
    bench = ramp()
    bench.log_s, bench.log_n = np.arange(0, 4000, 0.01), np.interp(np.arange(0, 4000, 0.01), bench.log_s, bench.log_n)
    assert check_recording(bench.recording()) == []


def test_faults_at_once_are_all_told():
    bench = ramp()
    bench.counts[100:150] = bench.counts[100]
    bench.counts[220, 0, 6, 0] = 30000
    bench.counts[250:, 0, 0, 1] = bench.counts[250, 0, 0, 1]
    bench.log_n = bench.log_n + 1.0
    found = check_recording(bench.recording())
    assert sorted(one.check for one in found) == ["frozen", "hanging", "wrong reading", "zero of the load cell"]
    assert left_out(bench.recording(), found)[101:150].all() and left_out(bench.recording(), found)[220, 0, 6, 0]


def test_noise_is_that_of_distinct_frames():
    frames = np.round(np.random.default_rng(0).normal(0, 3, (500, 28)) + np.linspace(0, 4000, 500)[:, None])
    repeated = np.repeat(frames, 16, axis=0)
    assert np.median(noise(repeated)) == np.median(noise(frames)) == pytest.approx(3, rel=0.1)
    assert new_frames(repeated).tolist() == list(range(0, 8000, 16))


@pytest.mark.parametrize(("wrong", "back", "sentence"), [
    (lambda ms: np.where(np.arange(len(ms)) < 60, ms, ms - 40), 0,
     "row 60: the time falls from 590 to 560 ms, as a clock does that is set back by 40 ms"),
    (lambda ms: (ms + 2**32 - 305) % 2**32, 305 - 2**32,
     "row 31: the time starts anew after 4294967291 ms, as a counter does that ends at 4294967296"),
    (lambda ms: (ms + 2**31 - 305 + 2**31) % 2**32 - 2**31, 305 - 2**31, "as a counter does that ends at 4294967296"),
])
def test_a_clock_that_is_set_back_or_starts_anew_is_told_and_counted_on(wrong, back, sentence):
    ms = 10.0 * np.arange(100)
    time, repairs = running_forward("r.csv", wrong(ms), range(100), unit="ms")
    assert time + back == pytest.approx(ms) and len(repairs) == 1 and sentence in repairs[0]


def test_a_counter_that_starts_anew_again_and_again_is_counted_on_each_time():
    ms = 1000 + 100.0 * np.arange(2000)
    time, repairs = running_forward("r.csv", ms % 2**16, range(2000), unit="ms")
    assert time == pytest.approx(ms) and len(repairs) == 3
    assert "row 1957: the time starts anew after 65528 ms, as a counter does that ends at 65536" in repairs[2]


def test_two_recordings_in_one_file_are_refused():
    with pytest.raises(InputError, match="row 50: time runs back from 1490 to 1000 ms; are these two recordings"):
        running_forward("r.csv", np.tile(1000 + 10.0 * np.arange(50), 2), range(100), unit="ms")


@pytest.mark.parametrize("baseline", ["auto", "subtracted"])
def test_negative_readings_without_their_sign_are_told_and_read_as_such(tmp_path, baseline):
    recording = ramp().alone()
    write_recording(tmp_path / "signed.csv", recording)
    header, base, *rows = (tmp_path / "signed.csv").read_text().splitlines()
    unsigned = [";".join(str(int(cell) % 65536) if 3 <= k < 59 else cell for k, cell in enumerate(row.split(";"))) for row in rows]
    (tmp_path / "u.csv").write_text("\n".join([header, base, *unsigned, ""]))
    again = read_recording(tmp_path / "u.csv", baseline=baseline)
    assert (again.counts.values == recording.counts.values).all()
    assert "negative ones without their sign" in again.attrs["repairs"][0] and "u.csv, row 3" in again.attrs["repairs"][0]


def test_a_kept_baseline_of_high_counts_is_not_taken_for_readings_without_a_sign(tmp_path):
    recording = ramp().alone()
    recording["baseline"] = recording.baseline + 36000
    write_recording(tmp_path / "kept.csv", recording, keep_baseline=True)
    again = read_recording(tmp_path / "kept.csv")
    assert (again.counts.values == recording.counts.values).all() and again.attrs["repairs"] == ()


def test_a_wrong_reading_beyond_16_bits_is_told_by_its_taxel_and_not_as_another_form_of_the_baseline(tmp_path):
    bench = ramp()
    write_recording(tmp_path / "r.csv", bench.alone())
    lines = (tmp_path / "r.csv").read_text().splitlines()
    cells = lines[103].split(";")
    lines[103] = ";".join([*cells[:8], "-30000", *cells[9:]])
    (tmp_path / "r.csv").write_text("\n".join([*lines, ""]))
    found, = check_recording(read_recording(tmp_path / "r.csv"))
    assert "row 104: finger 0, taxel 5 (row 1, column 1) reads -30000 counts" in found.sentence


def test_a_wrong_value_of_many_rows_is_left_out():
    bench = ramp()
    bench.counts[140:148, 0, 3, 1] = 30000
    found, = told(bench, "wrong reading")
    assert "row 140: finger 0, taxel 13 (row 3, column 1) reads 30000 counts" in found.sentence
    assert np.flatnonzero(found.left_out[:, 0, 3, 1]).tolist() == list(range(140, 148))


def test_a_frame_of_raw_zeros_is_left_out():
    bench = ramp()
    bench.counts[30, 0] = -9000
    found, = told(bench, "wrong reading")
    assert "row 30: the whole frame of finger 0" in found.sentence


def test_zeros_for_a_while_amid_a_press_are_frozen():
    bench = ramp()
    bench.counts[150:210] = 0
    found = told(bench, "frozen")
    assert "press.csv, rows 150 to 209: 60 readings" in found[0].sentence


def test_a_taxel_that_gives_noise_only_is_dead():
    bench = ramp()
    bench.counts[:, 0, 2, 2] = np.random.default_rng(2).integers(0, 2, len(bench.counts))
    found, = told(bench, "dead")
    assert "finger 0, taxel 10 (row 2, column 2) changes by 1 counts, its noise, in all 400 readings" in found.sentence


@pytest.mark.parametrize(("log", "sentence"), [
    (lambda n: np.where((np.arange(len(n)) > 150) & (np.arange(len(n)) < 260), n[150], n), "it reads "),
    (lambda n: np.minimum(n, 15.0), "it reads 15 N from 1.6"),
], ids=["frozen", "at its end"])
def test_readings_while_the_log_stands_still_are_left_out(log, sentence):
    bench = ramp()
    bench.log_n = log(bench.log_n)
    found, = told(bench, "standing log")
    assert sentence in found.sentence and "while the counts of finger 0 change by" in found.sentence and found.safe
    assert found.left_out[200, 0].all() and not found.left_out[100, 0].any()


def test_counts_that_fall_a_little_later_than_the_force_are_no_sign_of_a_standing_log():
    bench = ramp()
    force = np.interp(bench.time_s, [0.5, 1.0, 2.5, 2.53], [0, 20, 20, 0])
    bench.log_n = np.interp(bench.log_s, bench.time_s, force)
    bench.counts[:, 0] = np.round(30 * np.interp(bench.time_s - 0.04, bench.time_s, force))[:, None, None]
    assert "standing log" not in {one.check for one in check_recording(bench.recording())}


def test_creep_under_a_force_that_is_held_without_noise_is_no_standing_log():
    bench = ramp()
    held = np.interp(bench.time_s, [0.5, 1.0, 3.0, 3.5], [0, 20, 20, 0])
    bench.log_n = np.interp(bench.log_s, bench.time_s, held)
    creep = 1 + 0.15 * (1 - np.exp(-np.maximum(bench.time_s - 1.0, 0) / 0.8))
    bench.counts[:, 0] = np.round(30 * held * creep)[:, None, None]
    assert "standing log" not in {one.check for one in check_recording(bench.recording())}


def test_a_clock_that_never_moves_is_refused():
    with pytest.raises(InputError, match="rows 0 to 39: all have the time 5 ms"):
        running_forward("r.csv", np.full(40, 5.0), range(40), unit="ms")
