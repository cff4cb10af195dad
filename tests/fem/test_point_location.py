"""Points in a plan of curved elements: nodes find themselves, fields are interpolated exactly, points outside are refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from softtact.fem.extruded_mesh import interpolation_2d, refine, sheet_mesh_2d

CENTRES = np.array([(x, y) for y in (-0.6, 0.6) for x in (-1.2, 0.0, 1.2)])


def mesh_2d(rings=1, diameter=1.2):
    """3 x 2 cells with strips around: 4.0 x 2.9 mm. With 1.2 mm the discs touch, and triangles between them have cusps."""
    return sheet_mesh_2d(CENTRES, (3, 2), 1.2, diameter, (4.0, 2.9), rings=rings).mesh_2d


PLANS = {"discs that touch": mesh_2d(), "two rings": mesh_2d(rings=2), "discs apart": mesh_2d(diameter=0.9)}


def smooth(points):
    return np.sin(points[:, 0]) * np.cos(points[:, 1])


def test_a_node_is_found_at_itself():
    for name in PLANS:
        mesh = PLANS[name]
        assert abs(interpolation_2d(mesh, mesh.points) - np.eye(len(mesh.points))).max() < 1e-6


@pytest.mark.slow
@given(x=st.floats(-2.0, 2.0), y=st.floats(-1.45, 1.45), name=st.sampled_from(sorted(PLANS)))
@settings(max_examples=50, deadline=None)
def test_linear_fields_are_interpolated_exactly_everywhere(x, y, name):
    mesh = PLANS[name]
    got = interpolation_2d(mesh, np.array([[x, y]])) @ np.column_stack([np.ones(len(mesh.points)), mesh.points])
    np.testing.assert_allclose(got, [[1.0, x, y]], atol=1e-8)


def test_a_smooth_field_is_interpolated_to_third_order():
    """Quadratic elements: the error falls to an eighth where all elements are split in four, on the same curves."""
    points = np.random.default_rng(0).uniform((-2, -1.45), (2, 1.45), (500, 2))
    errors = []
    for times in (1, 2):
        mesh = refine(PLANS["discs that touch"], times)
        error = interpolation_2d(mesh, points) @ smooth(mesh.points) - smooth(points)
        errors.append(np.sqrt(np.mean(error**2)))
    assert 6 < errors[0] / errors[1] < 12


def test_a_point_outside_is_named():
    with pytest.raises(ValueError, match="x 2.1, y 0 mm lies outside"):
        interpolation_2d(PLANS["discs apart"], np.array([[0.0, 0.0], [2.1, 0.0]]))
