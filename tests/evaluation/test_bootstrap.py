"""The bootstrap of a mean: closed forms where there are some, and what it does with objects and trials."""

import numpy as np
import pytest
from scipy import stats

from softtact.evaluation.scoring import by_trial, interval_of_mean


def interval(values, items, trials=None, **options):
    trials = np.zeros(len(values), dtype=int) if trials is None else trials
    return interval_of_mean(np.asarray(values), items, trials, **{"seed": 1, **options})


def width(bounds):
    return bounds[1] - bounds[0]


# Forty thousand draws leave some 1 % in an interval's ends, and few normal values draw a mean that is not quite normal. Percentiles
# that are not taken farther out give 2.5 % less for 20 values, 4.3 % for 12, 6.5 % for 8.
def test_the_interval_of_a_normal_sample_is_students():
    for count, tolerance in [(60, 0.02), (20, 0.015), (12, 0.015), (8, 0.025)]:
        values = 0.7 + 0.1 * stats.norm.ppf((np.arange(count) + 0.5) / count)      # a sample as normal as can be
        students = stats.t.interval(0.95, count - 1, values.mean(), stats.sem(values))
        found = interval(values, np.arange(count), repeats=40_000)
        assert width(found) == pytest.approx(width(students), rel=tolerance), count
        assert np.mean(found) == pytest.approx(values.mean(), abs=tolerance * width(students)), count


@pytest.mark.parametrize("count", [2, 3, 4, 5, 6])
def test_the_interval_of_a_few_items_is_students_too(count):
    """Their means of 2,000 draws end before the percentile that would be taken: two items have three means."""
    values = 0.7 + 0.1 * stats.norm.ppf((np.arange(count) + 0.5) / count)
    students = stats.t.interval(0.95, count - 1, values.mean(), stats.sem(values))
    assert width(interval(values, np.arange(count))) == pytest.approx(width(students), rel=0.05)     # thrice what 2,000 draws leave


def test_maps_of_one_object_are_not_independent():
    """Ten objects with 20 equal maps each say no more than ten maps."""
    means = np.random.default_rng(0).normal(size=10)
    items, trials = np.repeat(np.arange(10), 20), np.tile(np.arange(20), 10)
    assert width(interval(np.repeat(means, 20), items, trials)) == pytest.approx(width(interval(means, np.arange(10))), rel=0.06)


def test_a_trial_brings_all_its_maps():
    """Two objects alike, whose trials differ and whose forces do not: the spread is that of the trials."""
    effect = np.array([-1.0, 1.0, -1.0, 1.0])
    items, trials = np.repeat([0, 1], 40), np.tile(np.repeat(np.arange(4), 10), 2)
    found = interval(np.tile(np.repeat(effect, 10), 2), items, trials, repeats=10_000)
    # The mean of eight fair signs has the variance 1 / 8, and Student's interval of two objects is wide.
    half = np.sqrt(2) * stats.t.ppf(0.975, 1) / np.sqrt(8)
    assert found == pytest.approx((-half, half), rel=0.02, abs=0.1)


def test_one_item_gives_no_interval():
    assert np.isnan(interval(np.random.default_rng(0).random(20), ["object_1"] * 20, np.arange(20))).all()


def test_the_same_seed_gives_the_same_interval_and_equal_scores_a_point():
    values, items = np.random.default_rng(0).random(30), np.repeat(np.arange(6), 5)
    assert interval(values, items) == interval(values, items) != interval(values, items, seed=2)
    assert interval(np.ones(30), items) == interval(np.ones(3), np.arange(3)) == (1.0, 1.0)


def test_objects_may_have_trials_of_different_number_and_name():
    sums, counts, n_trials = by_trial([1.0, 2.0, 4.0, 8.0], ["b", "b", "a", "b"], [7, 9, 3, 7])
    assert n_trials.tolist() == [1, 2]
    assert sums.tolist() == [[4, 0], [9, 2]] and counts.tolist() == [[1, 0], [2, 1]]
