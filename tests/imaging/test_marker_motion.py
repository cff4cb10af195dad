"""Errors of predicted marker motion, the file, formulas of the field, and the physics of a ball on a gel."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.imaging.ball_markers import MarkerGel, MarkerLoad, fit_load, predicted_motion
from softtact.imaging.marker_motion import (
    MarkerMotion,
    dilate,
    left_out_spline,
    motion_error,
    shear,
    shift_and_zoom,
    twist,
)
from softtact.models.elastic.ball_on_layer import BallOnLayer
from softtact.models.elastic.layer_shear import outward
from softtact.models.solid.ball_on_disc import DiscPress

MIDDLE = (160.0, 120.0)
GRID = np.column_stack([axis.ravel() for axis in np.meshgrid(np.arange(20.0, 310, 30), np.arange(15.0, 235, 30))])


def small_press():
    """A path of the linear layer, thickness 1, ball 0.8: stands for the solid model's, which takes half a minute."""
    radii, contacts = np.linspace(0, 4, 120), np.linspace(0.1, 0.6, 6)
    layers = [BallOnLayer(one, 0.8, 1.0, 0.475) for one in contacts]
    rows = [np.zeros((1, 120)), *([one.lowering(radii)] for one in layers)]
    out = [np.zeros((1, 120)), *([outward(one, radii)] for one in layers)]
    depth, force = [0, *(one.depth for one in layers)], [0, *(one.force_over_shear_modulus for one in layers)]
    return DiscPress(np.array(depth), np.array(force), radii, np.vstack(out), np.vstack(rows))


GEL = MarkerGel(small_press(), ball_px=94.0, ball_over_thickness=0.8, friction=0.5, distance_px=450.0, poisson=0.475)


def test_no_motion_has_the_error_one_and_the_truth_none():
    measured = np.array([[1.0, -2.0], [0.0, 3.0]])
    assert motion_error(0 * measured, measured).components == 1 == motion_error(0 * measured, measured).vectors
    assert motion_error(measured, measured).components == 0


def test_half_a_pixel_disappears_when_the_prediction_is_rounded():
    measured = np.array([[1.0, -2.0], [4.0, 3.0]])
    found = motion_error(measured + 0.4, measured)
    assert found.components == pytest.approx(4 * 0.4 / 10) and found.rounded == 0


def test_a_spline_through_the_others_predicts_a_uniform_motion():
    markers = MarkerMotion(GRID, np.tile([2.0, -1.0], (len(GRID), 1)))
    assert left_out_spline(markers) == pytest.approx(markers.motion_px, abs=1e-6)


def test_a_zoom_moves_markers_away_from_the_middle_and_a_turn_around_it():
    assert shift_and_zoom(np.array([[170.0, 120.0]]), MIDDLE, np.array([0, 0, 0.1, 0]))[0] == pytest.approx([1, 0])
    assert shift_and_zoom(np.array([[170.0, 120.0]]), MIDDLE, np.array([0, 0, 0, 0.1]))[0] == pytest.approx([0, 1])


def test_the_formulas_of_the_field_by_hand():
    at = np.array([[3.0, 4.0]])
    weight = np.exp(-25 / 100)
    assert dilate(at, (0, 0), np.array([2.0]), np.zeros((1, 2)), 0.5, 10.0)[0] == pytest.approx(weight * np.array([3, 4]))
    assert shear(at, (0, 0), (1, -1), 10.0)[0] == pytest.approx(weight * np.array([1, -1]))
    assert twist(at, (0, 0), 0.1, 10.0)[0] == pytest.approx(0.1 * weight * np.array([-4, 3]))


def test_a_lowered_marker_comes_nearer_to_the_camera_and_moves_outwards():
    far = MarkerGel(GEL.press, 94.0, 0.8, 0.5, 1e9, 0.475)
    marker, load = np.array([[220.0, 120.0]]), MarkerLoad((220.0, 120.0), 20.0)
    seen, flat = (predicted_motion(marker, gel, load, MIDDLE) for gel in (GEL, far))
    assert seen[0, 0] - flat[0, 0] == pytest.approx(60 * 20 / (450 - 20), rel=1e-3)


def test_a_ball_moved_by_less_than_the_sliding_distance_carries_its_centre_along():
    load = MarkerLoad(MIDDLE, 20.0, (3.0, 0.0))
    assert GEL.sliding_px(20.0) > 3
    moved = predicted_motion(np.array([MIDDLE]), GEL, load, MIDDLE)[0]
    assert moved == pytest.approx([3 * 450 / 430, 0], rel=1e-2)     # seen from nearer


def test_a_ball_moved_by_more_slides_over_the_gel():
    far = MarkerGel(GEL.press, 94.0, 0.8, 0.05, 1e9, 0.475)
    moved = predicted_motion(np.array([MIDDLE]), far, MarkerLoad(MIDDLE, 20.0, (40.0, 0.0)), MIDDLE)[0]
    assert moved[0] == pytest.approx(far.sliding_px(20.0), rel=1e-2)


@pytest.mark.parametrize("aside", [(0.0, 0.0), pytest.param((6.0, -4.0), marks=pytest.mark.slow)])
def test_a_fit_finds_how_the_ball_stood(aside):
    load = MarkerLoad((140.0, 110.0), 22.0, aside, (0.5, -1.0))
    markers = MarkerMotion(GRID, predicted_motion(GRID, GEL, load, MIDDLE))
    found, _, fit = fit_load(markers, GEL, MIDDLE, centre_px=(150.0, 118.0), sheared=any(aside))
    assert fit.error.components < 0.02
    assert found.centre_px == pytest.approx((140, 110), abs=1.0)
    assert found.depth_px == pytest.approx(22, rel=0.05)
    assert found.aside_px == pytest.approx(aside, abs=0.5)


def test_a_file_without_a_column_is_refused(tmp_path):
    file = tmp_path / "markers.csv"
    file.write_text("Mx,My,dx\n1,2,3\n")
    with pytest.raises(InputError, match="column 'dy': it is missing; write the columns Mx, My, dx, dy"):
        MarkerMotion.read(file)
