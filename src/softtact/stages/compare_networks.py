"""The study's networks and those trained beside them, on the same split.

inputs: networks, timings (of each network, in its order), validation, unseen, grasps (one per model each)
outputs: networks (CSV);  settings: ssim, seed
"""

from typing import Any

import pandas as pd

from softtact.evaluation.networks import compare_networks
from softtact.evaluation.scoring import score_sensor
from softtact.files import write_csv
from softtact.learning.network import load_network
from softtact.learning.samples import read_samples
from softtact.learning.settings import Ssim
from softtact.learning.training import prepare_torch

TESTS = ("validation", "unseen", "grasps")


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Score and time every network; write the table."""
    prepare_torch(threads=threads)
    ssim = Ssim.from_dict(settings.get("ssim", {}), where="ssim").model_dump()
    splits = {name: {samples.model: samples for samples in map(read_samples, inputs[name])} for name in TESTS}
    ceiling = pd.concat([score_sensor(next(iter(splits[name].values())), ssim=ssim) for name in TESTS])
    networks = [(*load_network(path), pd.read_csv(timing))
                for path, timing in zip(inputs["networks"], inputs["timings"], strict=True)]
    write_csv(outputs["networks"], compare_networks(networks, splits, ceiling, ssim=ssim, seed=settings["seed"]))
