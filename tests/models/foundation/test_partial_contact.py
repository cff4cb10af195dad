"""Nodes beside an edge, neither held nor free: an edge counts where it is, wherever it lies between the nodes."""

import numpy as np
import pytest
import trimesh
from foundation_study import SMALL  # its nodes are 0.3 mm apart
from support.laws import LAWS

from softtact.contact.height_field import HeightField
from softtact.contact.underside import Underside
from softtact.models.elastic.compliance import map_cells
from softtact.models.foundation.compliance import foundation_compliance
from softtact.models.foundation.dof_maps import SoftEdges, beyond, own_compliance
from softtact.models.foundation.solve import FoundationMaps, FoundationSettings, press_foundation

pytestmark = pytest.mark.slow     # the compliance of two grids

LINEAR = FoundationSettings(follow=False, rocking=False)
FINER = 3      # an odd number: nodes of the coarse grid are corners on it where they are corners


@pytest.fixture(scope="module")
def compliances(law):
    """By how many times finer than the sensor's their grid is."""
    return {times: foundation_compliance(SMALL, dielectric_law=LAWS["dielectric"], cover_law=LAWS["cover"], frustum=law,
                                          cells=tuple(times * count for count in map_cells(SMALL)))
            for times in (1, FINER)}


def points_of(compliance, width, length=3.1):
    mesh = trimesh.creation.box((width, length, 2.0))
    mesh.apply_translation([0, 0, 1.0])
    return Underside(HeightField(mesh), compliance.grid).points(1.0)


def map_of(compliances, times, width):
    """The map under a bar of a width in mm at 0.1 N, at the sensor's places."""
    points = points_of(compliances[times], width)
    load_step, = press_foundation(compliances[times], points, [0.1], settings=LINEAR)
    return FoundationMaps(compliances[times], points)([load_step])[0][::times, ::times]


def test_an_edge_is_felt_where_it_is_wherever_it_lies_between_two_nodes(compliances):
    """Against a grid three times as fine. Without soft edges a map is off by up to 2.4 %, and an edge by half a step, 0.16 mm."""
    for share in [0.0, 0.2, 0.4, 0.6, 0.8]:
        width = 2 * (4 + share) * 0.3
        fine = map_of(compliances, FINER, width)
        by_width = (map_of(compliances, FINER, width + 0.1) - map_of(compliances, FINER, width - 0.1)) / 0.2
        difference = map_of(compliances, 1, width) - fine
        edge = (difference * by_width).sum() / (by_width**2).sum() / 2
        assert np.sqrt((difference**2).mean()) < 0.007 * fine.max()
        assert abs(edge) < 0.05


def test_a_wider_bar_sinks_in_less_by_whichever_part_of_a_step_it_is_wider(compliances):
    depths = []
    for width in np.linspace(2.2, 3.0, 9):
        load_step, = press_foundation(compliances[1], points_of(compliances[1], width), [0.1], settings=LINEAR)
        depths.append(load_step.depth)
    fall = -np.diff(depths) / np.mean(depths)
    assert (fall > 0).all() and fall.max() < 2 * fall.mean()      # samples are an eighth of a step apart


def test_a_hats_covered_share_tells_how_far_the_edge_lies_beyond_the_node_before():
    r = np.linspace(0, 2, 9)
    covered = np.where(r < 1, r**2 / 2, 1 - (2 - r) ** 2 / 2)
    np.testing.assert_allclose(beyond(covered), r, atol=1e-9)


def test_a_point_is_the_softer_the_less_of_it_is_covered_and_free_where_nothing_is(compliances):
    points = points_of(compliances[1], 2.7)
    edges = SoftEdges(compliances[1])
    contact_compliance = [edges(points, np.array([np.full(points.count, moved), np.zeros(points.count)]), 0.02)
                for moved in (0.0, 0.05, 0.3)]
    right = points.edge[compliances[1].grid.points[points.nodes[points.edge], 0] > 1.0]
    assert (contact_compliance[1][right] >= contact_compliance[0][right]).all()
    assert (contact_compliance[1][right] > contact_compliance[0][right]).any()
    assert np.isinf(contact_compliance[2][right]).any()      # the outermost have moved out from under the bar
    plain = np.setdiff1d(np.arange(points.count), points.edge)
    assert (contact_compliance[0][plain] == 0).all()


def test_a_nodes_compliance_among_fixed_ones_is_less_than_alone_and_larger_at_elements_corners(compliances):
    compliance = compliances[1]
    grid = compliance.grid
    alone = []
    for offset in (0, 1):
        place = grid.quarter(np.array([(grid.shape[0] // 2) * grid.shape[1] + grid.shape[1] // 2 + offset]))
        alone.append(compliance.surface.between(*place, *place)[0, 0])
    for axis in (0, 1):
        corner, middle = own_compliance(compliance, axis)
        assert corner > middle > 0 and corner < alone[0]
