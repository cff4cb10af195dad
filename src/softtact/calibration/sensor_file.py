"""The file of a calibrated sensor: a copy of the sensor's own with a block `calibration`, which `load_sensor` reads."""

from pathlib import Path

import yaml

from softtact.calibration.fit import CalibrationResult
from softtact.files import atomic_path
from softtact.sensors.base import read_mapping
from softtact.sensors.specification import spec_from_dict

_HEAD = "# Made by `softtact calibrate` from {source}. Counts: gain x counts_per_relative_change x dC/C0 + zero_counts.\n"


def write_calibrated(path: str | Path, sensor_file: str | Path, result: CalibrationResult) -> None:
    """Write the sensor in `sensor_file` with what a calibration found; the file is checked before it takes its place."""
    values = read_mapping(sensor_file)
    block = result.block()
    cover = result.problem.presses.sensor.spec.cover
    if "cover" in result.problem.names and cover is not None:
        found = result.problem.value(result.vector, "cover", 1.0) * cover.thickness_mm
        values["cover"]["thickness_mm"] = {"value": round(found, 5), "reason": f"calibrated from {block.source}"}
    values["calibration"] = block.model_dump(mode="json")
    spec_from_dict(values, where=str(path))
    text = yaml.safe_dump(values, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True)
    with atomic_path(path) as temporary:
        temporary.write_text(_HEAD.format(source=block.source) + text, encoding="utf-8")
