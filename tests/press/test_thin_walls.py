"""Walls and pins that are thinner than the grid's step: no reading depends on where they stand among the grid's points."""

import warnings

import numpy as np
import pytest
import trimesh
from support.sensors import CORO

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.node_grid import NodeGrid
from softtact.contact.underside import Underside
from softtact.errors import NarrowPartWarning
from softtact.geometry.pose import Pose
from softtact.models.elastic.compliance import elastic_compliance
from softtact.models.elastic.tangential import surface_compliance
from softtact.press.sensor import Sensor
from softtact.press.validity import resolved_elastic
from softtact.readout.capacitance import felt_displacement, ideal_counts

SMALL = CORO.model_copy(update={"footprint_mm": (7.2, 7.2), "map_shape": (13, 13)})      # points of the surface 0.3 mm apart
GRID = NodeGrid(np.linspace(-3.6, 3.6, 25), np.linspace(-3.6, 3.6, 25), sides=True)
SHIFTS = (0.0, 0.05, 0.1, 0.15, 0.2, 0.25)     # mm, along y, over a step


def walls(thickness, *, count=2, apart=2.35):
    """Walls along x side by side, under a plate."""
    parts = [trimesh.creation.box((4.0, thickness, 3.0)) for _ in range(count)]
    for k, part in enumerate(parts):
        part.apply_translation([0, apart * (k - (count - 1) / 2), 1.5])
    plate = trimesh.creation.box((4.0, apart * count, 1.0))
    plate.apply_translation([0, 0, 3.0])
    return trimesh.util.concatenate([*parts, plate])


def moved(mesh, y):
    mesh = mesh.copy()
    mesh.apply_translation([0.07, y, 0])
    return HeightField(mesh)


@pytest.fixture(scope="module")
def sensor():
    return Sensor(SMALL, {}, prepared_models={"elastic": elastic_compliance(SMALL)})


def sums(sensor, mesh, shifts):
    """Counts (shifts, forces) of an object at some places along y."""
    return np.array([sensor.press(mesh, pose=Pose.from_values([0.07, y, 0, 0, 0, 0]), force_n=[0.5, 1.5], model="elastic",
                                  label="").tactile_map.sum(axis=(1, 2)) for y in shifts])


@pytest.mark.parametrize("thickness", [0.02, 0.1, 0.25])
def test_two_thin_walls_read_alike_wherever_they_stand_among_the_points(sensor, thickness):
    read = sums(sensor, walls(thickness), SHIFTS)
    assert (np.ptp(read, axis=0) < 0.05 * read.min(axis=0)).all(), read


@pytest.mark.parametrize("thickness", [0.02, 0.1, 0.25])
@pytest.mark.parametrize("kind", ["nodes", "points"])
def test_both_walls_have_points_under_them_in_either_fast_model(thickness, kind):
    for y in SHIFTS:
        found = getattr(Underside(moved(walls(thickness), y), GRID), kind)(0.5)
        rows = np.unique(GRID.points[found.nodes[found.gap < 0.01], 1])
        assert (np.abs(rows - y + 1.175) < 0.3).any() and (np.abs(rows - y - 1.175) < 0.3).any()


def test_a_pin_between_the_points_touches_the_nearest_one():
    pin = trimesh.creation.cylinder(radius=0.04, height=2.0)
    pin.apply_translation([0.08, 0.68, 1.0])
    found = Underside(HeightField(pin), GRID).nodes(0.5)
    assert GRID.points[found.nodes] == pytest.approx(np.array([[0.0, 0.6]])) and found.gap == pytest.approx([0.0])


def test_a_wall_between_all_samples_of_the_surface_is_pressed(sensor):
    wall = trimesh.creation.box((3.0, 0.02, 2.0))
    wall.apply_translation([0.0, 0.07, 1.0])
    assert Underside(HeightField(wall), GRID).depth_on_springs(1.0, 1.0) == np.inf
    with warnings.catch_warnings(action="ignore"):
        assert sensor.press(wall, force_n=0.5, model="elastic", label="").contact_area_mm2[0] > 0


