"""The table of architectures: each network's scores, weights and times."""

import numpy as np
import pandas as pd
import pytest
import torch
from test_scoring import SSIM, Echo, make_samples

from softtact.evaluation.networks import COLUMNS, compare_networks, count_weights
from softtact.evaluation.scoring import score_sensor
from softtact.learning.network import CompactNetwork, TactileNetwork


class NamedEcho(Echo):
    """A stand-in that has an architecture's name."""

    def __init__(self, name, factor):
        super().__init__(factor)
        self.architecture = name


def test_a_row_per_network_and_set_with_scores_weights_and_times():
    splits = {name: {"elastic": make_samples(split=name, noise=20)} for name in ("unseen", "grasps")}
    ceiling = pd.concat([score_sensor(split["elastic"], ssim=SSIM) for split in splits.values()])
    timing = pd.DataFrame({"epoch": [1, 2, 3], "wall_time_s": [9.0, 2.0, 4.0]})
    networks = [(NamedEcho(name, factor), {"model": "elastic"}, timing) for name, factor in (("printed", 0.5), ("compact", 1.0))]
    table = compare_networks(networks, splits, ceiling, ssim=SSIM, seed=1)
    assert table.columns.tolist() == COLUMNS and len(table) == 4
    assert (table.weights == 1).all() and (table.epochs == 3).all() and (table.epoch_s == 4.0).all() and (table.map_s > 0).all()
    means = table.groupby("architecture").ssim.mean()
    assert means["compact"] > means["printed"]
    assert ((table.ssim_low <= table.ssim) & (table.ssim <= table.ssim_high)).all()
    assert table.sensor_ssim.tolist() == pytest.approx(2 * [float(ceiling[ceiling["set"] == s].ssim.mean()) for s in splits])


def test_the_compact_network_has_a_thousandth_of_the_printed_ones_weights():
    sides = {"map_shape": (57, 33), "taxels": (7, 4)}
    with torch.device("meta"):
        printed = TactileNetwork(**sides)
    ratio = count_weights(printed) / count_weights(CompactNetwork(**sides))
    assert 1500 < ratio < 1600 and np.isfinite(ratio)
