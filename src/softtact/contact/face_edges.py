"""Contact points of a quadratic face beside an edge of a rigid object: how softly the object holds what it covers in part.

A row of points that is held makes the contact wider by a row, one that is free does not; that is how blunt a mesh is, and a flat
punch's indentation jumps by a tenth when its edge passes a row. A row with a spring of (1/r - 1) times its own compliance among
the held ones stores the energy of an edge a share r of the way from the row before (as in `models/foundation/partial_contact`,
for nodes). As a pressure on the covered share r of the row's area that is a softness of the compliance times the area times 1 - r.

What is not derived, for the three rows of a Gauss rule across a face, was taken from a punch's edge that moves across it by tenths
on the default mesh, against elements an eighth as wide (benchmarks/edges.py): where one row's share ends and the next one's
begins, and the compliances. These differ by how far the row is from the last held one: the first row of a face from that of the
face before, the others from that within their face.
"""

import numpy as np

ROWS = 3                                    # points across a face, at the places of Gauss's rule
ENDS = np.array([-1.0, -0.28, 0.28, 1.0])   # of the rows' own strips, from one side of the face to the other (-1 to 1)
# A row's own compliance times its own area, in widths of the face over the plane modulus: of the row that an edge comes to first
# as it moves outwards, of the middle one, and of the last.
_SOFTNESS = np.array([0.15, 0.3, 0.4])
_NOWHERE = 1e-12                            # squared: below this no direction is more outwards than another


def own_areas(half: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Corners (t, points, 4, 2) in mm of the points' own rectangles, from the points; half (t, 2): half the faces' sides in mm."""
    i, j = (g.ravel() for g in np.meshgrid(np.arange(ROWS), np.arange(ROWS), indexing="ij"))
    places = np.stack([np.column_stack([ENDS[i + a], ENDS[j + b]]) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))], axis=1)
    return half[:, None, None] * (places - points[:, None])


def contact_compliance(covered: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Softness (t * points,) in mm of displacement per unit of pressure over the plane modulus E / (1 - nu^2).

    covered (t * points,): share of each point's own area under the object;  width (t,): of the faces in mm
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
