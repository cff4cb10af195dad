"""The 20-node hexahedron and its meshes: interpolation, volumes, refusal. Its mechanics is in tests/verification."""

import numpy as np
import pytest

from softtact.materials.laws.registry import make_law
from softtact.mechanics.blocks import HexBlock
from softtact.mechanics.elements import HEX20_NODES, gauss, hex20, reference_gradients
from softtact.mechanics.hex_mesh import disc_plan, extrude

LAW = make_law("mooney_rivlin", {"c10": 0.1706, "c01": 0.0040})


def test_shape_functions_are_one_at_their_node_and_sum_to_one():
    values, derivatives = hex20(HEX20_NODES)
    assert values == pytest.approx(np.eye(20), abs=1e-14)
    assert derivatives.sum(axis=1) == pytest.approx(np.zeros((20, 3)), abs=1e-13)


def test_derivatives_agree_with_finite_differences():
    point, step = np.array([[0.3, -0.2, 0.6]]), 1e-6
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        slope = (hex20(point + shift)[0] - hex20(point - shift)[0]) / (2 * step)
        assert hex20(point)[1][..., axis] == pytest.approx(slope, abs=1e-9)


def test_the_disc_of_quadratic_quads_has_the_area_of_a_circle():
    mesh = extrude(disc_plan(), [0.0, 1.0])
    points, weights = gauss(3, 3)
    _, volumes = reference_gradients(mesh.points[mesh.hexes], hex20(points)[1], weights)
    assert volumes.sum() == pytest.approx(np.pi, rel=1e-12)   # exact by the choice of DISC_CORNER_RADIUS


def test_a_frustum_has_the_volume_of_a_truncated_cone():
    mesh = extrude(disc_plan(), [0.0, 0.2, 0.5], scale=lambda z: 0.3 + 0.6 * z)
    points, weights = gauss(3, 3)
    _, volumes = reference_gradients(mesh.points[mesh.hexes], hex20(points)[1], weights)
    assert volumes.sum() == pytest.approx(np.pi * 0.5 / 3 * (0.3**2 + 0.3 * 0.6 + 0.6**2), rel=1e-10)


def test_an_element_turned_inside_out_is_reported():
    block = HexBlock(HEX20_NODES[None].copy(), LAW)
    assert block.evaluate((-2.0 * HEX20_NODES * np.array([1, 0, 0]))[None]) is None
