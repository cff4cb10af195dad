"""Paired comparisons against known answers: Holm by hand, Student's interval, no effect, a flipped sign, chosen by chance."""

import numpy as np
import pytest
from scipy import stats

from softtact.evaluation.paired import FAILS, HOLDS, UNDECIDED, compare, compare_groups, holm, permutation_p, power, verdict


def test_holm_multiplies_the_sorted_p_values_by_how_many_are_left():
    """By hand: .01 * 4 = .04, .02 * 3 = .06, .03 * 2 = .06, .04 * 1 -> .06, as it must not fall."""
    assert holm([0.03, 0.01, 0.04, 0.02]) == pytest.approx([0.06, 0.04, 0.06, 0.06])


def test_holm_never_exceeds_one():
    assert holm([0.6, 0.9]) == pytest.approx([1.0, 1.0])


def test_one_seed_gives_nearly_students_interval_and_p_value():
    """Of 12 values the bootstrap's percentiles are expanded to Student's; what is left is the draws' scatter and skew."""
    rng = np.random.default_rng(3)
    sample = 0.05 + 0.1 * rng.standard_normal(12)
    found, expected = compare(sample, draws=20000), stats.ttest_1samp(sample, 0.0, alternative="greater")
    low, high = stats.t.interval(0.95, 11, sample.mean(), sample.std(ddof=1) / np.sqrt(12))
    assert (found.low, found.high) == pytest.approx((low, high), abs=0.1 * (high - low))
    assert found.p_above == pytest.approx(expected.pvalue, rel=0.3)
    assert found.p_above + found.p_below == pytest.approx(1.0, abs=1e-3)


def test_seeds_that_differ_widen_the_interval_of_a_crossed_table():
    rng = np.random.default_rng(0)
    objects, seeds = 0.02 * rng.standard_normal((20, 1)), 0.1 * rng.standard_normal((1, 5))
    wide, narrow = compare(objects + seeds), compare(np.tile(objects, (1, 5)))
    assert wide.high - wide.low > 3 * (narrow.high - narrow.low)


@pytest.mark.parametrize("objects, seeds", [(0.1, 0.0), (0.1, 0.1), (0.03, 0.15)])
def test_the_verdicts_of_no_effect_are_undecided_at_the_stated_rate_however_much_three_seeds_scatter(objects, seeds):
    """Both sides share 5 %: of 300 tables 2 to 9 % are decided with 99 % probability. Seeds without enlarging: 11 and 25 %."""
    rng = np.random.default_rng(1)
    decided = 0
    for k in range(300):
        found = compare(objects * rng.standard_normal((12, 1)) + seeds * rng.standard_normal((1, 3)), draws=1000, seed=k)
        decided += verdict(found.p_above, found.p_below, objects=12, least_objects=10) != UNDECIDED
    assert 0.02 < decided / 300 < 0.09


def test_two_groups_that_share_three_seeds_are_told_apart_at_the_stated_rate_alone():
    """The seeds' scatter, twice as large in one group, does not cancel: of 300 tables without a difference 1 to 9 % are decided."""
    rng = np.random.default_rng(4)
    decided = 0
    for k in range(300):
        seeds = 0.1 * rng.standard_normal((1, 3))
        one, other = (factor * seeds + 0.1 * rng.standard_normal((12, 1)) for factor in (2.0, 1.0))
        found = compare_groups(one, other, draws=1000, seed=k)
        decided += verdict(found.p_above, found.p_below, objects=12, least_objects=10) != UNDECIDED
    assert 0.01 < decided / 300 < 0.09


def test_a_flipped_sign_flips_the_verdict():
    differences = 0.05 + 0.01 * np.random.default_rng(0).standard_normal((12, 3))
    words = [verdict(found.p_above, found.p_below, objects=12, least_objects=10)
             for found in map(compare, (differences, -differences))]
    assert words == [HOLDS, FAILS]


def test_few_objects_are_undecided_whatever_they_show():
    found = compare(np.full((3, 2), 1.0) + 1e-6 * np.arange(6).reshape(3, 2))
    assert verdict(found.p_above, found.p_below, objects=3, least_objects=10) == UNDECIDED
    assert compare([0.3]).p_above == 1.0


