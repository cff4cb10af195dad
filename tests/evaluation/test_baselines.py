"""Predictors without a network: each reads what its name says, on samples whose readings are made so that one of them is right."""

import numpy as np
import pandas as pd
import pytest
from support.sensors import CORO

from softtact.evaluation.score_tables import KINDS, make_predictors, moved_by_a_taxel, score_baselines, taxel_depths, taxel_table
from softtact.learning.dataset import Samples
from softtact.readout.capacitance import ideal_counts

SSIM = {"window": 3, "data_range": 2400}
GAIN = 2600.0


def bumps(rng, count):
    """Deformation maps (count, 57, 33) in mm: one bump each, somewhere."""
    y, x = np.mgrid[0:57, 0:33]
    places = rng.uniform([10, 6], [47, 27], (count, 2))
    depth = rng.uniform(0.05, 0.25, count)[:, None, None]
    return depth * np.exp(-((y - places[:, :1, None])**2 + (x - places[:, 1:, None])**2) / 60)


def samples(counts_of, *, forces=(5.0, 50.0), count=24, seed=0, split="train"):
    """Samples whose counts (n, 7, 4) are `counts_of` their maps and forces."""
    rng = np.random.default_rng(seed)
    maps, force = bumps(rng, count), np.resize(forces, count)
    labels = pd.DataFrame({"set": split, "item": [f"form_{k}" for k in range(count)], "trial": 0, "force_n": force})
    bare = Samples(np.float32(maps), np.zeros((count, 7, 4), np.float32), labels, "elastic", split, "virtual sensor")
    return Samples(bare.maps_mm, np.float32(counts_of(bare)), labels, "elastic", split, "virtual sensor")


READINGS = {
    "mean_reading": lambda one: np.broadcast_to(10 * one.labels.force_n.to_numpy()[:, None, None], (len(one), 7, 4)),
    "ridge": lambda one: 3000 * taxel_depths(one)[:, ::-1] + 50,      # each taxel reads another one's depth
    "quadratic": lambda one: 7 + 900 * taxel_depths(one) + 4000 * taxel_depths(one)**2,
    "gap_formula": lambda one: ideal_counts(CORO, one.maps_mm, counts_per_relative_change=GAIN)}


@pytest.mark.parametrize("name", READINGS)
def test_a_predictor_is_right_where_the_readings_are_of_its_form_and_the_others_are_not(name):
    train, test = samples(READINGS[name]), samples(READINGS[name], seed=1, split="grasps")
    predictors = make_predictors(train, spec=CORO, counts_per_relative_change=GAIN)
    errors = {key: np.abs(predict(test) - test.counts).mean() for key, predict in predictors.items()}
    assert min(errors, key=errors.get) == name and errors[name] < 0.1 * test.counts.mean(), errors


def test_the_mean_reading_between_two_forces_is_linear():
    predict = make_predictors(samples(READINGS["mean_reading"]), spec=CORO, counts_per_relative_change=GAIN)["mean_reading"]
    between = samples(READINGS["mean_reading"], forces=(20.0,), split="unseen")
    assert predict(between) == pytest.approx(between.counts, rel=1e-5)


def test_forces_that_are_all_different_are_grouped():
    many = np.linspace(1, 50, 200)
    train = samples(READINGS["mean_reading"], forces=many, count=200)
    predict = make_predictors(train, spec=CORO, counts_per_relative_change=None)["mean_reading"]
    assert np.abs(predict(train) - train.counts).max() < 20     # a group spans 2.5 N


def test_the_penalty_of_the_ridge_is_a_thousandth_of_the_mean_sum_of_squares():
    """Against the normal equations of centred columns, since the constant is free; most taxels have no depth at all."""
    train = samples(READINGS["quadratic"])
    maps = np.zeros_like(train.maps_mm)
    maps[:, 20:36, 8:24] = np.linspace(0, 1, 24, dtype=np.float32)[:, None, None]
    lone = Samples(maps, 100 * np.float32(taxel_depths(Samples(maps, train.counts, train.labels, "elastic", "train", "x"))),
                   train.labels, "elastic", "train", "virtual sensor")
    x, y = (array.reshape(24, 28).astype(float) for array in (taxel_depths(lone), lone.counts))
    centred = x - x.mean(axis=0)
    weights = np.linalg.solve(centred.T @ centred + 1e-3 * (x**2).sum() / 28 * np.eye(28), centred.T @ (y - y.mean(axis=0)))
    expected = (centred @ weights + y.mean(axis=0)).reshape(24, 7, 4)
    assert np.abs(expected - lone.counts).max() > 1e-3
    assert make_predictors(lone, spec=CORO, counts_per_relative_change=GAIN)["ridge"](lone) == pytest.approx(expected, abs=1e-6)


def test_the_nearest_map_gives_the_mean_reading_of_its_trials():
    train = samples(READINGS["quadratic"])
    twice = Samples(np.repeat(train.maps_mm, 2, axis=0), np.repeat(train.counts, 2, axis=0) + np.resize([-4, 4], 48)[:, None, None],
                    train.labels.loc[np.repeat(np.arange(24), 2)].reset_index(drop=True), "elastic", "train", "virtual sensor")
    predict = make_predictors(twice, spec=CORO, counts_per_relative_change=GAIN)["nearest_map"]
    assert predict(train) == pytest.approx(train.counts, rel=1e-5)


def test_a_map_moved_by_a_taxel_keeps_its_first_row():
    counts = np.arange(28.0).reshape(1, 7, 4)
    assert (moved_by_a_taxel(counts)[0, 1:] == counts[0, :-1]).all() and (moved_by_a_taxel(counts)[0, 0] == counts[0, 0]).all()


def test_every_predictor_is_scored_on_every_sample_and_the_gap_formula_only_with_a_known_gain():
    train, test = samples(READINGS["quadratic"]), samples(READINGS["quadratic"], seed=1, split="grasps")
    known, unknown = (score_baselines(train, {"grasps": test}, spec=CORO, counts_per_relative_change=gain, ssim=SSIM)
                      for gain in (GAIN, None))
    assert known.groupby("predictor").size().to_dict() == dict.fromkeys(KINDS, len(test))
    assert set(known.predictor) - set(unknown.predictor) == {"gap_formula"}
    halved = known[known.predictor == "halved"].set_index("item").mae_counts[test.labels["item"]]
    assert halved.to_numpy() == pytest.approx(0.5 * np.abs(test.counts).mean(axis=(1, 2)), rel=1e-5)


def test_a_taxels_largest_reading_is_told_with_the_number_of_indenters():
    train = samples(READINGS["quadratic"])
    table = taxel_table([train])
    assert table.largest_counts.to_numpy() == pytest.approx(train.counts.max(axis=0).ravel()) and set(table.indenters) == {24}
