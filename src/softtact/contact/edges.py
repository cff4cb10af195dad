"""Edges of a rigid object over contact points: the share of a point's area that it covers, how softly it holds that, steep sides.

Covered share   A point that counts as a whole while it lies under the object and not at all beside it jumps to and fro at the edge,
and no equilibrium exists: the force that it carries pushes it out, and without it the cover pulls it back. So each point counts by
the share of its area that the object covers, continuous as it slides past the edge.

Contact compliance   A row of points that is held makes the contact wider by a row, one that is free does not; that is how blunt a
mesh is, and a flat punch's indentation jumps by a tenth when its edge passes a row. A row with a spring of (1/r - 1) times its
compliance among the held ones stores the energy of an edge that has come a share r of the distance from the row before (as in
`models/foundation/dof_maps`, for nodes). As a pressure on the covered share r of the row's area that is a contact compliance
of the row's compliance times the area times 1 - r. What is not derived, for the three rows of a Gauss rule across a face, was taken
from a punch's edge that moves across it by tenths on the default mesh, against elements an eighth as wide (benchmarks/edges.py):
where one row's share ends and the next one's begins, and the compliances. These differ by how far the row is from the last held
one: the first row of a face from that of the face before, the others from that within their face.

Walls   A view from below does not show an object's steep sides. A point that lies beside a deep edge and moves sideways under it
stands at once far above the object's lower side. Pushed out downwards it would take the surface with it by as much; the object's
wall, through which it came, is nearer and pushes it back.
"""

from typing import Any

import numpy as np

from softtact.contact.height_field import HeightField

STEEP = 1.5        # rise over run above which two places of the underside are taken for two sides of an edge
FLAT_MM = 0.02     # ... if they differ by more than this
_HALVINGS = 10     # the edge is found to a thousandth of the area's side
ROWS = 3                                    # points across a face, at the places of Gauss's rule
ENDS = np.array([-1.0, -0.28, 0.28, 1.0])   # of the rows' strips, from one side of the face to the other (-1 to 1)
# A row's compliance times its area, in widths of the face over the plane modulus: of the row that an edge comes to first
# as it moves outwards, of the middle one, and of the last.
_SOFTNESS = np.array([0.15, 0.3, 0.4])
_NOWHERE = 1e-12                            # squared: below this no direction is more outwards than another
OVERRUN_MM = 0.05      # overlap above which a wall is looked for
_NEARER = 0.5          # of the overlap: a wall that is not so near is none; on a smooth side the facet itself is always nearer
_DIRECTIONS = 32


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


def own_areas(half: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Corners (t, points, 4, 2) in mm of the points' rectangles, from the points; half (t, 2): half the faces' sides in mm."""
    i, j = (g.ravel() for g in np.meshgrid(np.arange(ROWS), np.arange(ROWS), indexing="ij"))
    places = np.stack([np.column_stack([ENDS[i + a], ENDS[j + b]]) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))], axis=1)
    return half[:, None, None] * (places - points[:, None])


def contact_compliance(covered: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Softness (t * points,) in mm of displacement per unit of pressure over the plane modulus E / (1 - nu^2).

    covered (t * points,): share of each point's area under the object;  width (t,): of the faces in mm
    """
    share = covered.reshape(-1, ROWS, ROWS)
    outwards = _outwards(share)
    squares = outwards**2
    total = squares.sum(axis=1, keepdims=True)
    squares = np.where(total > _NOWHERE, squares / np.maximum(total, _NOWHERE), 0.5)
    along_x, along_y = (np.where(outwards[:, axis, None] >= 0, _SOFTNESS, _SOFTNESS[::-1]) for axis in (0, 1))
    each = squares[:, 0, None, None] * along_x[:, :, None] + squares[:, 1, None, None] * along_y[:, None, :]
    return (each * (1.0 - share) * width[:, None, None]).ravel()


def _outwards(share):
    """Direction (t, 2) in which the faces (t, rows, rows) are covered less."""
    away = np.arange(ROWS) - (ROWS - 1) / 2
    return -np.stack([share.sum(axis=2) @ away, share.sum(axis=1) @ away], axis=1)


def face_walls(anchors: np.ndarray, normals: np.ndarray, points: np.ndarray, place: np.ndarray, overlap: np.ndarray,
               surface: Any) -> None:
    """Let those of the points (k,) that have a wall near them face it: their rows in anchors (p, 3) and normals (p, 3) change.

    place (p, 3): where the points are in the object's frame, overlap (p,): by how much they lie in it, both in mm
    surface(x, y): heights (n,) of the object's lower side, and its normals
    """
    if not len(points):
        return
    angle = 2 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    ways = np.column_stack([np.cos(angle), np.sin(angle)])
    reach = np.broadcast_to((_NEARER * overlap[points])[:, None], (len(points), _DIRECTIONS))
    level = np.broadcast_to(place[points, 2][:, None], reach.shape)
    start = np.broadcast_to(place[points, None, :2], (*reach.shape, 2))

    def outside(distance, chosen):
        there = start[chosen] + distance[:, None] * np.broadcast_to(ways, start.shape)[chosen]
        return surface(*there.T)[0] > level[chosen]

    leaves = outside(reach.ravel(), np.ones(reach.shape, dtype=bool)).reshape(reach.shape)
    low, high = np.zeros(leaves.sum()), reach[leaves]
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        out = outside(middle, leaves)
        low, high = np.where(out, low, middle), np.where(out, middle, high)
    distance = np.full(reach.shape, np.inf)
    distance[leaves] = high
    nearest = distance.argmin(axis=1)
    found = np.isfinite(distance[np.arange(len(points)), nearest])
    facing, way = points[found], ways[nearest[found]]
    anchors[facing, :2] = place[facing, :2] + distance[np.arange(len(points)), nearest][found, None] * way
    normals[facing] = np.column_stack([way, np.zeros(len(way))])
