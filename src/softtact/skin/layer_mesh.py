"""Meshes of a layer: triangles in its plane, and quadratic tetrahedra that are extruded from them.

A plane mesh is even for the deformation, and follows the taxels' circles for the electric field. Each prism between two levels is
cut into three tetrahedra.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.spatial import Delaunay, cKDTree
from skfem import Basis, ElementTetP2, MeshTet, MeshTet2

from softtact.errors import InputError
from softtact.skin.layout import Layout

_FLAT = 1e-9  # of a side squared: area below which a triangle has three points on one side of the outline
_INWARDS = 1e-9  # share by which points are moved to the middle before they are located
_CHORD = 2.9  # times the gap between taxel and guard: longest chord of a circle that Delaunay's triangulation keeps as an edge


@dataclass(frozen=True)
class PlaneMesh:
    """A Delaunay triangulation of points in the plane, whose hull is the outline."""

    points_mm: np.ndarray
    """(point, 2)"""
    circle: np.ndarray
    """(point,): number of the circle that a point lies on, or -1."""
    angle: np.ndarray
    """(point,): number of the step on its circle; neighbours differ by one."""
    circles_mm: np.ndarray
    """(circle, 4): centre, radius, and number of steps."""

    @cached_property
    def _delaunay(self):
        return Delaunay(self.points_mm)

    @cached_property
    def triangles(self) -> np.ndarray:
        """(triangle, 3) numbers of points, in rising order."""
        return np.sort(self._delaunay.simplices[self._solid], axis=1)

    @cached_property
    def _solid(self):
        a, b, c = (self.points_mm[self._delaunay.simplices[:, k]] for k in range(3))
        (x1, y1), (x2, y2) = (b - a).T, (c - a).T
        return np.abs(x1 * y2 - x2 * y1) > _FLAT * np.ptp(self.points_mm, axis=0).max() ** 2

    def locate(self, points_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Triangle (n,) of each of the points (n, 2), and its barycentric coordinates (n, 3) there."""
        middle = self.points_mm.mean(axis=0)
        moved = middle + (points_mm - middle) * (1 - _INWARDS)
        simplex = self._delaunay.find_simplex(moved)
        number = np.cumsum(self._solid) - 1
        if (simplex < 0).any() or not self._solid[simplex].all():
            raise InputError("a point lies beside the elastomer; move it onto it.")
        triangle = number[simplex]
        origin, one, two = (self.points_mm[self.triangles[triangle, k]] for k in range(3))
        (x1, y1), (x2, y2), (x, y) = (one - origin).T, (two - origin).T, (moved - origin).T
        double = x1 * y2 - x2 * y1
        second, third = (x * y2 - x2 * y) / double, (x1 * y - x * y1) / double
        return triangle, np.column_stack([1 - second - third, second, third])

    def between(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """Midpoints (n, 2) of points given by number, on the circle where both are neighbours on one."""
        middle = 0.5 * (self.points_mm[one] + self.points_mm[other])
        same = (self.circle[one] >= 0) & (self.circle[one] == self.circle[other])
        centre, radius, steps = (self.circles_mm[self.circle[one[same]]][:, part] for part in (slice(0, 2), 2, 3))
        apart = np.abs(self.angle[one[same]] - self.angle[other[same]])
        neighbours = (apart == 1) | (apart == steps - 1)
        arm = middle[same] - centre
        onto = centre + arm * (radius / np.maximum(np.linalg.norm(arm, axis=1), 1e-300))[:, None]
        middle[same] = np.where(neighbours[:, None], onto, middle[same])
        return middle


def even_mesh(layout: Layout, *, spacing_mm: float) -> PlaneMesh:
    """Points of a triangular lattice, at most `spacing_mm` apart, that fits modules of equal sides exactly."""
    side = np.linalg.norm(layout.corners_mm[0, 1] - layout.corners_mm[0, 0])
    points = _merged(np.concatenate([_lattice(corners, int(np.ceil(side / spacing_mm))) for corners in layout.corners_mm]))
    return PlaneMesh(points, np.full(len(points), -1), np.zeros(len(points), dtype=int), np.zeros((0, 4)))


def taxel_mesh(layout: Layout, *, spacing_mm: float, refinement: int = 1) -> PlaneMesh:
    """Points on circles around each taxel's centre, and of a lattice of about `spacing_mm` elsewhere.

    refinement: 1 has one element across the gap between taxel and guard; 2 and 3 have more, there and beside both edges, and need
    more distance between taxels
    """
    radius, guard = layout.radius_mm, layout.guard_radius_mm
    steps = min(refinement, 2) * 4 * int(np.ceil(max(16, 2 * np.pi * guard / (_CHORD * (guard - radius))) / 4))
    rings = _rings(radius, guard, steps, refinement)
    angles = [2 * np.pi * np.arange(count) / count for _, count in rings]
    disc = np.concatenate([[[0.0, 0.0]], *(r * np.column_stack([np.cos(a), np.sin(a)])
                                           for (r, _), a in zip(rings, angles, strict=True))])
    disc_circle = np.concatenate([[-1], *(np.full(count, k) for k, (_, count) in enumerate(rings))])
    disc_angle = np.concatenate([[0], *(np.arange(count) for _, count in rings)])
    taxels = len(layout.centres_mm)
    on_discs = (layout.centres_mm[:, None] + disc).reshape(-1, 2)
    circle = np.where(disc_circle >= 0, disc_circle + len(rings) * np.arange(taxels)[:, None], -1).ravel()
    circles = np.array([(*centre, r, count) for centre in layout.centres_mm for r, count in rings])
    rest = _merged(np.concatenate([_lattice(corners, int(np.ceil(np.linalg.norm(corners[1] - corners[0]) / spacing_mm)))
                                   for corners in layout.corners_mm]))
    near, _ = cKDTree(layout.centres_mm).query(rest)
    on_side = ~layout.inside(rest, margin_mm=1e-6)
    rest = rest[on_side | (near > guard + 0.4 * spacing_mm)]
    mesh = PlaneMesh(np.concatenate([on_discs, rest]), np.concatenate([circle, np.full(len(rest), -1)]),
                     np.concatenate([np.tile(disc_angle, taxels), np.zeros(len(rest), dtype=int)]), circles)
    _check_circles(mesh, layout)
    return mesh


def _rings(radius, guard, steps, refinement):
    """Radii and numbers of points of the circles around a taxel: closer at the gap, where the field is steep."""
    near = {1: (), 2: (0.14,), 3: (0.14, 0.05)}[refinement]  # mm from either edge
    within = {1: (), 2: (0.25, 0.5, 0.75), 3: (0.1, 0.25, 0.5, 0.75, 0.9)}[refinement]  # shares of the gap
    fine = [*(radius - off for off in near), radius, *(radius + (guard - radius) * share for share in within), guard,
            *(guard + off for off in reversed(near))]
    return [(0.5 * radius, steps // 2), (0.8 * radius, steps), *((r, steps) for r in fine)]


def _check_circles(mesh, layout):
    """Refuse a mesh in which a step on a taxel's or its guard's circle is no edge of the triangulation."""
    t = mesh.triangles
    edges = np.unique(np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [0, 2]]]), axis=1), axis=0)
    of = mesh.circle[edges]
    same = edges[(of[:, 0] >= 0) & (of[:, 0] == of[:, 1])]
    apart, steps = np.abs(np.diff(mesh.angle[same], axis=1))[:, 0], mesh.circles_mm[mesh.circle[same[:, 0]], 3]
    found = np.bincount(mesh.circle[same[(apart == 1) | (apart == steps - 1), 0]], minlength=len(mesh.circles_mm))
    marked = np.isclose(mesh.circles_mm[:, 2], layout.radius_mm) | np.isclose(mesh.circles_mm[:, 2], layout.guard_radius_mm)
    if (found < mesh.circles_mm[:, 3])[marked].any():
        raise InputError(f"module: taxels of radius {layout.radius_mm:g} mm with guards from {layout.guard_radius_mm:g} mm lie too "
                         "close to be meshed; choose a larger pitch or a smaller guard gap.")


