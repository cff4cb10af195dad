"""Recordings and logs of forces from files of any form: CSV of a recorder, ROS 2 bags."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from softtact.errors import InputError
from softtact.readout.bags import is_bag, read_bag, with_force_of_bag
from softtact.readout.recording import with_force
from softtact.readout.tsf85 import read_recording

if TYPE_CHECKING:
    import xarray


def recording_of(path: str | Path, *, baseline: str = "auto", topics: Sequence[str] = ()) -> "xarray.Dataset":
    """The recording with counts in a file or folder. Raises InputError where it has none; `topics` are of a bag."""
    if is_bag(path):
        return read_bag(path, baseline=baseline, topics=topics)
    recording = read_recording(path, baseline=baseline)
    if "counts" not in recording:
        raise InputError(f"{path}: it has nodes of a simulation but no counts; give the file of its readings.")
    return recording


def with_force_of(recording: "xarray.Dataset", path: str | Path, *, topics: Sequence[str] = ()) -> "xarray.Dataset":
    """The recording with `force_n` from a CSV or a bag."""
    return with_force_of_bag(recording, path, topics=topics) if is_bag(path) else with_force(recording, path)
