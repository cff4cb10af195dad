"""Scores, ceilings, predictions and times."""

import numpy as np
import pandas as pd
import pytest
import torch
import xarray

from softtact.evaluation.scoring import (
    predict_grasps,
    score_items,
    score_samples,
    score_sensor,
    summarise_scores,
    time_presses,
)
from softtact.learning.dataset import Samples

SSIM = {"window": 3, "data_range": 2400}
FORCES = [10.0, 20.0]


class Echo(torch.nn.Module):
    """Stands for a network: predicts `factor` times the taxels' mean depth, 3,000 counts per mm."""

    def __init__(self, factor=1.0):
        super().__init__()
        self.factor = torch.nn.Parameter(torch.tensor(factor))

    def forward(self, maps_mm):
        return 3000 * self.factor * maps_mm[:, :56, :32].unflatten(1, (7, 8)).unflatten(3, (4, 8)).mean(dim=(2, 4))


def make_samples(*, split="grasps", model="elastic", items=("object_1", "object_2"), trials=3, noise=0.0):
    """Dents of growing depth; the reading is what `Echo(1)` predicts, and noise."""
    labels = pd.DataFrame([(split, item, trial, force) for item in items for force in FORCES for trial in range(trials)],
                          columns=["set", "item", "trial", "force_n"])
    rng = np.random.default_rng(0)
    shapes = {item: rng.uniform(0, 0.02, (57, 33)) for item in items}
    maps = np.stack([shapes[row.item] * row.force_n for row in labels.itertuples()]).astype(np.float32)
    counts = Echo()(torch.from_numpy(maps)).detach().numpy() + rng.normal(0, noise, (len(maps), 7, 4))
    return Samples(maps, np.float32(counts), labels, model, split, "virtual sensor")


def test_a_perfect_network_scores_one_with_no_error():
    scores = score_samples(Echo(), make_samples(), ssim=SSIM)
    assert scores.columns.tolist() == ["model", "set", "item", "trial", "force_n", "ssim", "ssim_own_range", "mae_counts",
                                       "mean_counts",
                                       "overlap"]
    assert scores.ssim.values == pytest.approx(np.ones(12)) and scores.mae_counts.values == pytest.approx(0, abs=1e-3)


def test_a_worse_network_scores_lower_on_every_map():
    samples = make_samples()
    good, bad = (score_samples(Echo(factor), samples, ssim=SSIM) for factor in (0.9, 0.5))
    assert (bad.ssim < good.ssim).all() and (bad.mae_counts > good.mae_counts).all()


def test_a_row_per_map_in_an_order_that_the_samples_do_not_decide():
    samples = make_samples(noise=30)
    order = np.random.default_rng(0).permutation(len(samples))
    mixed = Samples(samples.maps_mm[order], samples.counts[order], samples.labels.iloc[order].reset_index(drop=True),
                    samples.model, samples.split, samples.source)
    pd.testing.assert_frame_equal(score_samples(Echo(), samples, ssim=SSIM), score_samples(Echo(), mixed, ssim=SSIM))


def test_validation_rows_are_named_so_though_their_items_are_indenters():
    samples = make_samples(split="validation")
    samples.labels["set"] = "indenters"
    assert set(score_samples(Echo(), samples, ssim=SSIM)["set"]) == {"validation"}


def test_the_sensors_ceiling_falls_with_its_noise():
    quiet, noisy = (score_sensor(make_samples(noise=noise), ssim=SSIM) for noise in (0, 100))
    assert quiet.columns.tolist() == ["set", "item", "force_n", "ssim", "ssim_own_range", "mae_counts", "mean_counts"]
    assert len(quiet) == 4 and quiet.mae_counts.values == pytest.approx(np.zeros(4), abs=1e-3)
    assert quiet.ssim.values == pytest.approx(np.ones(4)) and (noisy.ssim < 0.99).all()


def test_a_sensor_read_once_has_no_ceiling():
    assert score_sensor(make_samples(trials=1), ssim=SSIM).empty


