"""The cover's contact points under an object with rounded edges."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from support.bodies import small_body

from softtact.contact.friction import Coulomb, FrictionState
from softtact.contact.height_field import HeightField, MovedSurface
from softtact.contact.rounded_object import REACH_MM
from softtact.models.hyperelastic.mesh_settings import NewtonSettings
from softtact.models.hyperelastic.newton import _PressOfRounded
from softtact.models.hyperelastic.newton_step import StepContact
from softtact.models.hyperelastic.rigid_contact import ROWS


@pytest.fixture(scope="module")
def body():
    return small_body()


@pytest.fixture
def wavy(body):
    """Displacements of the slab whose top is uneven."""
    return 0.05 * np.random.default_rng(2).normal(size=body.rest()[0].shape)


def box():
    return trimesh.creation.box((2.0, 3.0, 4.0)).apply_translation([0.4, -0.3, 2.0])


def rounding(body):
    body.slab.top.round_edges(True)
    return body.slab.top


def test_gaps_are_distances_to_the_object_where_it_is_and_beyond_its_reach_points_count_for_nothing(body, wavy):
    top, surface, offset = rounding(body), HeightField(box()), np.array([0.3, 0.2])
    projection = top.project(wavy, MovedSurface(surface, offset), 0.1)
    place = top.reference + top.at_points(wavy) + [*-offset, 0.1]
    distance, _ = surface.rounded.averaged(place)
    near = distance < REACH_MM
    np.testing.assert_allclose(top.gaps(wavy, projection, 0.1)[near], distance[near], atol=1e-12)
    assert projection.edge_radius_mm == surface.rounded.radius_mm > 0 and near.any()
    assert (projection.covered == (distance < 1e3)).all() and (top.touch(wavy, projection, 0.1, top.fresh_history()).energy > 0)


def test_gaps_change_with_the_points_as_their_normals_say(body, wavy):
    """Where directions differ around a point its normal is shorter than 1; forces along it are the energy's derivative."""
    top, surface = rounding(body), HeightField(box())
    history, step = top.fresh_history(), 1e-6
    way = 0.05 * np.random.default_rng(4).normal(size=wavy.shape)
    touch = top.touch(wavy, top.project(wavy, surface, 0.1), 0.1, history)
    before, after = (top.touch(at, top.project(at, surface, 0.1), 0.1, history).energy
                     for at in (wavy - step * way, wavy + step * way))
    lengths = np.linalg.norm(top.project(wavy, surface, 0.1).normals, axis=1)
    assert (after - before) / (2 * step) == pytest.approx((touch.force * way[top.faces]).sum(), rel=1e-5) and lengths.min() < 0.99


def test_what_slides_is_across_a_normal_of_any_length(body, wavy):
    """Across the direction of a normal shorter than 1, nothing of a movement along it is slip."""
    top, surface = rounding(body), HeightField(box())
    projection = top.project(wavy, surface, 0.1)
    short = np.flatnonzero(np.linalg.norm(projection.normals, axis=1) < 0.99)
    place = top._in_object(wavy, projection, 0.1)
    unit = projection.normals / np.linalg.norm(projection.normals, axis=1, keepdims=True)
    friction = replace(FrictionState.first(Coulomb(0.3), place - 1e-3 * unit, np.zeros(len(place))), pressure=np.ones(len(place)))
    history = replace(top.fresh_history(), friction=friction)
    traction = top.touch(wavy, projection, 0.1, history).friction_response.traction
    assert len(short) > 3 and np.abs(traction[short]).max() < 1e-6


def test_points_too_deep_for_the_nearest_facet_to_be_known_are_below_the_facet_over_them(body, wavy):
    top = rounding(body)
    deep = 2.0
    gaps = top.gaps(wavy, top.project(wavy, HeightField(box()), deep), deep)
    heights = deep + (top.reference + top.at_points(wavy))[:, 2]
    middle = np.abs((top.reference + top.at_points(wavy))[:, :2] - [0.4, -0.3]).max(axis=1) < 0.4
    np.testing.assert_allclose(gaps[middle], -heights[middle], atol=1e-12)


