"""The elements: nodes, shape functions, faces, quadrature, and their names and node orders in other programs.

The 20-node hexahedron is cheap, and keeps its order of convergence as a parallelepiped. The full quadratic elements HEX27 and
WEDGE18 have the nodes of a plane element at the bottom, the top and the middle; they keep the order also when distorted (Arnold,
Boffi and Falk, Math. Comp. 71 (2002) 909).

A shape function returns values (n, m) and derivatives (n, m, d) at points (n, d) in parent coordinates.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from softtact.fem.quadrature import (
    Quadrature,
    gauss_rule,
    tetrahedron_rule,
    tetrahedron_rule4,
    tetrahedron_rule15,
    triangle_rule,
    wedge_rule,
)


def serendipity(points: np.ndarray, *, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quadratic serendipity functions on [-1, 1]^d, d = 2 or 3.

    nodes (m, d): corners and mid-sides (a 0 marks the direction of the side). (Zienkiewicz and Taylor, vol. 1, ch. 8.)
    """
    points, nodes = np.asarray(points, dtype=float), np.asarray(nodes, dtype=float)
    dimension = nodes.shape[1]
    linear = 1 + points[:, None, :] * nodes                       # factors of the directions in which a node is a corner
    bubble = 1 - points[:, None, :] ** 2 + 0 * nodes              # factor of the direction in which it is mid-side
    mid = nodes == 0
    factor = np.where(mid, bubble, linear)
    slope = np.where(mid, -2 * points[:, None, :], nodes)
    corner = ~mid.any(axis=1)
    extra = (points[:, None, :] * nodes).sum(axis=2) - (dimension - 1)
    scale = np.where(corner, 0.5**dimension, 0.5 ** (dimension - 1))
    product = factor.prod(axis=2)
    values = scale * product * np.where(corner, extra, 1.0)
    derivatives = np.empty(points.shape[:1] + nodes.shape)
    for i in range(dimension):
        others = np.delete(factor, i, axis=2).prod(axis=2)
        derivatives[..., i] = scale * (slope[..., i] * others * np.where(corner, extra, 1.0)
                                       + np.where(corner, product * nodes[:, i], 0.0))
    return values, derivatives


