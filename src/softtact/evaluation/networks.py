"""Several networks on the same split: how well each reads, and what it costs."""

import statistics
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd

from softtact.evaluation.convergence import COLUMNS as CONVERGENCE
from softtact.evaluation.convergence import convergence
from softtact.evaluation.score_tables import ALL_FORCES
from softtact.evaluation.scoring import score_samples, summarise_scores
from softtact.evaluation.timing import seconds
from softtact.learning.network import predict

if TYPE_CHECKING:
    import torch

    from softtact.learning.samples import Samples

BESIDE = {"mean_reading_ssim": "mean_reading", "quadratic_ssim": "quadratic", "gap_formula_ssim": "gap_formula"}
COLUMNS = ["model", "architecture", "weights", "set", "items", "maps", "ssim", "ssim_low", "ssim_high", "mae_counts", "overlap",
           "sensor_ssim", *BESIDE, "skill", "skill_simple", *CONVERGENCE, "epochs", "epoch_s", "map_s"]


class Trained(NamedTuple):
    """A network with what is known of its training: facts of its file, a frame epoch, wall_time_s, and its history."""

    network: "torch.nn.Module"
    facts: dict[str, Any]
    timing: pd.DataFrame
    history: pd.DataFrame

    @property
    def architecture(self) -> str:
        """As the study names it: `searched` is of the printed one's form."""
        return self.facts.get("architecture", self.network.architecture)


def score_networks(networks: Sequence[Trained], splits: "dict[str, dict[str, Samples]]", *, ssim: dict[str, Any]) -> pd.DataFrame:
    """The columns of `score_samples` and `predictor`, the architecture: a row for each network and sample.

    splits {set: {model: samples}}
    """
    frames = [score_samples(one.network, samples[one.facts["model"]], ssim=ssim).assign(predictor=one.architecture)
              for one in networks for samples in splits.values()]
    return pd.concat(frames, ignore_index=True)


def compare_networks(networks: Sequence[Trained], scores: pd.DataFrame, ceiling: pd.DataFrame, table: pd.DataFrame, *,
                     maps_mm: np.ndarray, taxels: int, seed: int) -> pd.DataFrame:
    """A row per network and set with COLUMNS: scores as in `summarise_scores`, what they stand beside, the training and times.

    scores: of `score_networks`;  ceiling: of `score_sensor`;  table: `score_table` of all predictors
    maps_mm (n, y, x): one of them is timed;  taxels: their number, over which a loss is summed
    epochs: trained;  epoch_s: median time of one, with its validation;  map_s: one map alone through the network, measured here
    """
    noise = ceiling[ceiling["set"] == "validation"].mae_counts.mean() * taxels
    rows = []
    for one in networks:
        own = scores[(scores.model == one.facts["model"]) & (scores.predictor == one.architecture)]
        summary = summarise_scores(own, ceiling, seed=seed).assign(
            architecture=one.architecture, weights=count_weights(one.network), epochs=len(one.timing),
            epoch_s=one.timing.wall_time_s.median(), map_s=time_of_a_map(one.network, maps_mm),
            **convergence(one.history, noise_loss=noise, unseen_loss=own[own["set"] == "unseen"].mae_counts.mean() * taxels))
        rows.append(summary.join(_beside(table, one), on="set"))
    return pd.concat(rows)[COLUMNS]


def _beside(table, one):
    """What stands beside a network's scores, by set: baselines and skill."""
    rows = table[(table.model == one.facts["model"]) & (table.force == ALL_FORCES)]
    wide = rows.pivot(index="set", columns="predictor", values="ssim")
    beside = pd.DataFrame({name: wide.get(predictor, np.nan) for name, predictor in BESIDE.items()}, index=wide.index)
    return beside.join(rows[rows.predictor == one.architecture].set_index("set")[["skill", "skill_simple"]])


def count_weights(network: "torch.nn.Module") -> int:
    """Trained numbers of a network."""
    return sum(tensor.numel() for tensor in network.parameters())


def time_of_a_map(network: "torch.nn.Module", maps_mm: np.ndarray, *, repeats: int = 5) -> float:
    """Median seconds of one map alone; the first call allocates and is not counted."""
    one = maps_mm[:1]
    predict(network, one)
    return statistics.median(seconds(predict, network, one) for _ in range(repeats))
