"""Compiled loops over the points of a surface: positions of points and of anchors on another surface, and that surface's frames."""

import numpy as np

from softtact.compiled import compiled
from softtact.contact.facet_shapes import LINE2, NODES_OF, evaluate_shapes, place_on, room_for_shapes, unit_normal
from softtact.contact.surfaces import SurfacePoints


@compiled
def place_of_point(points: SurfacePoints, p: int, x: np.ndarray, place: np.ndarray, tangents: np.ndarray) -> None:
    """Fill the place (3,) of point p and the tangents (2, 3) of its surface there, nodes at x (n, 3) in mm."""
    place[:], tangents[:] = 0.0, 0.0
    for a in range(9):
        node = points.nodes[p, a]
        if node < 0:
            break
        for i in range(3):
            place[i] += points.values[p, a] * x[node, i]
            tangents[0, i] += points.slopes[p, 0, a] * x[node, i]
            tangents[1, i] += points.slopes[p, 1, a] * x[node, i]
    if points.kind[p] >= LINE2:
        tangents[1, 2] = 1.0


@compiled
def places(points: SurfacePoints, x: np.ndarray) -> np.ndarray:
    """Positions (p, 3) in mm of the points with nodes at x (n, 3); for nodal displacements x, the points' displacements."""
    out, tangents = np.zeros((len(points.facet), 3)), np.empty((2, 3))
    for p in range(len(points.facet)):
        place_of_point(points, p, x, out[p], tangents)
    return out


@compiled
def places_on(facet: np.ndarray, coordinates: np.ndarray, nodes: np.ndarray, kinds: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Places (p, 3) of coordinates (p, 2) on facets (p,) of a surface; zeros where the facet is -1."""
    out, room = np.zeros((len(facet), 3)), room_for_shapes()
    for p in range(len(facet)):
        if facet[p] >= 0:
            evaluate_shapes(kinds[facet[p]], coordinates[p, 0], coordinates[p, 1], room)
            for a in range(NODES_OF[kinds[facet[p]]]):
                for i in range(3):
                    out[p, i] += room.values[a] * x[nodes[facet[p], a], i]
    return out


@compiled
def frames_on(facet: np.ndarray, coordinates: np.ndarray, nodes: np.ndarray, kinds: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Unit vectors (p, 2, 3) in a surface at coordinates (p, 2) on facets (p,), which turn with it; zeros where the facet is -1.

    The first lies along the facet's first coordinate, the second across it.
    """
    out, room = np.zeros((len(facet), 2, 3)), room_for_shapes()
    corners, place, tangents, n = np.zeros((9, 3)), np.empty(3), np.empty((2, 3)), np.empty(3)
    for p in range(len(facet)):
        if facet[p] < 0:
            continue
        kind = kinds[facet[p]]
        evaluate_shapes(kind, coordinates[p, 0], coordinates[p, 1], room)
        for a in range(NODES_OF[kind]):
            for i in range(3):
                corners[a, i] = x[nodes[facet[p], a], i]
        place_on(kind, corners, room, place, tangents)
        unit_normal(tangents, n)
        e = tangents[0] / np.sqrt((tangents[0] ** 2).sum())
        out[p, 0, 0], out[p, 0, 1], out[p, 0, 2] = e[0], e[1], e[2]
        out[p, 1, 0], out[p, 1, 1], out[p, 1, 2] = n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2], n[0] * e[1] - n[1] * e[0]
    return out
