"""Which load steps of a press are flagged: each criterion by itself, at its limit, and the object that has sunk in as a press."""

import numpy as np
import pytest
import trimesh
from support.bodies import COARSE, SMALL
from support.laws import LAWS

from softtact.errors import ConvergenceError
from softtact.models.elastic.compliance import elastic_compliance
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.press.sensor import Sensor
from softtact.press.validity import flags_elastic, flags_foundation, flags_hyperelastic, reasons, touches_lightly

GOOD = {"compression_mm": [0.1, 0.2, 0.3], "contact_error_mm": [0.0, 0.001, 0.001], "points": [9, 40, 80],
        "rough": [False, False, False], "residual_n": [0.09, 0.1, 0.1], "volume_ratio": [0.9, 0.5, np.nan],
        "depth_mm": [0.1, 0.2, 0.3], "forces_n": [5.0, 20.0, 50.0]}
MANY = np.full(3, 40)     # points that carry the object


def valid(**changed):
    """Load steps of a press in which frusta of 0.5 mm may be compressed by 0.4 mm, and overlaps of 0.001 mm were asked for."""
    load_steps = {name: np.array(values) for name, values in (GOOD | changed).items()}
    return holds(flags_hyperelastic(**load_steps, frustum_mm=0.5, allowed_mm=0.001))


def holds(flags):
    """Which of three load steps have no flag."""
    return (reasons(flags, 3) == "").tolist()


def test_all_load_steps_of_a_good_press_hold():
    assert valid() == [True, True, True]


@pytest.mark.parametrize("changed", [
    {"compression_mm": [0.1, 0.2, 0.41]}, {"contact_error_mm": [0.0, 0.001, 0.0031]}, {"points": [9, 40, 8]},
    {"rough": [False, False, True]}, {"residual_n": [0.1, 0.1, 1.1]}, {"volume_ratio": [0.9, 0.01, 0.0]}])
def test_each_criterion_flags_its_own_load_step_alone(changed):
    assert valid(**changed) == [True, True, False]


@pytest.mark.parametrize(("depth", "expected"), [
    ([0.1, 0.3, 0.2], [True, False, False]),      # of two that contradict each other neither is believed
    ([0.3, 0.1, 0.2], [False, False, False]),     # the first contradicts both
    ([0.1, 0.2, 0.1995], [True, True, True]),     # by less than the overlap that was asked for
    ([0.1, 0.1, 0.1], [True, True, True])])
def test_load_steps_that_do_not_grow_with_the_force_are_flagged(depth, expected):
    assert valid(depth_mm=depth) == expected


def test_elastic_load_steps_hold_to_half_of_the_layer():
    flags = flags_elastic(np.array([0.1, 1.24, 1.26]), np.ones((3, 9, 9)), MANY, thickness_mm=2.5, dielectric_mm=1.0)
    assert holds(flags) == [True, True, False]


def test_foundation_load_steps_hold_within_their_law_and_what_was_compared():
    compression = np.array([0.05, 0.164, 0.166])
    sensor, hardly = {"frustum_mm": 0.5, "thickness_mm": 2.0}, np.zeros(3)
    assert holds(flags_foundation(compression, hardly, MANY, **sensor, law_limit_mm=1.0)) == [True, True, False]    # 0.33 of 0.5 mm
    assert holds(flags_foundation(compression, hardly, MANY, **sensor, law_limit_mm=0.07)) == [True, False, False]
    deep = np.array([0.99, 1.01, 0.5])      # half of the layer
    assert holds(flags_foundation(hardly, deep, MANY, **sensor, law_limit_mm=1.0)) == [True, False, True]


@pytest.mark.parametrize("flags_of", [
    lambda points: flags_elastic(np.zeros(3), np.zeros((3, 9, 9)), points, thickness_mm=2.5, dielectric_mm=1.0),
    lambda points: flags_foundation(np.zeros(3), np.zeros(3), points, frustum_mm=0.5, thickness_mm=2.0, law_limit_mm=1.0)])
def test_less_than_nine_points_on_a_pad_do_not_resolve_a_contact_but_none_is_no_contact(flags_of):
    words = "fewer than 9 points of the surface carry the object, which is finer than these"
    assert reasons(flags_of(np.array([0, 8, 9])), 3).tolist() == ["", words, ""]


def test_a_small_ball_whose_depth_changes_with_its_place_between_the_nodes_is_flagged():
    """On nodes 0.3 mm apart; a larger ball under the same force is resolved."""
    sensor = Sensor(SMALL, LAWS, prepared_models={"elastic": elastic_compliance(SMALL)})
    for radius, valid_steps in ((0.5, [0, 0]), (5.0, [1, 1])):
        ball = trimesh.creation.icosphere(subdivisions=3, radius=radius)
        pressed = sensor.press(ball, force_n=[0.1, 0.15], model="elastic", label="")
        moved = sensor.press(ball, motion="fz -0.1; x 0.05; x 0.05", model="elastic", label="")
        assert pressed.within_validity.tolist() == valid_steps and (moved.within_validity == valid_steps[0]).all()


