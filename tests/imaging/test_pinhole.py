"""The pinhole behind a gel, against numbers computed by hand."""

import numpy as np
import pytest

from softtact.imaging.pinhole import Pinhole

PAPER = Pinhole(rows=256, columns=256, mm_per_px=0.0625, distance_mm=35.0)
LENS = Pinhole(rows=240, columns=320, mm_per_px=0.06, distance_mm=20.0, distortion=(-0.2, 0.05, 0.003, -0.002, -0.01))


def test_the_middle_of_the_surface_is_seen_in_the_middle_of_the_image():
    assert PAPER.project(np.zeros(3)) == pytest.approx([127.5, 127.5])


def test_at_rest_a_millimetre_is_sixteen_pixels_of_a_sixteenth_of_a_millimetre():
    assert PAPER.project(np.array([1.0, -2.0, 0.0])) == pytest.approx([127.5 + 16, 127.5 - 32])


def test_a_corner_marker_pressed_by_1_2_mm_moves_by_4_px_outwards_along_x_and_y():
    """By hand: it lies 127.5 - 15.7 = 111.8 px and 111.0 px off the middle; 35 / (35 - 1.2) - 1 = 0.035503; 3.969 and 3.941 px."""
    rest = np.array([15.7, 16.5])
    place = PAPER.on_surface(rest)
    assert place == pytest.approx([-111.8 / 16, -111.0 / 16, 0.0])
    moved = PAPER.project(place + [0.0, 0.0, -1.2]) - rest
    assert moved == pytest.approx([-3.9692, -3.9408], abs=1e-4)


def test_brown_distortion_is_that_of_the_formula_by_hand():
    """u = 0.1, v = -0.05: r2 = 0.0125, radial = 1 - 0.0025 + 7.8125e-6 - 1.953e-8 = 0.9975077930;
    2 p1 u v = -3e-5, p2 (r2 + 2 u^2) = -6.5e-5; p1 (r2 + 2 v^2) = 5.25e-5, 2 p2 u v = 2e-5."""
    seen = LENS.distorted(np.array([0.1, -0.05]))
    assert seen == pytest.approx([0.0997507793 - 9.5e-5, -0.04987538965 + 7.25e-5], abs=1e-10)


def test_the_inverse_of_the_distortion_finds_every_pixel_again():
    px = LENS.pixels()
    assert np.abs(LENS.project(LENS.on_surface(px)) - px).max() < 1e-9


def test_the_inverse_holds_at_any_height_of_the_surface():
    px = np.array([[3.0, 7.0], [200.5, 100.25]])
    heights = np.array([-1.5, -0.3])
    assert np.allclose(LENS.project(LENS.on_surface(px, heights)), px, atol=1e-9)
    assert np.allclose(LENS.on_surface(px, heights)[:, 2], heights)


def test_a_camera_that_looks_the_other_way_round_turns_its_axes():
    turned = Pinhole(rows=240, columns=320, mm_per_px=0.1, distance_mm=30.0, axes=("y", "-x"))
    assert turned.project(np.array([1.0, 3.0, 0.0])) == pytest.approx([159.5 + 30, 119.5 - 10])
    assert turned.on_surface(np.array([189.5, 109.5])) == pytest.approx([1.0, 3.0, 0.0])


def test_a_point_is_in_the_image_up_to_the_outer_side_of_its_last_pixel():
    assert PAPER.sees(np.array([[-0.4, 255.4], [255.6, 0.0]])).tolist() == [True, False]
