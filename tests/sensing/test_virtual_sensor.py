"""Capacitance and the virtual sensor against closed forms."""

from pathlib import Path

import numpy as np
import pytest

from softtact.geometry.sensor_spec import SensorSpec
from softtact.sensing.capacitance import (
    EPSILON_0_PF_PER_MM,
    capacitance_per_area,
    ideal_counts,
    layer_heights,
    taxel_means,
)
from softtact.sensing.virtual_sensor import VirtualSensorSettings, lagged, read_virtual_sensor

SPEC = SensorSpec.from_yaml(Path(__file__).parents[2] / "config/sensors/coro.yaml")
FAULTLESS = VirtualSensorSettings(relaxation=0, gain_scatter=0, offset_counts=0, drift=0, noise_counts=0, step_counts=1e-9)


def test_at_rest_the_capacitance_is_that_of_two_plates_in_series():
    air, solid = layer_heights(SPEC)
    assert air + solid == pytest.approx(SPEC.dielectric_thickness_mm)
    expected = 1 / (air / EPSILON_0_PF_PER_MM + solid / (EPSILON_0_PF_PER_MM * SPEC.dielectric.relative_permittivity))
    assert capacitance_per_area(SPEC, 0.0) == pytest.approx(expected)


def test_taxels_average_a_linear_field_exactly():
    x, y = np.meshgrid(SPEC.map_x_mm, SPEC.map_y_mm)
    means = taxel_means(SPEC, 2 * x + 3 * y)
    centres = [(np.arange(n) + 0.5) / n * side - side / 2 for n, side in ((4, 22.0), (7, 37.0))]
    assert means == pytest.approx(2 * centres[0][None] + 3 * centres[1][:, None], abs=1e-9)


def test_a_step_relaxes_exponentially():
    response = lagged(np.ones((5, 1, 1)), share=0.2, time_constant_s=2.0, step_s=1.0)
    assert response[:, 0, 0] == pytest.approx(1 - 0.2 * np.exp(-np.arange(5) / 2.0))


def test_with_every_effect_off_it_reads_the_ideal_counts():
    maps = np.random.default_rng(0).uniform(0, 0.3, (3, 57, 33))
    counts = read_virtual_sensor(SPEC, maps, trials=2, seed=1, item="a", settings=FAULTLESS)
    assert counts[0] == pytest.approx(ideal_counts(SPEC, maps), abs=1e-6) and (counts[0] == counts[1]).all()


def test_trials_scatter_and_a_seed_repeats_them():
    maps = np.full((2, 57, 33), 0.2)
    first, again, other = (read_virtual_sensor(SPEC, maps, trials=2, seed=s, item="a") for s in (1, 1, 2))
    assert (first == again).all() and (first != other).any() and (first[0] != first[1]).any()
