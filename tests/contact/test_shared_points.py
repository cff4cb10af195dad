"""Patches of contact points that share a pressure: where they are formed and where not."""

import numpy as np
import pytest
from small_layer import flat_box, placed
from test_object_points import GRID, object_points

from softtact.contact.node_grid import patches_of


def plate(side=30.0, *, tilt_deg=0.0):
    return object_points(placed(flat_box(side, side), (0, 0, 0, 0, tilt_deg, 0)))


def sizes(points, **options):
    """How many points each patch has; a patch's shares are all above 0 and sum to 1."""
    share = patches_of(points, GRID, True, **options)
    assert np.allclose(share.sum(axis=1), 1.0) and (share.data > 0).all() and share.shape[1] == points.count
    assert (np.bincount(share.indices, minlength=points.count) == 1).all()
    return np.diff(share.indptr)


def test_level_points_of_a_large_contact_go_four_to_a_patch_in_pairs_from_the_middle():
    """41 x 49 nodes: the middle row and column alone, 10 and 12 pairs on each side of them."""
    found = sizes(plate())
    assert (found == 4).sum() == 20 * 24 and (found == 2).sum() == 20 + 24 and (found == 1).sum() == 1


def test_points_along_the_edge_keep_a_pressure_of_their_own_when_asked():
    """The outermost pairs are broken up: 18 x 22 patches of four are left."""
    found = sizes(plate(), beside_edge=1)
    assert (found == 4).sum() == 18 * 22 and (found == 1).sum() > 2 * (41 + 49)


def test_points_on_a_slope_are_not_level_and_keep_their_own():
    """Nodes 0.34 mm apart rise by 0.018 mm at 3 degrees, by 0.024 at 4, and are level up to 0.02; along y they always are."""
    steep = sizes(plate(tilt_deg=4.0))
    assert (sizes(plate(tilt_deg=3.0)) == 4).sum() == 20 * 24
    assert (steep == 4).sum() == 0 and (steep == 2).sum() == 24      # of the middle column


@pytest.mark.parametrize(("side", "shared"), [(8.0, True), (30.0, False)])
def test_a_small_contact_or_one_that_shares_nothing_keeps_all_of_its_points(side, shared):
    points = plate(side)
    share = patches_of(points, GRID, shared)
    assert share.shape == (points.count, points.count) and (share != np.eye(points.count)).sum() == 0
