"""Score the predictors without a network, the baselines of every score.

inputs: train, validation, unseen, grasps (one per model each)
outputs: baselines (CSV, a row for each sample and predictor), taxels (CSV, largest counts of each taxel over the indenters)
settings: sensor, counts_per_relative_change (of the readings; null if unknown), ssim
"""

from typing import Any

import pandas as pd

from softtact.evaluation.score_tables import score_baselines, taxel_table
from softtact.files import write_csv
from softtact.learning.dataset import TESTS, read_samples
from softtact.learning.settings import Ssim
from softtact.sensors.specification import SensorSpec


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Fit the predictors to each model's training samples and score them on its tests."""
    ssim = Ssim.from_dict(settings.get("ssim", {}), where="ssim").model_dump()
    spec = SensorSpec.from_dict(settings["sensor"])
    frames = []
    for k, path in enumerate(inputs["train"]):
        tests = {name: read_samples(inputs[name][k]) for name in TESTS}
        frames.append(score_baselines(read_samples(path), tests, spec=spec, ssim=ssim,
                                      counts_per_relative_change=settings["counts_per_relative_change"]))
    write_csv(outputs["baselines"], pd.concat(frames))
    write_csv(outputs["taxels"], taxel_table([read_samples(inputs[name][0]) for name in ("train", "validation")]))
