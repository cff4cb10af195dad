"""Which recordings of a real sensor stand for the readings of a study's items."""

from collections.abc import Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

from softtact.errors import InputError
from softtact.readout.recording import COLUMNS, ROWS
from softtact.sensors.specification import SensorSpec
from softtact.studies.configuration import refuse_unknown
from softtact.studies.hybrid.keys import Data, Recording

_AT = "the configuration, at 'data.recordings'"
_TOLD = 8     # items without a recording that a refusal lists


def recordings_of(data: Data, items_of: Mapping[str, Mapping[str, Any]], spec: SensorSpec) -> dict[str, list[Recording]] | None:
    """{SET/ITEM: recordings, its trials}, or None where the readings have another source.

    Raises InputError for a sensor of another grid, an item that the study does not have, a file that is not there or stands twice,
    and where an item has no recording.
    """
    if data.source != "recorded":
        return None
    if (spec.taxels.rows, spec.taxels.columns) != (ROWS, COLUMNS):
        raise InputError(f"{_AT}: the sensor {spec.name} has {spec.taxels.rows} x {spec.taxels.columns} taxels, and the TSF-85 "
                         f"{ROWS} x {COLUMNS}; name the sensor that was recorded, tsf85 say.")
    items = [f"{name}/{item}" for name, of_set in items_of.items() for item in of_set]
    for recording in data.recordings:
        refuse_unknown(recording.item, items, kind="item", where=_AT)
    _check_files(data.recordings)
    found = {item: list(own) for item, own in groupby(sorted(data.recordings, key=lambda one: one.item), key=lambda one: one.item)}
    missing = [item for item in items if item not in found]
    if missing:
        more = f" and {len(missing) - _TOLD} more" if len(missing) > _TOLD else ""
        raise InputError(f"{_AT}: there is no recording of {', '.join(missing[:_TOLD])}{more}; add one of each, or take the items "
                         "out of 'objects'.")
    return {item: found[item] for item in items}


def _check_files(recordings):
    """Refuse a file that is not there, and a finger of a recording that would stand for two presses."""
    seen: dict[tuple[Path, int], str] = {}
    for recording in recordings:
        for path in (recording.file, recording.force_log):
            if not Path(path).is_file():
                raise InputError(f"{_AT}: there is no file {path}, of {recording.item}; correct the path.")
        own = Path(recording.file).resolve(), recording.finger
        if own in seen:
            raise InputError(f"{_AT}: finger {recording.finger} of {recording.file} stands for {seen[own]} and again for "
                             f"{recording.item}; a recording is one press: leave it at one of them.")
        seen[own] = recording.item
