"""Scores of marker images on cases that are known by hand."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.evaluation.image_scores import (
    degenerate,
    image_scores,
    marker_sum_change_px,
    motion_error_px,
    outside_markers,
    position_error_px,
    similarity,
)


def test_d_is_the_sum_of_distances_over_markers():
    real = np.array([[10.0, 10.0], [20.0, 10.0]])
    assert position_error_px(real + [[3, 4], [0, 2]], real) == pytest.approx(5 + 2)


def test_d_of_a_lost_marker_is_unknown_and_the_image_is_degenerate():
    made = np.array([[[1.0, 1.0], [2.0, 2.0]], [[1.0, 1.0], [np.nan, 2.0]]])
    assert np.isnan(position_error_px(made, made)).tolist() == [False, True]
    assert degenerate(made).tolist() == [False, True]


def test_the_error_of_motions_forgives_an_image_at_rest_that_is_shifted():
    rest = np.array([[10.0, 10.0], [20.0, 10.0]])
    moved, shift = rest + [1.0, 0.0], np.array([0.5, 0.5])
    assert motion_error_px(moved + shift, moved, made_at_rest=rest + shift, real_at_rest=rest) == pytest.approx(0)
    assert position_error_px(moved + shift, moved) == pytest.approx(2 * np.hypot(0.5, 0.5))


def test_pixels_of_either_images_markers_are_left_out():
    far = outside_markers((9, 9), np.array([[2.0, 2.0]]), np.array([[6.0, 6.0], [np.nan, 1.0]]), radius_px=1.0)
    assert 81 - far.sum() == 2 * 5     # a cross of five pixels around each known marker
    assert not far[2, 3] and not far[6, 5]


def test_a_constant_difference_has_its_mae_mse_and_psnr():
    real = np.full((16, 16, 3), 100.0)
    scores = image_scores(real + 10, real, counted=np.ones((16, 16), dtype=bool))
    assert (scores.mae, scores.mse) == (10, 100)
    assert scores.psnr == pytest.approx(10 * np.log10(255**2 / 100))
    constant = (2 * 100 * 110 + 2.55**2) / (100**2 + 110**2 + 2.55**2)     # of flat images only the term of the means is left
    assert scores.ssim == pytest.approx(constant)


def test_equal_images_are_alike_and_noise_is_not():
    image = np.random.default_rng(0).uniform(0, 255, (24, 24, 3))
    everywhere = np.ones((24, 24), dtype=bool)
    assert image_scores(image, image, counted=everywhere).ssim == pytest.approx(1)
    assert image_scores(image, image, counted=everywhere).psnr == np.inf
    assert abs(image_scores(image, image[::-1], counted=everywhere).ssim) < 0.2


def test_similarity_agrees_with_the_formula_written_out_at_one_pixel():
    rng = np.random.default_rng(1)
    one, other = rng.uniform(0, 255, (2, 15, 15, 1))
    y, x = np.mgrid[-5:6, -5:6]
    weight = np.exp(-(x**2 + y**2) / (2 * 1.5**2))
    weight /= weight.sum()
    a, b = one[2:13, 2:13, 0], other[2:13, 2:13, 0]
    ma, mb = (weight * a).sum(), (weight * b).sum()
    va, vb, ab = (weight * a * a).sum() - ma**2, (weight * b * b).sum() - mb**2, (weight * a * b).sum() - ma * mb
    expected = (2 * ma * mb + 2.55**2) * (2 * ab + 7.65**2) / ((ma**2 + mb**2 + 2.55**2) * (va + vb + 7.65**2))
    assert similarity(one, other)[7, 7, 0] == pytest.approx(expected)


def test_pixels_outside_the_markers_alone_count():
    real = np.zeros((8, 8, 3))
    made = real.copy()
    made[4, 4] = 200
    counted = outside_markers((8, 8), np.array([[4.0, 4.0]]), radius_px=1.0)
    assert image_scores(made, real, counted=counted).mae == 0


def test_a_sliding_object_changes_the_sum_of_the_motions():
    before = np.zeros((64, 2))
    assert marker_sum_change_px(before, before + [0.3, 0.4]) == pytest.approx(64 * 0.5)


def test_images_of_other_sizes_are_refused():
    with pytest.raises(InputError, match=r"cannot be compared; give as many markers"):
        position_error_px(np.zeros((3, 2)), np.zeros((4, 2)))
    with pytest.raises(InputError, match="no pixel lies outside the markers"):
        image_scores(np.zeros((4, 4, 3)), np.zeros((4, 4, 3)), counted=np.zeros((4, 4), dtype=bool))
