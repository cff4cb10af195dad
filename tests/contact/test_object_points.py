"""Nodes where an object can touch, and how far it covers their surroundings: edges sharper than the grid, kinks, tips, borders."""

import numpy as np
import pytest
import trimesh
from small_layer import ball, flat_box, placed, punch, underside

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.node_grid import NodeGrid
from softtact.errors import MissError

STEP = 0.34                                        # mm, about that of the sensor's grid
GRID = NodeGrid(STEP * np.arange(-20, 21), STEP * np.arange(-24, 25))
OBLONG = flat_box(5.13, 3.47)                      # mm: 15.09 x 10.2 steps
ANYWHERE = (0.11, 0.23, 0, 0, 0, 27)
FLAT = {
    "circle": (placed(punch(3.0)), 9 * np.pi),
    "circle off the nodes": (placed(punch(3.0), ANYWHERE), 9 * np.pi),
    "rectangle": (placed(OBLONG), 5.13 * 3.47),
    "rectangle turned": (placed(OBLONG, ANYWHERE), 5.13 * 3.47),
}


def object_points(mesh, reach=2.5):
    return underside(mesh, GRID).points(reach)


def of_node(points, i, j, values):
    """What `values` (c, ...) says of the node i, j steps from the middle."""
    number = (j + 24) * 41 + i + 20
    return values[np.flatnonzero(points.nodes == number)[0]]


def still(points):
    return np.zeros((2, points.count))


# --- grid ---


