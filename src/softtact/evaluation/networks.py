"""Several networks on the same split: how well each reads, and what it costs."""

import statistics
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import pandas as pd

from softtact.evaluation.scoring import score_samples, summarise_scores
from softtact.evaluation.timing import seconds
from softtact.learning.network import predict

if TYPE_CHECKING:
    import numpy as np
    import torch

    from softtact.learning.samples import Samples

COLUMNS = ["model", "architecture", "weights", "set", "items", "maps", "ssim", "ssim_low", "ssim_high", "mae_counts", "overlap",
           "sensor_ssim", "epochs", "epoch_s", "map_s"]


def compare_networks(networks: "Iterable[tuple[torch.nn.Module, dict[str, Any], pd.DataFrame]]",
                     splits: "dict[str, dict[str, Samples]]", ceiling: pd.DataFrame, *, ssim: dict[str, Any],
                     seed: int) -> pd.DataFrame:
    """A row per network and set with COLUMNS: scores as in `summarise_scores`, and times.

    architecture: as the study names it: `searched` is of the printed one's form
    networks: [(network, facts, timing)], timing: a frame epoch, wall_time_s;  splits {set: {model: samples}}
    epochs: trained;  epoch_s: median time of one, with its validation;  map_s: one map alone through the network, measured here
    """
    rows = []
    for network, facts, timing in networks:
        own = [samples[facts["model"]] for samples in splits.values()]
        scores = pd.concat([score_samples(network, samples, ssim=ssim) for samples in own])
        rows.append(summarise_scores(scores, ceiling, seed=seed).assign(
            architecture=facts.get("architecture", network.architecture), weights=count_weights(network), epochs=len(timing),
            epoch_s=timing.wall_time_s.median(), map_s=time_of_a_map(network, own[0].maps_mm)))
    return pd.concat(rows)[COLUMNS]


def count_weights(network: "torch.nn.Module") -> int:
    """Trained numbers of a network."""
    return sum(tensor.numel() for tensor in network.parameters())


def time_of_a_map(network: "torch.nn.Module", maps_mm: "np.ndarray", *, repeats: int = 5) -> float:
    """Median seconds of one map alone; the first call allocates and is not counted."""
    one = maps_mm[:1]
    predict(network, one)
    return statistics.median(seconds(predict, network, one) for _ in range(repeats))
