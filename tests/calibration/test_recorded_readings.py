"""Readings at forces from simulated recordings of a specimen that creeps, held at each force."""

import numpy as np
from support.calibration import BALL, LEVELS_N

from softtact.readout.recorded_press import readings_at


def test_a_creeping_sensor_reads_the_means_of_its_holds_and_more_on_the_way_down(bench):
    recording = bench.recording(BALL, (0.0, 0.0, 0.0))
    press = readings_at(recording, LEVELS_N)
    force, counts = recording.force_n.values[:, 0], recording.counts.values[:, 0]
    up = np.arange(len(force)) <= np.flatnonzero(force == LEVELS_N[-1])[-1]
    held = [[counts[(force == level) & way].mean(axis=0) for level in LEVELS_N[:-1]] for way in (up, ~up)]
    assert np.allclose(press.loading[:-1], held[0], rtol=0, atol=1e-9)
    assert np.allclose(press.unloading[:-1], held[1], rtol=0, atol=1e-9)
    more = (press.unloading - press.loading)[:-1].mean(axis=(1, 2))
    assert (more > 3 * bench.hidden.noise_counts / np.sqrt(60 * 28)).all()      # of means over 60 readings and 28 taxels
