"""Points where an object can touch: areas and edges sharper than the grid, and what lies between its nodes."""

import numpy as np
import pytest
import trimesh
from small_layer import ball, flat_box, object_points, placed, punch

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.object_points import NodeGrid, Underside
from softtact.errors import InputError

STEP = 0.34                                        # mm, about that of the sensor's grid
GRID = NodeGrid(STEP * np.arange(-20, 21), STEP * np.arange(-24, 25))
HALF_SAMPLE = 1 / 16                               # of a step: an edge is found among eight samples along a side
OBLONG = flat_box(5.13, 3.47)                      # mm: 15.09 x 10.2 steps
ANYWHERE = (0.11, 0.23, 0, 0, 0, 27)
FLAT = {
    "circle": (placed(punch(3.0)), 9 * np.pi),
    "circle off the nodes": (placed(punch(3.0), ANYWHERE), 9 * np.pi),
    "rectangle": (placed(OBLONG), 5.13 * 3.47),
    "rectangle turned": (placed(OBLONG, ANYWHERE), 5.13 * 3.47),
}


def places_of(points, grid=GRID):
    """Places (c, 2) of `ObjectPoints` in mm."""
    return points.interpolation(points.weights()) @ grid.points[points.all_nodes]


def centroid(mesh):
    points = object_points(mesh, GRID)
    return points.covered @ places_of(points) / points.covered.sum()


# --- grid ---


