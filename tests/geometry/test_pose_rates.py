"""A pose's six numbers: the velocities of an object's points by each, and numbers that are no pose."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.geometry.pose import Pose

POINTS = np.array([[1.0, -2.0, 3.0], [0.5, 4.0, -1.0]])


@pytest.mark.parametrize("angles", [(10, 20, 30), (-170, 60, 100), (20, 120, 60), (0, -135, 0), (30, 90, 62), (5, -90, -40)])
def test_the_velocities_are_those_by_the_angles_that_were_given(angles):
    """An ry beyond 90 degrees, too: the same rotation has another ry within, by which the object turns the other way."""
    six, step = np.array([0.3, -0.2, 1.0, *angles]), 1e-6
    rates = Pose.from_values(six).rates(Pose.from_values(six).apply(POINTS))
    for number, aside in enumerate(step * np.eye(6)):
        upper, lower = (Pose.from_values(six + sign * aside).apply(POINTS) for sign in (1, -1))
        np.testing.assert_allclose(rates[number], (upper - lower) / (2 * step), atol=1e-7)


def test_a_matrix_has_the_velocities_of_its_angles_within_90_degrees():
    pose, matrix = Pose.from_values([0.3, -0.2, 1.0, 10, 20, 30]), np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = pose.rotation.as_matrix(), pose.translation_mm
    np.testing.assert_allclose(Pose.of(matrix).rates(POINTS), pose.rates(POINTS), atol=1e-12)


MOVED = np.eye(4)
MOVED[0, 3] = np.nan


@pytest.mark.parametrize(("value", "sentence"), [
    ("abc", "The pose 'abc' is not six numbers"), ([0, 0, "x", 0, 0, 0], "is not six numbers"), ({}, "is not six numbers"),
    ([[0, 0], [0]], "is not six numbers"), (MOVED, "is no rigid motion"), (5, "is not six finite numbers")])
def test_what_is_no_pose_is_refused_in_a_sentence(value, sentence):
    with pytest.raises(InputError, match=sentence):
        Pose.of(value)