@pytest.mark.parametrize("slope", [0.3, 0.5, 2.0])
def test_a_tip_between_four_points_presses_them_however_small_the_force(sensor, slope):
    cone = trimesh.creation.cone(radius=2.0, height=2.0 * slope)
    pose = Pose.from_values([0.15, 0.15, 2.0 * slope, 180.0, 0, 0])
    result = sensor.press(cone, pose=pose, force_n=1e-5, model="elastic", label="")
    assert result.contact_area_mm2[0] > 0 and result.indentation_mm[0] < 0.15


def test_nothing_is_added_to_an_object_that_the_points_see():
    for mesh in (trimesh.creation.icosphere(subdivisions=4, radius=2.0), trimesh.creation.box((1.9, 2.3, 2.0)), walls(0.6)):
        surface = moved(mesh, 0.11)
        seen = surface(*GRID.points.T)[0]
        found = Underside(surface, GRID).nodes(0.5)
        assert found.gap == pytest.approx(seen[found.nodes], abs=0)
        assert not Underside(surface, GRID).narrow_parts(0.5) and (seen[np.setdiff1d(np.arange(GRID.count), found.nodes)]
                                                                  > seen.min() + 0.5).all()
        assert (seen == NO_CONTACT_MM).any()


def test_points_along_edges_lie_on_the_object_in_equal_steps_and_below_the_height():
    surface = HeightField(trimesh.creation.box((2.0, 1.0, 1.0)))      # its lower side: two triangles, five edges
    points = surface.along_edges(0.0, 0.3)
    assert (points[:, 2] == -0.5).all() and len(points) == 2 * (8 + 5) + 9 and not len(surface.along_edges(-0.6, 0.3))
    assert np.ptp(points, axis=0) == pytest.approx([2.0, 1.0, 0.0])


def test_the_felt_displacement_has_the_mean_capacitance_of_quadratic_elements():
    """Simpson's rule, exact for the sensor's mean of 1 / gap to the fourth order; a taxel's mean has a linear interpolant."""
    x, fine = np.linspace(-11, 11, 65), np.linspace(-11, 11, 6401)
    down = np.broadcast_to(0.15 + 0.01 * x + 0.0004 * x**2, (113, 65))
    exact = ideal_counts(CORO.model_copy(update={"map_shape": (57, 6401)}),
                         np.broadcast_to(0.15 + 0.01 * fine + 0.0004 * fine**2, (57, 6401)))
    read = ideal_counts(CORO, felt_displacement(CORO, down))
    assert read.sum() == pytest.approx(exact.sum(), rel=1e-5) and read == pytest.approx(exact, rel=2e-3)
    assert felt_displacement(CORO, np.zeros((113, 65))) == pytest.approx(np.zeros((57, 33)), abs=1e-12)


def test_a_level_surface_is_felt_as_it_is():
    assert felt_displacement(CORO, np.full((2, 113, 65), 0.3)) == pytest.approx(np.full((2, 57, 33), 0.3), abs=1e-7)


def test_a_narrow_wall_deep_in_the_dielectric_is_flagged_and_a_wide_part_or_a_shallow_one_is_not():
    row, wide = np.zeros((1, 9, 9)), np.zeros((1, 9, 9))
    row[:, 4], wide[:, 2:7, 2:7] = 1.0, 1.0
    deep = [resolved_elastic(depth * field, dielectric_mm=1.0)[0] for field in (row, wide) for depth in (0.45, 0.55)]
    assert deep == [True, False, True, True]


def test_a_motion_of_walls_between_the_points_is_flagged_with_its_reason():
    sensor = Sensor(SMALL, {}, prepared_models={"elastic_surface": surface_compliance(SMALL)})
    with pytest.warns(NarrowPartWarning, match="fall between the points"):
        result = sensor.press(walls(0.1), motion="z -0.05", model="elastic", label="")
    assert not result.within_validity.any() and "fall between the points" in result.validity_reason[0]
    assert sensor.press(walls(0.6), motion="z -0.05", model="elastic", label="").within_validity.all()
