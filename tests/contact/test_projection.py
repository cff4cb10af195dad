"""Which points of a surface stand inside an object: those over its facets, and none beside them."""

import numpy as np
import pytest
import trimesh

from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.fem.structured_meshes import box


def gaps(ball_at, *, subdivisions=4):
    """Gaps (p,) in mm of a plate's top, 6 x 0.2 mm around the origin at z = 0, to a ball of radius 2 mm, and x (p,) in mm."""
    plate = box((-3, -0.1, -1), (3, 0.1, 0), (30, 1, 1))
    ball = trimesh.creation.icosphere(subdivisions, 2.0)
    n = len(plate.points)
    x = np.vstack([plate.points, ball.vertices + ball_at])
    top, other = Surface.of(plate.face("z1")), Surface.of({"triangle": ball.faces + n})
    pair = ContactPair(top, other, stiffness=1.0, reach_mm=4.0, rigid=True)
    history = pair.first(x)
    places = (history.points.values[:, :, None] * x[history.points.nodes]).sum(axis=1)
    return history.anchor.gap, places[:, 0]


def test_a_plane_that_a_ball_presses_has_the_gaps_of_the_ball():
    gap, x = gaps((0, 0, 1.9))
    under = np.abs(x) < 1.5
    assert gap[under] == pytest.approx(np.sqrt(x[under] ** 2 + 1.9**2) - 2, abs=0.01)      # facets lie inside the ball
    assert (gap < 0).sum() == (np.hypot(x, 1.9) < 1.995).sum()


@pytest.mark.parametrize("height", [-0.6, -1.0, -1.4])
def test_a_point_beside_a_ball_is_not_inside_it_though_it_is_behind_its_lowest_eligible_facets(height):
    """The plate is above the ball's middle: facets that look at it end below, and their planes go on through the plate's points."""
    gap, x = gaps((0, 0, height))
    outside = np.abs(x) > np.sqrt(4 - height**2) + 0.02
    assert outside.any() and not (gap[outside] < 0).any()
