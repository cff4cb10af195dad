"""Distances to an object with rounded edges, against closed forms."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from softtact.contact.height_field import HeightField, MovedSurface
from softtact.contact.lower_envelope import NO_CONTACT_MM
from softtact.contact.rounded_object import EDGE_RADIUS_MM, REACH_MM, RoundedObject

SIDES = np.array([3.0, 2.0, 4.0])


def rounded(mesh):
    return RoundedObject.of(np.array(mesh.vertices), np.array(mesh.faces))


def distance_to_rounded_box(points, radius):
    """Quilez' closed form: beside the box that is smaller by the radius on all sides, and less the radius."""
    beyond = np.abs(points) - (0.5 * SIDES - radius)
    return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0) - radius


def near_the_surface(count=4000):
    """Random points up to 0.3 mm outside and inside a box, more of them at edges and corners."""
    rng = np.random.default_rng(3)
    points = rng.uniform(-0.5, 0.5, (count, 3)) * SIDES
    onto = rng.random((count, 3)) < 0.5
    onto[~onto.any(axis=1), 2] = True
    return np.where(onto, np.sign(points) * 0.5 * SIDES, points) + rng.uniform(-0.3, 0.3, (count, 3))


@pytest.mark.parametrize("turn", [None, [0.3, -0.5, 0.8]])
def test_the_distance_to_a_box_is_that_to_a_rounded_box_at_faces_edges_and_corners(turn):
    points, turned = near_the_surface(), Rotation.from_rotvec(turn or [0.0, 0.0, 0.0])
    box = trimesh.creation.box(SIDES)
    box.vertices = turned.apply(box.vertices)
    distance, directions = rounded(box)(turned.apply(points))
    exact = distance_to_rounded_box(points, EDGE_RADIUS_MM)
    near = np.abs(exact + EDGE_RADIUS_MM) < REACH_MM - 1e-9
    np.testing.assert_allclose(distance[near], exact[near], atol=1e-12)
    assert near.mean() > 0.9 and (distance[~near & (exact > 0)] == NO_CONTACT_MM).all()
    step = 1e-6
    along = distance_to_rounded_box(points + step * turned.inv().apply(directions), EDGE_RADIUS_MM)
    smooth = near & (exact > -EDGE_RADIUS_MM)      # deeper inside, the nearest face changes at once
    np.testing.assert_allclose((along - exact)[smooth] / step, 1.0, atol=1e-5)


def test_a_point_that_slides_past_an_edge_changes_its_distance_by_no_more_than_its_way():
    """Facets over the point, in place of distances, jump by the object's height there."""
    points, way = near_the_surface(), np.random.default_rng(5).normal(scale=0.02, size=(4000, 3))
    box = rounded(trimesh.creation.box(SIDES))
    before, after = box(points)[0], box(points + way)[0]
    near = np.maximum(before, after) < NO_CONTACT_MM
    assert (np.abs(after - before)[near] <= np.linalg.norm(way, axis=1)[near] + 1e-12).all() and near.sum() > 3000


def test_a_hole_keeps_its_walls_where_they_are():
    ring = trimesh.creation.annulus(r_min=2.0, r_max=4.0, height=3.0, sections=8)
    inside = 2.0 * np.cos(np.pi / 8)      # of an octagon, in the middle of a side
    direction = np.array([np.cos(np.pi / 8), np.sin(np.pi / 8), 0.0])
    distance, out = rounded(ring)(np.array([(inside - 0.1) * direction, (inside + 0.02) * direction]))
    np.testing.assert_allclose(distance, [0.1, -0.02], atol=1e-9)
    np.testing.assert_allclose(out, [-direction, -direction], atol=1e-9)


