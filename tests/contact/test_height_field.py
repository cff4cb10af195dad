"""The lower envelope of an object: exact to its triangles, silent beside it."""

import numpy as np
import pytest
import trimesh
from naive_underside import lowest_crossing

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.penalty import penalty


def sphere(radius=3.0):
    mesh = trimesh.creation.icosphere(subdivisions=2, radius=radius)
    mesh.apply_translation([0.3, -0.2, radius])
    return mesh


def test_bins_give_what_testing_every_triangle_gives():
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-4, 4, (2, 500))
    fast, _ = HeightField(sphere())(x, y)
    assert fast == pytest.approx(lowest_crossing(x, y, sphere()), abs=1e-12)


def test_beside_the_object_there_is_no_contact():
    height, normal = HeightField(sphere())(np.array([10.0]), np.array([0.0]))
    assert height[0] == NO_CONTACT_MM and normal[0] == pytest.approx([0, 0, -1])


def test_a_flat_base_is_level_and_faces_down():
    box = trimesh.creation.box((4, 4, 2))
    box.apply_translation([0, 0, 1.5])
    height, normal = HeightField(box)(np.array([0.1, 1.9]), np.array([0.3, -1.9]))
    assert height == pytest.approx([0.5, 0.5]) and normal == pytest.approx(np.array([[0, 0, -1.0]] * 2))


def test_penalty_pressure_and_slope_are_derivatives_of_its_energy():
    gap, step = np.array([-5e-3, -1e-3, -4e-4, 1e-3]), 1e-8
    options = {"stiffness": 2000.0, "smoothing": 1e-3}
    energy = [penalty(gap + s * step, **options)[0] for s in (1, -1)]
    pressure = [penalty(gap + s * step, **options)[1] for s in (1, -1)]
    _, p, slope = penalty(gap, **options)
    assert p == pytest.approx(-(energy[0] - energy[1]) / (2 * step), rel=1e-5, abs=1e-9)
    away = np.array([True, False, True, True])   # at the smoothing depth itself the slope has a kink
    assert slope[away] == pytest.approx((-(pressure[0] - pressure[1]) / (2 * step))[away], rel=1e-4, abs=1e-6)


def test_a_height_field_that_has_moved_is_that_of_the_moved_object():
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=5.0)
    way = np.array([1.3, -0.7, 0.4])
    moved = mesh.copy()
    moved.apply_translation(way)
    rng = np.random.default_rng(0)
    x, y = rng.uniform(-6, 6, (2, 400))
    for a, b in zip(HeightField(mesh).moved(way)(x, y), HeightField(moved)(x, y), strict=True):
        assert a == pytest.approx(b, abs=1e-9)
    lowest = [field.lowest_over([1, -1], [2, 0]) for field in (HeightField(mesh).moved(way), HeightField(moved))]
    assert lowest[0] == pytest.approx(lowest[1])
    assert HeightField(mesh).moved(way).lowest_mm == pytest.approx(HeightField(moved).lowest_mm)


def test_thin_triangles_are_found_wherever_they_reach_and_stand_in_few_bins():
    """A tilted disc of 300 slivers: the same bits as if each point looked at all of them."""
    disc = trimesh.creation.cylinder(5.0, 4.0, sections=300)
    disc.apply_transform(trimesh.transformations.rotation_matrix(0.2, (1, 0.3, 0)))
    field, rng = HeightField(disc), np.random.default_rng(0)
    corners = field.triangles.reshape(-1, 3)
    x, y = np.concatenate([rng.uniform(-5.2, 5.2, (3000, 2)), corners[:, :2]]).T
    alone = HeightField(disc, bins=1)
    assert np.array_equal(field(x, y)[0], alone(x, y)[0])
    assert len(field._search[-1]) < 6 * 128 * 128     # their boxes fill ten times as many
