"""Steep sides of an object, which a view from below does not show: points of the surface that have run under an edge face them.

A point that lies beside a deep edge and moves sideways under it stands at once far above the object's lower side. Pushed out
downwards it would take the surface with it by as much; the object's wall, through which it came, is nearer and pushes it back.
"""

from typing import Any

import numpy as np

OVERRUN_MM = 0.05      # overlap above which a wall is looked for
_NEARER = 0.5          # of the overlap: a wall that is not so near is none; on a smooth side the facet itself is always nearer
_DIRECTIONS, _HALVINGS = 32, 10


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
