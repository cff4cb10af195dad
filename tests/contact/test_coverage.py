"""How much of a point's own area an object covers."""

import numpy as np
import pytest

from softtact.contact.edges import covered

SQUARE = 0.05 * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
DOWN = np.array([0.0, 0.0, -1.0])


def half_plane(angle, offset, *, beyond=1e3):
    """An underside at height 0 on one side of a straight edge, and at `beyond` on the other."""
    n = np.array([np.cos(angle), np.sin(angle)])
    return lambda x, y: (np.where(n[0] * x + n[1] * y < offset, 0.0, beyond), np.tile(DOWN, (len(x), 1)))


def test_a_straight_edge_cuts_off_exactly_its_part():
    """Against 400 x 400 samples, which are good to their row along the edge: 1/400."""
    g = 0.05 * (2 * (np.arange(400) + 0.5) / 400 - 1)
    x, y = (a.ravel() for a in np.meshgrid(g, g))
    for angle in np.deg2rad([0, 17, 45, 90, 133, 180, 251, 300]):
        for offset in (-0.06, -0.03, -0.005, 0.0, 0.02, 0.045):
            expected = (half_plane(angle, offset)(x, y)[0] == 0).mean()
            shares, _ = covered(SQUARE[None], half_plane(angle, offset))
            # Beside the object everything lies on one level, too: there nothing is cut off.
            assert shares[0] == pytest.approx(expected or 1.0, abs=4e-3), (angle, offset)


def test_the_share_changes_little_when_the_point_slides_a_little():
    shifts = np.linspace(-0.08, 0.04, 601)
    shares, _ = covered(SQUARE[None] + np.column_stack([shifts, 0 * shifts])[:, None], half_plane(0.3, 0.0))
    assert (np.abs(np.diff(shares)) < 5e-3).all() and shares[0] == 1.0 and shares[-1] < 0.15   # 0.2 um of 0.1 mm: 2e-3 a step


def test_an_underside_that_only_leans_covers_everything():
    slope = 1.0
    shares, foot = covered(SQUARE[None], lambda x, y: (slope * x, np.tile(DOWN, (len(x), 1))))
    assert shares == pytest.approx([1.0]) and foot[0, 0] == -0.05


def test_beyond_a_step_down_only_the_lower_part_counts():
    shares, foot = covered(SQUARE[None], half_plane(0.0, 0.025, beyond=0.5))
    assert shares == pytest.approx([0.75], abs=2e-3) and foot[0, 0] == -0.05
