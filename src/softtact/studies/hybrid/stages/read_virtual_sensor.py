"""The virtual sensor's readings of a reference press.

inputs: press;  outputs: tactile;  settings: sensor, virtual_sensor, trials, seed
"""

from typing import Any

import xarray

from softtact.files import read_dataset, write_dataset
from softtact.readout.virtual_sensor import VirtualSensorSettings, read_branches
from softtact.sensors.specification import SensorSpec


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Read `trials` presses and write their counts while the force rises and while it falls."""
    press = read_dataset(inputs["press"])
    item = f"{press.attrs['set']}/{press.attrs['item']}"
    counts = read_branches(SensorSpec.from_dict(settings["sensor"]), press.deformation_map_mm.values,
                           force_n=press.normal_force_n.values,
                           trials=settings["trials"], seed=settings["seed"], item=item,
                           settings=VirtualSensorSettings.from_dict(settings["virtual_sensor"]))
    axes = ("trial", "force", "row", "column")
    data = xarray.Dataset({"tactile_map": (axes, counts.loading, {"units": "counts"}),
                           "unloading_tactile_map": (axes, counts.unloading, {"units": "counts"}),
                           "force_n": ("force", press.normal_force_n.values, {"units": "N"})},
                          attrs={"source": "virtual sensor", "set": press.attrs["set"], "item": press.attrs["item"]})
    write_dataset(outputs["tactile"], data, seed=settings["seed"], settings=settings)