def _lattice(corners, count):
    """Points (n, 2) of a triangle divided into count parts a side."""
    i, j = np.array([(i, j) for i in range(count + 1) for j in range(count + 1 - i)]).T
    weights = np.column_stack([count - i - j, i, j]) / count
    return weights @ corners


def _merged(points):
    """The points, those that two modules share only once."""
    _, first = np.unique(np.round(points, 6), axis=0, return_index=True)
    return points[np.sort(first)]


@dataclass(frozen=True)
class LayerMesh:
    """Tetrahedra of order two between levels z (rising; the first, 0, is the floor) over a plane mesh."""

    plane: PlaneMesh
    levels_mm: np.ndarray
    """(level,)"""

    @cached_property
    def corners(self) -> np.ndarray:
        """(tetrahedron, 4) numbers of corners, l * points + p of point p in level l; the three of a prism follow each other."""
        t, points = self.plane.triangles, len(self.plane.points_mm)
        low = t[None] + points * np.arange(len(self.levels_mm) - 1)[:, None, None]
        v0, v1, v2 = np.moveaxis(low, 2, 0)
        up = points
        prism = np.stack([np.stack([v0, v1, v2, v2 + up], -1), np.stack([v0, v1, v1 + up, v2 + up], -1),
                          np.stack([v0, v0 + up, v1 + up, v2 + up], -1)], axis=2)
        return prism.reshape(-1, 4)

    @cached_property
    def mesh(self) -> MeshTet2:
        """scikit-fem's mesh of order two, whose edges on the circles of the plane mesh are curved."""
        points, levels = self.plane.points_mm, self.levels_mm
        corners = np.column_stack([np.tile(points, (len(levels), 1)), np.repeat(levels, len(points))])
        # Corners in rising order: scikit-fem keeps it.
        straight = MeshTet(np.ascontiguousarray(corners.T), np.ascontiguousarray(self.corners.T), sort_t=False, validate=False)
        mesh = MeshTet2.from_mesh(straight)
        edges = straight.edges % len(points)
        nodes = np.array(mesh.doflocs)
        nodes[:2, corners.shape[0] :] = self.plane.between(*edges).T
        return displaced(mesh, nodes.T)

    @cached_property
    def basis(self) -> Basis:
        """Scalar quadratic functions, numbered like the nodes."""
        return Basis(self.mesh, ElementTetP2(), intorder=3)

    @property
    def nodes_mm(self) -> np.ndarray:
        """(node, 3)"""
        return np.asarray(self.mesh.doflocs).T

    @cached_property
    def floor(self) -> np.ndarray:
        """Numbers of the nodes on the floor."""
        return np.flatnonzero(self.nodes_mm[:, 2] < 1e-9)

    @cached_property
    def top(self) -> np.ndarray:
        """Numbers of the nodes on the upper side."""
        return np.flatnonzero(self.nodes_mm[:, 2] > self.levels_mm[-1] - 1e-9)

    def interpolation(self, points_mm: np.ndarray) -> sp.csr_matrix:
        """Matrix (n, node) that interpolates values from the nodes to points (n, 3); for a mesh without curved edges."""
        triangle, flat = self.plane.locate(points_mm[:, :2])
        layer = np.clip(np.searchsorted(self.levels_mm, points_mm[:, 2], side="right") - 1, 0, len(self.levels_mm) - 2)
        share = np.clip((points_mm[:, 2] - self.levels_mm[layer]) / np.diff(self.levels_mm)[layer], 0.0, 1.0)
        part, weights = _within_prism(flat, share)
        tet = 3 * (layer * len(self.plane.triangles) + triangle) + part
        element = ElementTetP2()
        values = np.stack([element.lbasis(weights[:, 1:].T, k)[0] for k in range(10)])
        columns = self.basis.element_dofs[:, tet]
        rows = np.broadcast_to(np.arange(len(points_mm)), columns.shape)
        return sp.csr_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape=(len(points_mm), self.mesh.doflocs.shape[1]))


def displaced(mesh: MeshTet2, nodes_mm: np.ndarray) -> MeshTet2:
    """The same elements with their nodes at (node, 3)."""
    return MeshTet2(np.ascontiguousarray(nodes_mm.T), mesh.t, sort_t=False, validate=False)


def _within_prism(flat, share):
    """Number (n,) of the tetrahedron of its prism that holds a point, and the point's barycentric coordinates (n, 4) there.

    flat (n, 3): barycentric coordinates in the triangle;  share (n,): of the prism's height
    """
    l0, l1, l2 = flat.T
    first, second = share <= l2, share <= l1 + l2
    low = np.stack([l0, l1, l2 - share, share], -1)
    middle = np.stack([l0, l1 + l2 - share, share - l2, l2], -1)
    high = np.stack([1 - share, share - l1 - l2, l1, l2], -1)
    return np.where(first, 0, np.where(second, 1, 2)), np.where(first[:, None], low, np.where(second[:, None], middle, high))
