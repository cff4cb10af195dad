"""Crushed frusta are foretold before a press by the hyperelastic model begins."""

import warnings

import numpy as np
import pytest
import trimesh
from foundation_study import SMALL
from support.bodies import COARSE
from support.laws import LAWS

from softtact.errors import CrushedWarning, TimeLimitError
from softtact.press.crushing import crushing_forces_n
from softtact.press.sensor import Sensor


@pytest.fixture
def sensor(compliance):
    return Sensor(SMALL, LAWS, mesh=COARSE, prepared_models={"foundation": compliance})


@pytest.fixture
def ball():
    ball = trimesh.creation.icosphere(subdivisions=3, radius=1.5)
    return ball.apply_translation([0.0, 0.0, -ball.bounds[0, 2]])


def test_the_forces_are_those_at_which_the_map_is_as_deep_as_six_and_eight_fifths_of_a_frustum(sensor, ball):
    forces = crushing_forces_n(sensor, ball, 12.0)
    maps = sensor.press(ball, pose=np.eye(4), force_n=forces, model="foundation", label="").deformation_map_mm
    assert maps.max(axis=(1, 2)) / SMALL.frustum_height_mm == pytest.approx([1.2, 1.6], rel=0.01)      # of the interpolation


def test_no_force_is_told_above_the_largest_one(sensor, ball):
    may, will = crushing_forces_n(sensor, ball, 12.0)
    assert np.isinf(crushing_forces_n(sensor, ball, 0.9 * may)).all()
    between = crushing_forces_n(sensor, ball, 0.5 * (may + will))
    assert between[0] == pytest.approx(may, rel=0.02) and np.isinf(between[1])


def test_nothing_else_is_told_that_the_press_itself_will_tell(sensor):
    """At 20 N the wall, longer than the pad, rests on the shell."""
    wall = trimesh.creation.box((2.0, 20.0, 4.0)).apply_translation([0.0, 0.0, 2.0])
    with warnings.catch_warnings(action="error"):
        assert np.isfinite(crushing_forces_n(sensor, wall, 20.0)).all()


def test_a_press_that_will_crush_frusta_is_told_before_its_first_load_step(sensor, ball):
    told = r"crushed, by more than 80% of their height, from 4\.\d N on, and surely from 6\.\d N on"
    with pytest.warns(CrushedWarning, match=told), pytest.raises(TimeLimitError):
        sensor.press(ball, pose=np.eye(4), force_n=[1.0, 12.0], model="hyperelastic", label="", time_limit_s=0.0)


@pytest.mark.parametrize("prepared, force_n", [(True, 1.0), (False, 12.0)])
def test_light_presses_and_sensors_without_the_foundation_model_are_not_warned_of(sensor, ball, monkeypatch, prepared, force_n):
    if not prepared:
        sensor.prepared_models.clear()
        monkeypatch.setattr("softtact.press.sensor.seconds_to_prepare_foundation", lambda spec, laws: 30.0)
    with warnings.catch_warnings(action="error"), pytest.raises(TimeLimitError):
        sensor.press(ball, pose=np.eye(4), force_n=[force_n], model="hyperelastic", label="", time_limit_s=0.0)
