"""The readings of an item from recordings of a real sensor, one trial each, in place of the virtual sensor's.

inputs: recordings, force_logs (lists of CSV);  outputs: tactile
settings: sensor, set, item, forces_n, fingers and baselines (lists, one for each recording)
"""

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray

from softtact.errors import InputError
from softtact.files import write_dataset
from softtact.progress import announce
from softtact.readout.checks.finding import left_out, refuse_unsafe, zeroed
from softtact.readout.checks.recording import check_recording
from softtact.readout.recorded_press import SOURCE, RecordedPress, readings_at
from softtact.readout.recording import with_force
from softtact.readout.tsf85 import RECORDER, read_recording
from softtact.sensors.specification import SensorSpec

if TYPE_CHECKING:
    from pathlib import Path

_AXES = ("trial", "force", "row", "column")


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the counts at the study's forces while the force rises and, if all recordings have it, while it falls."""
    spec, forces = SensorSpec.from_dict(settings["sensor"]), settings["forces_n"]
    recordings = inputs["recordings"]
    presses = [_read(path, log, forces, finger=finger, baseline=baseline, largest_counts=spec.largest_counts)
               for path, log, finger, baseline in zip(recordings, inputs["force_logs"], settings["fingers"], settings["baselines"],
                                                      strict=True)]
    counts = {"tactile_map": [press.loading for press in presses], "unloading_tactile_map": [press.unloading for press in presses]}
    held = [str(path) for path, press in zip(recordings, presses, strict=True) if press.unloading is None]
    if held:
        announce(f"{settings['set']}/{settings['item']}: no readings at falling forces, because {', '.join(held)} "
                 f"{'ends' if len(held) == 1 else 'end'} above {forces[0]:g} N.")
        del counts["unloading_tactile_map"]
    data = xarray.Dataset({name: (_AXES, np.array(trials), {"units": "counts"}) for name, trials in counts.items()}
                          | {"force_n": ("force", np.array(forces, dtype=float), {"units": "N"})},
                          attrs={"source": SOURCE, "set": settings["set"], "item": settings["item"],
                                 "files": "; ".join(map(str, recordings))})
    write_dataset(outputs["tactile"], data, seed=None, settings=settings)


def _read(path: "Path", log: "Path", forces: list[float], *, finger: int, baseline: str, largest_counts: float) -> RecordedPress:
    """One recording at the forces. Raises InputError for a simulated recording, and for faults that are not safe.

    Frames with readings that are left out are not used; taxels that are dead are, and clipped ones are refused where they matter.
    """
    recording = read_recording(path, baseline=baseline)
    if recording.attrs["source"] != RECORDER:
        raise InputError(f"{path}: its source is the {recording.attrs['source']}, not a real sensor; give a file of the TSF-85's "
                         "recorder.")
    recording = with_force(recording, log)
    found = [one for one in check_recording(recording, largest=largest_counts) if finger in one.fingers]
    refuse_unsafe(found)
    for one in found:
        announce(one.sentence)
    faulty = left_out(recording, [one for one in found if one.check not in ("dead", "clipped")])[:, finger].any(axis=(1, 2))
    return readings_at(zeroed(recording, found).isel(time=~faulty), forces, finger=finger, largest_counts=largest_counts)
