"""Meshes extruded from a 2-D mesh of quadratic quadrilaterals and triangles; interpolation in a 2-D mesh."""

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from softtact.fem.elements import QUAD8, QUAD9, TRI6

_SAME = 1e-7   # mm: nodes closer than this are merged
NO_TRIANGLES = np.zeros((0, 6, 2))
_NEAREST = 16        # elements with the nearest centres in which a point is searched for
_NEWTON_STEPS = 30
_INSIDE = 1e-6       # in parent coordinates, of which an element spans 2 or 1
_AT_POINT = 1e-9         # mm
_STARTS = np.linspace(0.0, 1.0, 9)


@dataclass(frozen=True)
class Mesh2D:
    """points (n, 2) in mm, of which the first `corners` are element corners; quads (q, 8 or 9), triangles (t, 6).

    An element's nodes are its corners, then its mid-sides, and for the 9-node quad its centre.
    """

    points: np.ndarray
    quads: np.ndarray
    corners: int
    triangles: np.ndarray = field(default_factory=lambda: np.zeros((0, 6), dtype=np.int64))

    def outer_sides(self) -> tuple[np.ndarray, ...]:
        """Quads (k,) and the numbers (k,) of their sides, as in `QUAD9.faces`, that no other element shares."""
        sides = np.sort(self.quads[:, QUAD9.sides[:, :2]], axis=2)     # by their corners
        others = np.sort(self.triangles[:, TRI6.sides[:, :2]], axis=2)
        _, where, counts = np.unique(np.vstack([sides.reshape(-1, 2), others.reshape(-1, 2)]), axis=0, return_inverse=True,
                                     return_counts=True)
        return np.nonzero(counts[where.ravel()[:sides[..., 0].size]].reshape(-1, 4) == 1)


@dataclass(frozen=True)
class HexMesh:
    """points (n, 3) in mm; hexes (e, 20 or 27), wedges (w, 18), layer by layer from below.

    `planes` (heights, points of the 2-D mesh): node numbers between the layers.
    """

    points: np.ndarray
    hexes: np.ndarray
    planes: np.ndarray
    wedges: np.ndarray

    @property
    def layers(self) -> int:
        """Number of element layers."""
        return len(self.planes) - 1

    @property
    def inner_planes(self) -> np.ndarray:
        """Node numbers (2 layers, points of the 2-D mesh) of all planes below the top, including the layers' middle planes.

        Only for a mesh whose middle planes have all points of the 2-D mesh (27-node hexahedra).
        """
        return np.vstack([self.planes[:-1], *(self.middle(k) for k in range(self.layers))])

    def middle(self, index: int) -> np.ndarray:
        """Node numbers (points of the 2-D mesh,) in the middle plane of one layer, of a mesh with full middle planes."""
        count = self.planes.shape[1]
        return self.planes.size + index * count + np.arange(count)

    def layer(self, index: int) -> np.ndarray:
        """Hexes of one layer (q, 20 or 27)."""
        return self.hexes.reshape(self.layers, -1, self.hexes.shape[1])[index]

    def wedge_layer(self, index: int) -> np.ndarray:
        """Wedges of one layer (t, 18)."""
        return self.wedges.reshape(self.layers, -1, 18)[index]