def quadratic(points: np.ndarray, *, nodes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Products of the quadratic functions along each direction of [-1, 1]^d, for nodes (m, d) at -1, 0 and 1."""
    points, kind = np.asarray(points, dtype=float), np.asarray(nodes, dtype=np.int64) % 3     # of nodes at 0, 1, -1
    lines = [_along(points[:, axis]) for axis in range(kind.shape[1])]

    def product(slope_of):
        out = np.ones((len(points), len(kind)))
        for axis, line in enumerate(lines):
            out = out * line[1 if axis == slope_of else 0][:, kind[:, axis]]
        return out

    return product(None), np.stack([product(axis) for axis in range(len(lines))], axis=2)


def _along(t):
    """Values (n, 3) and derivatives (n, 3) of the quadratic functions of nodes at 0, 1 and -1."""
    t = t[:, None]
    return np.hstack([1 - t**2, 0.5 * t * (t + 1), 0.5 * t * (t - 1)]), np.hstack([-2 * t, t + 0.5, t - 0.5])


_TRIANGLE_SIDES = np.array([[0, 1], [1, 2], [2, 0]])


def quadratic_triangle(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quadratic functions of the triangle (0, 0), (1, 0), (0, 1): three corners, then the mid-sides."""
    L, dL = linear_simplex(points)
    a, b = _TRIANGLE_SIDES.T
    values = np.hstack([L * (2 * L - 1), 4 * L[:, a] * L[:, b]])
    slopes = np.concatenate([(4 * L - 1)[..., None] * dL,
                             4 * (L[:, a, None] * dL[:, b] + L[:, b, None] * dL[:, a])], axis=1)
    return values, slopes


_TETRAHEDRON_EDGES = np.array([[0, 1], [1, 2], [2, 0], [0, 3], [1, 3], [2, 3]])


def quadratic_tetrahedron(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Quadratic functions of the tetrahedron of the origin and the unit vectors: four corners, then the mid-edges."""
    L, dL = linear_simplex(points)
    a, b = _TETRAHEDRON_EDGES.T
    values = np.hstack([L * (2 * L - 1), 4 * L[:, a] * L[:, b]])
    slopes = np.concatenate([(4 * L - 1)[..., None] * dL,
                             4 * (L[:, a, None] * dL[:, b] + L[:, b, None] * dL[:, a])], axis=1)
    return values, slopes


def linear_simplex(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Linear functions of the simplex of the origin and the unit vectors: a triangle or a tetrahedron."""
    points = np.asarray(points, dtype=float)
    d = points.shape[1]
    rest = 1 - points[:, 0]
    for axis in range(1, d):
        rest = rest - points[:, axis]
    slopes = np.vstack([-np.ones(d), np.eye(d)])
    return np.column_stack([rest, points]), np.broadcast_to(slopes, (len(points), *slopes.shape))


def lifted(points: np.ndarray, *, base: Callable) -> tuple[np.ndarray, np.ndarray]:
    """Products of a plane element's functions `base` with quadratic ones along the height, for bottom, top and middle nodes."""
    points = np.asarray(points, dtype=float)
    values, slopes = base(points[:, :2])
    (z, dz), order = _along(points[:, 2]), [2, 1, 0]
    z, dz = z[:, order], dz[:, order]
    shape = len(points), 3 * values.shape[1]
    product = (z[:, :, None] * values[:, None, :]).reshape(shape)
    in_plane = (z[:, :, None, None] * slopes[:, None]).reshape(*shape, 2)
    upwards = (dz[:, :, None] * values[:, None, :]).reshape(*shape, 1)
    return product, np.concatenate([in_plane, upwards], axis=2)


@dataclass(frozen=True, eq=False)
class Face:
    """A face: its element type, and its nodes (k,) among those of the parent element, in the order of that type."""

    element: "Element"
    nodes: np.ndarray


@dataclass(frozen=True, eq=False)
class Element:
    """A kind of element.

    nodes: (m, d) parent coordinates
    shape: function of points (n, d) that gives the shape functions' values (n, m) and derivatives (n, m, d)
    quadrature: the full rule;  reduced: the rule with a point less along each side, None where it is not used
    faces: in Abaqus' order S1, S2, ...: of a solid its bottom, counter-clockwise seen from inside, then its top where it has one
        and its sides, counter-clockwise seen from outside; of a plane element its sides
    meshio_name, vtk_order: the cell's name in meshio, and the permutation to VTK's node order: cells[:, vtk_order]
    abaqus_name, abaqus_nodes: the corresponding element of Abaqus and CalculiX, and its nodes among these, in its order;
        dialects add letters to the name
    """

    nodes: np.ndarray
    shape: Callable
    quadrature: Quadrature
    meshio_name: str
    vtk_order: np.ndarray
    faces: tuple = ()
    reduced: Quadrature | None = None
    abaqus_name: str | None = None
    abaqus_nodes: np.ndarray | None = None

    @cached_property
    def corners(self) -> int:
        """Number of corners; in VTK's order they are the first nodes."""
        if self.nodes.shape[1] < 3:
            return len(self.faces) or 2
        return len(np.unique(np.concatenate([face.nodes[:face.element.corners] for face in self.faces])))

    @property
    def bottom(self) -> np.ndarray:
        """Nodes of a solid's face S1."""
        return self.faces[0].nodes

    @property
    def top(self) -> np.ndarray:
        """Nodes of the face S2 of a hexahedron or wedge."""
        return self.faces[1].nodes

    @cached_property
    def sides(self) -> np.ndarray:
        """Nodes (s, k) of the sides: those of a plane element, or those of a hexahedron or wedge over its bottom's sides."""
        return np.array([face.nodes for face in (self.faces[2:] if self.nodes.shape[1] == 3 else self.faces)])


def reference_gradients(coordinates: np.ndarray, derivatives: np.ndarray, weights: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gradients in the reference configuration.

    coordinates (e, m, d) in mm, derivatives (g, m, d), weights (g,); d = 3, or 2 for plane elements.
    Returns gradients (e, g, m, d) in 1/mm and volumes (e, g) in mm3 (mm2). Raises ValueError on an inverted element.
    """
    jacobian = np.einsum("emi,gmj->egij", coordinates, derivatives, optimize=True)
    determinant = np.linalg.det(jacobian)
    if determinant.min() <= 0:
        raise ValueError(f"element {int(np.argmin(determinant.min(axis=1)))} is inverted")
    inverse = np.linalg.inv(jacobian)
    return np.ascontiguousarray(np.matmul(derivatives[None], inverse)), determinant * weights


_CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
_MIDS = np.array([[0, -1], [1, 0], [0, 1], [-1, 0]], dtype=float)


def _at_height(plane, zeta):
    return np.column_stack([plane, np.full(len(plane), float(zeta))])


def _faces(element, nodes):
    return tuple(Face(element, np.array(numbers)) for numbers in nodes)


_LINE3_NODES = np.array([[-1.0], [1.0], [0.0]])
LINE3 = Element(_LINE3_NODES, partial(quadratic, nodes=_LINE3_NODES), gauss_rule(3, 1), "line3", np.arange(3))
"""Quadratic line::

    0 --- 2 --- 1     xi from -1 to 1
"""

_QUAD8_NODES = np.vstack([_CORNERS, _MIDS])
_QUAD_SIDES = _faces(LINE3, [[0, 1, 4], [1, 2, 5], [2, 3, 6], [3, 0, 7]])
QUAD8 = Element(_QUAD8_NODES, partial(serendipity, nodes=_QUAD8_NODES), gauss_rule(3, 2), "quad8", np.arange(8), _QUAD_SIDES,
                abaqus_name="8", abaqus_nodes=np.arange(8))
"""Serendipity quadrilateral on [-1, 1]^2; sides eta = -1, xi = 1, eta = 1, xi = -1::

    3 --- 6 --- 2     eta
    |           |      |
    7           5      |
    |           |      +---- xi
    0 --- 4 --- 1
"""

_QUAD9_NODES = np.vstack([_QUAD8_NODES, [[0.0, 0.0]]])
QUAD9 = Element(_QUAD9_NODES, partial(quadratic, nodes=_QUAD9_NODES), gauss_rule(3, 2), "quad9", np.arange(9), _QUAD_SIDES,
                abaqus_name="8", abaqus_nodes=np.arange(8))
"""Full quadratic quadrilateral on [-1, 1]^2; sides as those of QUAD8::

    3 --- 6 --- 2     eta
    |           |      |
    7     8     5      |
    |           |      +---- xi
    0 --- 4 --- 1
"""

TRI6 = Element(np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]]), quadratic_triangle, triangle_rule(), "triangle6",
               np.arange(6), _faces(LINE3, [[0, 1, 3], [1, 2, 4], [2, 0, 5]]), abaqus_name="6", abaqus_nodes=np.arange(6))
"""Quadratic triangle with corners (0, 0), (1, 0), (0, 1); its sides begin at nodes 0, 1 and 2::

    2
    |`.             eta
    5   4            |
    |     `.         |
    0 -- 3 -- 1      +---- xi
"""

_HEX20_NODES = np.vstack([_at_height(_CORNERS, -1), _at_height(_CORNERS, 1), _at_height(_MIDS, -1), _at_height(_MIDS, 1),
                          _at_height(_CORNERS, 0)])
HEX20 = Element(
    _HEX20_NODES, partial(serendipity, nodes=_HEX20_NODES), gauss_rule(3, 3), "hexahedron20", np.arange(20),
    _faces(QUAD8, [[0, 1, 2, 3, 8, 9, 10, 11], [4, 5, 6, 7, 12, 13, 14, 15], [0, 1, 5, 4, 8, 17, 12, 16],
                   [1, 2, 6, 5, 9, 18, 13, 17], [2, 3, 7, 6, 10, 19, 14, 18], [3, 0, 4, 7, 11, 16, 15, 19]]),
    reduced=gauss_rule(2, 3), abaqus_name="C3D20", abaqus_nodes=np.arange(20))
"""Serendipity hexahedron on [-1, 1]^3; sides eta = -1, xi = 1, eta = 1, xi = -1::

          7 ---14--- 6
         /|         /|
       15 |       13 |        zeta
       /  19      /  18         |  eta
      4 ---12--- 5   |          | /
      |   |      |   |          |/
      |   3 ---10|-- 2          +---- xi
     16  /      17  /
      | 11       | 9
      |/         |/
      0 --- 8--- 1
"""


def _side(a, b, middle, plane):
    """Nodes in the order of QUAD9 of the side over the edge from a to b of a plane element with `plane` nodes."""
    low, high, between = 0, plane, 2 * plane
    return [a + low, b + low, b + high, a + high, middle + low, b + between, middle + high, a + between, middle + between]


_HEX27_NODES = np.vstack([_at_height(_QUAD9_NODES, zeta) for zeta in (-1, 1, 0)])
HEX27 = Element(
    _HEX27_NODES, partial(quadratic, nodes=_HEX27_NODES), gauss_rule(3, 3), "hexahedron27",
    np.array([0, 1, 2, 3, 9, 10, 11, 12, 4, 5, 6, 7, 13, 14, 15, 16, 18, 19, 20, 21, 25, 23, 22, 24, 8, 17, 26]),
    _faces(QUAD9, [np.arange(9), np.arange(9, 18), *(_side(*face.nodes, 9) for face in _QUAD_SIDES)]),     # type: ignore[call-arg]
    reduced=gauss_rule(2, 3), abaqus_name="C3D20",
    abaqus_nodes=np.array([0, 1, 2, 3, 9, 10, 11, 12, 4, 5, 6, 7, 13, 14, 15, 16, 18, 19, 20, 21]))
"""Full quadratic hexahedron on [-1, 1]^3: QUAD9 at the bottom, the top and the middle; sides as those of HEX20::

       bottom, zeta = -1          top, zeta = 1            middle, zeta = 0

      3 ---- 6 ---- 2          12 ----15 ----11          21 ----24 ----20       eta
      |             |           |             |           |             |        |
      7      8      5          16     17     14          25     26     23        |
      |             |           |             |           |             |        +---- xi
      0 ---- 4 ---- 1           9 ----13 ----10          18 ----22 ----19
"""

WEDGE18 = Element(
    np.vstack([_at_height(TRI6.nodes, zeta) for zeta in (-1, 1, 0)]), partial(lifted, base=quadratic_triangle), wedge_rule(),
    "wedge18",
    np.array([0, 1, 2, 6, 7, 8, 3, 4, 5, 9, 10, 11, 12, 13, 14, 15, 16, 17]),
    _faces(TRI6, [np.arange(6), np.arange(6, 12)]) + _faces(QUAD9, [_side(*face.nodes, 6) for face in TRI6.faces]),     # type: ignore[call-arg]
    abaqus_name="C3D15", abaqus_nodes=np.array([0, 1, 2, 6, 7, 8, 3, 4, 5, 9, 10, 11, 12, 13, 14]))
"""Full quadratic wedge, zeta from -1 to 1: TRI6 at the bottom, the top and the middle; sides over those of TRI6::

       bottom, zeta = -1     top, zeta = 1       middle, zeta = 0

      2                      8                   14
      |`.                    |`.                  |`.               eta
      5   4                 11   10              17   16             |
      |     `.               |     `.             |     `.           |
      0 -- 3 -- 1            6 -- 9 -- 7         12 --15 --13        +---- xi
"""

TRI3 = Element(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), linear_simplex, triangle_rule(), "triangle", np.arange(3))
"""Linear triangle: TRI6 without its mid-sides."""

TET4 = Element(np.vstack([np.zeros(3), np.eye(3)]), linear_simplex, tetrahedron_rule(), "tetra", np.arange(4),
               _faces(TRI3, [[0, 1, 2], [0, 1, 3], [1, 2, 3], [2, 0, 3]]), abaqus_name="C3D4", abaqus_nodes=np.arange(4))
"""Linear tetrahedron with corners at the origin and the unit vectors::

    3
    |`.
    |  `.          zeta
    | 2  `.          |  eta
    |/     `.        | /
    0 ------- 1      +---- xi
"""


TET10 = Element(np.vstack([TET4.nodes, 0.5 * (TET4.nodes[[0, 1, 2, 0, 1, 2]] + TET4.nodes[[1, 2, 0, 3, 3, 3]])]),
                quadratic_tetrahedron, tetrahedron_rule15(), "tetra10", np.arange(10),
                _faces(TRI6, [[0, 1, 2, 4, 5, 6], [0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 9, 8], [2, 0, 3, 6, 7, 9]]),
                reduced=tetrahedron_rule4(), abaqus_name="C3D10", abaqus_nodes=np.arange(10))
"""Quadratic tetrahedron: TET4 and the mid-sides of its edges 01, 12, 20, 03, 13, 23. Its reduced rule of four points integrates
the small-strain energy of straight elements exactly, and is the usual one."""


def dofs_of(nodes: np.ndarray) -> np.ndarray:
    """Unknowns (..., 3 k) of nodes (..., k): x, y and z of each node in a row."""
    return (3 * nodes[..., None] + np.arange(3)).reshape(*nodes.shape[:-1], -1)
