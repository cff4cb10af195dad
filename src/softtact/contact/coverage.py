"""Which share of a contact point's own area an object covers, continuous as the point slides past the object's edge.

A point that counts as a whole while it lies under the object and not at all beside it jumps to and fro at the edge, and no
equilibrium exists: the force that it carries pushes it out, and without it the cover pulls it back.
"""

import numpy as np

from softtact.contact.height_field import HeightField

STEEP = 1.5        # rise over run above which two places of the underside are taken for two sides of an edge
FLAT_MM = 0.02     # ... if they differ by more than this
_HALVINGS = 10     # the edge is found to a thousandth of the area's side


def covered(corners: np.ndarray, surface: HeightField) -> tuple[np.ndarray, np.ndarray]:
    """Shares (p,) of rectangles with corners (p, 4, 2), in order around, that lie under the object's lowest part there.

    `surface(x, y)` gives heights (n,) and normals. Also returned: each rectangle's lowest corner (p, 2).
    An edge is taken to cut a rectangle once; what is smaller than a rectangle may go unseen.
    """
    heights = surface(*corners.reshape(-1, 2).T)[0].reshape(len(corners), 4)
    lowest = heights.argmin(axis=1)
    each = np.arange(len(corners))
    foot, base = corners[each, lowest], heights[each, lowest]
    under = continues(heights, corners, base[:, None], foot[:, None])
    share = np.ones(len(corners))
    cut = np.flatnonzero(~under.all(axis=1))
    share[cut] = _shares(corners[cut], under[cut], base[cut], foot[cut], surface)
    return share, foot


def continues(height: np.ndarray, place: np.ndarray, base: np.ndarray, foot: np.ndarray) -> np.ndarray:
    """Whether heights (...) in mm at places (..., 2) belong to the same part of the underside as a lower one, `base` at `foot`."""
    return height - base <= STEEP * np.linalg.norm(place - foot, axis=-1) + FLAT_MM


def _shares(corners, under, base, foot, surface):
    ends = np.roll(corners, -1, axis=1)
    crossing = _crossings(corners, ends, under, np.roll(under, -1, axis=1), base, foot, surface)
    before, after = np.roll(crossing, 1, axis=1), crossing               # on the sides before and after a corner
    previous, following = np.roll(under, 1, axis=1)[..., None], np.roll(under, -1, axis=1)[..., None]
    # Two vertices for each corner: itself twice, or where the edge crosses its sides; a corner without any repeats the next one's.
    inside = under[..., None]
    first = np.where(inside, corners, np.where(previous, before, np.where(following, after, np.roll(crossing, -1, axis=1))))
    second = np.where(inside, corners, np.where(following, after, first))
    polygon = np.stack([first, second], axis=2).reshape(len(corners), 8, 2) - corners[:, :1]
    x, y = polygon[..., 0], polygon[..., 1]
    area = 0.5 * np.abs((x * np.roll(y, -1, axis=1) - y * np.roll(x, -1, axis=1)).sum(axis=1))
    diagonals = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    whole = 0.5 * np.abs(diagonals[0][:, 0] * diagonals[1][:, 1] - diagonals[0][:, 1] * diagonals[1][:, 0])
    return area / whole


def _crossings(starts, ends, start_under, end_under, base, foot, surface):
    """Where sides (p, 4) with one end under the object and one beside it meet the edge (p, 4, 2); elsewhere their start."""
    rows, sides = np.nonzero(start_under != end_under)
    inner = np.where(start_under[rows, sides][:, None], starts[rows, sides], ends[rows, sides])
    outer = np.where(start_under[rows, sides][:, None], ends[rows, sides], starts[rows, sides])
    for _ in range(_HALVINGS):
        middle = 0.5 * (inner + outer)
        under = continues(surface(*middle.T)[0], middle, base[rows], foot[rows])[:, None]
        inner, outer = np.where(under, middle, inner), np.where(under, outer, middle)
    out = starts.copy()
    out[rows, sides] = 0.5 * (inner + outer)
    return out
