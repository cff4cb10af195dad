"""The file of a calibrated sensor: a copy of the sensor's own with a block `calibration`, which `load_sensor` reads."""

from pathlib import Path
from typing import Any

import yaml

from softtact.calibration.fit import CalibrationResult
from softtact.calibration.ladder import with_cover
from softtact.files import atomic_path
from softtact.sensors.base import read_mapping
from softtact.sensors.edge import SidesBelow
from softtact.sensors.specification import spec_from_dict

_HEAD = "# Made by `softtact calibrate` from {source}. Counts: gain x counts_per_relative_change x dC/C0 + zero_counts.\n"


def write_calibrated(path: str | Path, sensor_file: str | Path, result: CalibrationResult) -> None:
    """Write the sensor in `sensor_file` with what a calibration found; the file is checked before it takes its place."""
    values = read_mapping(sensor_file)
    block = result.block()
    if "cover" in result.problem.names:
        spec: Any = result.problem.presses.sensor.spec     # of kind frusta, else there were no presses
        thicker = with_cover(spec, result.problem.value(result.vector, "cover", 1.0))
        values["cover"]["thickness_mm"] = _calibrated(thicker.cover.thickness_mm, block.source)
        if isinstance(thicker.edge.held, SidesBelow):
            values["edge"] = thicker.edge.model_dump(mode="json") | {
                "held": {"sides_below_mm": _calibrated(thicker.edge.held.sides_below_mm, block.source)}}
    if "friction" in result.problem.names:
        found = round(result.problem.value(result.vector, "friction", 0.0), 4)
        values["friction"] = values.get("friction", {}) | {"object": {"value": found, "reason": f"calibrated from {block.source}"}}
    values["calibration"] = block.model_dump(mode="json")
    spec_from_dict(values, where=str(path))
    text = yaml.safe_dump(values, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True)
    with atomic_path(path) as temporary:
        temporary.write_text(_HEAD.format(source=block.source) + text, encoding="utf-8")


def _calibrated(value_mm, source):
    return {"value": round(value_mm, 5), "reason": f"calibrated from {source}"}