def extrude(mesh_2d: Mesh2D, heights: Sequence[float] | np.ndarray, *, scale: Callable[[float], float] | None = None) -> HexMesh:
    """Extrude a 2-D mesh through `heights` (increasing z in mm); `scale(z)` multiplies the coordinates x and y.

    8-node quads become 20-node hexahedra, 9-node quads 27-node ones, triangles 18-node wedges.
    """
    heights = np.asarray(heights, dtype=float)
    middles = 0.5 * (heights[:-1] + heights[1:])
    full = mesh_2d.quads.shape[1] == 9
    count, upright = len(mesh_2d.points), len(mesh_2d.points) if full else mesh_2d.corners

    def lifted(points, z):
        return np.column_stack([points * (scale(z) if scale else 1.0), np.full(len(points), z)])

    planes = np.arange(len(heights) * count).reshape(len(heights), count)
    between = planes.size + np.arange(len(middles) * upright).reshape(len(middles), upright)
    points = np.vstack([lifted(mesh_2d.points, z) for z in heights] + [lifted(mesh_2d.points[:upright], z) for z in middles])

    def lift(elements):
        layers = [_full_element(low, high, edge, elements) if full else _serendipity(low, high, edge, elements)
                  for low, high, edge in zip(planes[:-1], planes[1:], between, strict=True)]
        return np.vstack([np.zeros((0, 3 * elements.shape[1] if full else 20), dtype=np.int64), *layers])

    return HexMesh(points=points, hexes=lift(mesh_2d.quads), planes=planes,
                   wedges=lift(mesh_2d.triangles) if len(mesh_2d.triangles) else np.zeros((0, 18), dtype=np.int64))


def _full_element(low, high, middle, elements):
    return np.hstack([low[elements], high[elements], middle[elements]])


def _serendipity(low, high, middle, quads):
    corner, mid = quads[:, :4], quads[:, 4:]
    return np.hstack([low[corner], high[corner], low[mid], high[mid], middle[corner]])


def grid_mesh_2d(x_lines: np.ndarray, y_lines: np.ndarray) -> Mesh2D:
    """Rectangles between grid lines (increasing, mm), numbered x fastest."""
    nx, ny = len(x_lines), len(y_lines)
    corner = np.arange(nx * ny).reshape(ny, nx)
    along_x = nx * ny + np.arange((nx - 1) * ny).reshape(ny, nx - 1)
    along_y = nx * ny + (nx - 1) * ny + np.arange(nx * (ny - 1)).reshape(ny - 1, nx)
    xm, ym = 0.5 * (x_lines[:-1] + x_lines[1:]), 0.5 * (y_lines[:-1] + y_lines[1:])

    def points(x, y):
        gx, gy = np.meshgrid(x, y)
        return np.column_stack([gx.ravel(), gy.ravel()])

    quads = np.stack([corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1],
                      along_x[:-1], along_y[:, 1:], along_x[1:], along_y[:, :-1]], axis=-1).reshape(-1, 8)
    return Mesh2D(np.vstack([points(x_lines, y_lines), points(xm, y_lines), points(x_lines, ym)]), quads, nx * ny)


def merge(quads: np.ndarray, triangles: np.ndarray = NO_TRIANGLES) -> Mesh2D:
    """2-D mesh of elements given by their nodes' coordinates: quads (q, 9, 2) and triangles (t, 6, 2) in mm."""
    corners = np.vstack([quads[:, :4].reshape(-1, 2), triangles[:, :3].reshape(-1, 2)])
    others = np.vstack([quads[:, 4:].reshape(-1, 2), triangles[:, 3:].reshape(-1, 2)])
    corner_points, corner = _unique(corners)
    other_points, other = _unique(others)
    other = other + len(corner_points)
    ends = (4 * len(quads), 5 * len(quads))
    quad = np.hstack([corner[:ends[0]].reshape(-1, 4), other[:ends[1]].reshape(-1, 5)])
    triangle = np.hstack([corner[ends[0]:].reshape(-1, 3), other[ends[1]:].reshape(-1, 3)])
    return Mesh2D(np.vstack([corner_points, other_points]), quad, len(corner_points), triangle)


def with_centres(quads: np.ndarray) -> np.ndarray:
    """9-node quads (q, 9, 2) from 8-node quads (q, 8, 2); the ninth node is the centre of the 8-node map, so the shape is kept."""
    centre = QUAD8.shape(np.zeros((1, 2)))[0] @ quads
    return np.concatenate([quads, centre], axis=1)


def _unique(points):
    _, first, where = np.unique(np.round(points / _SAME).astype(np.int64), axis=0, return_index=True, return_inverse=True)
    return points[first], where.ravel()


