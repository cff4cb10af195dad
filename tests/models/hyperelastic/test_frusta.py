"""Contacts of the frusta at rest, for both readings of the printed diameters."""

import numpy as np
from support.sensors import CORO

from softtact.materials.laws.registry import make_law
from softtact.models.hyperelastic.build import build_patch, build_unit_cell
from softtact.models.hyperelastic.mesh_settings import MeshSettings

LAW = make_law("mooney_rivlin", {"c10": 0.1706, "c01": 0.0040})


def bed_of(tip_mm, root_mm):
    """The support of one frustum of an endless lattice."""
    frusta = CORO.dielectric.frusta.model_copy(update={"tip_diameter_mm": tip_mm, "root_diameter_mm": root_mm})
    spec = CORO.model_copy(update={"dielectric": CORO.dielectric.model_copy(update={"frusta": frusta})})
    return build_unit_cell(spec, dielectric_law=LAW, mesh=MeshSettings.draft()).support


def test_neighbours_meet_halfway_between_the_axes():
    for tip_mm, root_mm in [(0.6, 1.2), (1.2, 0.6), (0.6, 1.0)]:
        support = bed_of(tip_mm, root_mm)
        half = 0.5 * CORO.dielectric.frusta.pitch_mm
        towards = support.point_neighbour >= 0
        nodes, weights, axis = support.point_nodes[towards, :-1], support.point_weights[towards, :-1], support.point_axis[towards]
        from_axis = -(weights * support.coordinates[0, nodes, axis[:, None]]).sum(axis=1)
        np.testing.assert_allclose(support.gap0[0, towards], half - from_axis, atol=1e-12)
        assert support.gap0.min() > -1e-12


def test_a_frustum_at_the_edge_that_bulges_overlaps_nothing():
    body = build_patch(CORO, (2, 1), dielectric_law=LAW, mesh=MeshSettings.draft())
    _, bulge = body.rest()
    bulge[..., :2] = 0.02 * body.support.coordinates[..., :2]     # wider by 2 %, from the middle of the pair
    state = body.support.evaluate(bulge)
    faces_neighbour = body.support.point_neighbour >= 0
    absent = faces_neighbour[None] & ~body.support.geometry.neighbours[:, body.support.point_neighbour]
    assert absent.any(axis=1).all() and state.gaps[absent].min() > 1.0
