"""Scores and times of all networks.

inputs: networks (one per model), validation, unseen, grasps (one per model each),
    presses (of the models, for times; none for an archive)
outputs: ssim, per_item, summary, ceiling, timing (CSV), predictions (NetCDF);  settings: ssim, seed
"""

from typing import Any

import pandas as pd

from softtact.evaluation.scoring import predict_grasps, score_items, score_samples, score_sensor, summarise_scores, time_presses
from softtact.files import read_dataset, write_csv, write_dataset
from softtact.learning.dataset import TESTS, read_samples
from softtact.learning.network import load_network, predict
from softtact.learning.settings import Ssim
from softtact.learning.training import prepare_torch


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Score every network on its three splits, measure the sensor's repeatability, and time every map."""
    prepare_torch(threads=threads)
    ssim = Ssim.from_dict(settings.get("ssim", {}), where="ssim").model_dump()
    networks = {facts["model"]: network for network, facts in map(load_network, inputs["networks"])}
    splits = {name: {samples.model: samples for samples in map(read_samples, inputs[name])} for name in TESTS}
    scores = pd.concat([score_samples(network, splits[name][model], ssim=ssim)
                        for model, network in networks.items() for name in TESTS])
    ceiling = pd.concat([score_sensor(next(iter(splits[name].values())), ssim=ssim) for name in TESTS])
    write_csv(outputs["ssim"], scores)
    write_csv(outputs["ceiling"], ceiling)
    write_csv(outputs["per_item"], score_items(scores, seed=settings.get("seed", 0)))
    write_csv(outputs["summary"], summarise_scores(scores, ceiling, seed=settings.get("seed", 0)))
    write_dataset(outputs["predictions"], predict_grasps(networks, splits["grasps"]), seed=settings.get("seed"),
                  settings=settings)
    presses = (read_dataset(path) for path in inputs.get("presses", ()))
    write_csv(outputs["timing"], time_presses(presses, networks, predict=predict))
