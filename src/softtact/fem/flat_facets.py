"""Curved facets as flat triangles: through their nodes, or finer."""

import numpy as np

from softtact.fem.elements import QUAD8, QUAD9, TRI6
from softtact.fem.solid_mesh import Facets, SolidMesh

_CUT = {"triangle6": [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
        "quad8": [[0, 4, 7], [4, 1, 5], [5, 2, 6], [6, 3, 7], [4, 5, 6], [4, 6, 7]],
        "quad9": [[0, 4, 8], [4, 1, 8], [1, 5, 8], [5, 2, 8], [2, 6, 8], [6, 3, 8], [3, 7, 8], [7, 0, 8]]}


def flat_triangles(facets: Facets) -> np.ndarray:
    """Triangles (t, 3) of nodes that stand for facets, seen as these are."""
    return np.concatenate([nodes[:, _CUT[kind]].reshape(-1, 3) for kind, nodes in facets.items()])


def fine_triangles(facets: Facets, points: np.ndarray, *, divisions: int = 4) -> np.ndarray:
    """Corners (t, 3, 3) in mm of triangles with corners on curved facets, each of whose edges is cut into so many parts.

    A facet of length h and radius of curvature R is missed by at most h^2 / (8 R divisions^2).
    """
    found = []
    for kind, nodes in facets.items():
        corners, triangles = _grid(kind, divisions)
        places = np.einsum("cm,fmi->fci", _SHAPES[kind].shape(corners)[0], points[nodes])
        found.append(places[:, triangles].reshape(-1, 3, 3))
    return np.concatenate(found)


_SHAPES = {"triangle6": TRI6, "quad8": QUAD8, "quad9": QUAD9}


def _grid(kind, n):
    """Parent coordinates (c, 2) of a facet's corners when it is cut, and the triangles (t, 3) of these."""
    i, j = (line.ravel() for line in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
    number = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    a, b, c, d = number[:-1, :-1].ravel(), number[1:, :-1].ravel(), number[1:, 1:].ravel(), number[:-1, 1:].ravel()
    lower, upper = np.column_stack([a, b, d]), np.column_stack([b, c, d])
    if kind != "triangle6":
        return 2 * np.column_stack([i, j]) / n - 1, np.vstack([lower, upper])
    whole = (i + j)[upper].max(axis=1) <= n
    inside = (i + j)[lower].max(axis=1) <= n
    return np.column_stack([i, j]) / n, np.vstack([lower[inside], upper[whole]])


def outer_triangles(mesh: SolidMesh) -> np.ndarray:
    """Triangles (t, 3) of the mesh's outside, through the nodes in the middles of edges; of a plane mesh all of it."""
    if mesh.geometry == "solid":
        return flat_triangles(mesh.boundary)
    return np.concatenate([flat_triangles({kind: nodes}) for _, kind, nodes in mesh.cells])
