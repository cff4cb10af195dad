"""Surfaces in contact: facets and the quadrature points on them."""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from softtact.contact.facet_shapes import KIND_OF, LINE2, MOST_NODES, NODES_OF, QUAD8, evaluate_shapes, room_for_shapes
from softtact.contact.facet_tree import FacetTree, build_tree


@dataclass(frozen=True)
class Surface:
    """Facets on a set of nodes, normals outwards."""

    nodes: np.ndarray
    """(f, 9) nodes of each facet, padded with -1."""
    kinds: np.ndarray
    """(f,) kinds, see `facet_shapes`."""

    @classmethod
    def of(cls, facets: dict[str, np.ndarray]) -> "Surface":
        """The surface of facets {meshio's name of the facet: nodes (f, k)}."""
        nodes = [np.pad(part, ((0, 0), (0, MOST_NODES - part.shape[1])), constant_values=-1) for part in facets.values()]
        kinds = [np.full(len(part), KIND_OF[name]) for name, part in facets.items()]
        return cls(np.ascontiguousarray(np.concatenate(nodes)), np.concatenate(kinds))

    def tree(self, x: np.ndarray) -> FacetTree:
        """The search tree of the surface with nodes at x (n, 3) in mm."""
        return build_tree(self.nodes, self.kinds, x)

    @cached_property
    def used(self) -> np.ndarray:
        """Its nodes, each once."""
        return np.unique(self.nodes[self.nodes >= 0])

    @cached_property
    def width(self) -> int:
        """Nodes of its largest facet."""
        return int(NODES_OF[self.kinds].max())

    def rims(self, x: np.ndarray) -> np.ndarray:
        """(f, 4) which edges of each facet end the surface: edges without a neighbour, or with one at an angle above 45 degrees.
        x (n, 3): the nodes at rest in mm
        """
        corners = np.where(self.kinds >= LINE2, 2, np.where(self.kinds >= QUAD8, 4, 3))
        normals = self._normals(x)
        owner: dict[tuple[int, ...], tuple[int, int]] = {}
        out = np.ones((len(self.kinds), 4), dtype=bool)
        for facet, count in enumerate(corners):
            own = self.nodes[facet, :count].tolist()
            ends = (
                [(node,) for node in own] if count == 2 else [tuple(sorted((own[k], own[(k + 1) % count]))) for k in range(count)]
            )
            for edge, key in enumerate(ends):
                if key in owner:
                    other, its_edge = owner[key]
                    out[facet, edge] = out[other, its_edge] = normals[facet] @ normals[other] < _SMOOTH
                owner[key] = facet, edge
        return out

    def _normals(self, x: np.ndarray) -> np.ndarray:
        """Unit normals (f, 3) of the planes through the facets' first corners."""
        a, b, c = (x[self.nodes[:, k]] for k in (0, 1, 2))
        normals = np.cross(b - a, np.array([0.0, 0.0, 1.0]) if self.is_line else c - a)
        return normals / np.linalg.norm(normals, axis=1)[:, None]

    def size_mm(self, x: np.ndarray) -> float:
        """Mean size (mm) of the facets: the square root of the mean area, or the mean length of lines."""
        _, area = _at_rest(self, x, *_rules(self.kinds)[:3])
        mean = area.sum() / len(self.kinds)
        return float(mean if self.is_line else np.sqrt(mean))

    @property
    def is_line(self) -> bool:
        """Whether it is a line in the plane."""
        return bool(self.kinds[0] >= LINE2)


class SurfacePoints(NamedTuple):
    """Points p on a surface at which contact acts."""

    facet: np.ndarray
    """(p,) facet of the surface."""
    nodes: np.ndarray
    """(p, 9) its nodes."""
    kind: np.ndarray
    """(p,) its kind."""
    values: np.ndarray
    """(p, 9) shape functions."""
    slopes: np.ndarray
    """(p, 2, 9) their derivatives."""
    weight: np.ndarray
    """(p,) area in mm2 of the point at rest (for a line: length times thickness or circumference)."""
    coordinates: np.ndarray
    """(p, 2) on the facet."""


