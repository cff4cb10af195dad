"""Scores against the number of training maps, on dents made by a formula."""

import numpy as np
import pandas as pd
import pytest
from formula_study import make_samples

from softtact.evaluation.retraining import SIZES_COLUMNS, Experiment, learning_curve
from softtact.learning.settings import Training
from softtact.learning.training import prepare_torch

SIZES = (4, 16, 64)


def curve():
    unseen = make_samples(16, first=1000, split="unseen")
    validation = make_samples(8, first=500, split="validation")
    experiment = Experiment(make_samples(64), {"validation": validation, "unseen": unseen},
                            network={"architecture": "compact", "filters": (4, 8, 16)},
                            options=Training(batch=8, learning_rate=3e-3),
                            ssim={"window": 3, "data_range": 2400}, device=prepare_torch(threads=1))
    return learning_curve(experiment, sizes=SIZES, steps=48, seed=1)


@pytest.fixture(scope="module")
def found():
    return curve()


def test_more_maps_read_unseen_dents_better_in_equal_steps(found):
    unseen = found[found["set"] == "unseen"]
    assert unseen.maps.tolist() == [4, 16, 64] and unseen.epochs.tolist() == [48, 24, 6]
    assert unseen.ssim.iloc[-1] > unseen.ssim.iloc[0] + 0.02
    assert unseen.mae_counts.iloc[-1] < 0.8 * unseen.mae_counts.iloc[0]


def test_a_row_per_size_and_set_the_same_again(found):
    assert found.columns.tolist() == SIZES_COLUMNS and len(found) == 6
    pd.testing.assert_frame_equal(found, curve(), check_exact=True)


def test_each_subset_holds_the_smaller_one():
    train = make_samples(64)
    parts = [{image.tobytes() for image in train.subset(size, seed=1).maps_mm} for size in SIZES]
    assert all(small < large for small, large in zip(parts, parts[1:], strict=False))
    assert [len(part) for part in parts] == list(SIZES) and np.isfinite(train.maps_mm).all()