def test_a_node_is_found_again_from_its_number_in_the_quarter_and_its_signs():
    numbers, signs = GRID.quarter(np.arange(GRID.count))
    quarter = np.stack(np.meshgrid(GRID.x[20:], GRID.y[24:]), axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(quarter[numbers] * signs, GRID.points, atol=1e-12)


def test_the_map_s_nodes_are_every_second_one_with_the_middle_among_them():
    grid = NodeGrid(STEP * np.arange(-3, 4), STEP * np.arange(-5, 6))
    np.testing.assert_allclose(grid.every_second.x / STEP, [-2, 0, 2], atol=1e-12)
    np.testing.assert_allclose(grid.every_second.y / STEP, [-4, -2, 0, 2, 4], atol=1e-12)


# --- areas and places ---


def test_every_rectangle_that_a_plate_covers_whole_has_one_point_at_its_node():
    """A plate over all of the grid: no edge anywhere."""
    points = object_points(placed(flat_box(30.0, 30.0)), GRID)
    np.testing.assert_array_equal(points.nodes, np.arange(GRID.count))
    np.testing.assert_array_equal(points.covered, 1.0)
    assert len(points.edge) == 0 == len(points.others)


def test_each_covered_rectangle_has_exactly_one_point():
    surface = HeightField(FLAT["circle"][0])
    points = object_points(FLAT["circle"][0], GRID)
    middle = np.flatnonzero(surface(*GRID.points.T)[0] < NO_CONTACT_MM)      # nodes under the punch: more than half covered, mostly
    assert len(np.unique(points.nodes)) == points.count
    assert np.isin(middle, points.nodes).all()
    assert not np.isin(points.others, points.nodes).any()
    assert np.hypot(*GRID.points[points.nodes].T).max() < 3.0 + STEP / np.sqrt(2)


@pytest.mark.parametrize("name", FLAT)
def test_a_flat_punch_covers_its_area(name):
    mesh, expected = FLAT[name]
    covered = object_points(mesh, GRID).covered.sum() * STEP**2
    assert covered == pytest.approx(expected, rel=0.01)      # 64 samples a rectangle; less than a tenth of one is left out


@pytest.mark.parametrize("mesh", [punch(3.0), OBLONG], ids=["circle", "rectangle"])
@pytest.mark.parametrize("share", [(0.3, 0.0), (0.0, 0.3), (0.3, 0.7)])
def test_a_punch_that_moves_by_part_of_a_step_takes_its_points_along(mesh, share):
    moved = centroid(placed(mesh, (share[0] * STEP, share[1] * STEP, 0, 0, 0, 0))) - centroid(placed(mesh))
    np.testing.assert_allclose(moved / STEP, share, atol=0.03)      # half of HALF_SAMPLE, as opposite edges err differently


@pytest.mark.parametrize("name", FLAT)
def test_points_at_an_edge_lie_inside_the_object(name):
    mesh, _ = FLAT[name]
    points = object_points(mesh, GRID)
    places = places_of(points)[points.edge]
    inside = HeightField(mesh)
    towards_middle = places + HALF_SAMPLE * STEP * -np.sign(places - mesh.centroid[:2])
    assert (inside(*towards_middle.T)[0] < NO_CONTACT_MM).all()
    assert len(points.edge) > 20


@pytest.mark.parametrize("name", FLAT)
def test_points_that_are_not_at_an_edge_are_their_nodes(name):
    points = object_points(FLAT[name][0], GRID)
    plain = np.setdiff1d(np.arange(points.count), points.edge)
    np.testing.assert_allclose(places_of(points)[plain], GRID.points[points.nodes[plain]], atol=1e-12)
    np.testing.assert_array_equal(points.covered[plain], 1.0)


# --- between the nodes ---


@pytest.mark.parametrize("shift", [None, (0.0, 0.0), (0.3, -0.2), (5.0, -5.0)])
def test_support_weights_are_shares_of_one(shift):
    points = object_points(FLAT["rectangle turned"][0], GRID)
    weights = points.weights(None if shift is None else np.tile(shift, (len(points.edge), 1)))
    assert (weights >= 0).all()
    np.testing.assert_allclose(weights.sum(axis=1), 1.0, rtol=1e-12)
    np.testing.assert_allclose(points.interpolation(weights).sum(axis=1), 1.0, rtol=1e-12)


def test_a_point_at_an_edge_moves_by_the_shift_it_is_given():
    points = object_points(FLAT["circle off the nodes"][0], GRID)
    free = (np.abs(points.offset) > 0.1).all(axis=1)                 # not on their nodes' lines, which they would leave
    shift = np.tile([0.05, -0.08], (len(points.edge), 1))
    moved = points.interpolation(points.weights(shift)) @ GRID.points[points.all_nodes] - places_of(points)
    assert free.sum() > 10
    np.testing.assert_allclose(moved[points.edge][free] / STEP, shift[free], atol=1e-9)


# --- heights ---


def test_gap_and_slope_are_those_of_a_tilted_plate_where_the_points_lie():
    mesh = placed(flat_box(5.13, 3.47), (0.1, 0.2, 0, 6.0, -4.0, 20.0))
    points, surface = object_points(mesh, GRID), HeightField(mesh)
    normal = surface(np.array([0.1]), np.array([0.2]))[1][0]
    slope = -normal[:2] / normal[2]
    wall = np.abs(points.slope - slope).max(axis=1) > 1e-9           # points under the plate's tilted sides
    assert wall.mean() < 0.15
    height = surface(np.array([0.1]), np.array([0.2]))[0] + (places_of(points) - [0.1, 0.2]) @ slope
    np.testing.assert_allclose(points.gap[~wall], height[~wall], atol=1e-9)


def test_a_sphere_s_points_lie_on_its_underside():
    """Facets of 2.2 mm/64: their sag, edge^2 / 8 R, is a micrometre or two."""
    points = object_points(placed(ball(6.0)), GRID, reach=1.0)
    radius = np.hypot(*places_of(points).T)
    np.testing.assert_allclose(points.gap, 6.0 - np.sqrt(36.0 - radius**2), atol=0.02)
    np.testing.assert_allclose(np.hypot(*points.slope.T), radius / np.sqrt(36.0 - radius**2), atol=0.06)     # a facet's half angle


def test_no_point_is_higher_than_asked_for():
    underside = Underside(HeightField(placed(ball(6.0))), GRID)
    few, many = underside.points(0.3), underside.points(0.6)
    assert few.gap.max() <= underside.lowest_mm + 0.3 + 0.02         # a rectangle's lowest place counts, the point is its node
    assert few.count < many.count and np.isin(few.nodes, many.nodes).all()


def test_the_depth_on_springs_presses_them_with_the_whole_force():
    underside = Underside(HeightField(placed(punch(2.0))), GRID)
    area = object_points(placed(punch(2.0)), GRID).covered.sum() * STEP**2
    assert underside.depth_on_springs(3.0, 0.5) == pytest.approx(3.0 / 0.5 / area, rel=0.01)     # slivers count here


def test_a_sharp_tip_has_a_point_at_its_lowest_place():
    """A cone twice as high as its radius, its tip down."""
    cone = trimesh.creation.cone(radius=2.0, height=4.0, sections=64)
    cone.apply_transform(trimesh.transformations.rotation_matrix(np.pi, [1, 0, 0]))
    points = object_points(placed(cone), GRID, reach=1.0)
    assert points.count > 0 and points.gap.min() < 0.25 * STEP


# --- borders and refusals ---


def test_an_object_over_the_border_keeps_points_on_the_grid():
    points = object_points(placed(punch(3.0), (6.0, 7.5, 0, 0, 0, 0)), GRID)
    assert points.all_nodes.min() >= 0 and points.all_nodes.max() < GRID.count
    places = places_of(points)
    assert (places <= [GRID.x[-1] + 1e-9, GRID.y[-1] + 1e-9]).all()


def test_an_object_that_misses_the_free_surface_is_refused():
    with pytest.raises(InputError, match="misses every free point"):
        Underside(HeightField(placed(punch(1.0), (9.0, 0, 0, 0, 0, 0))), GRID)
