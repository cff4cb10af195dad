"""The cover's contact points at a deep edge of the object: what they face, and that Newton's method turns them back."""

import numpy as np
import trimesh
from support.bodies import small_body

from softtact.contact.height_field import HeightField
from softtact.models.hyperelastic.newton import NewtonSettings, _Press

DEEP_MM, BESIDE_MM = 0.3, 0.04


def block_beside(point):
    """A block whose wall, at its largest x, lies a little beyond a point: its underside on the surface at rest."""
    block = trimesh.creation.box((4.0, 20.0, 4.0))
    block.apply_translation([point[0] + BESIDE_MM - 2.0, 0.0, 2.0])
    return HeightField(block)


def middle_point(body):
    """Number and place of a contact point near the middle."""
    places = body.slab.top.reference
    number = int(np.linalg.norm(places[:, :2], axis=1).argmin())
    return number, places[number]


def test_a_point_far_under_an_edge_faces_the_wall_when_the_objects_depth_is_known():
    body = small_body()
    number, place = middle_point(body)
    rest, surface = body.rest()[0], block_beside(place)
    blind, seeing = body.slab.project(rest, surface), body.slab.project(rest, surface, DEEP_MM)
    np.testing.assert_allclose(blind.normals[number], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(seeing.normals[number], [1, 0, 0], atol=1e-9)
    gaps = [body.slab.top.gaps(rest, planes, DEEP_MM)[number] for planes in (blind, seeing)]
    np.testing.assert_allclose(gaps, [-DEEP_MM, -BESIDE_MM], atol=5e-4)      # ten halvings of half the overlap
    assert seeing.overrun[number] and not blind.overrun.any()
    body.close()


def test_newtons_method_turns_a_point_back_that_ran_under_an_edge_while_planes_were_kept():
    body = small_body()
    number, place = middle_point(body)
    slab, support = body.rest()
    surface = block_beside(place)
    far = body.slab.project(slab, lambda x, y: (np.full(len(x), 1e3), np.tile([0.0, 0.0, -1.0], (len(x), 1))))
    state = body.evaluate(slab, support, DEEP_MM, far)
    press = _Press(body, surface, None, 1e-3, NewtonSettings(projection_iterations=0))
    turned = press.prepared(state, 0)
    np.testing.assert_allclose(turned.slab.projection.normals[number], [1, 0, 0], atol=1e-9)
    assert body.at_edge(turned)
    body.close()
