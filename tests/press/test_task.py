"""What a press is asked for: without a step, and without a number."""

import pytest
import trimesh

import softtact
from softtact.contact.motion import Motion, MotionStep
from softtact.errors import InputError


@pytest.fixture(scope="module")
def sensor():
    return softtact.load_sensor("sheet")


def refusal(sensor, **asked):
    with pytest.raises(InputError) as caught:
        sensor.press(trimesh.creation.icosphere(subdivisions=1, radius=5.0), label="", **asked)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("model", ["elastic", "hyperelastic", "solid", "auto"])
def test_no_forces_and_a_motion_without_steps_are_refused_by_every_model(sensor, model):
    assert "force_n is empty; give at least one number" in refusal(sensor, force_n=[], model=model)
    assert "The motion of a press has no step; give at least one" in refusal(sensor, motion=Motion(), model=model)


def test_forces_and_motions_of_another_kind_are_refused(sensor):
    assert refusal(sensor, force_n="5 N") == "force_n='5 N' is no number; give a finite one."
    assert "force_n=[1, 2] is no number" in refusal(sensor, force_n=[[1, 2]])
    assert "is no motion; give a Motion, or its text" in refusal(sensor, motion=MotionStep(ways={"z": -0.1}))
