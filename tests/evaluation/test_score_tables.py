"""What a score is worth: skill, forces and verdicts follow from the rows."""

import numpy as np
import pandas as pd
import pytest

from softtact.evaluation.score_tables import force_labels, forces_of, level_table, score_table, untrained, verdicts


def rows(**scores):
    """A row for each predictor and force, of one model and set: SSIM by name, lower by 0.1 at 50 N."""
    return pd.DataFrame([{"model": "elastic", "set": "grasps", "item": "key", "trial": 0, "force_n": force,
                          "ssim": value - 0.1 * late,
                          "ssim_own_range": value, "mae_counts": 20.0, "mean_counts": 100.0, "overlap": 1.0, "predictor": name}
                         for name, value in scores.items() for late, force in enumerate((5.0, 50.0))])


def table(network=0.8, *, mean=0.5, gap=0.7, ceiling=0.9):
    sensor = rows(sensor=ceiling).drop(columns=["model", "predictor", "trial", "overlap"])
    return score_table(rows(printed=network), rows(zeros=0.1, mean_reading=mean, gap_formula=gap, halved=0.99), sensor)


def row(frame, predictor, force="all"):
    found = frame[(frame.predictor == predictor) & (frame.force == force)]
    assert len(found) == 1
    return found.iloc[0]


def test_skill_is_the_share_of_what_the_best_trivial_predictor_leaves():
    found = row(table(), "printed")
    assert found.skill == pytest.approx((0.8 - 0.5) / (0.9 - 0.5))
    assert found.skill_simple == pytest.approx((0.8 - 0.7) / (0.9 - 0.7))
    assert found.mae_share == pytest.approx(0.2) and found.maps == 2


def test_marks_that_know_the_truth_are_no_predictors_to_beat():
    assert row(table(), "sensor_repeated").skill == pytest.approx(1.0) and row(table(), "halved").skill > 1


def test_a_sensor_read_once_gives_no_skill():
    nothing = rows(sensor=0.9).drop(columns=["model", "predictor", "trial", "overlap"]).iloc[:0]
    frame = score_table(rows(printed=0.8), rows(mean_reading=0.5), nothing)
    assert np.isnan(frame.skill).all() and (frame.predictor != "sensor_repeated").all()


def test_every_force_stands_alone_beside_all_of_them():
    frame = table()
    assert forces_of(frame) == ["5", "50"] and row(frame, "printed", "50").ssim == pytest.approx(0.7)
    levels = level_table(frame)
    assert levels.columns.tolist() == ["set", "model", "predictor", "kind", "ssim_5_n", "ssim_50_n", "mae_counts_5_n",
                                       "mae_counts_50_n"]
    assert levels[levels.predictor == "printed"].ssim_50_n.iloc[0] == pytest.approx(0.7)


def test_forces_that_are_all_different_are_gathered_in_ranges():
    labels = force_labels(pd.Series(np.linspace(0.5, 50, 100)))
    assert sorted(set(labels), key=float) == ["2.5", "7.5", "12.5", "17.5", "22.5", "27.5", "32.5", "37.5", "42.5", "47.5"]
    assert (labels.value_counts() == 10).all() and force_labels(pd.Series([5.0, 12.5])).tolist() == ["5", "12.5"]


def test_grasps_that_reach_less_than_other_sets_are_compared_at_their_own_largest_force():
    frame = table(0.6)
    frame = frame[(frame["set"] != "grasps") | (frame.force != "50")]
    assert verdicts(frame, architecture="printed")[-1].startswith("At 5 N on grasped objects the printed network")


@pytest.mark.parametrize(("network", "begins"), [(0.4, "Not trained: the printed network of the elastic model"),
                                                 (0.6, "At 50 N on grasped objects the printed network")])
def test_a_network_below_the_mean_reading_is_called_not_trained_first(network, begins):
    sentences = verdicts(table(network), architecture="printed")
    assert sentences[0].startswith(begins) and "gap_formula, has 0.600" in sentences[-1]
    assert len(untrained(table(network))) == (network < 0.5)