def test_the_faces_have_four_times_the_points_and_the_same_area(body):
    area, points = body.slab.top.area.sum(), None
    top = rounding(body)
    points = len(top.area)
    assert top.area.sum() == pytest.approx(area, rel=1e-12)
    top.round_edges(False)
    assert points == 4 * len(top.area) == 4 * ROWS**2 * len(top.faces)


def test_a_step_that_keeps_its_normals_has_the_gaps_of_its_end_and_is_corrected_once(body, wavy):
    """Along planes a step leaves the object by the square of its length over twice its radius, and the contact is stiff."""
    rounding(body)
    surface, slab = HeightField(box()), body.slab
    state = slab.evaluate(np.zeros_like(wavy), slab.project(np.zeros_like(wavy), surface, 0.1), 0.1)
    contact = StepContact(slab, state, 0.1, surface, turning=False)
    planes, step, lowered = contact.points, wavy.ravel()[slab.unknowns], 0.02

    def linear(points):
        return points.gaps + points.rows @ step + points.indentation_increment * lowered

    moved = np.zeros_like(wavy)
    moved.ravel()[slab.unknowns] = step
    at_end = slab.project(moved, surface, 0.12)
    near = (at_end.covered > 0) & (state.projection.covered > 0)
    gaps = slab.top.gaps(moved, at_end, 0.12)[near]
    assert np.abs(linear(planes)[near] - gaps).max() > 0.01
    assert contact.follow(step, lowered) and not contact.follow(step, lowered)
    np.testing.assert_allclose(linear(contact.points)[near], gaps, atol=1e-12)
    assert contact.points.rows is planes.rows and (contact.points.gaps[~near] == planes.gaps[~near]).all() and not near.all()


def test_a_step_that_is_cut_keeps_the_gaps_of_its_planes(body, wavy):
    rounding(body)
    surface, slab = HeightField(box()), body.slab
    state = slab.evaluate(np.zeros_like(wavy), slab.project(np.zeros_like(wavy), surface, 0.1), 0.1)
    contact = StepContact(slab, state, 0.1, surface, turning=False, largest_mm=0.1)
    assert not contact.follow(wavy.ravel()[slab.unknowns], 0.02)


def test_the_way_along_a_corrected_step_begins_along_the_one_that_lowers_the_potential(body):
    """What is corrected grows with the square of the way; with all of the correction, no share of some steps is an improvement."""
    rounding(body)
    tilted = trimesh.creation.box((1.0, 1.5, 4.0)).apply_translation([0.0, 0.0, 2.0])
    tilted.apply_transform(trimesh.transformations.rotation_matrix(0.4, [1.0, 0.3, 0.0]))
    surface = HeightField(tilted.apply_translation([0.0, 0.0, -tilted.bounds[0, 2]]))
    (slab, support), depth, force = body.rest(), 0.06, 2.0
    state = body.evaluate(slab, support, depth, body.slab.project(slab, surface, depth))
    step = body.newton_step(state, force, surface, turning=False)
    straight = step.straight()
    assert np.abs(step.slab - straight.slab).max() > 0.1
    for share in (1.0, 0.5, 1e-3):
        for found, whole, first in zip(step.share(share), (step.slab, step.support, step.indentation),
                                       (straight.slab, straight.support, straight.indentation), strict=True):
            np.testing.assert_allclose(found, share * first + share**2 * (whole - first), atol=1e-12)
    moved = _PressOfRounded(body, surface, force, np.inf, NewtonSettings()).moved(state, step, 1e-3)
    np.testing.assert_array_equal(moved.slab.displacement, step.share(1e-3)[0])
    assert moved.energy - force * moved.indentation < state.energy - force * depth