def test_a_flagged_load_step_names_its_limits_and_all_of_its_reasons():
    narrow = np.zeros((3, 9, 9))
    narrow[:, 4] = 0.6
    flags = flags_elastic(np.array([0.6, 1.3, 1.3]), narrow * [[[1]], [[1]], [[0.5]]], MANY, thickness_mm=2.5, dielectric_mm=1.0)
    deep = "the object is deeper in than 1.25 mm, half of the linear layer"
    thin = "a wall or pin narrower than three points of the surface is deeper in than 0.5 mm, half of the dielectric"
    assert reasons(flags, 3).tolist() == [thin, f"{deep}; {thin}", deep]


@pytest.mark.parametrize("height, expected", [(0.1, 0), (3.0, 1)])
def test_an_object_whose_top_has_sunk_in_is_flagged(height, expected):
    """At 3 N the cylinder of radius 1.8 mm stands deeper than 0.1 mm: what would close over it is in no model."""
    disc = trimesh.creation.cylinder(radius=1.8, height=height, sections=64)
    result = Sensor(SMALL, LAWS, mesh=COARSE).press(disc, force_n=[3.0], model="hyperelastic")
    assert result.indentation_mm[0] > 0.1 and result.within_validity[0] == expected
    assert result.validity_reason[0] == ("" if expected else "the object is 0.1 mm high, and its top is below the surface")


@pytest.mark.slow
def test_the_load_steps_before_a_force_that_is_not_reached_are_flagged_alike():
    disc = trimesh.creation.cylinder(radius=1.8, height=0.1, sections=64)
    sensor = Sensor(SMALL, LAWS, mesh=COARSE, solver=NewtonSettings(smallest_increment_n=100))     # so no smaller step is tried
    with pytest.raises(ConvergenceError) as stopped:
        sensor.press(disc, force_n=[3.0, 50.0], model="hyperelastic")
    assert stopped.value.result.indentation_mm[0] > 0.1 and stopped.value.result.within_validity.tolist() == [0]


@pytest.mark.parametrize(("rough_after", "expected"), [(30, 1), (0, 0)])
def test_a_press_flags_a_load_step_that_is_balanced_roughly(monkeypatch, rough_after, expected):
    """Half of the force may soon be left, and any overlap: nothing else could flag it."""
    monkeypatch.setattr("softtact.models.hyperelastic.newton.DEEP", -1.0)
    monkeypatch.setattr("softtact.models.hyperelastic.newton._ROUGH_SOON", 0)
    solver = NewtonSettings(rough_tolerance=0.5, rough_after=rough_after, largest_penetration_mm=1.0)
    result = Sensor(SMALL, LAWS, mesh=COARSE, solver=solver).press(trimesh.creation.icosphere(subdivisions=3, radius=4.0),
                                                                   force_n=[10.0], model="hyperelastic")
    assert result.within_validity[0] == expected


def test_a_step_without_a_force_has_no_residual_that_is_a_share_of_it():
    assert valid(forces_n=[0.0, 20.0, 50.0], residual_n=[0.003, 0.1, 0.1]) == [True, True, True]


def test_a_force_of_which_the_solver_leaves_more_than_a_fiftieth_is_flagged():
    """The tolerance of the residual is that of 10 N for all smaller forces: 3 mN."""
    box = trimesh.creation.box((3.0, 3.0, 2.0))
    result = Sensor(SMALL, LAWS, mesh=COARSE).press(box, force_n=[0.003, 3.0], model="hyperelastic", label="")
    share = result.residual_n / result.normal_force_n
    assert share[0] > 0.02 > share[1] and result.within_validity.tolist() == [0, 1]
    assert "the force is so small that the residual is above 2% of it" in result.validity_reason[0]


def test_depths_may_fall_where_the_force_does_not_grow():
    assert valid(depth_mm=[0.3, 0.2, 0.1], forces_n=[50.0, 20.0, 20.0]) == [True, True, True]


def test_a_load_step_is_light_where_few_points_are_its_only_flag():
    few, deep = np.array([5, 5, 40]), np.array([0.1, 9.0, 9.0])
    flags = flags_elastic(deep, np.zeros((3, 5, 5)), few, thickness_mm=2.0, dielectric_mm=1.0)
    assert [touches_lightly(reason) for reason in (*reasons(flags, 3), "")] == [True, False, False, False]
