"""The hyperelastic press on a small sensor: first touch, refusal, mesh file; tests/verification has the rest."""

import numpy as np
import pytest
import trimesh
from support.bodies import COARSE, SMALL, small_body
from support.laws import LAWS

from softtact.contact.height_field import HeightField
from softtact.errors import ConvergenceError
from softtact.geometry.meshes import place
from softtact.geometry.pose import Pose
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.models.hyperelastic.path import press_load_steps
from softtact.models.meshes import layered_mesh
from softtact.press.sensor import Sensor
from softtact.sensors.specification import SensorSpec


def press_small(mesh, forces, **where):
    return Sensor(SMALL, LAWS, mesh=COARSE).press(mesh, force_n=forces, model="hyperelastic", **where)


@pytest.fixture(scope="module")
def cylinder_press():
    return press_small(trimesh.creation.cylinder(radius=1.8, height=3, sections=64), [0.5, 1.5, 3.0])


def test_a_deeper_press_needs_more_force_and_stays_out_of_the_object(cylinder_press):
    assert (np.diff(cylinder_press.indentation_mm) > 0).all()
    # Below the punch pressure over stiffness, 0.3 MPa / 3000 N/mm3, and more at its edge; what is deeper is augmented.
    assert cylinder_press.penetration_mm.max() <= NewtonSettings().largest_penetration_mm
    assert (cylinder_press.converged == 1).all()


def test_the_contact_area_does_not_depend_on_augmentation():
    """To a point or two of 0.1 mm2: touching points were once told by their gaps, which are of either sign after augmentation."""
    cylinder, areas = trimesh.creation.cylinder(radius=1.8, height=3, sections=64), []
    for allowed in (1.0, 2e-4):
        sensor = Sensor(SMALL, LAWS, mesh=COARSE, solver=NewtonSettings(largest_penetration_mm=allowed))
        result = sensor.press(cylinder, force_n=[0.5, 1.5], model="hyperelastic")
        areas.append(result.contact_area_mm2)
    assert result.penetration_mm.max() < 2e-4       # the second was augmented
    np.testing.assert_allclose(areas[1], areas[0], rtol=0.02)


def test_a_light_press_overlaps_by_less_in_proportion():
    cylinder = trimesh.creation.cylinder(radius=1.8, height=3, sections=64)
    light = press_small(cylinder, [0.1])
    assert light.penetration_mm[0] <= 1e-3 * light.indentation_mm[0] / 0.2 < 1e-4      # the cover comes down by less


def test_overlaps_that_were_not_augmented_are_outside_validity(cylinder_press):
    solver = NewtonSettings(largest_penetration_mm=0.25 * cylinder_press.penetration_mm.min(), max_augmentations=0)
    cylinder = trimesh.creation.cylinder(radius=1.8, height=3, sections=64)
    left = Sensor(SMALL, LAWS, mesh=COARSE, solver=solver).press(cylinder, force_n=[0.5], model="hyperelastic")
    assert cylinder_press.within_validity.all() and not left.within_validity.any()


@pytest.mark.parametrize(("rough_after", "rough"), [(30, False), (0, True)])
def test_a_load_step_says_whether_it_is_balanced_roughly(monkeypatch, rough_after, rough):
    """As where frusta fold: pressed beyond a share of their height, here none, half of the force may soon be left unbalanced."""
    monkeypatch.setattr("softtact.models.hyperelastic.newton.DEEP", -1.0)
    monkeypatch.setattr("softtact.models.hyperelastic.newton._ROUGH_SOON", 0)
    settings = NewtonSettings(rough_tolerance=0.5, rough_after=rough_after, max_augmentations=0)
    ball = HeightField(place(trimesh.creation.icosphere(subdivisions=3, radius=4.0), pose=None))
    step, = press_load_steps(small_body(), ball, [10.0], settings=settings)
    assert step.rough == rough and (settings.relative_tolerance * 10 < step.residual_n <= 5.0) == rough


def test_a_tip_between_the_contact_points_finds_its_first_touch():
    """The cap of a small sphere on a corner of the grid is nearer to the surface than any point that feels contact."""
    result = press_small(trimesh.creation.icosphere(subdivisions=4, radius=2.0), [0.2, 1.0])
    assert (np.diff(result.indentation_mm) > 0).all()


SPIKE = trimesh.creation.cone(radius=0.8, height=2.5, sections=64).apply_transform(np.diag([1.0, -1.0, -1.0, 1.0]))
BETWEEN_POINTS = Pose.from_values([0.17, 0.11, 0, 0, 0, 0])


