"""The training of one model's networks from several seeds, on the same presses and split.

inputs: train, validation, unseen, grasps, and best (of the search) and rate (of its trial) where a network needs them
outputs: seeds (CSV, a row for each network, seed and set)
settings: repeats {seeds, networks}, training, network, ssim, seed, threads
"""

from typing import Any

import pandas as pd

from softtact.evaluation.retraining import SEEDS_COLUMNS, Experiment, train_seeds
from softtact.files import read_json, write_csv
from softtact.learning.dataset import read_samples
from softtact.learning.settings import Network, Repeats, Ssim, Training, chosen_network, chosen_training, found_for
from softtact.learning.training import prepare_torch

TESTS = ("validation", "unseen", "grasps")


def run(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Train every network from the study's seed and those after it; write a row per network, seed and set."""
    repeats = Repeats.from_dict(settings["repeats"], where="repeats")
    options = Training.from_dict(settings["training"], where="training")
    best, trial = (read_json(inputs[name]) if name in inputs else None for name in ("best", "rate"))
    train, tests = read_samples(inputs["train"]), {name: read_samples(inputs[name]) for name in TESTS}
    shared: dict[str, Any] = {"ssim": Ssim.from_dict(settings["ssim"], where="ssim").model_dump(),
                              "device": prepare_torch(threads=settings.get("threads", threads), device=options.device)}
    tables = []
    for kind in repeats.networks:
        network = Network.from_dict(settings["network"] | {"architecture": kind}, where="network")
        found = found_for(network, search=best, trial=trial)
        experiment = Experiment(train, tests, network=chosen_network(network, best),
                                options=chosen_training(options, network, found), **shared)
        table = train_seeds(experiment, seeds=range(settings["seed"], settings["seed"] + repeats.seeds))
        tables.append(table.assign(model=train.model, architecture=kind))
    write_csv(outputs["seeds"], pd.concat(tables)[["model", "architecture", *SEEDS_COLUMNS]])