def test_predictions_are_labelled_and_stand_beside_the_sensors_mean():
    grasps = {"elastic": make_samples(noise=20), "hyperelastic": make_samples(model="hyperelastic", noise=20)}
    data = predict_grasps({"elastic": Echo(), "hyperelastic": Echo(0.5)}, grasps)
    assert data.tactile_map.dims == ("model", "item", "force", "row", "column")
    assert data.sel(model="hyperelastic").tactile_map.values == pytest.approx(
        0.5 * data.sel(model="elastic").tactile_map.values)
    chosen = (grasps["elastic"].labels["item"] == "object_2") & (grasps["elastic"].labels.force_n == 20)
    assert data.sensor_map.sel(item="object_2").values[1] == pytest.approx(
        grasps["elastic"].counts[chosen.to_numpy()].mean(axis=0))
    assert data.force_n.values.tolist() == FORCES and data.attrs["source"] == "virtual sensor"


def test_a_load_step_that_an_object_lacks_is_nan():
    samples = make_samples()
    kept = ~((samples.labels["item"] == "object_1") & (samples.labels.force_n == 20)).to_numpy()
    fewer = Samples(samples.maps_mm[kept], samples.counts[kept], samples.labels[kept].reset_index(drop=True),
                    samples.model, samples.split, samples.source)
    data = predict_grasps({"elastic": Echo()}, {"elastic": fewer})
    lacking = np.isnan(data.tactile_map.sel(model="elastic").values).all(axis=(2, 3))
    assert lacking.tolist() == [[False, True], [False, False]]


def test_the_summary_has_means_an_interval_and_the_ceiling_per_model_and_set():
    samples = make_samples(noise=20)
    scores, ceiling = score_samples(Echo(0.9), samples, ssim=SSIM), score_sensor(samples, ssim=SSIM)
    row = summarise_scores(scores, ceiling, seed=1).iloc[0]
    assert (row.model, row["set"], row["items"], row.maps) == ("elastic", "grasps", 2, 12)
    for name in ("ssim", "mae_counts", "overlap"):
        assert row[name] == pytest.approx(scores[name].mean())
    assert row.ssim_low < row.ssim < row.ssim_high and row.sensor_ssim == pytest.approx(ceiling.ssim.mean())


def test_one_item_has_a_mean_and_no_interval_and_a_sensor_read_once_no_ceiling():
    samples = make_samples(items=("object_1",), trials=1)
    row = summarise_scores(score_samples(Echo(0.9), samples, ssim=SSIM), score_sensor(samples, ssim=SSIM), seed=1).iloc[0]
    assert row.ssim > 0.9 and np.isnan([row.ssim_low, row.ssim_high, row.sensor_ssim]).all()


def test_each_item_has_its_own_mean_and_an_interval_over_its_trials():
    scores = score_samples(Echo(0.9), make_samples(noise=20), ssim=SSIM)
    rows = score_items(scores, seed=1)
    assert rows["item"].tolist() == ["object_1", "object_2"] and (rows.maps == 6).all()
    assert rows.ssim.to_numpy() == pytest.approx(scores.groupby("item").ssim.mean().to_numpy())
    assert (rows.ssim_low < rows.ssim).all() and (rows.ssim < rows.ssim_high).all()
    alone = score_items(scores[scores.trial == 0], seed=1)
    assert np.isnan(alone[["ssim_low", "ssim_high"]]).all(axis=None)


@pytest.fixture
def press():
    return xarray.Dataset({"deformation_map_mm": (("step", "y", "x"), np.zeros((2, 57, 33))),
                           "normal_force_n": ("step", FORCES), "wall_time_s": ("step", [3.0, 1.0])},
                          attrs={"model": "elastic", "item": "object_1", "set": "grasps"})


def test_times_hold_the_solvers_from_the_press_and_the_networks_as_measured(press):
    shapes = []
    timing = time_presses([press], {"elastic": None}, predict=lambda network, maps: shapes.append(maps.shape), repeats=2)
    assert timing.columns.tolist() == ["model", "item", "set", "force_n", "solver_s", "network_s"]
    assert timing.solver_s.tolist() == [3.0, 1.0] and (timing.network_s >= 0).all()
    assert set(shapes) == {(1, 57, 33)} and len(shapes) == 1 + 2 * 2


def test_one_trial_at_the_same_force_twice_is_no_repetition():
    samples = make_samples(trials=2, noise=30)
    same = Samples(samples.maps_mm, samples.counts, samples.labels.assign(trial=0), samples.model, samples.split, samples.source)
    assert len(score_sensor(samples, ssim=SSIM)) == 4
    assert len(score_sensor(same, ssim=SSIM)) == 0
