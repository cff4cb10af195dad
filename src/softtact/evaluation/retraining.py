"""Series of trainings that differ only in the number of maps (growing, nested subsets) or in the seed.

Another seed changes the initial weights and the order of the maps; presses and split stay the same.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import pandas as pd

from softtact.evaluation.scoring import interval_over_objects, score_samples
from softtact.learning.training import start_run, train_network

if TYPE_CHECKING:
    import torch

    from softtact.learning.dataset import Samples
    from softtact.learning.settings import Training

SIZES_COLUMNS = ["maps", "epochs", "set", "ssim", "ssim_low", "ssim_high", "mae_counts", "overlap"]
SEEDS_COLUMNS = ["seed", "set", "ssim", "mae_counts", "overlap"]
SPREAD = ["model", "architecture", "set", "seeds", "ssim", "ssim_sd", "ssim_least", "ssim_most", "mae_counts", "mae_sd"]
_SCORES = ["ssim", "mae_counts", "overlap"]


@dataclass(frozen=True)
class Experiment:
    """The common part of all trainings of a series."""

    train: "Samples"
    """Maps and readings that the network is fitted to."""
    tests: "dict[str, Samples]"
    """Samples to score, by the name of their set; those of `validation` choose the best epoch."""
    network: dict[str, Any]
    """The argument of `start_run`."""
    options: "Training"
    """Settings of each training, with its learning rate."""
    ssim: dict[str, Any]
    """Window and data range of the SSIM."""
    device: "torch.device | str"
    """Device of the trainings."""

    def scores(self, part: "Samples", options: "Training", *, seed: int, label: str) -> dict[str, pd.DataFrame]:
        """{set: `score_samples` of the best network} of one training on a part of the maps."""
        run = start_run(part, network=self.network, learning_rate=options.learning_rate,     # type: ignore[arg-type]
                        seed=seed, device=self.device)
        for _ in train_network(run, part, self.tests["validation"], options=options, ssim=self.ssim, seed=seed, checkpoint=None,
                               label=label):
            pass
        run.network.load_state_dict(run.best["weights"])
        return {name: score_samples(run.network, samples, ssim=self.ssim) for name, samples in self.tests.items()}


def learning_curve(experiment: Experiment, *, sizes: Iterable[int], steps: int, seed: int) -> pd.DataFrame:
    """Mean scores of networks trained on the first `sizes` maps of one shuffled order: SIZES_COLUMNS, a row per size and set.

    ssim_low, ssim_high: 95 % interval of the mean over objects and trials, not over seeds of the training
    steps: of the optimiser, rounded to whole epochs, so that all sizes are trained equally long
    """
    rows = []
    for size in sizes:
        part = experiment.train.subset(size, seed=seed)      # nested: each size's maps are among those of the next
        epochs = max(1, round(steps / math.ceil(len(part) / experiment.options.batch)))
        options = experiment.options.model_copy(update={"epochs": epochs, "patience": epochs})
        for name, scores in experiment.scores(part, options, seed=seed, label=f"{len(part)} maps").items():
            low, high = interval_over_objects(scores, seed=seed)
            rows.append({"maps": len(part), "epochs": epochs, "set": name, "ssim_low": low, "ssim_high": high,
                         **scores[_SCORES].mean()})
    return pd.DataFrame(rows, columns=SIZES_COLUMNS)


def train_seeds(experiment: Experiment, *, seeds: Iterable[int]) -> pd.DataFrame:
    """Mean scores of the same training from each seed: SEEDS_COLUMNS, a row per seed and set."""
    rows = [{"seed": seed, "set": name, **scores[_SCORES].mean()} for seed in seeds
            for name, scores in experiment.scores(experiment.train, experiment.options, seed=seed, label=f"seed {seed}").items()]
    return pd.DataFrame(rows, columns=SEEDS_COLUMNS)


def spread_of_seeds(repeats: pd.DataFrame) -> pd.DataFrame:
    """A row with SPREAD (mean, standard deviation, least and largest) per model, architecture and set of `train_seeds`."""
    groups = repeats.groupby(["model", "architecture", "set"], sort=False)
    table = groups.agg(seeds=("seed", "nunique"), ssim=("ssim", "mean"), ssim_sd=("ssim", "std"), ssim_least=("ssim", "min"),
                       ssim_most=("ssim", "max"), mae_counts=("mae_counts", "mean"), mae_sd=("mae_counts", "std"))
    return table.reset_index()[SPREAD]
