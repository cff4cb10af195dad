"""Meshes lifted from plane ones: areas and volumes of discs, frusta and sheets. Their mechanics is in tests/verification."""

import numpy as np
import pytest

from softtact.fem.elements import HEX27, WEDGE18, reference_gradients
from softtact.fem.extruded_mesh import disc_mesh_2d, extrude, sheet_mesh_2d
from softtact.models.hyperelastic.build import lattice
from softtact.models.hyperelastic.mesh_settings import MeshSettings


def volume(mesh):
    total = 0.0
    for element, nodes in ((HEX27, mesh.hexes), (WEDGE18, mesh.wedges)):
        if len(nodes):
            points, weights, _ = element.quadrature
            total += reference_gradients(mesh.points[nodes], element.shape(points)[1], weights)[1].sum()
    return total


def test_the_disc_of_quadratic_quads_has_the_area_of_a_circle():
    for refinement, rings, core in [(0, 1, 0.5), (1, 1, 0.5), (0, 1, 0.8), (0, 2, 0.4)]:
        assert volume(extrude(disc_mesh_2d(refinement, rings, core), [0.0, 1.0])) == pytest.approx(np.pi, rel=1e-12), refinement


def test_a_frustums_core_is_as_wide_as_asked_for_or_as_its_rings_want_it():
    for mesh, core in [(MeshSettings(), 0.6), (MeshSettings(frustum_rings=2), 0.5),
                       (MeshSettings(frustum_core=0.7), 0.7)]:
        innermost = disc_mesh_2d(0, mesh.frustum_rings, mesh.core).quads[0, :4]
        corners = disc_mesh_2d(0, mesh.frustum_rings, mesh.core).points[innermost]
        assert np.hypot(*corners.T) == pytest.approx(np.full(4, core)), mesh


def test_a_frustum_has_the_volume_of_a_truncated_cone():
    mesh = extrude(disc_mesh_2d(), [0.0, 0.2, 0.5], scale=lambda z: 0.3 + 0.6 * z)
    assert volume(mesh) == pytest.approx(np.pi * 0.5 / 3 * (0.3**2 + 0.3 * 0.6 + 0.6**2), rel=1e-10)


def test_the_sheets_2d_mesh_fills_its_footprint_and_holds_every_frustums_root():
    for diameter in [1.2, 0.9]:
        for refinement in [0, 1]:
            centres, _ = lattice((3, 2), 1.2)
            sheet = sheet_mesh_2d(centres, (3, 2), 1.2, diameter, (4.0, 2.9), refinement=refinement)
            assert volume(extrude(sheet.mesh_2d, [0.0, 1.0])) == pytest.approx(4.0 * 2.9, rel=1e-12), refinement
            root = sheet.mesh_2d.points[sheet.roots[4]] - centres[4]
            assert root == pytest.approx(0.5 * diameter * disc_mesh_2d(refinement).points, abs=1e-9), refinement


def test_the_outer_sides_of_a_disc_lie_on_its_circle():
    quads, sides = disc_mesh_2d(1).outer_sides()
    assert len(quads) == 8 and (sides == 1).all()
