"""What is foretold before a press by the hyperelastic model begins: crushed frusta, and a touch of the border alone."""

import warnings

import numpy as np
import pytest
import trimesh
from foundation_study import SMALL
from support.bodies import COARSE
from support.laws import LAWS

from softtact.errors import CrushedWarning, ShellWarning, TimeLimitError
from softtact.press.foretelling import foretell
from softtact.press.sensor import Sensor


@pytest.fixture
def sensor(compliance):
    return Sensor(SMALL, LAWS, mesh=COARSE, prepared_models={"foundation": compliance})


def crushing_forces_n(sensor, placed, largest_n):
    told = foretell(sensor, placed, largest_n)
    return told.may_crush_n, told.will_crush_n


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


def beside(sensor, within_mm):
    """A block beside the pad, upright, which overlaps it by `within_mm`."""
    block = trimesh.creation.box((4.0, 3.0, 4.0))
    return block.apply_translation([0.5 * sensor.spec.footprint_mm[0] - within_mm + 2.0, 0.0, 2.0])


def test_an_object_on_the_shell_that_touches_the_border_alone_is_told_with_the_number_of_frusta_it_moves(sensor):
    block = beside(sensor, 0.2)
    told = foretell(sensor, block, 10.0)
    result = sensor.press(block, pose=np.eye(4), force_n=10.0, model="foundation", label="")
    node = np.diff(sensor.spec.map_x_mm)[0] * np.diff(sensor.spec.map_y_mm)[0]
    moved = (result.deformation_map_mm[0] >= 0.1 * sensor.spec.frustum_height_mm).sum() * node
    pitch = np.divide(sensor.spec.footprint_mm, sensor.spec.frusta_counts)
    assert result.shell_force_n[0] > 0 and 0 < told.grazed_frusta < 6
    assert told.grazed_frusta == pytest.approx(moved / pitch.prod(), rel=1e-12)
    assert told.may_crush_n == told.will_crush_n == np.inf


def test_an_object_on_the_shell_that_presses_many_frusta_or_one_that_the_pad_carries_does_not_graze(sensor, ball):
    assert foretell(sensor, beside(sensor, 3.0), 20.0).grazed_frusta is None
    assert foretell(sensor, ball, 0.2).grazed_frusta is None


def test_an_object_that_the_shell_alone_carries_does_not_graze(sensor):
    roof = trimesh.creation.box((4.0, 4.0, 1.0)).apply_translation([0.0, 0.0, 3.5])
    assert foretell(sensor, trimesh.util.concatenate([beside(sensor, -0.6), roof]), 10.0).grazed_frusta is None


def test_a_press_of_the_border_alone_is_told_before_its_first_load_step(sensor):
    told = r"rest on the shell and presses the sensor at its border only, on about \d frusta"
    with pytest.warns(ShellWarning, match=told), pytest.raises(TimeLimitError):
        sensor.press(beside(sensor, 0.2), pose=np.eye(4), force_n=10.0, model="hyperelastic", label="", time_limit_s=0.0)
