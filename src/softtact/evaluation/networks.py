"""Compare several networks on the same split: their scores, their costs, and what determines the remaining loss.

The cause of the remaining loss follows from the losses alone, tested in this order:
noise        the losses on validation maps and unseen indenters are within CLOSE of the loss between the sensor's trials
optimiser    the best validation loss still fell by more than STILL over the last quarter of the epochs: train for longer
data         the loss on validation maps or on unseen indenters is more than GAP times the training loss: the network does not
             generalise, so more maps would help (validation maps alone are of indenters that the training includes)
network      none of these: this network, with these weights and this rate, fits no better
"""

import statistics
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pandas as pd

from softtact.evaluation.score_tables import ALL_FORCES
from softtact.evaluation.scoring import score_samples, seconds, summarise_scores
from softtact.learning.network import predict

if TYPE_CHECKING:
    import torch

    from softtact.learning.dataset import Samples

BASELINES = {"mean_reading_ssim": "mean_reading", "quadratic_ssim": "quadratic", "gap_formula_ssim": "gap_formula"}
CONVERGENCE = ["learning_rate", "best_epoch", "train_loss", "validation_loss", "unseen_loss", "late_fall", "remains"]
COLUMNS = ["model", "architecture", "weights", "set", "items", "maps", "ssim", "ssim_low", "ssim_high", "mae_counts", "overlap",
           "sensor_ssim", *BASELINES, "skill", "skill_simple", *CONVERGENCE, "epochs", "epoch_s", "map_s"]
CLOSE, STILL, GAP = 1.25, 0.02, 1.5


class Trained(NamedTuple):
    """A network and its training: facts of its file, a frame with columns epoch and wall_time_s, and its history."""

    network: "torch.nn.Module"
    facts: dict[str, Any]
    timing: pd.DataFrame
    history: pd.DataFrame

    @property
    def architecture(self) -> str:
        """The study's name of the architecture; a `searched` network has the form of the printed one."""
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
    """A row per network and set with COLUMNS: scores as in `summarise_scores`, those of baselines, the training and times.

    scores: of `score_networks`;  ceiling: of `score_sensor`;  table: `score_table` of all predictors
    maps_mm (n, y, x): one of them is timed;  taxels: number of taxels, over which a loss is summed
    Columns: epochs: number trained;  epoch_s: median time of one, with its validation;  map_s: time of one map, measured here
    """
    noise = ceiling[ceiling["set"] == "validation"].mae_counts.mean() * taxels
    rows = []
    for one in networks:
        of_network = scores[(scores.model == one.facts["model"]) & (scores.predictor == one.architecture)]
        unseen = of_network[of_network["set"] == "unseen"].mae_counts.mean() * taxels
        summary = summarise_scores(of_network, ceiling, seed=seed).assign(
            architecture=one.architecture, weights=count_weights(one.network), epochs=len(one.timing),
            epoch_s=one.timing.wall_time_s.median(), map_s=time_of_a_map(one.network, maps_mm),
            **convergence(one.history, noise_loss=noise, unseen_loss=unseen))
        rows.append(summary.join(_baselines(table, one), on="set"))
    return pd.concat(rows)[COLUMNS]


def _baselines(table, one):
    """Scores of the baselines and a network's skill over them, by set."""
    rows = table[(table.model == one.facts["model"]) & (table.force == ALL_FORCES)]
    wide = rows.pivot(index="set", columns="predictor", values="ssim")
    baselines = pd.DataFrame({name: wide.get(predictor, np.nan) for name, predictor in BASELINES.items()}, index=wide.index)
    return baselines.join(rows[rows.predictor == one.architecture].set_index("set")[["skill", "skill_simple"]])


def count_weights(network: "torch.nn.Module") -> int:
    """Number of trained weights of a network."""
    return sum(tensor.numel() for tensor in network.parameters())


def time_of_a_map(network: "torch.nn.Module", maps_mm: np.ndarray, *, repeats: int = 5) -> float:
    """Median seconds for one map; the first call allocates memory and is not counted."""
    one = maps_mm[:1]
    predict(network, one)
    return statistics.median(seconds(predict, network, one) for _ in range(repeats))


def convergence(history: "pd.DataFrame", *, noise_loss: float = np.nan, unseen_loss: float = np.nan) -> dict[str, Any]:
    """CONVERGENCE of a training's history.csv; losses in counts, summed over the taxels, at the best epoch.

    late_fall: share by which the best validation loss fell over the last quarter of the epochs
    noise_loss: the loss between the sensor's trials; nan with one trial
    unseen_loss: the loss of the best network on indenters outside the training; nan if unknown
    """
    best = history.loc[history.validation_loss.idxmin()]
    early = history.validation_loss.iloc[:max(1, (3 * len(history)) // 4)].min()
    fall = 1.0 - best.validation_loss / early
    test_loss = np.fmax(best.validation_loss, unseen_loss)
    if test_loss <= CLOSE * noise_loss:
        remains = "noise"
    elif fall > STILL or len(history) < 4:
        remains = "optimiser"
    else:
        remains = "data" if test_loss > GAP * best.train_loss else "network"
    return {"learning_rate": history.learning_rate.iloc[0], "best_epoch": int(best.epoch), "train_loss": best.train_loss,
            "validation_loss": best.validation_loss, "unseen_loss": unseen_loss, "late_fall": fall, "remains": remains}
