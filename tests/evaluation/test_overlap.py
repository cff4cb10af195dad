"""Overlap of contact patches, on patches drawn by hand."""

import numpy as np
import pytest

from softtact.evaluation.scoring import contact_patch_overlap


def patch(rows, columns, *, counts=1000.0):
    """A map (1, 7, 4) with one rectangle pressed."""
    values = np.zeros((1, 7, 4))
    values[0, slice(*rows), slice(*columns)] = counts
    return values


def test_the_overlap_is_intersection_over_union():
    for predicted, expected in [
        (patch((0, 3), (0, 2)), 1.0),
        (patch((0, 3), (1, 3)), 3 / 9),                 # one of two columns shared
        (patch((0, 6), (0, 2)), 6 / 12),                # twice the patch
        (patch((4, 7), (2, 4)), 0.0),
        (patch((0, 3), (0, 2), counts=120.0), 1.0),     # fainter, but above a tenth of the reading
        (patch((0, 3), (0, 2), counts=80.0), 0.0),      # too faint to count as touched
    ]:
        assert contact_patch_overlap(predicted, patch((0, 3), (0, 2))) == pytest.approx([expected]), predicted


def test_noise_below_the_floor_is_no_patch_and_two_empty_patches_agree():
    quiet = np.random.default_rng(0).uniform(-20, 20, (2, 7, 4))
    assert contact_patch_overlap(quiet[:1], quiet[1:]) == [1.0]
    assert contact_patch_overlap(patch((0, 1), (0, 1)), quiet[:1]) == [0.0]


def test_each_map_has_its_own_threshold():
    measured = np.concatenate([patch((0, 3), (0, 2), counts=2000.0), patch((0, 3), (0, 2), counts=400.0)])
    faint = np.repeat(patch((0, 3), (0, 2), counts=100.0), 2, axis=0)
    assert contact_patch_overlap(faint, measured).tolist() == [0.0, 1.0]
