"""The learning curve of benchmarks/foundation_curve.py: who is tested on what, and what its error is."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from softtact.learning.dataset import Samples, object_of


@pytest.fixture(scope="module")
def benchmark():
    sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
    import foundation_curve

    yield foundation_curve
    sys.path.pop(0)


def test_no_object_is_in_two_roles_and_both_models_have_the_same_samples(benchmark, monkeypatch, tmp_path):
    monkeypatch.chdir(Path(__file__).parents[2])
    part = {"force_n": np.array([5.0]), "counts": np.ones((1, 7, 4)), "foundation": np.zeros((1, 57, 33)),
            "elastic": np.ones((1, 57, 33))}
    monkeypatch.setattr(benchmark, "pressed", lambda sensor, mesh, pose: part)
    found = benchmark.all_samples(tmp_path, 1)
    objects = {role: {object_of(item) for item in samples.labels["item"]} for role, samples in found["elastic"].items()}
    assert sum(map(len, objects.values())) == len(set.union(*objects.values())) == len(list(tmp_path.iterdir()))
    assert len(objects["train"]) == 40 and len(objects["validation"]) == 9 and len(objects["test"]) >= 10
    for role in objects:
        pd.testing.assert_frame_equal(found["elastic"][role].labels, found["foundation"][role].labels)


def test_the_error_is_that_over_the_mean_reading_of_each_object(benchmark):
    """Half of each reading errs by a half, whatever an object reads and however many load steps it has."""
    counts = np.random.default_rng(1).uniform(1, 100, (5, 7, 4)) * np.array([1, 1, 1, 9, 9])[:, None, None]
    labels = pd.DataFrame({"item": ["a-0", "a-1", "a-1", "b-0", "b-0"]})
    samples = Samples(np.zeros((5, 57, 33)), counts, labels, "elastic", "test", "made")
    assert benchmark.error_of(0.5 * counts, samples) == {"error": 0.5, "sd_of_objects": 0.0, "objects": 2}
    off = np.array([1.0, 1.0, 1.0, 0.8, 0.8])[:, None, None]
    assert benchmark.error_of(off * counts, samples)["error"] == pytest.approx(0.1)