def refine(mesh_2d: Mesh2D, times: int = 1) -> Mesh2D:
    """Split every element of a 2-D mesh into four, on the same curves."""
    for _ in range(times):
        mesh_2d = merge(_split(mesh_2d.points[mesh_2d.quads], QUAD9.shape, QUAD9.nodes, _QUAD_CHILDREN),
                     _split(mesh_2d.points[mesh_2d.triangles], TRI6.shape, TRI6.nodes, _TRIANGLE_CHILDREN))
    return mesh_2d


_QUAD_CHILDREN = [(0.5 * np.eye(2), np.array([0.5 * x, 0.5 * y])) for y in (-1, 1) for x in (-1, 1)]
_TRIANGLE_CHILDREN = ([(0.5 * np.eye(2), np.array(shift)) for shift in ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5))]
                      + [(-0.5 * np.eye(2), np.array([0.5, 0.5]))])


def _split(nodes, shape, parent, children):
    """Nodes (4 e, m, 2) of the children of elements (e, m, 2): the parent's map at each child's parent coordinates."""
    parts = [np.einsum("pa,ead->epd", shape(parent @ matrix.T + shift)[0], nodes) for matrix, shift in children]
    return np.stack(parts, axis=1).reshape(-1, len(parent), 2)


_AXES = np.deg2rad([0, 90, 180, 270])
_DIAGONALS = _AXES + np.pi / 4
CORE_RADIUS = 0.5   # of the inner square's corners: all five quads have similar sizes
# A quadratic arc over 90 degrees with its mid-side node on the circle encloses 1.2 % too little area. The ends stay on the circle,
# where frusta touch; the middle is moved out to this radius m, so that the disc's area is exactly pi: 8/3 sqrt(2) m - 2/3 = pi.
DISC_MIDDLE_RADIUS = (np.pi + 2 / 3) * 3 / (8 * np.sqrt(2))


def _ring(radius, angles):
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def _ring_quads(inner, inner_mid, outer, outer_mid):
    """The four quads between two closed curves, each given by corners (4, 2) and the mid-sides (4, 2) after them."""
    quads = []
    for k in range(4):
        n = (k + 1) % 4
        quads.append([inner[k], outer[k], outer[n], inner[n],
                      0.5 * (inner[k] + outer[k]), outer_mid[k], 0.5 * (inner[n] + outer[n]), inner_mid[k]])
    return np.array(quads)


def disc_quads(rings: int = 1, core: float = CORE_RADIUS) -> np.ndarray:
    """Unit disc as an O-grid of a square core and `rings` rings of four quads (1 + 4 rings, 9, 2); outer rings are thinner.

    The corners of the outer sides are at 0, 90, 180 and 270 degrees.
    """
    inner = _ring(core, _AXES)
    inner_mid = _ring(0.5 * core * (np.cos(np.pi / 4) + 0.5), _DIAGONALS)
    outer, outer_mid = _ring(1.0, _AXES), _ring(DISC_MIDDLE_RADIUS, _DIAGONALS)
    shares = 1.0 - (1.0 - np.arange(rings + 1) / rings) ** 2
    curves = [(inner + share * (outer - inner), inner_mid + share * (outer_mid - inner_mid)) for share in shares]
    between = [_ring_quads(*low, *high) for low, high in itertools.pairwise(curves)]
    return with_centres(np.vstack([[[*inner, *inner_mid]], *between]))


def disc_mesh_2d(refinement: int = 0, rings: int = 1, core: float = CORE_RADIUS) -> Mesh2D:
    """Unit disc as an O-grid of `disc_quads`, each split into four `refinement` times."""
    return refine(merge(disc_quads(rings, core)), refinement)


