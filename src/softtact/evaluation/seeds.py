"""How much another seed of learning changes a score: other first weights, another order of the maps, the same presses and split."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import pandas as pd

from softtact.evaluation.scoring import score_samples
from softtact.learning.training import start_run, train_network

if TYPE_CHECKING:
    import torch

    from softtact.learning.samples import Samples
    from softtact.learning.settings import Training

COLUMNS = ["seed", "set", "ssim", "mae_counts", "overlap"]
SPREAD = ["model", "architecture", "set", "seeds", "ssim", "ssim_sd", "ssim_least", "ssim_most", "mae_counts", "mae_sd"]


def train_seeds(train: "Samples", validation: "Samples", tests: "dict[str, Samples]", *, seeds: Iterable[int],
                network: dict[str, Any], options: "Training", ssim: dict[str, Any], device: "torch.device | str") -> pd.DataFrame:
    """Mean scores of the same training from each seed: a frame with COLUMNS, a row a seed and set.

    tests {set: samples};  network, ssim as for `start_run` and `train_network`;  options: a `Training` with its learning rate
    """
    rows = []
    for seed in seeds:
        run = start_run(train, network=network, learning_rate=options.learning_rate,     # type: ignore[arg-type]
                        seed=seed, device=device)
        for _ in train_network(run, train, validation, options=options, ssim=ssim, seed=seed, checkpoint=None,
                               label=f"seed {seed}"):
            pass
        run.network.load_state_dict(run.best["weights"])
        for name, samples in tests.items():
            means = score_samples(run.network, samples, ssim=ssim)[["ssim", "mae_counts", "overlap"]].mean()
            rows.append({"seed": seed, "set": name, **means})
    return pd.DataFrame(rows, columns=COLUMNS)


def spread_of_seeds(repeats: pd.DataFrame) -> pd.DataFrame:
    """A row with SPREAD per model, architecture and set of `train_seeds` (with these columns): mean, standard deviation, ends."""
    groups = repeats.groupby(["model", "architecture", "set"], sort=False)
    table = groups.agg(seeds=("seed", "nunique"), ssim=("ssim", "mean"), ssim_sd=("ssim", "std"), ssim_least=("ssim", "min"),
                       ssim_most=("ssim", "max"), mae_counts=("mae_counts", "mean"), mae_sd=("mae_counts", "std"))
    return table.reset_index()[SPREAD]
