"""A mesh of any body: nodes, elements by region, faces by name; spatial, in plane strain or axisymmetric.

Plane meshes lie in z = 0. In an axisymmetric body x is the radius and y the axis. Curved facets can be converted to flat triangles.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from softtact.errors import InputError
from softtact.fem.elements import HEX20, HEX27, LINE3, QUAD8, QUAD9, TET10, TRI6, WEDGE18, Element

GEOMETRIES = ("solid", "plane_strain", "axisymmetric")
ELEMENTS = {element.meshio_name: element for element in (TET10, HEX20, HEX27, WEDGE18, TRI6, QUAD8, QUAD9)}
_FLIPPED = {6: [0, 2, 1, 5, 4, 3], 8: [0, 3, 2, 1, 7, 6, 5, 4], 9: [0, 3, 2, 1, 7, 6, 5, 4, 8]}  # a facet seen from its other side
_ROUND_OFF = 1e-6     # of the largest radius: how far beyond the axis a node may lie
FACETS = {element.meshio_name: element for element in (LINE3, TRI6, QUAD8, QUAD9)}
Facets = dict[str, np.ndarray]
"""{meshio's name of a facet: nodes (f, k)}, seen counter-clockwise from outside."""
_CUT = {"triangle6": [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
        "quad8": [[0, 4, 7], [4, 1, 5], [5, 2, 6], [6, 3, 7], [4, 5, 6], [4, 6, 7]],
        "quad9": [[0, 4, 8], [4, 1, 8], [1, 5, 8], [5, 2, 8], [2, 6, 8], [6, 3, 8], [3, 7, 8], [7, 0, 8]]}


@dataclass(frozen=True)
class SolidMesh:
    """A mesh of one or several bodies."""

    points: np.ndarray
    """(n, 3) nodes in mm."""
    cells: tuple[tuple[str, str, np.ndarray], ...]
    """Elements by region: (region, meshio's name of the element, nodes (e, m))."""
    faces: dict[str, Facets] = field(default_factory=dict)
    """Faces by name."""
    geometry: str = "solid"
    """solid, plane_strain or axisymmetric."""
    thickness_mm: float = 1.0
    """Thickness of a body in plane strain."""

    def __post_init__(self) -> None:
        if self.geometry not in GEOMETRIES:
            raise InputError(f"The geometry {self.geometry!r} is unknown; use one of {', '.join(GEOMETRIES)}.")
        plane = self.geometry != "solid"
        for region, kind, nodes in self.cells:
            if kind not in ELEMENTS:
                raise InputError(f"The region {region!r} has cells {kind!r}; use one of {', '.join(ELEMENTS)}.")
            if (ELEMENTS[kind].nodes.shape[1] == 2) != plane:
                raise InputError(f"The region {region!r} has cells {kind!r}, which do not fit the geometry {self.geometry!r}.")
            if len(nodes) and (nodes.min() < 0 or nodes.max() >= len(self.points)):
                raise InputError(f"The region {region!r} has cells with nodes beyond the mesh's {len(self.points)}.")
        if not 0 < self.thickness_mm < np.inf:
            raise InputError(f"The thickness of the body is {self.thickness_mm:g} mm; give a positive number.")
        self._check_places()

    def _check_places(self):
        """Refuse nodes of elements at no finite place, or beyond the axis of an axisymmetric body, x = 0."""
        if np.isfinite(self.points).all() and not self.axisymmetric or not self.cells:
            return
        used = np.unique(np.concatenate([nodes.ravel() for _, _, nodes in self.cells]))
        if (lost := ~np.isfinite(self.points[used]).all(axis=1)).any():
            raise InputError(f"{lost.sum()} nodes of elements have a coordinate that is not a finite number (the first is node "
                             f"{used[lost.argmax()]}); correct it.")
        x = self.points[used, 0]
        if self.axisymmetric and len(x) and x.min() < -_ROUND_OFF * np.abs(x).max():
            place = ", ".join(f"{value:.4g}" for value in self.points[used[x.argmin()]])
            raise InputError(f"{np.count_nonzero(x < 0)} nodes lie beyond the axis x = 0 (one at {place} mm); move the body, or "
                             "leave out its half at x < 0.")

    @property
    def regions(self) -> list[str]:
        """Names of the regions, each once."""
        return list(dict.fromkeys(region for region, _, _ in self.cells))

    @property
    def axisymmetric(self) -> bool:
        """Whether x is a radius."""
        return self.geometry == "axisymmetric"

    def parts(self) -> Iterator[tuple[str, Element, np.ndarray]]:
        """(region, element, nodes (e, m)) one after the other."""
        return ((region, ELEMENTS[kind], nodes) for region, kind, nodes in self.cells)

    @cached_property
    def boundary(self) -> Facets:
        """All facets that belong to exactly one element."""
        return _boundary([(ELEMENTS[kind], nodes) for _, kind, nodes in self.cells])

    def face(self, name: str) -> Facets:
        """The face with that name; `boundary` is the whole surface. InputError lists the known names if it is unknown."""
        if name == "boundary" and name not in self.faces:
            return self.boundary
        if name not in self.faces:
            raise InputError(f"The mesh has no face {name!r}; its faces are {', '.join(['boundary', *self.faces])}.")
        return self.faces[name]

    def face_nodes(self, name: str) -> np.ndarray:
        """Nodes (k,) of a face, each once."""
        return np.unique(np.concatenate([nodes.ravel() for nodes in self.face(name).values()]))

    def with_faces(self, **where: Callable[[np.ndarray], np.ndarray]) -> "SolidMesh":
        """The mesh with named faces: the facets of the boundary whose centres (f, 3) in mm satisfy the rule `where` (f,).

        Raises InputError if a face is empty.
        """
        named = {name: self._facets_where(name, rule) for name, rule in where.items()}
        return replace(self, faces=self.faces | named)

    def _facets_where(self, name, rule):
        found = {}
        for kind, nodes in self.boundary.items():
            middles = self.points[nodes[:, : FACETS[kind].corners]].mean(axis=1)
            if (here := np.asarray(rule(middles), dtype=bool)).any():
                found[kind] = nodes[here]
        if not found:
            raise InputError(f"The face {name!r} would be empty: no facet of the boundary is where it was asked for.")
        return found

    def with_regions(self, rule: Callable[[np.ndarray], np.ndarray]) -> "SolidMesh":
        """The mesh with the region names (e,) that `rule` returns for the centres (e, 3) in mm of its elements."""
        cells = []
        for _, kind, nodes in self.cells:
            names = np.asarray(rule(self.points[nodes].mean(axis=1)))
            cells += [(str(name), kind, nodes[names == name]) for name in np.unique(names)]
        return replace(self, cells=tuple(cells))

    def moved(self, transform: Callable[[np.ndarray], np.ndarray]) -> "SolidMesh":
        """The mesh with its nodes at transform(points (n, 3))."""
        return replace(self, points=np.ascontiguousarray(transform(self.points), dtype=float))

    def joined(self, other: "SolidMesh", *, prefix: str = "") -> "SolidMesh":
        """Both meshes as one without merged nodes; `prefix` precedes the other's names of regions and faces.

        Regions and faces of one name become one. With a prefix the other's whole surface is the face PREFIXboundary.
        """
        if other.geometry != self.geometry:
            raise InputError(f"A mesh of the geometry {other.geometry!r} cannot join one of {self.geometry!r}.")
        if self.geometry == "plane_strain" and other.thickness_mm != self.thickness_mm:
            raise InputError(f"A mesh of {other.thickness_mm:g} mm thickness cannot join one of {self.thickness_mm:g} mm; give "
                             "both one thickness.")
        shift, faces = len(self.points), dict(self.faces)
        whole = {"boundary": other.boundary} if prefix else {}
        for name, facets in (other.faces | whole).items():
            faces[prefix + name] = _joined(faces.get(prefix + name, {}), {kind: nodes + shift for kind, nodes in facets.items()})
        cells = tuple((prefix + region, kind, nodes + shift) for region, kind, nodes in other.cells)
        return replace(self, points=np.vstack([self.points, other.points]), cells=self.cells + cells, faces=faces)

    def volume_mm3(self) -> float:
        """Volume of all elements in mm3."""
        return float(sum(volumes.sum() for volumes in map(self._volumes, self.cells)))

    def _volumes(self, cell):
        element, nodes = ELEMENTS[cell[1]], cell[2]
        d, rule = element.nodes.shape[1], element.quadrature
        jacobian = np.einsum("emi,gmj->egij", self.points[nodes][..., :d], element.shape(rule.points)[1], optimize=True)
        volumes = np.linalg.det(jacobian) * rule.weights
        if d == 3:
            return volumes
        radius = np.einsum("gm,em->eg", element.shape(rule.points)[0], self.points[nodes][..., 0])
        return volumes * (2 * np.pi * radius if self.axisymmetric else self.thickness_mm)


def thickness_of(geometry: str, stated_mm: float | None) -> float:
    """Thickness in mm of a body in a geometry: the stated one, else 1. Raises InputError where a stated one has no effect."""
    if stated_mm is not None and geometry != "plane_strain":
        raise InputError(f"The thickness of {stated_mm:g} mm has no effect on a mesh of the geometry {geometry!r}; leave it out.")
    return 1.0 if stated_mm is None else stated_mm


def _joined(one: Facets, other: Facets) -> Facets:
    """The facets of both."""
    return one | {kind: np.concatenate([one[kind], nodes]) if kind in one else nodes for kind, nodes in other.items()}


def _boundary(cells):
    """Facets of elements [(element, nodes (e, m))] that occur once, oriented outwards."""
    kinds: dict[str, list[np.ndarray]] = {}
    for element, nodes in cells:
        for number, face in enumerate(element.faces):
            facet = nodes[:, face.nodes]
            if number == 0 and element.nodes.shape[1] == 3:  # a bottom is seen from inside
                facet = facet[:, _FLIPPED[facet.shape[1]]]
            kinds.setdefault(face.element.meshio_name, []).append(facet)
    facets = {kind: np.concatenate(blocks) for kind, blocks in kinds.items()}
    corners = {kind: FACETS[kind].corners for kind in facets}
    width = max(corners.values())
    keys = [
        np.pad(np.sort(nodes[:, : corners[kind]], axis=1), ((0, 0), (0, width - corners[kind])), constant_values=-1)
        for kind, nodes in facets.items()
    ]
    _, inverse, counts = np.unique(np.concatenate(keys), axis=0, return_inverse=True, return_counts=True)
    once, found, start = counts[inverse.ravel()] == 1, {}, 0
    for kind, nodes in facets.items():
        single = once[start : start + len(nodes)]
        start += len(nodes)
        if single.any():
            found[kind] = nodes[single]
    return found


def flat_triangles(facets: Facets) -> np.ndarray:
    """Triangles (t, 3) of nodes that approximate facets, with the same orientation."""
    return np.concatenate([nodes[:, _CUT[kind]].reshape(-1, 3) for kind, nodes in facets.items()])


def fine_triangles(facets: Facets, points: np.ndarray, *, divisions: int = 4) -> np.ndarray:
    """Corners (t, 3, 3) in mm of triangles on curved facets, each of whose edges is cut into `divisions` parts.

    Their deviation from a facet of length h and radius of curvature R is at most h^2 / (8 R divisions^2).
    """
    found = []
    for kind, nodes in facets.items():
        corners, triangles = _grid(kind, divisions)
        places = np.einsum("cm,fmi->fci", FACETS[kind].shape(corners)[0], points[nodes])
        found.append(places[:, triangles].reshape(-1, 3, 3))
    return np.concatenate(found)


def _grid(kind, n):
    """Parent coordinates (c, 2) of the corners of a subdivided facet, and the triangles (t, 3) between them."""
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
    """Triangles (t, 3) of the mesh's surface, with the mid-side nodes as corners; for a plane mesh, of the whole mesh."""
    if mesh.geometry == "solid":
        return flat_triangles(mesh.boundary)
    return np.concatenate([flat_triangles({kind: nodes}) for _, kind, nodes in mesh.cells])
