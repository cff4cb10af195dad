"""How much scores depend on the gain of the virtual sensor's readings.

inputs: references (list of presses), presses (list: the same with every tested model)
outputs: gains (CSV);  settings: sensor, virtual_sensor, ssim, seed
"""

from typing import Any

from softtact.evaluation.limits import gain_table
from softtact.files import read_dataset, write_csv
from softtact.learning.settings import Ssim
from softtact.readout.virtual_sensor import VirtualSensorSettings
from softtact.sensors.specification import SensorSpec


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Read the presses again with each gain, and write a row for each."""
    tested: dict[str, list[Any]] = {}
    for press in map(read_dataset, inputs["presses"]):
        tested.setdefault(press.attrs["model"], []).append(press)
    table = gain_table([read_dataset(path) for path in inputs["references"]], tested,
                       spec=SensorSpec.from_dict(settings["sensor"]), seed=settings["seed"],
                       settings=VirtualSensorSettings.from_dict(settings["virtual_sensor"]),
                       ssim=Ssim.from_dict(settings.get("ssim", {}), where="ssim").model_dump())
    write_csv(outputs["gains"], table)