@pytest.mark.parametrize("value", [0.1, 0.3, 1 / 3, 0.013, -0.7])
def test_round_off_alone_tells_no_two_groups_and_no_mean_from_its_bound(value):
    """Equal constants, whose means differ in the last digit by how many there are."""
    for first, second in ((7, 11), (6, 13), (9, 10)):
        found = compare_groups(np.full((first, 3), value), np.full((second, 3), value))
        assert verdict(found.p_above, found.p_below, objects=6, least_objects=6) == UNDECIDED
    rounded = compare(np.full((7, 3), value) * (1 + 1e-15 * np.arange(7)[:, None]), bound=value)
    assert (rounded.p_above, rounded.p_below) == (1.0, 1.0)


def test_groups_without_scatter_that_differ_are_told_apart():
    found = compare_groups(np.full((7, 3), 0.1), np.full((11, 3), 0.1 - 1e-6))
    assert verdict(found.p_above, found.p_below, objects=7, least_objects=6) == HOLDS


def test_a_bound_below_zero_is_a_margin():
    """Worse by .002 of a scatter of .001, with a margin of .01: no worse than the margin, and worse than zero."""
    differences = -0.002 + 0.001 * np.random.default_rng(0).standard_normal(12)
    assert compare(differences, bound=-0.01).p_above < 1e-3 < 0.99 < compare(differences).p_above


def test_the_best_of_all_choices_has_the_permutations_least_p_value():
    """Two of five objects gain, and both are taken: one of C(5, 2) = 10 choices does as well."""
    gains = np.array([1.0, 1.0, 0.0, 0.0, 0.0])
    assert permutation_p(gains, np.array([1, 1, 0, 0, 0])) == pytest.approx(0.1, abs=0.02)
    assert permutation_p(gains, np.array([0, 0, 1, 1, 0])) == 1.0


def test_the_same_choice_for_all_objects_is_no_choice():
    assert permutation_p(np.array([1.0, 0.0, 2.0]), np.ones(3)) == 1.0


def test_the_stated_power_is_how_often_the_effect_is_found():
    """Effect over spread 1, 12 objects, one seed without spread, at 5 %: .94; of 150 simulated tables within .05 with 99 %."""
    rng = np.random.default_rng(2)
    found = [compare(0.1 + 0.1 * rng.standard_normal(12), draws=500, seed=k).p_above < 0.05 for k in range(150)]
    stated = power(0.1, objects=12, seeds=1, object_sd=0.1, seed_sd=0.0, level=0.05)
    assert np.mean(found) == pytest.approx(stated, abs=0.06)


def test_without_an_effect_the_power_is_the_level():
    assert power(0.0, objects=12, seeds=5, object_sd=0.1, seed_sd=0.02, level=0.05) == pytest.approx(0.05)


def test_without_any_spread_an_effect_is_found_for_certain():
    assert [power(effect, objects=8, seeds=3, object_sd=0.0, seed_sd=0.0, level=0.025) for effect in (0.5, 0.0, -0.5)] == [1, 0, 0]


def test_two_groups_have_the_power_of_students_test_of_two_samples():
    """Effect 0.1, spread 0.1, 12 and 12, one side at 5 %: noncentral t with 22 degrees of freedom."""
    expected = stats.nct.sf(stats.t.isf(0.05, 22), 22, 0.1 / (0.1 * np.sqrt(2 / 12)))
    assert power(0.1, objects=(12, 12), seeds=1, object_sd=0.1, seed_sd=0.0, level=0.05) == pytest.approx(expected, abs=1e-3)


def test_a_spread_between_seeds_limits_the_power_of_any_number_of_objects():
    many, few = (power(0.02, objects=count, seeds=3, object_sd=0.1, seed_sd=0.05, level=0.05) for count in (10**6, 100))
    certain = power(0.02, objects=10**6, seeds=3, object_sd=0.1, seed_sd=0.0, level=0.05)
    assert few < 0.15 and many < 0.15 and certain == pytest.approx(1.0)