def quadrature_points(surface: Surface, x: np.ndarray, *, axisymmetric: bool = False, thickness_mm: float = 1.0) -> SurfacePoints:
    """Quadrature points of degree 4 or more on each facet, with nodes at rest at x (n, 3) in mm.

    axisymmetric: a line's points represent rings around the y axis;  thickness_mm: otherwise strips of this thickness
    """
    return points_at(surface, x, *_rules(surface.kinds), axisymmetric=axisymmetric, thickness_mm=thickness_mm)


def points_at(
    surface: Surface,
    x: np.ndarray,
    facet: np.ndarray,
    coordinates: np.ndarray,
    share: np.ndarray,
    *,
    axisymmetric: bool = False,
    thickness_mm: float = 1.0,
) -> SurfacePoints:
    """Points at parent coordinates (p, 2) on facets (p,) with quadrature weights `share` (p,) in parent coordinates."""
    values, slopes = _shapes(surface.kinds[facet], coordinates)
    place, weight = _at_rest(surface, x, facet, coordinates, share)
    if surface.is_line:
        weight = weight * (2 * np.pi * place[:, 0] if axisymmetric else thickness_mm)
    return SurfacePoints(
        facet, np.ascontiguousarray(surface.nodes[facet]), surface.kinds[facet], values, slopes, weight, coordinates
    )


def _at_rest(surface, x, facet, coordinates, share):
    """Places (p, 3) and areas (p,) of points."""
    values, slopes = _shapes(surface.kinds[facet], coordinates)
    corners = x[surface.nodes[facet]]
    place, along = np.einsum("pa,pai->pi", values, corners), np.einsum("pda,pai->pdi", slopes, corners)
    if surface.is_line:
        return place, np.linalg.norm(along[:, 0], axis=1) * share
    return place, np.linalg.norm(np.cross(along[:, 0], along[:, 1]), axis=1) * share


def _shapes(kinds, coordinates):
    """Values (p, 9) and derivatives (p, 2, 9); points at the same coordinates of a kind are computed once."""
    key, inverse = np.unique(np.column_stack([kinds, coordinates]), axis=0, return_inverse=True)
    room, values, slopes = room_for_shapes(), np.empty((len(key), 9)), np.empty((len(key), 2, 9))
    for k, (kind, xi, eta) in enumerate(key):
        evaluate_shapes(int(kind), xi, eta, room)
        values[k], slopes[k] = room.values, room.slopes
    inverse = inverse.ravel()
    return np.ascontiguousarray(values[inverse]), np.ascontiguousarray(slopes[inverse])


def _rules(kinds):
    """Facets (p,), coordinates (p, 2) and shares (p,) of the points of the facets' rules."""
    facet, coordinates, share = [], [], []
    for kind in np.unique(kinds):
        alike, (points, weights) = np.flatnonzero(kinds == kind), _rule(int(kind))
        facet.append(np.repeat(alike, len(weights)))
        coordinates.append(np.tile(points, (len(alike), 1)))
        share.append(np.tile(weights, len(alike)))
    return np.concatenate(facet), np.concatenate(coordinates), np.concatenate(share)


def _rule(kind: int) -> tuple[np.ndarray, np.ndarray]:
    line, weight = np.polynomial.legendre.leggauss(3)
    if kind >= LINE2:
        return np.column_stack([line, 0 * line]), weight
    if kind >= QUAD8:
        xi, eta = np.meshgrid(line, line, indexing="ij")
        return np.column_stack([xi.ravel(), eta.ravel()]), np.outer(weight, weight).ravel()
    return TRIANGLE_POINTS, TRIANGLE_WEIGHTS


def _dunavant():
    """Six points of degree 4. (Dunavant, Int. J. Numer. Meth. Engng 21 (1985) 1129.)"""
    (a, wa), (b, wb) = (0.445948490915965, 0.223381589678011), (0.091576213509771, 0.109951743655322)
    points = [p for c in (a, b) for p in ([c, c], [1 - 2 * c, c], [c, 1 - 2 * c])]
    return np.array(points), 0.5 * np.array([wa] * 3 + [wb] * 3)


_SMOOTH = np.cos(np.radians(45))  # of the angle between facets' normals
TRIANGLE_POINTS, TRIANGLE_WEIGHTS = _dunavant()
