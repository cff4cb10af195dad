"""A recording of a real sensor beside the press that is simulated."""

import numpy as np
import pytest

from softtact.cli import main
from softtact.errors import InputError
from softtact.play.pictures import board
from softtact.play.recorded import Recorded
from softtact.readout.recording import make_recording
from softtact.readout.tsf85 import write_recording

FORCES = np.array([0.0, 5.0, 10.0, 20.0])


@pytest.fixture
def files(tmp_path):
    """A recording of four readings, finger 1 with ten times the counts of finger 0, and its log of forces."""
    counts = np.zeros((4, 2, 7, 4))
    counts[:, 0, 5, 2] = 10 * FORCES
    counts[:, 1] = 10 * counts[:, 0]
    recording = make_recording(0.1 * np.arange(4), counts, source="hand", baseline=np.full((2, 7, 4), 500))
    write_recording(tmp_path / "real.csv", recording)
    rows = [f"{0.1 * k:.2f},{force}" for k, force in enumerate(FORCES)]
    (tmp_path / "log.csv").write_text("\n".join(["time_s,force_n", *rows]) + "\n")
    return tmp_path


def test_the_newest_reading_at_a_time_is_shown_with_its_force(files):
    recorded = Recorded.read(files / "real.csv", log=files / "log.csv", finger=1)
    for time_s, place in ((-1.0, 0), (0.05, 0), (0.1, 1), (0.29, 2), (9.0, 3)):
        reading = recorded.at(time_s)
        assert reading.counts[5, 2] == 100 * FORCES[place] and reading.force_n == pytest.approx(FORCES[place])
    assert Recorded.read(files / "real.csv").at(0.1).force_n is None
    simulated = np.zeros((7, 4))
    simulated[5, 2] = 500.0 - 28
    assert recorded.in_words(0.1, simulated, 5.001) == (
        "real.csv at 0.10 s, 5 N: 500 counts in all; simulated 472, and 1 apart in the mean over taxels.")


def test_a_reading_is_compared_with_a_press_by_its_force_alone(files):
    recorded, simulated = Recorded.read(files / "real.csv", log=files / "log.csv"), np.zeros((7, 4))
    for time_s, pressed_n, compared in ((0.0, 5.0, False), (0.1, 5.0, True), (0.2, 5.0, False), (0.2, 10.005, True)):
        words = recorded.in_words(time_s, simulated, pressed_n)
        assert ("apart in the mean" in words) == compared and ("; not pressed with this force." in words) != compared
    assert "apart in the mean" in Recorded.read(files / "real.csv").in_words(0.0, simulated, 5.0)     # its force is not known


def test_recorded_taxels_stand_beside_the_simulated_ones_in_the_same_colours(state, solver):
    result = solver.solve(state, draft=True).result
    taxels = result.readings["taxels"].values[-1]
    alone, beside = board(result), board(result, None, np.asarray(taxels))
    wide = beside.shape[1] - alone.shape[1]      # of a panel of taxels
    tiles = [beside[40:370, -2 * wide:-wide], beside[40:370, -wide:]]
    np.testing.assert_array_equal(*tiles)
    dimmer = board(result, None, 4.0 * np.asarray(taxels))[40:370, -2 * wide:-wide]
    assert tiles[0].max() == 255 and dimmer.mean() < 0.8 * tiles[0].mean()


def test_an_unknown_finger_or_a_log_without_a_recording_is_refused(files, capsys):
    with pytest.raises(InputError, match="finger 2 is unknown; give a number from 0 to 1"):
        Recorded.read(files / "real.csv", finger=2)
    pytest.importorskip("viser")
    for option in ("--force-log", "--finger"):
        assert main(["play", "--no-open", "--out", str(files / "out"), option, "1"]) == 1
        assert f"{option} 1: it belongs to a recording; add --recording FILE" in capsys.readouterr().err
