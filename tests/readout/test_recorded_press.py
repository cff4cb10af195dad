"""Readings at a study's forces, from recordings of presses whose counts are known in closed form."""

import numpy as np
import pytest
from support.sensors import CORO

from softtact.errors import InputError
from softtact.files import read_dataset
from softtact.learning.dataset import read_tactile
from softtact.readout.recorded_press import readings_at
from softtact.readout.recording import make_recording
from softtact.readout.tsf85 import write_recording
from softtact.studies.hybrid.stages import read_recordings

SLOPE = 10.0 + np.arange(28).reshape(7, 4)      # counts per N of each taxel
FORCES = [5.0, 12.5, 50.0]
BASE = np.full((2, 7, 4), 9000)
LOOP = 80.0                                     # counts by which the way down lies higher


def ramp(top_n=50.0, *, end_n=0.0, step_n=0.7):
    """Forces (n,) in N up to the top and down to the end, in steps that meet none of the study's forces below the top."""
    return np.r_[np.arange(0.0, top_n, step_n), np.arange(top_n, end_n, -step_n), end_n]


def recording(force_n, *, counts=None, finger=0):
    """A recording of one finger whose counts are linear in the force, and higher during unloading."""
    force = np.asarray(force_n)
    down = np.arange(len(force)) > np.argmax(force)
    read = force[:, None, None] * SLOPE + LOOP * down[:, None, None] if counts is None else counts
    both = np.zeros((len(force), 2, 7, 4))
    both[:, finger] = read
    return make_recording(np.arange(len(force)) / 60, both, source="a test's", baseline=BASE, file="press.csv",
                          force_n=np.stack([force, force], axis=1), row_of_file=np.arange(len(force)) + 3)


def refusal(*arguments, **options):
    with pytest.raises(InputError) as caught:
        readings_at(*arguments, **options)
    sentence = str(caught.value)
    assert sentence.startswith("press.csv") and sentence.endswith(".") and "\n" not in sentence
    return sentence


def test_counts_that_are_linear_in_the_force_are_read_exactly_on_both_ways():
    for finger in (0, 1):
        press = readings_at(recording(ramp(), finger=finger), FORCES, finger=finger)
        exact = np.multiply.outer(FORCES, SLOPE)
        assert press.loading == pytest.approx(exact, rel=1e-12)
        assert press.unloading[:2] == pytest.approx(exact[:2] + LOOP, rel=1e-12)
        assert press.unloading[2] == pytest.approx(exact[2], rel=1e-12)      # where both ways meet


def test_readings_of_a_hold_are_averaged_up_to_its_end_also_at_the_largest_force():
    held = np.r_[np.linspace(0, 5, 8), np.full(9, 5.0), np.linspace(6, 49, 30), np.full(9, 50.0)]
    wave = np.where(np.arange(len(held)) % 2, 30.0, -30.0)
    read = (held + np.r_[np.zeros(7), 0.1 * np.arange(10), np.zeros(30), 0.1 * np.arange(9)])[:, None, None] * SLOPE
    press = readings_at(recording(held, counts=read), [5.0, 50.0])
    assert press.loading == pytest.approx(np.multiply.outer([5.45, 50.4], SLOPE))      # means of 5 + 0 to 0.9, and 50 + 0 to 0.8
    assert press.unloading is None
    waved = readings_at(recording(held, counts=read + wave[:, None, None]), [5.0, 50.0])
    assert np.abs(waved.loading - press.loading).max() <= 30 / 9 + 1e-9      # of an odd number of readings one is left over


def test_noise_of_the_load_cell_moves_readings_by_no_more_than_its_own_size():
    true, noise = np.linspace(0, 50, 2000), 0.1
    noisy = true + np.random.default_rng(0).uniform(-noise, noise, len(true))
    press = readings_at(recording(noisy, counts=true[:, None, None] * SLOPE), FORCES)
    assert np.abs(press.loading / SLOPE - np.reshape(FORCES, (3, 1, 1))).max() < noise


def test_what_is_no_single_press_from_touch_to_the_largest_force_is_refused():
    assert ("its force goes from 0 to 42 N and does not reach 50 N; record the press from touch to 50 N" in
            refusal(recording(ramp(42.0)), FORCES))
    assert "its force goes from 7 to 50 N and does not reach 5 N" in refusal(recording(ramp()[10:40].tolist() + [50.0]), FORCES)
    twice = np.r_[ramp(20.0), ramp()]
    assert "press.csv, row 34: the force falls back during loading (20 and 18.6 N)" in refusal(recording(twice), FORCES)
    assert "the force rises again during unloading" in refusal(recording(np.r_[ramp(), ramp(20.0)]), FORCES)
    assert "it has no finger 2; give one of 0 to 1" in refusal(recording(ramp()), FORCES, finger=2)


