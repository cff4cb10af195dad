"""Recordings of a whole study, one a trial of each item, whose counts are linear in the force: for tests of plans and data sets."""

from pathlib import Path

import numpy as np

from softtact.readout.recording import make_recording
from softtact.readout.tsf85 import write_recording

_SLOPE = 10.0 + np.arange(56).reshape(2, 7, 4)     # counts per N


def write_recordings(folder, items, *, largest_n=50.0, trials=1):
    """Files below the folder, and the entries of `data.recordings` that name them, for items SET/ITEM."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    force = np.r_[np.linspace(0, largest_n, 101), np.linspace(largest_n, 0, 101)[1:]]
    counts = np.round(force[:, None, None, None] * _SLOPE).astype(int)
    entries = []
    for item in items:
        for trial in range(trials):
            path = Path(folder, f"{item.replace('/', '_')}_{trial}.csv")
            log = path.with_name(f"{path.stem}_force.csv")
            press = make_recording(np.arange(len(force)) / 50, counts, source="a test's", baseline=np.full((2, 7, 4), 9000))
            write_recording(path, press)
            rows = zip(press.time.values, force, strict=True)
            log.write_text("time_s,force_n\n" + "".join(f"{time:.3f},{value:.3f}\n" for time, value in rows))
            entries.append({"item": item, "file": str(path), "force_log": str(log)})
    return entries