def test_a_node_is_found_again_from_its_number_in_the_quarter_and_its_signs():
    numbers, signs = GRID.quarter(np.arange(GRID.count))
    quarter = np.stack(np.meshgrid(GRID.x[20:], GRID.y[24:]), axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(quarter[numbers] * signs, GRID.points, atol=1e-12)


def test_the_map_s_nodes_are_every_second_one_with_the_middle_among_them():
    grid = NodeGrid(STEP * np.arange(-3, 4), STEP * np.arange(-5, 6))
    np.testing.assert_allclose(grid.every_second.x / STEP, [-2, 0, 2], atol=1e-12)
    np.testing.assert_allclose(grid.every_second.y / STEP, [-4, -2, 0, 2, 4], atol=1e-12)


# --- coverage ---


def test_a_plate_over_all_of_the_grid_covers_every_node_whole():
    points = object_points(placed(flat_box(30.0, 30.0)))
    np.testing.assert_array_equal(points.nodes, np.arange(GRID.count))
    np.testing.assert_array_equal(points.covered, 1.0)
    assert len(points.edge) == 0 and points.beneath is None


def test_a_flat_punch_covers_its_area():
    """Hat functions sum to one everywhere; 64 samples a step squared."""
    for name in FLAT:
        mesh, expected = FLAT[name]
        assert object_points(mesh).covered.sum() * STEP**2 == pytest.approx(expected, rel=0.01), name


def test_nodes_that_are_not_near_an_edge_are_covered_whole():
    for name in FLAT:
        points = object_points(FLAT[name][0])
        plain = np.setdiff1d(np.arange(points.count), points.edge)
        assert len(plain) > 20 and len(points.edge) > 20, name
        np.testing.assert_array_equal(points.covered[plain], 1.0)


def test_a_straight_edge_covers_a_share_of_a_hat_that_tells_where_it_is():
    """An edge r steps beyond the node before covers r^2 / 2 of the next one's hat, and 1 - (1 - r)^2 / 2 of its own.

    Samples are an eighth of a step apart, with these edges between them: the midpoint rule is exact on a straight hat.
    """
    for beyond in [0.0, 0.25, 0.5, 0.75]:
        points = object_points(placed(flat_box(2 * (5 + beyond) * STEP, 8.0)))
        assert of_node(points, 5, 0, points.covered) == pytest.approx(1 - (1 - beyond) ** 2 / 2, abs=1e-6), beyond
        if beyond:
            assert of_node(points, 6, 0, points.covered) == pytest.approx(beyond**2 / 2, abs=1e-6), beyond
        assert of_node(points, 4, 0, points.covered) == pytest.approx(1.0, abs=1e-6), beyond


def test_nodes_that_move_meet_the_edge_elsewhere():
    """Moving the nodes by a part of a step is moving the object back by it."""
    for moved in [-0.5, 0.25, 0.75]:
        points = object_points(placed(flat_box(10 * STEP, 8.0)))
        shifted = object_points(placed(flat_box(10 * STEP, 8.0), (-moved * STEP, 0, 0, 0, 0, 0)))
        by_nodes = points.covered_at(np.array([np.full(points.count, moved * STEP), np.zeros(points.count)]), rounding_mm=0.01)
        for i in (4, 5):
            assert of_node(points, i, 0, by_nodes) == pytest.approx(of_node(shifted, i, 0, shifted.covered), abs=1e-6), moved


def test_the_way_out_of_an_object_is_across_its_edge():
    points = object_points(placed(flat_box(10 * STEP, 8.0)))
    outwards = np.zeros((points.count, 2))
    outwards[points.edge] = points.outwards()
    np.testing.assert_allclose(of_node(points, 5, 0, outwards), [1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(outwards[points.edge].sum(axis=1), 1.0)


# --- heights ---


def test_gap_and_slope_are_those_of_a_tilted_plate_even_beyond_its_edge():
    mesh = placed(flat_box(5.13, 3.47), (0.1, 0.2, 0, 6.0, -4.0, 20.0))
    points, surface = object_points(mesh), HeightField(mesh)
    height, normal = surface(np.array([0.1]), np.array([0.2]))
    slope = -normal[0, :2] / normal[0, 2]
    wall = np.abs(points.slope - slope).max(axis=1) > 1e-9           # nodes at the plate's tilted sides
    assert wall.mean() < 0.2
    expected = height + (GRID.points[points.nodes] - [0.1, 0.2]) @ slope
    np.testing.assert_allclose(points.gap[~wall], expected[~wall], atol=1e-9)


def test_a_sphere_s_points_lie_on_its_underside_and_are_covered_whole():
    """Facets of 0.11 mm lie less than a micrometre inside. No slope changes by more than 0.08 a step."""
    points = object_points(placed(trimesh.creation.icosphere(subdivisions=6, radius=6.0)), reach=0.5)
    radius = np.hypot(*GRID.points[points.nodes].T)
    np.testing.assert_allclose(points.gap, 6.0 - np.sqrt(36.0 - radius**2), atol=0.001)
    np.testing.assert_allclose(np.hypot(*points.slope.T), radius / np.sqrt(36.0 - radius**2), atol=0.02)     # a facet's half angle
    np.testing.assert_array_equal(points.covered, 1.0)


def test_no_point_is_higher_than_asked_for():
    below = underside(placed(ball(6.0)), GRID)
    few, many = below.points(0.3), below.points(0.6)
    assert few.gap.max() <= below.lowest_mm + 0.3
    assert few.count < many.count and np.isin(few.nodes, many.nodes).all()


@pytest.mark.parametrize("mesh", [ball(2.0), ball(9.0), placed(OBLONG, (0.11, 0.23, 0, 12, -9, 27)), punch(3.0)])
def test_points_up_to_a_height_are_those_of_the_points_up_to_a_larger_one(mesh):
    """Surroundings that lie higher are left out before they are looked at."""
    few, all_of_them = object_points(mesh, 0.3), object_points(mesh, 2.5)
    low = np.flatnonzero(all_of_them.gap < underside(mesh, GRID).lowest_mm + 0.3)
    np.testing.assert_array_equal(few.nodes, all_of_them.nodes[low])
    np.testing.assert_array_equal(few.gap, all_of_them.gap[low])
    np.testing.assert_array_equal(few.nodes[few.edge], np.intersect1d(all_of_them.nodes[all_of_them.edge], few.nodes))


def test_the_depth_on_springs_presses_them_with_the_whole_force():
    below = underside(placed(punch(2.0)), GRID)
    assert below.depth_on_springs(3.0, 0.5) == pytest.approx(3.0 / 0.5 / (4 * np.pi), rel=0.05)     # half a step's samples


def test_a_sharp_tip_has_a_point_at_its_lowest_place():
    """A cone twice as high as its radius, its tip down."""
    cone = trimesh.creation.cone(radius=2.0, height=4.0, sections=64)
    cone.apply_transform(trimesh.transformations.rotation_matrix(np.pi, [1, 0, 0]))
    points = object_points(placed(cone), reach=1.0)
    assert points.count > 0 and points.gap.min() < 0.25 * STEP


# --- rounded edges and kinks ---


def profile(corners, length=8.0):
    """A convex bar along y with a section of corners (x, z)."""
    return placed(trimesh.convex.convex_hull([(x, y, z) for x, z in corners for y in (-length / 2, length / 2)]))


def test_more_of_a_rounded_edge_counts_the_deeper_it_is_pressed():
    """Of a radius of 0.25 mm from x = 5.5 steps on: up to a height h it is sqrt(2 R h - h^2) wide."""
    flat, radius, angles = 5.5 * STEP, 0.25, np.linspace(0, np.pi / 2, 41)
    half = [(flat + radius * np.sin(a), radius * (1 - np.cos(a))) for a in angles] + [(flat + radius, 2.0)]
    points = object_points(profile(half + [(-x, z) for x, z in half]))
    node = np.flatnonzero(points.nodes == 24 * 41 + 26)[0]
    assert points.gap[node] == 0.0 and points.slope[node, 0] == 0.0       # the flat's plane, though the node lies beyond it
    shares = [points.covered_at(still(points), rounding_mm=height)[node] for height in (0.0, 0.02, 0.1)]
    beyond = [0.5 + np.sqrt(2 * radius * height - height**2) / STEP for height in (0.0, 0.02, 0.1)]
    expected = [r**2 / 2 if r < 1 else 1 - (2 - r) ** 2 / 2 for r in beyond]
    np.testing.assert_allclose(shares, expected, atol=0.07)      # a sample is an eighth of a step


def test_beyond_a_kink_a_node_is_touched_only_once_the_object_has_come_down_to_it():
    """A flat bottom of half 4.6 steps, then sides of slope 0.3: the node at 5 lies 0.4 * 0.3 steps higher."""
    kink = 4.6 * STEP
    points = object_points(profile([(kink, 0), (-kink, 0), (kink + 1.5, 0.45), (-kink - 1.5, 0.45), (0, 2.0)]))
    light, deep = points.as_deep(0.02), points.as_deep(0.2)
    assert of_node(light, 5, 0, light.gap) == 0.0
    assert of_node(light, 5, 0, light.covered_at(still(light), rounding_mm=1e-4)) == pytest.approx(0.6**2 / 2, abs=0.08)
    assert of_node(deep, 5, 0, deep.gap) == pytest.approx(0.4 * STEP * 0.3, abs=1e-9)
    assert of_node(deep, 5, 0, deep.slope)[0] == pytest.approx(0.3)
    assert of_node(deep, 5, 0, deep.covered) > 0.8
    for seen in (light, deep):
        assert of_node(seen, 3, 0, seen.gap) == 0.0


def test_the_lower_part_of_a_step_keeps_its_edge_beside_the_higher_one():
    """A ridge of half 3.5 steps, 0.25 mm lower than the plate around it."""
    ridge = trimesh.util.concatenate([trimesh.creation.box((7 * STEP, 8.0, 1.0)), trimesh.creation.box((9.0, 8.0, 0.5))])
    points = object_points(placed(ridge))
    light = points.as_deep(0.1)
    assert of_node(light, 4, 0, light.gap) == 0.0
    assert of_node(light, 4, 0, light.covered) == pytest.approx(0.5**2 / 2, abs=1e-6)
    assert of_node(points, 4, 0, points.gap) == pytest.approx(0.25)      # once the object has come down to it
    assert of_node(points, 6, 0, points.gap) == pytest.approx(0.25)      # boxes of 1 and of 0.5 mm about the same middle


# --- borders and refusals ---


def test_an_object_over_the_border_covers_the_outermost_nodes_as_if_the_grid_went_on():
    points = object_points(placed(flat_box(10 * STEP, 30.0)))
    covered = np.array([of_node(points, 5, j, points.covered) for j in range(-24, 25)])
    np.testing.assert_allclose(covered, 0.5, atol=1e-6)


def test_an_object_that_misses_the_free_surface_is_refused():
    with pytest.raises(MissError, match="misses every free point"):
        underside(placed(punch(1.0), (9.0, 0, 0, 0, 0, 0)), GRID)


def test_only_nodes_under_the_object_count_where_points_are_nodes():
    mesh = FLAT["rectangle turned"][0]
    points = underside(mesh, GRID).nodes(1.0)
    np.testing.assert_array_equal(points.nodes, np.flatnonzero(HeightField(mesh)(*GRID.points.T)[0] < NO_CONTACT_MM))
    np.testing.assert_array_equal(points.covered, 1.0)
