"""A ball on a round gel: the linear layer's force for a small depth, stiffer when bonded, and sentences for what cannot be."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.models.elastic.ball_on_layer import BallOnLayer
from softtact.models.solid.ball_on_disc import Disc, DiscPress, press_disc

PATH = DiscPress(np.array([0.0, 1.0, 2.0]), np.array([0.0, 1.0, 4.0]), np.array([0.0, 1.0]), np.array([[0, 0], [0, 0.1], [0, 0.3]]),
                 np.array([[0, 0], [1, 0.2], [2, 0.6]]))


@pytest.mark.slow     # the path's interpolation is tested below
def test_a_small_press_needs_the_force_of_the_linear_layer():
    disc = Disc(radius_mm=6.0, height_mm=1.0, ball_mm=10.0, bulk_over_shear=20, element_mm=0.08)
    found = press_disc(disc, [0.02])
    poisson = (3 * 20 - 2) / (6 * 20 + 2)
    radius = np.linspace(0.2, 0.8, 61)
    layers = [BallOnLayer(one, 10.0, 1.0, poisson) for one in radius]
    expected = np.interp(0.02, [one.depth for one in layers], [one.force_over_shear_modulus for one in layers])
    assert found.force_over_shear[1] == pytest.approx(expected, rel=0.03)    # six elements across the contact, strains of 4 %
    assert found.lowering_mm[1, 0] == pytest.approx(0.02, rel=0.02)


def test_force_and_depth_of_a_path_are_each_others_inverse():
    assert PATH.at(1.5) == pytest.approx(2.25)       # force^(1/2) is straight here
    assert PATH.depth_at(PATH.at(1.3)) == pytest.approx(1.3)


def test_the_surface_between_two_steps_is_between_theirs():
    out, low = PATH.motion_at(1.5, np.array([0.0, 1.0]))
    assert out == pytest.approx([0, 0.2]) and low == pytest.approx([1.5, 0.4])


def test_a_depth_beyond_the_path_is_refused():
    with pytest.raises(InputError, match="the depth 2.5 mm is beyond the path's last, 2 mm; compute a longer path"):
        PATH.at(2.5)


def test_depths_that_fall_are_refused():
    with pytest.raises(InputError, match="depths 1, 0.5 mm: give rising numbers"):
        press_disc(Disc(6.0, 2.0, 3.0), [1.0, 0.5])


@pytest.mark.parametrize(("ask", "sentence"), [
    (lambda: PATH.at(-0.1), "the depth -0.1 mm is not on the path; give numbers from 0 on"),
    (lambda: PATH.at([0.5, float("nan")]), "the depth nan mm is not on the path"),
    (lambda: PATH.depth_at(-1.0), "the force over the shear modulus -1 mm.2 is not on the path"),
    (lambda: PATH.motion_at(-0.1, np.zeros(1)), "the depth -0.1 mm is not on the path"),
    (lambda: press_disc(Disc(6.0, 2.0, 3.0), []), "there is no depth; give at least one"),
    (lambda: press_disc(Disc(6.0, 2.0, 3.0), [float("nan")]), "depths nan mm: give rising numbers"),
    (lambda: Disc(6.0, 2.0, 3.0, element_mm=0.0), "element_mm=0 is not possible; give a finite number above 0"),
    (lambda: Disc(6.0, 2.0, -3.0), "ball_mm=-3 is not possible"),
    (lambda: Disc(6.0, float("inf"), 3.0), "height_mm=inf is not possible"),
    (lambda: Disc(6.0, 2.0, 3.0, friction=-0.1), "friction=-0.1 is not possible; give a finite number from 0 on")])
def test_what_is_no_disc_and_no_place_on_its_path_is_refused_in_a_sentence(ask, sentence):
    with pytest.raises(InputError, match=sentence):
        ask()


def test_no_depths_have_no_forces():
    assert not len(PATH.at(np.zeros(0)))