def cell_mesh_2d(pitch: float, diameter: float, rings: int = 1, core: float = CORE_RADIUS) -> tuple[np.ndarray, np.ndarray]:
    """One cell of a lattice of discs: quads (q, 9, 2) and triangles (4, 6, 2) in mm, the first quads being `disc_quads`.

    Each side of the cell has two elements. If neighbouring discs do not touch, a ring of quads surrounds the disc.
    """
    half, radius = 0.5 * pitch, 0.5 * diameter
    quads = [radius * disc_quads(rings, core)]
    if radius < half * (1 - 1e-9):
        quads.append(with_centres(_ring_quads(*(r * _ring(1.0, a) if a is _AXES else r * _ring(DISC_MIDDLE_RADIUS, a)
                                                for r in (radius, half) for a in (_AXES, _DIAGONALS)))))
    touch, arc = half * _ring(1.0, _AXES), half * _ring(DISC_MIDDLE_RADIUS, _DIAGONALS)
    corner = half * np.sqrt(2) * _ring(1.0, _DIAGONALS)
    triangles = []
    for k in range(4):
        n = (k + 1) % 4
        triangles.append([touch[k], corner[k], touch[n], 0.5 * (touch[k] + corner[k]), 0.5 * (corner[k] + touch[n]), arc[k]])
    return np.vstack(quads), np.array(triangles)


@dataclass(frozen=True)
class SheetMesh2D:
    """2-D mesh of the sheet over a lattice of frusta: quads and triangles cell by cell, then the strips at the edges.

    roots (f, disc nodes): nodes of each frustum's root in the order of `disc_mesh_2d`; cell_quads: number of quads of a cell.
    quarters: nodes (k, 4) at the quarter points of the cells' edges, each with the nearer corner, the middle and the farther
    corner, and the three weights of the quadratic curve through these; none in a refined mesh.
    """

    mesh_2d: Mesh2D
    roots: np.ndarray
    cell_quads: int
    quarters: tuple


def sheet_mesh_2d(centres: np.ndarray, counts: Sequence[int], pitch: float, diameter: float, footprint: Sequence[float], *,
                  refinement: int = 0, rings: int = 1, core: float = CORE_RADIUS) -> SheetMesh2D:
    """Cells at `centres` (f, 2) of a lattice `counts`, and strips of quads to the edges of the footprint (mm)."""
    quads, triangles = cell_mesh_2d(pitch, diameter, rings, core)
    strips = _strips(counts, pitch, footprint)
    mesh_2d = refine(merge(np.vstack([(quads[None] + centres[:, None, None]).reshape(-1, 9, 2), strips]),
                        (triangles[None] + centres[:, None, None]).reshape(-1, 6, 2)), refinement)
    disc = 0.5 * diameter * disc_mesh_2d(refinement, rings, core).points
    roots = _find(mesh_2d.points, (centres[:, None] + disc).reshape(-1, 2)).reshape(len(centres), -1)
    return SheetMesh2D(mesh_2d, roots, len(quads) * 4**refinement, _quarters(mesh_2d, centres, pitch, refinement))


def _quarters(mesh_2d, centres, pitch, refinement):
    weights = np.array([0.375, 0.75, -0.125])
    if refinement:
        return np.zeros((0, 4), dtype=np.int64), weights
    walls = 0.5 * pitch * np.array([[[c, side * 0.5], [c, side], [c, 0.0], [c, -side]] for c in (-1, 1) for side in (-1, 1)])
    walls = np.concatenate([walls, walls[..., ::-1]])                        # (8, 4, 2): quarter, near corner, middle, far corner
    nodes = _find(mesh_2d.points, (centres[:, None, None] + walls).reshape(-1, 2)).reshape(-1, 4)
    return np.unique(nodes, axis=0), weights


def _find(points, wanted):
    """Numbers (n,) of the points at the wanted places."""
    from scipy.spatial import cKDTree

    distance, index = cKDTree(points).query(wanted)
    if distance.max() > 1e-6:
        raise ValueError("The disc's nodes are not nodes of the plan.")
    return index


