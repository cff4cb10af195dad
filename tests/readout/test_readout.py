"""Gain, zero, drift and the converter."""

import numpy as np
import pytest

from softtact.readout import registry
from softtact.readout.registry import Readings, Unlabelled, labelled, register
from softtact.readout.virtual_sensor import amplified, converted, random_walk


def test_gain_zero_and_their_drift_are_each_taxels_own():
    gain, offset = np.array([[1.1, 0.9]]), np.array([[3.0, -2.0]])
    assert amplified(np.array([[100.0, 100.0]]), gain=gain, offset=offset) == pytest.approx(np.array([[113.0, 88.0]]))
    drifted = amplified(100.0, gain=1.0, offset=0.0, gain_drift=np.array([0.1, -0.1]), offset_drift=np.array([1.0, 2.0]))
    assert drifted == pytest.approx([111.0, 92.0])


def test_drift_starts_at_nothing_and_spreads_with_the_root_of_the_trials():
    walk = random_walk(np.random.default_rng(0).standard_normal((26, 4000)), 0.02)
    assert (walk[0] == 0).all() and walk[25].std() == pytest.approx(0.02 * 5, rel=0.05)      # 4000 walks: 1.1 % standard error
    assert (random_walk(np.ones((3, 2)), 0.0) == 0).all()


def test_the_converter_rounds_to_its_steps_within_its_range():
    counts = np.array([-5.0, 10.4, 11.1, 2399.0, 5000.0])
    assert converted(counts, step=2.0, largest=2400.0).tolist() == [0, 10, 12, 2400, 2400]


def test_rounding_errs_by_a_step_over_the_root_of_twelve():
    values = np.random.default_rng(0).uniform(100, 1000, 100_000)
    assert np.std(converted(values, step=4.0) - values) == pytest.approx(4 / np.sqrt(12), rel=0.01)


def test_without_a_step_and_a_limit_the_converter_gives_what_it_gets():
    values = np.array([0.0, 0.123, 1e6])
    assert (converted(values, step=0.0, largest=np.inf) == values).all()


def test_a_dead_taxel_reads_zero_whatever_the_noise():
    assert converted(np.array([500.0, 500.0]), noise=np.array([3.0, 3.0]), dead=np.array([True, False])).tolist() == [0, 503]


def test_a_users_readout_stays_when_the_packages_own_of_its_kind_is_loaded_later(monkeypatch):
    monkeypatch.setattr(registry, "_KINDS", {})
    mine, again = (register("depth")(type("Mine", (), {"__module__": "mine"})) for _ in range(2))
    register("depth")(type("Own", (), {"__module__": "softtact.readout.depth"}))
    assert registry._KINDS["depth"] is again is not mine


def test_counts_get_their_labels_when_they_are_asked_for():
    counts = np.arange(6.0).reshape(1, 2, 3)
    readings = Readings(taxels=Unlabelled(counts, ("step", "row", "column"), "counts"), depth=labelled(np.ones(1), ("step",)))
    assert readings.array("taxels") is counts and isinstance(readings.data["taxels"], Unlabelled)
    assert list(readings) == ["taxels", "depth"] and "taxels" in readings and "none" not in readings
    asked = readings["taxels"]
    assert asked.dims == ("step", "row", "column") and asked.attrs == {"units": "counts"} and readings["taxels"] is asked
    assert readings.array("taxels").tolist() == counts.tolist()
