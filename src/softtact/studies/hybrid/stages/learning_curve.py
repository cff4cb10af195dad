"""SSIM against the number of training maps of one model.

inputs: train, validation, unseen, grasps, and best (of the search) and rate (of its trial) where a network needs them
outputs: curve (CSV);  settings: learning_curve, training, network, ssim, seed, threads
"""

from typing import Any

import pandas as pd

from softtact.evaluation.retraining import SIZES_COLUMNS, Experiment, learning_curve
from softtact.files import read_json, write_csv
from softtact.learning.dataset import read_samples
from softtact.learning.settings import LearningCurve, Network, Ssim, Training, chosen_network, chosen_training, found_for
from softtact.learning.training import prepare_torch

TESTS = ("validation", "unseen", "grasps")


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Train every network at every share; write a row per network, share and set."""
    curve = LearningCurve.from_dict(settings["learning_curve"], where="learning_curve")
    options = Training.from_dict(settings["training"], where="training")
    best, trial = (read_json(inputs[name]) if name in inputs else None for name in ("best", "rate"))
    train, tests = read_samples(inputs["train"]), {name: read_samples(inputs[name]) for name in TESTS}
    sizes = sorted({max(1, round(share * len(train))) for share in curve.shares})
    shared: dict[str, Any] = {"ssim": Ssim.from_dict(settings["ssim"], where="ssim").model_dump(),
                              "device": prepare_torch(threads=settings.get("threads", threads), device=options.device)}
    tables = []
    for kind in curve.networks:
        network = Network.from_dict(settings["network"] | {"architecture": kind}, where="network")
        found = found_for(network, search=best, trial=trial)
        experiment = Experiment(train, tests, network=chosen_network(network, best),
                                options=chosen_training(options, network, found), **shared)
        table = learning_curve(experiment, sizes=sizes, steps=curve.steps, seed=settings["seed"])
        tables.append(table.assign(model=train.model, architecture=kind))
    write_csv(outputs["curve"], pd.concat(tables)[["model", "architecture", *SIZES_COLUMNS]])
