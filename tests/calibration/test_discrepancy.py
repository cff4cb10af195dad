"""The error of a calibration's model: its size comes back from misfits, and it widens what the fit states."""

from dataclasses import replace

import numpy as np
import pytest
from support.calibration import BALL, PLATE, Bench

from softtact.calibration.discrepancy import _most_likely
from softtact.calibration.fit import calibrate
from softtact.calibration.problem import Problem


@pytest.mark.parametrize("size", [0.01, 0.05, 0.2])
def test_the_size_of_a_models_error_comes_back_from_misfits(size):
    """500 terms, each 100 times the noise for an error of 1: the prior of a factor of two hardly counts."""
    rng = np.random.default_rng(3)
    model, known = 100.0 * np.eye(500), np.zeros((500, 1))
    values = model @ (size * rng.standard_normal(500)) + rng.standard_normal(500)
    assert _most_likely(values, known, model, 0.06) == pytest.approx(size, rel=0.1)


def test_what_the_unknowns_absorb_of_the_error_is_not_taken_for_its_absence():
    """One unknown that moves all readings alike takes the mean away; what is left of 50 readings still shows the size."""
    rng = np.random.default_rng(4)
    values = 10.0 * rng.standard_normal(50) + rng.standard_normal(50)
    absorbed = values - values.mean()
    assert _most_likely(absorbed, 1e3 * np.ones((50, 1)), 100.0 * np.eye(50), 0.06) == pytest.approx(0.1, rel=0.3)


def test_readings_that_contradict_the_model_widen_the_intervals_of_gains(bench):
    """The ball's counts 30 % higher than any gain explains that the plate allows."""
    exact = Bench(bench.presses, replace(bench.hidden, relaxation=(), relaxation_s=(), modulus_scale=1.0))
    experiments = [exact.experiment(PLATE, (0, 0, 0), seed=0), exact.experiment(BALL, (1.0, 1.2, 0), seed=1)]
    wrong = [experiments[0], replace(experiments[1], counts=1.3 * experiments[1].counts)]
    true, other = (calibrate(Problem(bench.presses, each, ()), label="") for each in (experiments, wrong))
    assert other.model_error > 2 * true.model_error
    assert (other.gain_deviation > 1.5 * true.gain_deviation).all()
