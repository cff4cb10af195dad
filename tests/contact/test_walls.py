"""Points that have run under an edge face the object's wall; others keep the facet that they face."""

import numpy as np
import trimesh

from softtact.contact.edges import face_walls
from softtact.contact.height_field import HeightField


def facing(mesh, place, overlap):
    """Anchors and normals of points (p, 3) that lie in an object by an overlap (p,), at first the facet below."""
    height, normals = HeightField(mesh)(*place[:, :2].T)
    anchors = np.column_stack([place[:, :2], height])
    face_walls(anchors, normals, np.arange(len(place)), place, overlap, HeightField(mesh))
    return anchors, normals


def test_a_point_just_under_an_edge_faces_the_wall_and_is_pushed_out_sideways():
    pin = trimesh.creation.box((4.0, 4.0, 4.0))          # its lower side at z = -2, walls at x, y = 2 and -2
    place = np.array([[1.95, 0.3, -1.5], [-0.2, -1.9, -1.5]])
    anchors, normals = facing(pin, place, np.array([0.5, 0.5]))
    np.testing.assert_allclose(normals, [[1, 0, 0], [0, -1, 0]], atol=1e-9)
    np.testing.assert_allclose([anchors[0, 0], anchors[1, 1]], [2.0, -2.0], atol=5e-4)     # a halving of 0.25 mm ten times
    gaps = np.einsum("pi,pi->p", normals, place - anchors)
    np.testing.assert_allclose(gaps, [-0.05, -0.1], atol=5e-4)


def test_a_point_far_from_any_wall_keeps_the_lower_side():
    pin = trimesh.creation.box((4.0, 4.0, 4.0))
    _, normals = facing(pin, np.array([[1.0, 0.0, -1.5]]), np.array([0.5]))
    np.testing.assert_array_equal(normals, [[0.0, 0.0, -1.0]])


def test_on_a_steep_smooth_side_the_facet_is_nearer_than_any_wall():
    cone = trimesh.creation.cone(radius=1.0, height=3.0, sections=64)
    cone.apply_transform(np.diag([1.0, -1.0, -1.0, 1.0]))      # tip down: 72 degrees steep
    place = np.array([[0.5, 0.0, -1.2]])                        # the side is at z = -1.5 there, and 0.095 mm away along its normal
    _, normals = facing(cone, place, np.array([0.095]))
    assert abs(normals[0, 2]) > 0.25                            # cos(72 degrees) = 0.31, the facet's own
