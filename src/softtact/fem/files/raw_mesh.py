"""A mesh as the file of another program states it: cells of all kinds, sets of elements and of facets, and what was not read."""

from dataclasses import dataclass, field

import numpy as np

from softtact.fem.elements import Element
from softtact.fem.quadratic_nodes import QUADRATIC
from softtact.fem.solid_mesh import ELEMENTS, FACETS

Flags = list[np.ndarray]
"""Which cells (e,) of each block belong to a set."""
DIMENSION = {"vertex": 0, "line": 1, "triangle": 2, "quad": 2, "tetra": 3, "hexahedron": 3, "wedge": 3, "pyramid": 3}
FACET_CORNERS = {"line": 2, "triangle": 3, "quad": 4} | {kind: element.corners for kind, element in FACETS.items()}
_CORNERS = FACET_CORNERS | {"vertex": 1, "tetra": 4, "hexahedron": 8, "wedge": 6, "pyramid": 5}


@dataclass
class RawMesh:
    """Cells of a file, in its unit, with nodes in the order of VTK (a linear wedge in that of Gmsh and Abaqus, or turned)."""

    points: np.ndarray
    """(n, 3)"""
    blocks: list[tuple[str, np.ndarray]]
    """Cells by kind: (meshio's name, nodes (e, m))."""
    regions: dict[str, Flags] = field(default_factory=dict)
    """Sets of elements."""
    faces: dict[str, Flags] = field(default_factory=dict)
    """Sets of facets."""
    sides: dict[str, list[np.ndarray]] = field(default_factory=dict)
    """Faces given as sides of elements: corners [(f, k)]."""
    default_regions: list[str] | None = None
    """The sets that are the regions where the file says so."""
    geometry: str | None = None
    """plane_strain or axisymmetric, where the file states it."""
    thickness_mm: float | None = None
    in_mm: bool = False
    """Whether the file is one of softtact's own."""
    numbered: bool = False
    """Whether regions and faces are called by numbers of the file, which has no names."""
    remarks: list[str] = field(default_factory=list)
    """What was left out, in sentences without a full stop."""

    @property
    def dimensions(self) -> list[int]:
        """Dimension of each block's cells."""
        return [dimension_of(kind) for kind, _ in self.blocks]


def dimension_of(kind: str) -> int:
    """Dimension of cells by meshio's name; -1 of those that are unknown here."""
    return DIMENSION.get(_shape(kind), -1)


def corners_of(kind: str) -> int:
    """Number of corners of a cell by meshio's name."""
    return _CORNERS[_shape(kind)]


def _shape(kind: str) -> str:
    return kind.rstrip("0123456789")


def element_of(kind: str) -> Element | None:
    """The quadratic element that cells of a kind become, None of others."""
    return QUADRATIC.get(kind) or ELEMENTS.get(kind)


def side_corners(kind: str) -> list[np.ndarray]:
    """Corners of each side S1, S2, ... of an element in Abaqus' order, among its corners; none of other cells."""
    element = element_of(kind)
    if element is None:
        return []
    corners = element.vtk_order[: element.corners]
    return [np.flatnonzero(np.isin(corners, face.nodes)) for face in element.faces]