def test_means_of_distances_turn_little_by_little_across_an_inner_edge():
    """Facets of a bore of 64 sides meet at 5.6 degrees; a point between them would be pushed by one and by the other in turn."""
    ring = rounded(trimesh.creation.annulus(r_min=2.0, r_max=4.0, height=3.0, sections=64))
    angles = np.linspace(-0.02, 0.02, 2001)      # 40 um to both sides of an edge
    points = np.column_stack([2.0 * np.cos(angles), 2.0 * np.sin(angles), 0.1 + 0 * angles])

    def largest_turn(directions):
        return np.degrees(np.linalg.norm(np.diff(directions, axis=0), axis=1)).max()

    assert largest_turn(ring(points)[1]) == pytest.approx(360 / 64, rel=0.05)
    assert largest_turn(ring.averaged(points)[1]) < 0.15 * 360 / 64
    assert np.abs(ring.averaged(points)[0] - ring(points)[0]).max() < 1e-3


def test_means_of_distances_are_those_of_the_points_at_faces_and_up_to_three_micrometres_more_at_edges_and_corners():
    points = near_the_surface()
    box = rounded(trimesh.creation.box(SIDES))
    distance, mean = box(points)[0], box.averaged(points)[0]
    near = np.abs(distance) < 0.02
    inner = near & ((np.abs(points) > 0.5 * SIDES - EDGE_RADIUS_MM - 0.02).sum(axis=1) == 1)
    assert inner.sum() > 50
    np.testing.assert_allclose(mean[inner], distance[inner], atol=1e-12)
    assert -1e-12 < (mean - distance)[near].min() and 1e-3 < (mean - distance)[near].max() < 3e-3


def test_a_point_in_the_middle_of_a_wall_keeps_its_own_direction_to_one_side():
    """The mean of both would be no direction at all."""
    wall = rounded(trimesh.creation.box((0.3, 4.0, 4.0)))
    point = np.array([[1e-4, 0.1, 0.2]])
    for found, own in zip(wall.averaged(point), wall(point), strict=True):
        np.testing.assert_array_equal(found, own)
    assert wall(point)[0] == pytest.approx(-0.15 + 1e-4)


@pytest.mark.parametrize(("thickness", "radius"), [(0.3, EDGE_RADIUS_MM), (0.09, EDGE_RADIUS_MM / 2), (0.005, 0.0)])
def test_a_wall_too_thin_for_the_radius_has_a_smaller_one_and_its_faces_stay(thickness, radius):
    wall = rounded(trimesh.creation.box((thickness, 4.0, 4.0)))
    assert wall.radius_mm == pytest.approx(radius)
    distance, _ = wall(np.array([[0.5 * thickness + 0.01, 0.0, 0.0], [0.0, 0.0, -2.01]]))
    np.testing.assert_allclose(distance, 0.01, atol=1e-12)


def test_a_facet_without_an_area_changes_no_distance():
    """Its corners have no normal along which they could be shrunk, and would stand out by the radius."""
    box = trimesh.creation.box(SIDES)
    needle = np.array([[0.0, 0.0, -2.0], [0.5, 0.0, -2.0], [1.0, 0.0, -2.0]])
    with_needle = RoundedObject.of(np.vstack([box.vertices, needle]), np.vstack([box.faces, [[8, 9, 10], [0, 0, 1]]]))
    distance, directions = with_needle(np.array([[0.2, 0.1, -2.1]]))
    np.testing.assert_allclose(distance, 0.1, atol=1e-12)
    np.testing.assert_allclose(directions, [[0.0, 0.0, -1.0]], atol=1e-12)


def test_a_moved_surface_has_its_rounded_object_where_it_is():
    mesh, way = trimesh.creation.icosphere(subdivisions=3, radius=2.0), np.array([0.7, -0.4])
    surface, points = HeightField(mesh), np.random.default_rng(1).normal(size=(50, 3))
    points *= 2.05 / np.linalg.norm(points, axis=1, keepdims=True)
    there = points + [*way, 0.0]
    expected, _ = surface.rounded(points)
    assert expected.max() < 0.1
    for moved in (MovedSurface(surface, way).rounded, surface.moved(np.append(way, 0.0)).rounded, HeightField(
            mesh.copy().apply_translation([*way, 0.0])).rounded):
        np.testing.assert_allclose(moved(there)[0], expected, atol=1e-9)
    assert MovedSurface(lambda x, y: (x, y), way).rounded is None
