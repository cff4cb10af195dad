"""Readings of both sensors at the event `grip` of one grasp: two specimens of the virtual sensor.

inputs: events (NetCDF), sensor (YAML);  outputs: readings (NetCDF);  settings: item, force_n, trials, seed, virtual_sensor
"""

from typing import Any

import numpy as np
import xarray

from softtact.files import read_dataset, write_dataset
from softtact.readout.virtual_sensor import VirtualSensorSettings, read_virtual_sensor
from softtact.sensors.specification import read_spec

GRIP = 1     # number of the event `grip` in `softtact.robot.events.EVENTS`


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Read; of a grasp that failed there is nothing to read."""
    events = read_dataset(inputs["events"])
    data = xarray.Dataset(attrs={"failed": events.attrs["failed"]}) if "failed" in events.attrs else _readings(
        read_spec(inputs["sensor"]), events, settings)
    write_dataset(outputs["readings"], data, seed=settings["seed"], settings=settings)


def _readings(spec, events, settings):
    choices = VirtualSensorSettings.from_dict(settings["virtual_sensor"])
    names = [str(name) for name in events.finger.values]
    counts = [read_virtual_sensor(spec, events.deformation_map_mm.values[GRIP, finger][None], force_n=[settings["force_n"]],
                                  trials=settings["trials"], seed=2 * settings["seed"] + finger, item=f"{settings['item']}/{name}",
                                  settings=choices)
              for finger, name in enumerate(names)]
    return xarray.Dataset({"tactile_map": (("finger", "trial", "row", "column"), np.stack(counts)[:, :, 0], {"units": "counts"})},
                          coords={"finger": np.array(names, dtype=object)}, attrs={"source": "virtual sensor"})
