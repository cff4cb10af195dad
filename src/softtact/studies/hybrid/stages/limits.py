"""What limits the scores: model, data or network; and the gain of the readings."""

from typing import Any

import pandas as pd

from softtact.evaluation.limits import gain_table, limits
from softtact.files import read_csv, read_dataset, write_csv
from softtact.learning.settings import Ssim
from softtact.readout.virtual_sensor import VirtualSensorSettings
from softtact.sensors.specification import SensorSpec


def find_limits(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Find whether model, data or network limits each score: a row per model and set.

    inputs: curves (list of learning_curve.csv), networks (CSV);  outputs: limits
    settings: architecture, tested, reference (names of models), source (of the readings)
    """
    write_csv(outputs["limits"], limits(pd.concat(map(read_csv, inputs["curves"])), read_csv(inputs["networks"]), **settings))


def compare_gains(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """The effect of the virtual sensor's gain on scores: read the presses with each gain, a row for each.

    inputs: references (list of presses), presses (list: the same with every tested model)
    outputs: gains (CSV);  settings: sensor, virtual_sensor, ssim, seed
    """
    tested: dict[str, list[Any]] = {}
    for press in map(read_dataset, inputs["presses"]):
        tested.setdefault(press.attrs["model"], []).append(press)
    table = gain_table([read_dataset(path) for path in inputs["references"]], tested,
                       spec=SensorSpec.from_dict(settings["sensor"]), seed=settings["seed"],
                       settings=VirtualSensorSettings.from_dict(settings["virtual_sensor"]),
                       ssim=Ssim.from_dict(settings.get("ssim", {}), where="ssim").model_dump())
    write_csv(outputs["gains"], table)
