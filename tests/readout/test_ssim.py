"""Structural similarity of tactile maps."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.readout.ssim import leave_one_out_ssim, map_ssim, mean_absolute_counts, whole_map_ssim

CHOICES = {"window": 3, "data_range": 2400}


@pytest.fixture
def maps():
    return np.random.default_rng(0).uniform(0, 2400, (5, 7, 4))


def test_identical_maps_score_one(maps):
    assert map_ssim(maps, maps.copy(), **CHOICES) == pytest.approx(np.ones(5))


def test_a_shuffled_map_scores_lower(maps):
    shuffled = np.random.default_rng(1).permutation(maps.reshape(5, 28), axis=1).reshape(maps.shape)
    assert (map_ssim(shuffled, maps, **CHOICES) < 0.5).all()


def test_more_noise_scores_lower(maps):
    noise = np.random.default_rng(1).normal(0, 1, maps.shape)
    scores = [map_ssim(maps + sd * noise, maps, **CHOICES).mean() for sd in (0, 50, 200, 800)]
    assert scores == sorted(scores, reverse=True) and scores[-1] < 0.8


def test_the_score_is_the_formulas_mean_over_the_inner_windows(maps):
    a, b = maps[0], maps[1]
    c1, c2 = (0.01 * 2400) ** 2, (0.03 * 2400) ** 2
    by_hand = []
    for row in range(1, 6):
        for column in range(1, 3):
            p, q = (m[row - 1:row + 2, column - 1:column + 2].ravel() for m in (a, b))
            covariance = np.cov(p, q)  # with n - 1, as scikit-image's sample covariance
            by_hand.append((2 * p.mean() * q.mean() + c1) * (2 * covariance[0, 1] + c2)
                           / ((p.mean() ** 2 + q.mean() ** 2 + c1) * (covariance[0, 0] + covariance[1, 1] + c2)))
    assert map_ssim(maps[:1], maps[1:2], **CHOICES)[0] == pytest.approx(np.mean(by_hand), rel=1e-9)


def test_the_data_range_decides_how_much_a_small_difference_weighs(maps):
    faint = maps / 200  # up to 12 counts
    noisy = faint + np.random.default_rng(1).normal(0, 3, maps.shape)
    wide, narrow = (map_ssim(noisy, faint, window=3, data_range=r).mean() for r in (2400, 12))
    assert wide > 0.99 > 0.9 > narrow


def test_maps_that_cannot_be_compared_are_refused(maps):
    for window, shape, sentence in [
        (5, (2, 7, 4), "ssim.window is 5; it must fit on the 4 taxels"),
        (3, (3, 7, 4), "give maps alike"),
    ]:
        with pytest.raises(InputError, match=sentence):
            map_ssim(np.zeros(shape), maps[:2], window=window, data_range=2400)


def test_mean_absolute_counts_of_a_hand_made_case():
    measured = np.zeros((1, 7, 4))
    predicted = measured.copy()
    predicted[0, 0, 0], predicted[0, 1, 1] = 14, -14
    assert mean_absolute_counts(predicted, measured) == pytest.approx([1.0])


def test_trials_that_repeat_exactly_have_a_ceiling_of_one(maps):
    assert leave_one_out_ssim(np.repeat(maps[:1], 4, axis=0), **CHOICES) == pytest.approx(np.ones(4))


def test_each_trial_is_held_against_the_mean_of_the_others(maps):
    trials = maps[:3]
    expected = map_ssim(trials[1:].mean(axis=0, keepdims=True), trials[:1], **CHOICES)
    assert leave_one_out_ssim(trials, **CHOICES)[0] == pytest.approx(expected[0])


def test_one_window_over_the_whole_map_is_the_formula_on_all_taxels(maps):
    a, b = maps[0].ravel(), maps[1].ravel()
    c1, c2, covariance = (0.01 * 2400) ** 2, (0.03 * 2400) ** 2, np.cov(maps[0].ravel(), maps[1].ravel())
    by_hand = (2 * a.mean() * b.mean() + c1) * (2 * covariance[0, 1] + c2) / (
        (a.mean() ** 2 + b.mean() ** 2 + c1) * (covariance[0, 0] + covariance[1, 1] + c2))
    assert whole_map_ssim(maps[:1], maps[1:2], data_range=2400) == pytest.approx([by_hand])
