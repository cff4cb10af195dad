"""The rule by which claims on objects are decided: few objects or an interval that holds the limit leave them undecided."""

import numpy as np
import pytest

from softtact.evaluation.decisions import (
    LEAST_OBJECTS,
    Estimate,
    above,
    all_of,
    below,
    difference_of_groups,
    inside,
    interval_inside,
    mean_over_objects,
    share_of_objects,
    wider_spread,
)

SIX = np.array([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])


def test_six_objects_are_the_fewest_whose_signs_alone_can_reach_five_per_cent():
    assert LEAST_OBJECTS == 6
    assert 2 / 2**LEAST_OBJECTS < 0.05 < 2 / 2 ** (LEAST_OBJECTS - 1)


def test_a_mean_has_students_interval():
    """Mean 3.5, variance 3.5, t of 5 freedoms at 97.5 % 2.5706 (a table): half width 2.5706 (3.5 / 6)^(1/2) = 1.9633."""
    found = mean_over_objects(SIX)
    assert (found.mean, found.objects) == (3.5, 6)
    assert (found.low, found.high) == pytest.approx((3.5 - 1.9633, 3.5 + 1.9633), abs=1e-3)


@pytest.mark.parametrize(("limit", "verdict"), [(1.5, "reproduced"), (1.6, "undecided"), (5.4, "undecided"),
                                                (5.5, "not reproduced")])  # fmt: skip
def test_an_interval_that_holds_the_limit_is_undecided_and_one_clear_of_it_decides(limit, verdict):
    assert above(mean_over_objects(SIX), limit) == verdict
    assert below(mean_over_objects(-SIX), -limit) == verdict


@pytest.mark.parametrize("values", [SIX[:5] + 100, np.full(5, 100.0), [100.0], []])
def test_fewer_than_six_objects_decide_nothing_however_far_the_limit_is(values):
    estimate = mean_over_objects(values)
    assert above(estimate, 0.0) == below(estimate, 0.0) == inside(estimate, -1e9, 1e9) == "undecided"


def test_objects_without_a_value_do_not_count():
    assert mean_over_objects([*SIX[:5], np.nan]).objects == 5


@pytest.mark.parametrize(("limits", "verdict"), [((1.0, 6.0), "reproduced"), ((2.0, 6.0), "undecided"), ((3.4, 3.6), "undecided"),
                                                 ((6.0, 9.0), "not reproduced"), ((-9.0, 1.0), "not reproduced")])  # fmt: skip
def test_alike_needs_the_whole_interval_between_the_limits(limits, verdict):
    assert inside(mean_over_objects(SIX), *limits) == verdict


def test_an_interval_that_is_not_known_decides_nothing():
    assert interval_inside((np.nan, np.nan), -1.0, 1.0) == "undecided"


def test_two_groups_are_compared_by_welch_and_count_as_many_as_the_smaller_one():
    """Groups of variance 3.5 and the same size: standard error (2 x 3.5 / 6)^(1/2) = 1.080, t of 10 freedoms 2.228: half 2.406."""
    found = difference_of_groups(SIX + 3, SIX)
    assert (found.low, found.high) == pytest.approx((3 - 2.4065, 3 + 2.4065), abs=1e-3)
    assert above(found, 0.0) == "reproduced"
    few = difference_of_groups(SIX + 30, SIX[:5])
    assert few.objects == 5 and above(few, 0.0) == "undecided"


def test_groups_without_scatter_differ_by_their_means():
    found = difference_of_groups(np.full(6, 2.0), np.full(7, 1.0))
    assert (found.low, found.high) == (1.0, 1.0) and above(found, 0.0) == "reproduced"


def test_a_share_has_the_exact_interval():
    """All of 6: the lower end solves p^6 = 0.025."""
    found = share_of_objects(6, 6)
    assert (found.low, found.high) == pytest.approx((0.025 ** (1 / 6), 1.0))
    assert above(found, 0.5) == "reproduced" and above(share_of_objects(5, 6), 0.5) == "undecided"
    assert above(share_of_objects(0, 6), 0.5) == "not reproduced" and above(share_of_objects(0, 0), 0.5) == "undecided"


def test_scatters_of_the_same_objects_are_compared_by_sum_and_difference():
    other = np.array([3.0, 3.1, 2.9, 3.05, 2.95, 3.0])
    assert above(wider_spread(SIX, other), 0.0) == "reproduced" and above(wider_spread(other, SIX), 0.0) == "not reproduced"
    assert above(wider_spread(SIX, SIX[[1, 0, 3, 2, 5, 4]]), 0.0) == "undecided"
    assert above(wider_spread(SIX[:5], other[:5]), 0.0) == "undecided"


def test_a_claim_of_several_parts_fails_with_one_of_them_and_is_open_with_an_open_one():
    assert all_of(["reproduced", "undecided", "not reproduced"]) == "not reproduced"
    assert all_of(["reproduced", "undecided"]) == all_of([]) == "undecided"
    assert all_of(["reproduced", "reproduced"]) == "reproduced"


def test_the_words_name_interval_and_objects():
    assert Estimate(0.1, -0.2, 0.4, 7).in_words() == "95 % interval -0.200 to +0.400 over 7 objects"
    assert mean_over_objects([1.0]).in_words() == "1 object: no interval"
