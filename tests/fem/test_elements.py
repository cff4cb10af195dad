"""The elements and their meshes: interpolation, volumes, refusal. Their mechanics is in tests/verification."""

import numpy as np
import pytest

from softtact.fem.elements import (
    HEX20_NODES,
    HEX27_NODES,
    QUAD8_NODES,
    QUAD9_NODES,
    TRI6_NODES,
    WEDGE18_NODES,
    gauss,
    hex20,
    hex27,
    quad8,
    quad9,
    reference_gradients,
    tri6,
    wedge18,
    wedge_rule,
)
from softtact.fem.extruded_mesh import disc_mesh_2d, extrude, sheet_mesh_2d
from softtact.fem.solid_block import HexBlock
from softtact.materials.laws.registry import make_law
from softtact.models.hyperelastic.build import lattice
from softtact.models.hyperelastic.mesh_settings import MeshSettings

LAW = make_law("mooney_rivlin", {"c10": 0.1706, "c01": 0.0040})


SHAPES = {"hex20": (hex20, HEX20_NODES), "hex27": (hex27, HEX27_NODES), "wedge18": (wedge18, WEDGE18_NODES),
          "quad8": (quad8, QUAD8_NODES), "quad9": (quad9, QUAD9_NODES), "tri6": (tri6, TRI6_NODES)}


@pytest.mark.parametrize("name", SHAPES)
def test_shape_functions_are_one_at_their_node_and_sum_to_one(name):
    shape, nodes = SHAPES[name]
    values, derivatives = shape(nodes)
    assert values == pytest.approx(np.eye(len(nodes)), abs=1e-14)
    assert derivatives.sum(axis=1) == pytest.approx(np.zeros(nodes.shape), abs=1e-13)


@pytest.mark.parametrize("name", SHAPES)
def test_derivatives_agree_with_finite_differences(name):
    shape, nodes = SHAPES[name]
    point, step = np.array([[0.3, 0.2, 0.6]])[:, :nodes.shape[1]], 1e-6
    for axis in range(nodes.shape[1]):
        shift = step * np.eye(nodes.shape[1])[axis]
        slope = (shape(point + shift)[0] - shape(point - shift)[0]) / (2 * step)
        assert shape(point)[1][..., axis] == pytest.approx(slope, abs=1e-9)


def test_the_wedges_rule_integrates_the_square_of_its_quadratic_functions():
    points, weights = wedge_rule()
    r, s, t = points.T
    # integral of r^2 s^2 over the triangle is 4/6! = 1/180, of t^4 over [-1, 1] 2/5
    assert weights @ (r**2 * s**2 * t**4) == pytest.approx(2 / 5 / 180, rel=1e-10)


def volume(mesh):
    points, weights = gauss(3, 3)
    total = reference_gradients(mesh.points[mesh.hexes], hex27(points)[1], weights)[1].sum()
    if len(mesh.wedges):
        points, weights = wedge_rule()
        total += reference_gradients(mesh.points[mesh.wedges], wedge18(points)[1], weights)[1].sum()
    return total


@pytest.mark.parametrize(("refinement", "rings", "core"), [(0, 1, 0.5), (1, 1, 0.5), (0, 1, 0.8), (0, 2, 0.4)])
def test_the_disc_of_quadratic_quads_has_the_area_of_a_circle(refinement, rings, core):
    assert volume(extrude(disc_mesh_2d(refinement, rings, core), [0.0, 1.0])) == pytest.approx(np.pi, rel=1e-12)


@pytest.mark.parametrize(("mesh", "core"), [(MeshSettings(), 0.6), (MeshSettings(frustum_rings=2), 0.5),
                                            (MeshSettings(frustum_core=0.7), 0.7)])
def test_a_frustums_core_is_as_wide_as_asked_for_or_as_its_rings_want_it(mesh, core):
    innermost = disc_mesh_2d(0, mesh.frustum_rings, mesh.core).quads[0, :4]
    corners = disc_mesh_2d(0, mesh.frustum_rings, mesh.core).points[innermost]
    assert np.hypot(*corners.T) == pytest.approx(np.full(4, core))


def test_a_frustum_has_the_volume_of_a_truncated_cone():
    mesh = extrude(disc_mesh_2d(), [0.0, 0.2, 0.5], scale=lambda z: 0.3 + 0.6 * z)
    assert volume(mesh) == pytest.approx(np.pi * 0.5 / 3 * (0.3**2 + 0.3 * 0.6 + 0.6**2), rel=1e-10)


@pytest.mark.parametrize("diameter", [1.2, 0.9])
@pytest.mark.parametrize("refinement", [0, 1])
def test_the_sheets_plan_fills_its_footprint_and_holds_every_frustums_root(diameter, refinement):
    centres, _ = lattice((3, 2), 1.2)
    sheet = sheet_mesh_2d(centres, (3, 2), 1.2, diameter, (4.0, 2.9), refinement=refinement)
    assert volume(extrude(sheet.mesh_2d, [0.0, 1.0])) == pytest.approx(4.0 * 2.9, rel=1e-12)
    root = sheet.mesh_2d.points[sheet.roots[4]] - centres[4]
    assert root == pytest.approx(0.5 * diameter * disc_mesh_2d(refinement).points, abs=1e-9)


def test_the_outer_sides_of_a_disc_lie_on_its_circle():
    quads, sides = disc_mesh_2d(1).outer_sides()
    assert len(quads) == 8 and (sides == 1).all()


def test_an_element_turned_inside_out_is_reported():
    block = HexBlock(HEX20_NODES[None].copy(), LAW)
    assert block.evaluate((-2.0 * HEX20_NODES * np.array([1, 0, 0]))[None]) is None
