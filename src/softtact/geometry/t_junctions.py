"""T-junctions: a corner that lies on an open edge of a facet, whose neighbours have it and the facet itself has not."""

import numpy as np
import trimesh

from softtact.geometry.polygons import triangulated


def split_at_corners(mesh: trimesh.Trimesh, open_edges: np.ndarray, *, tolerance: float) -> tuple[np.ndarray, int]:
    """Faces (n, 3) in which each corner that lies on an open edge of a facet is a corner of it, and how many facets were split.

    open_edges : corners (k, 2) of the edges that only one facet has, as it goes along them
    tolerance : how far in mm a corner may lie beside an edge

    The surface keeps its shape: a facet is replaced by a fan of triangles that cover it.
    """
    inserted = _corners_on(mesh.vertices, open_edges, tolerance)
    split, pieces = [], []
    for number in np.flatnonzero(_has_edge(mesh.faces, inserted)):
        polygon = _with_corners(mesh.faces[number], inserted)
        if len(polygon) > 3:
            split.append(number)
            pieces.append(polygon[triangulated(mesh.vertices[polygon][None])[0]])
    return np.vstack([np.delete(mesh.faces, split, axis=0), *pieces]), len(split)


def _corners_on(points, edges, tolerance):
    """By an edge (a, b) the corners on it, from a to b."""
    from scipy.spatial import cKDTree

    rim = np.unique(edges)
    a, along = points[edges[:, 0]], points[edges[:, 1]] - points[edges[:, 0]]
    length = np.linalg.norm(along, axis=1)
    near = cKDTree(points[rim]).query_ball_point(a + along / 2, length / 2 + tolerance)
    inserted = {}
    for number, found in enumerate(near):
        corners = rim[found]
        spokes = points[corners] - a[number]
        at = spokes @ along[number] / length[number]
        beside = np.linalg.norm(spokes - at[:, None] * along[number] / length[number], axis=1)
        on = (beside <= tolerance) & (at > tolerance) & (at < length[number] - tolerance)
        if on.any():
            inserted[tuple(edges[number])] = corners[on][np.argsort(at[on])]
    return inserted


def _has_edge(faces, inserted):
    """Which faces (n,) have corners that are ends of an edge with corners on it."""
    ends = np.unique(np.array(list(inserted), dtype=int))
    return np.isin(faces, ends).sum(axis=1) >= 2


def _with_corners(face, inserted):
    """The corners of a face with those that lie on its edges."""
    polygon = []
    for a, b in zip(face, np.roll(face, -1), strict=True):
        polygon += [a, *(corner for corner in inserted.get((a, b), ()) if corner not in face)]
    return np.array(polygon)
