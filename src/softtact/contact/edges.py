"""Edges of a rigid object over contact points: covered share of a point's area, contact compliance at the edge, steep sides.

Covered share   If a point counted fully under the object and not at all beside it, its contact state would oscillate at the edge
and no equilibrium would exist: its contact force pushes it out, and without that force the cover pulls it back. So each point
counts by the share of its area that the object covers, which is continuous as the point slides past the edge.

Contact compliance   A row of points in contact widens the contact by a full row, and a flat punch's indentation jumps by a tenth
when its edge passes a row. A row with a spring of (1/r - 1) times its compliance, among rows in rigid contact, stores the energy of
an edge that has covered the share r of the distance from the previous row (as in `models/foundation/dof_maps`, for nodes). With the
pressure on the covered share r of the row's area, this is a contact compliance of the row's compliance times the area times 1 - r.
Some values for the three rows of a Gauss rule across a face are not derived but calibrated: where one row's share ends and the next
one's begins, and the compliances. They come from a punch's edge moved across a face in tenths on the default mesh, compared with
elements an eighth as wide (benchmarks/edges.py). The compliances depend on the distance to the last row in contact: for the first
row of a face this is the last row of the previous face, for the others a row of the same face.

Walls   The height field seen from below does not contain an object's steep sides. A point beside a deep edge that moves sideways
under it is suddenly far above the object's underside. Projected on the underside it would displace the surface by that distance;
the wall through which it came is nearer, so the point is projected on the wall.
"""

from typing import Any

import numpy as np

from softtact.contact.height_field import HeightField

STEEP = 1.5        # slope above which two places of the underside count as two sides of an edge
FLAT_MM = 0.02     # ... if their heights differ by more than this
_HALVINGS = 10     # bisections: the edge is located to a thousandth of the area's side
ROWS = 3                                    # points across a face, at the places of Gauss's rule
ENDS = np.array([-1.0, -0.28, 0.28, 1.0])   # of the rows' strips, from one side of the face to the other (-1 to 1)
# A row's compliance times its area, in widths of the face over the plane modulus: of the first, middle and last row that an
# edge reaches as it moves outwards.
_ROW_COMPLIANCE = np.array([0.15, 0.3, 0.4])
_NOWHERE = 1e-12                            # squared length below which there is no outward direction
OVERRUN_MM = 0.05      # overlap above which a wall is searched for
_NEARER = 0.5          # of the overlap: farther walls are ignored; on a smooth side the facet itself is always nearer
_DIRECTIONS = 32


def covered(corners: np.ndarray, surface: HeightField) -> tuple[np.ndarray, np.ndarray]:
    """Shares (p,) of rectangles with corners (p, 4, 2), in order around, that lie under the object's lowest part there.

    `surface(x, y)` gives heights (n,) and normals. Also returned: each rectangle's lowest corner (p, 2).
    An edge is assumed to cut a rectangle once; features smaller than a rectangle may be missed.
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
    # Two vertices for each corner: the corner twice, or the crossings on its sides; a corner without either repeats the next one's.
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
    """Intersections (p, 4, 2) of sides (p, 4) with the object's edge, for one end under and one beside it; else their start."""
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


def point_areas(half: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Corners (t, points, 4, 2) in mm of the points' rectangles, from the points; half (t, 2): half the faces' sides in mm."""
    i, j = (g.ravel() for g in np.meshgrid(np.arange(ROWS), np.arange(ROWS), indexing="ij"))
    places = np.stack([np.column_stack([ENDS[i + a], ENDS[j + b]]) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))], axis=1)
    return half[:, None, None] * (places - points[:, None])


def contact_compliance(covered: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Contact compliance (t * points,) in mm: displacement per unit of pressure over the plane modulus E / (1 - nu^2).

    covered (t * points,): share of each point's area under the object;  width (t,): of the faces in mm
    """
    share = covered.reshape(-1, ROWS, ROWS)
    outwards = _outwards(share)
    squares = outwards**2
    total = squares.sum(axis=1, keepdims=True)
    squares = np.where(total > _NOWHERE, squares / np.maximum(total, _NOWHERE), 0.5)
    along_x, along_y = (np.where(outwards[:, axis, None] >= 0, _ROW_COMPLIANCE, _ROW_COMPLIANCE[::-1]) for axis in (0, 1))
    each = squares[:, 0, None, None] * along_x[:, :, None] + squares[:, 1, None, None] * along_y[:, None, :]
    return (each * (1.0 - share) * width[:, None, None]).ravel()


def _outwards(share):
    """Direction (t, 2) in which the covered share of the faces (t, rows, rows) decreases."""
    away = np.arange(ROWS) - (ROWS - 1) / 2
    return -np.stack([share.sum(axis=2) @ away, share.sum(axis=1) @ away], axis=1)


def face_walls(anchors: np.ndarray, normals: np.ndarray, points: np.ndarray, place: np.ndarray, overlap: np.ndarray,
               surface: Any) -> None:
    """Project those points (k,) that are near a wall on it: updates their rows in anchors (p, 3) and normals (p, 3).

    place (p, 3): positions in the object's frame in mm;  overlap (p,): penetration in mm
    surface(x, y): heights (n,) of the object's lower side, and its normals
    """
    if not len(points):
        return
    angle = 2 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    directions = np.column_stack([np.cos(angle), np.sin(angle)])
    reach = np.broadcast_to((_NEARER * overlap[points])[:, None], (len(points), _DIRECTIONS))
    level = np.broadcast_to(place[points, 2][:, None], reach.shape)
    start = np.broadcast_to(place[points, None, :2], (*reach.shape, 2))

    def outside(distance, chosen):
        there = start[chosen] + distance[:, None] * np.broadcast_to(directions, start.shape)[chosen]
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
    facing, direction = points[found], directions[nearest[found]]
    anchors[facing, :2] = place[facing, :2] + distance[np.arange(len(points)), nearest][found, None] * direction
    normals[facing] = np.column_stack([direction, np.zeros(len(direction))])
