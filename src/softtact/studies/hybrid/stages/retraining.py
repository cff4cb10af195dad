"""Series of trainings of one model's networks: on increasing numbers of maps, and from several seeds with their spread."""

from collections.abc import Callable, Sequence
from typing import Any

import pandas as pd

from softtact.evaluation import retraining
from softtact.evaluation.retraining import SEEDS_COLUMNS, SIZES_COLUMNS, Experiment
from softtact.files import read_csv, read_json, write_csv
from softtact.learning.dataset import TESTS, read_samples
from softtact.learning.settings import (
    LearningCurve,
    Network,
    Repeats,
    Ssim,
    Training,
    chosen_network,
    chosen_training,
    found_for,
)
from softtact.learning.training import prepare_torch


def learning_curve(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """SSIM against the number of training maps: train every network at every share; a row per network, share and set.

    inputs: train, validation, unseen, grasps, and best (of the search) and rate (of its trial) if a network needs them
    outputs: curve (CSV);  settings: learning_curve, training, network, ssim, seed, threads
    """
    curve = LearningCurve.from_dict(settings["learning_curve"], where="learning_curve")

    def train(experiment):
        sizes = sorted({max(1, round(share * len(experiment.train))) for share in curve.shares})
        return retraining.learning_curve(experiment, sizes=sizes, steps=curve.steps, seed=settings["seed"])

    write_csv(outputs["curve"], _of_networks(train, curve.networks, inputs, settings, threads)[
        ["model", "architecture", *SIZES_COLUMNS]])


def repeat_learning(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Train every network from the study's seed and those after it, on the same presses and split.

    inputs: as of `learning_curve`;  outputs: seeds (CSV, a row for each network, seed and set)
    settings: repeats {seeds, networks}, training, network, ssim, seed, threads
    """
    repeats = Repeats.from_dict(settings["repeats"], where="repeats")

    def train(experiment):
        return retraining.train_seeds(experiment, seeds=range(settings["seed"], settings["seed"] + repeats.seeds))

    write_csv(outputs["seeds"], _of_networks(train, repeats.networks, inputs, settings, threads)[
        ["model", "architecture", *SEEDS_COLUMNS]])


def gather_seeds(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """The spread of scores over the seeds of learning: a row per model, network and set.

    inputs: seeds (list of seeds.csv, one of each model);  outputs: table (CSV)
    """
    write_csv(outputs["table"], retraining.spread_of_seeds(pd.concat(map(read_csv, inputs["seeds"]))))


def _of_networks(train: Callable[[Experiment], pd.DataFrame], networks: Sequence[str], inputs: dict[str, Any],
                 settings: dict[str, Any], threads: int) -> pd.DataFrame:
    """The tables of one series of trainings of each network, concatenated."""
    options = Training.from_dict(settings["training"], where="training")
    best, trial = (read_json(inputs[name]) if name in inputs else None for name in ("best", "rate"))
    samples, tests = read_samples(inputs["train"]), {name: read_samples(inputs[name]) for name in TESTS}
    shared: dict[str, Any] = {"ssim": Ssim.from_dict(settings["ssim"], where="ssim").model_dump(),
                              "device": prepare_torch(threads=settings.get("threads", threads), device=options.device)}
    tables = []
    for kind in networks:
        network = Network.from_dict(settings["network"] | {"architecture": kind}, where="network")
        found = found_for(network, search=best, trial=trial)
        experiment = Experiment(samples, tests, network=chosen_network(network, best),
                                options=chosen_training(options, network, found), **shared)
        tables.append(train(experiment).assign(model=samples.model, architecture=kind))
    return pd.concat(tables)