def test_a_spike_between_the_contact_points_goes_down_until_they_touch_it():
    # With more force it slips on between them, and where it stops is chance.
    result = press_small(SPIKE, [0.01, 0.02], pose=BETWEEN_POINTS)
    assert (np.diff(result.indentation_mm) > 0).all() and result.residual_n.max() < 3e-3
    assert not result.within_validity.any()     # a handful of points does not resolve it


@pytest.mark.slow
def test_a_tip_deeper_than_the_sensor_is_thick_is_no_load_step_and_the_load_steps_before_are_kept(monkeypatch):
    tip = press_small(SPIKE, [0.01, 0.02], pose=BETWEEN_POINTS).indentation_mm
    monkeypatch.setattr(SensorSpec, "thickness_mm", tip.mean())
    with pytest.raises(ConvergenceError, match=rf"0\.02 N was not reached.* {tip[1]:.3g} mm deep") as caught:
        press_small(SPIKE, [0.01, 0.02], pose=BETWEEN_POINTS)
    np.testing.assert_array_equal(caught.value.result.normal_force_n, [0.01])


def test_a_cone_whose_tip_is_between_the_contact_points_goes_deeper_with_more_force():
    # Unlike the spike's, its flanks are met by several points: without kept tangents 0.3705 and 0.4443 mm.
    cone = trimesh.creation.cone(radius=0.8, height=1.0, sections=64)
    cone.apply_transform(np.diag([1.0, -1.0, -1.0, 1.0]))
    result = press_small(cone, [0.05, 0.1], pose=Pose.from_values([0.17, 0.11, 0, 0, 0, 0]))
    np.testing.assert_allclose(result.indentation_mm, [0.3705, 0.4443], atol=2e-4)


def test_a_press_that_stalls_says_between_which_forces_and_gives_no_load_step():
    body = small_body()
    surface = HeightField(place(trimesh.creation.icosphere(radius=3.0), pose=None))
    load_steps = press_load_steps(body, surface, [20.0], settings=NewtonSettings(max_iterations=4, smallest_increment_n=15.0))
    with pytest.raises(ConvergenceError, match="load step of 20 N was not reached: from 0 N on"):
        next(load_steps)


def test_a_press_that_crawls_ends_after_the_iterations_of_a_load_step():
    body = small_body()
    surface = HeightField(place(trimesh.creation.icosphere(radius=3.0), pose=None))
    load_steps = press_load_steps(body, surface, [20.0], settings=NewtonSettings(max_iterations=4, load_step_iterations=7))
    with pytest.raises(ConvergenceError, match=", 8 iterations in all"):     # to 20 N and to 10 N, four each
        next(load_steps)


@pytest.mark.slow
def test_a_tangent_that_nothing_makes_positive_definite_fails_the_load_step_and_is_not_tried_for_ever(monkeypatch):
    body, shifts = small_body(), []
    surface = HeightField(place(trimesh.creation.icosphere(radius=3.0), pose=None))
    load_steps = press_load_steps(body, surface, [1.0, 2.0], settings=NewtonSettings(smallest_increment_n=0.6))
    next(load_steps)
    monkeypatch.setattr(body.stepper, "step", lambda rubber, *_, **__: shifts.append(rubber.diagonal().max()))     # None: no step
    with pytest.raises(ConvergenceError, match="load step of 2 N was not reached: from 1 N on"):
        next(load_steps)
    assert max(shifts) > 1e6 * shifts[0]      # N/mm: all was tried


def test_the_mesh_file_holds_the_volume_of_sheet_and_cover_and_of_the_frusta():
    """As VTK sees it, which cuts curved elements into tetrahedra: cones of eight sides, with a tenth less volume."""
    import pyvista

    grid = pyvista.from_meshio(layered_mesh(SMALL, {"cover_heights": [0.0, 1.0], "cover_splits": [0],
                                                   "frustum_heights": [0.0, 0.35, 1.0]}))
    volumes = grid.compute_cell_sizes(length=False, area=False)["Volume"]
    assert volumes.min() > 0
    octagon = 8 * np.sin(np.pi / 4) / 2 / np.pi
    frusta = 35 * np.pi * 0.5 / 3 * (0.3**2 + 0.3 * 0.6 + 0.6**2)
    for number, expected, tolerance in ((0, octagon * frusta, 0.02), (1, 6.0 * 8.4 * 0.5, 1e-9), (2, 6.0 * 8.4 * 1.5, 1e-9)):
        assert volumes[grid["layer"] == number].sum() == pytest.approx(expected, rel=tolerance)
