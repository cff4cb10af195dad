"""The table of architectures: each network's scores, weights and times."""

from typing import ClassVar

import numpy as np
import pandas as pd
import pytest
import torch
from test_scoring import SSIM, Echo, make_samples

from softtact.evaluation import scoring
from softtact.evaluation.networks import COLUMNS, Trained, compare_networks, count_weights, score_networks, time_of_a_map
from softtact.evaluation.score_tables import score_table
from softtact.evaluation.scoring import score_sensor
from softtact.learning.network import CompactNetwork, TactileNetwork


class NamedEcho(Echo):
    """A stand-in that has an architecture's name."""

    def __init__(self, name, factor):
        super().__init__(factor)
        self.architecture = name


def test_a_row_per_network_and_set_with_scores_weights_and_times():
    splits = {name: {"elastic": make_samples(split=name, noise=20)} for name in ("unseen", "grasps", "validation")}
    ceiling = pd.concat([score_sensor(split["elastic"], ssim=SSIM) for split in splits.values()])
    timing = pd.DataFrame({"epoch": [1, 2, 3], "wall_time_s": [9.0, 2.0, 4.0]})
    history = pd.DataFrame({"epoch": [1, 2, 3], "train_loss": 90.0, "validation_loss": [9.0, 2.0, 4.0], "learning_rate": 1e-4})
    networks = [Trained(NamedEcho(name, factor), {"model": "elastic"}, timing, history)
                for name, factor in (("printed", 0.5), ("compact", 1.0))]
    scores = score_networks(networks, splits, ssim=SSIM)
    baseline = scores[scores.predictor == "printed"].assign(predictor="mean_reading", ssim=0.25)
    beside = score_table(scores, baseline, ceiling)
    maps = splits["unseen"]["elastic"].maps_mm
    table = compare_networks(networks, scores, ceiling, beside, maps_mm=maps, taxels=28, seed=1)
    assert (table.mean_reading_ssim == 0.25).all() and table.gap_formula_ssim.isna().all() and (table.skill > 0).all()
    assert (table.best_epoch == 2).all() and (table.learning_rate == 1e-4).all()
    assert table.columns.tolist() == COLUMNS and len(table) == 6
    assert (table.weights == 1).all() and (table.epochs == 3).all() and (table.epoch_s == 4.0).all() and (table.map_s > 0).all()
    unseen = scores[(scores["set"] == "unseen")].groupby("predictor").mae_counts.mean()
    assert table.groupby("architecture").unseen_loss.first().to_dict() == pytest.approx((28 * unseen).to_dict())
    assert table.groupby("architecture").remains.first().to_dict() == {"compact": "noise", "printed": "optimiser"}
    means = table.groupby("architecture").ssim.mean()
    assert means["compact"] > means["printed"]
    assert ((table.ssim_low <= table.ssim) & (table.ssim <= table.ssim_high)).all()
    assert table.sensor_ssim.tolist() == pytest.approx(2 * [float(ceiling[ceiling["set"] == s].ssim.mean()) for s in splits])


def test_a_map_is_timed_alone_in_seconds_without_the_first_one(monkeypatch):
    clock, takes = [0.0], iter([9.0, 2.0, 4.0, 3.0])      # the first one allocates
    monkeypatch.setattr(scoring.time, "perf_counter", lambda: clock[0])

    class Seen(Echo):
        counts: ClassVar[list[int]] = []

        def forward(self, maps):
            self.counts.append(len(maps))
            clock[0] += next(takes)
            return super().forward(maps)

    assert time_of_a_map(Seen(), make_samples(trials=1).maps_mm, repeats=3) == 3.0
    assert Seen.counts == [1, 1, 1, 1]


def test_the_compact_network_has_a_thousandth_of_the_printed_ones_weights():
    sides = {"map_shape": (57, 33), "taxels": (7, 4)}
    with torch.device("meta"):
        printed = TactileNetwork(**sides)
    ratio = count_weights(printed) / count_weights(CompactNetwork(**sides))
    assert 1500 < ratio < 1600 and np.isfinite(ratio)