def test_a_taxel_that_is_clipped_in_use_is_refused_and_one_clipped_beyond_is_not():
    force = ramp(60.0)
    read = force[:, None, None] * SLOPE
    full = np.minimum(read, 1900.0)      # reached at 1900 / 37 = 51.4 N by the steepest taxel
    assert readings_at(recording(force, counts=full), FORCES, largest_counts=1900.0).loading.max() == 50 * SLOPE.max()
    said = refusal(recording(force, counts=np.minimum(read, 1800.0)), FORCES, largest_counts=1800.0)
    assert "row 73: finger 0, taxel 27 (row 6, column 3) reads the end of its range" in said     # the 71st reading, at 49 N
    up = np.append(np.arange(0.0, 50.0, 0.7), 50.0)      # the last reading alone is at the end, 37 counts per N times 50 N
    said = refusal(recording(up, counts=up[:, None, None] * SLOPE), FORCES, largest_counts=1850.0)
    assert f"row {len(up) + 2}: finger 0, taxel 27" in said


@pytest.fixture
def files(tmp_path):
    """Write a recording and its log of forces; the paths of both."""

    def write(name, force, *, dead=()):
        path, log = tmp_path / f"{name}.csv", tmp_path / f"{name}_force.csv"
        read = recording(force)
        for row, column in dead:
            read.counts[:, 0, row, column] = 7
        write_recording(path, read.assign(counts=read.counts.round().astype(int)))
        times = read.time.values.round(3)
        log.write_text("time_s,force_n\n" + "".join(f"{time},{value}\n" for time, value in zip(times, force, strict=True)))
        return path, log

    return write


def run(pairs, out):
    settings = {"sensor": CORO.model_dump(mode="json"), "set": "grasps", "item": "key", "forces_n": FORCES,
                "fingers": [0] * len(pairs), "baselines": ["subtracted"] * len(pairs)}
    recordings, logs = zip(*pairs, strict=True)
    read_recordings.run(inputs={"recordings": list(recordings), "force_logs": list(logs)}, outputs={"tactile": out},
                        settings=settings)
    return read_dataset(out)


def test_each_recording_of_an_item_is_a_trial_of_its_readings(files, tmp_path, capsys):
    pairs = [files("first", ramp()), files("second", ramp(51.0))]
    data = run(pairs, tmp_path / "key.nc")
    assert dict(data.sizes) == {"trial": 2, "force": 3, "row": 7, "column": 4}
    assert np.abs(data.tactile_map.values - np.multiply.outer(FORCES, SLOPE)).max() <= 0.5      # whole counts
    assert np.abs(data.unloading_tactile_map.values[:, :2] - np.multiply.outer(FORCES[:2], SLOPE) - LOOP).max() <= 0.5
    assert data.attrs["source"] == "recording of a TSF-85" and "first.csv; " in data.attrs["files"]
    assert list(read_tactile([tmp_path / "key.nc"])) == [("grasps", "key")]
    assert capsys.readouterr().err == ""


def test_readings_on_the_way_down_are_left_out_whole_and_told_where_a_recording_ends_before(files, tmp_path, capsys):
    data = run([files("whole", ramp()), files("held", ramp(end_n=30.0))], tmp_path / "key.nc")
    assert "unloading_tactile_map" not in data and data.sizes["trial"] == 2
    assert f"grasps/key: no readings at falling forces, because {tmp_path / 'held.csv'} ends above 5 N." in capsys.readouterr().err


def test_taxels_that_may_be_dead_are_reported_and_used_as_recorded(files, tmp_path, capsys):
    data = run([files("worn", ramp(), dead=[(3, 1), (6, 3)])], tmp_path / "key.nc")
    told = capsys.readouterr().err
    assert all(f"finger 0, taxel {taxel} " in told for taxel in (13, 27)) and told.count("it may be dead") == 2
    assert (data.tactile_map.values[..., 3, 1] == 7).all()


def test_what_a_network_gave_is_refused_as_a_recording(files, tmp_path):
    _, log = files("x", ramp())
    path = tmp_path / "extension.csv"
    path.write_text("time_sec,frame," + ",".join(f"pred_{k}" for k in range(28)) + "\n0,0" + ",1" * 28 + "\n")
    with pytest.raises(InputError, match="a network's reading, not a real sensor; give a file of the TSF-85's recorder"):
        run([(path, log)], tmp_path / "key.nc")
    assert not (tmp_path / "key.nc").exists()