def _strips(counts, pitch, footprint):
    """Quads (q, 9, 2) between the lattice and the footprint's edges, two for each pitch; none where there is no room."""
    lines = []
    for side, count in zip(footprint, counts, strict=True):
        inner = 0.5 * pitch * (np.arange(2 * count + 1) - count)
        room = 0.5 * side - 0.5 * pitch * count > 1e-6
        lines.append(np.concatenate([[-0.5 * side], inner, [0.5 * side]]) if room else inner)
    mesh_2d = grid_mesh_2d(*lines)
    middle = mesh_2d.points[mesh_2d.quads[:, :4]].mean(axis=1)
    outside = (np.abs(middle) > 0.5 * pitch * np.asarray(counts)).any(axis=1)
    return with_centres(mesh_2d.points[mesh_2d.quads[outside]])


def interpolation_2d(mesh_2d: Mesh2D, points: np.ndarray) -> sp.csr_matrix:
    """Sparse matrix (p, mesh points) that interpolates a nodal field of a full quadratic `Mesh2D` at points (p, 2) in mm.

    Raises ValueError for a point outside the mesh.
    """
    rows, nodes, values = [], [], []
    missing = np.arange(len(points))
    for elements, kind in ((mesh_2d.quads, _Quads), (mesh_2d.triangles, _Triangles)):
        if len(elements) and len(missing):
            found, element, shape = _search(kind, elements, mesh_2d.points[elements], points[missing])
            rows.append(np.repeat(missing[found], elements.shape[1]))
            nodes.append(elements[element].ravel())
            values.append(shape.ravel())
            missing = missing[~found]
    if len(missing):
        x, y = points[missing[0]]
        raise ValueError(f"The point x {x:g}, y {y:g} mm lies outside the plan.")
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(nodes))
    return sp.csr_matrix(entries, shape=(len(points), len(mesh_2d.points)))


class _Quads:
    shape = staticmethod(QUAD9.shape)
    starts = np.array([(2 * x - 1, 2 * y - 1) for x in _STARTS for y in _STARTS])

    @staticmethod
    def outside(parent):
        return np.abs(parent).max(axis=1) - 1


class _Triangles:
    shape = staticmethod(TRI6.shape)
    starts = np.array([(x, y) for x in _STARTS for y in _STARTS if x + y <= 1])

    @staticmethod
    def outside(parent):
        return np.maximum(-parent.min(axis=1), parent.sum(axis=1) - 1)


def _search(kind, elements, corners, points):
    """Which points (p,) lie in elements of a kind, and for those the element (f,) and the shape values (f, w)."""
    _, near = cKDTree(corners.mean(axis=1)).query(points, k=min(_NEAREST, len(elements)))
    near = near.reshape(len(points), -1)
    element, values = np.full(len(points), -1), np.zeros((len(points), elements.shape[1]))
    for candidates in near.T:
        open_ = np.flatnonzero(element < 0)
        parent = _parent(kind, corners[candidates[open_]], points[open_])
        shape = kind.shape(parent)[0]
        there = np.abs(np.einsum("pa,pad->pd", shape, corners[candidates[open_]]) - points[open_]).max(axis=1) < _AT_POINT
        inside = there & (kind.outside(parent) < _INSIDE)
        element[open_[inside]], values[open_[inside]] = candidates[open_[inside]], shape[inside]
    found = element >= 0
    return found, element[found], values[found]


def _parent(kind, corners, points):
    """Parent coordinates (p, 2) of points (p, 2), each in its element (p, w, 2), by Newton's method.

    It starts from the nearest of many start points: triangles between touching circles have a cusp, into which Newton's
    method does not converge from afar.
    """
    at_starts = np.einsum("sa,pad->psd", kind.shape(kind.starts)[0], corners)
    parent = kind.starts[((at_starts - points[:, None]) ** 2).sum(axis=2).argmin(axis=1)]
    for _ in range(_NEWTON_STEPS):
        shape, slopes = kind.shape(parent)
        jacobian = np.einsum("pad,pai->pdi", corners, slopes)
        jacobian[np.abs(np.linalg.det(jacobian)) < 1e-9] = np.eye(2)
        miss = np.einsum("pa,pad->pd", shape, corners) - points
        parent = np.clip(parent - np.linalg.solve(jacobian, miss[..., None])[..., 0], -2.0, 2.0)
    return parent
