"""Compare the policies that choose a model, on presses with all models.

inputs: elastic, foundation, hyperelastic (lists of presses, in the same order), complexity
outputs: presses (a row per press), policies (a row per policy), calibration
settings: sensor, tolerances_mm
"""

from dataclasses import asdict
from typing import Any

from softtact.evaluation.policies import CALIBRATION_SET, MODELS, expected_over_true, policy_table, press_table
from softtact.files import read_csv, read_dataset, write_csv, write_json
from softtact.sensors.specification import SensorSpec


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Calibrate on the indenters, and compare on all other sets."""
    paths = zip(*(inputs[model] for model in MODELS), strict=True)
    presses = [dict(zip(MODELS, map(read_dataset, three), strict=True)) for three in paths]
    paper = read_csv(inputs["complexity"]).set_index("object").model.to_dict()
    height = SensorSpec.from_dict(settings["sensor"]).dielectric.frusta.height_mm
    table, calibrated = press_table(presses, paper, height_mm=height)
    others = [name for name in table.set.unique() if name != CALIBRATION_SET] or [CALIBRATION_SET]
    policies = policy_table(table, settings["tolerances_mm"], sets=others)
    write_csv(outputs["presses"], table)
    write_csv(outputs["policies"], policies)
    unseen = table[table.set.isin(others)]
    write_json(outputs["calibration"], {"foundation": asdict(calibrated), "tested_on": others,
                                        "expected_over_true": {model: expected_over_true(unseen, model) for model in MODELS[:2]}})
