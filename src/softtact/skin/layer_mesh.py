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

_FLAT = 1e-9  # of a side squared: triangles of three points on one side of the outline, from round-off
_INWARDS = 1e-9  # of the size: how far points are drawn to the middle before they are located
_CHORD = 2.9  # of the gap between taxel and guard: longest chord of a circle whose neighbour still lets it be an edge


@dataclass(frozen=True)
class Plan:
    """A triangulation by Delaunay of points in the plane, whose hull is the outline."""

    points_mm: np.ndarray
    """(point, 2)"""
    circle: np.ndarray
    """(point,): number of the circle that a point lies on, or -1."""
    angle: np.ndarray
    """(point,): place on its circle in steps; neighbours differ by one."""
    circles_mm: np.ndarray
    """(circle, 4): centre, radius, and steps around."""

    @cached_property
    def _delaunay(self):
        return Delaunay(self.points_mm)

    @cached_property
    def triangles(self) -> np.ndarray:
        """(triangle, 3) numbers of points, rising in each."""
        return np.sort(self._delaunay.simplices[self._solid], axis=1)

    @cached_property
    def _solid(self):
        a, b, c = (self.points_mm[self._delaunay.simplices[:, k]] for k in range(3))
        (x1, y1), (x2, y2) = (b - a).T, (c - a).T
        return np.abs(x1 * y2 - x2 * y1) > _FLAT * np.ptp(self.points_mm, axis=0).max() ** 2

    def locate(self, points_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Triangle (n,) that holds each of the points (n, 2), and their barycentric coordinates (n, 3) in it."""
        middle = self.points_mm.mean(axis=0)
        drawn = middle + (points_mm - middle) * (1 - _INWARDS)
        simplex = self._delaunay.find_simplex(drawn)
        number = np.cumsum(self._solid) - 1
        if (simplex < 0).any() or not self._solid[simplex].all():
            raise InputError("a point lies beside the elastomer; move it onto it.")
        triangle = number[simplex]
        origin, one, two = (self.points_mm[self.triangles[triangle, k]] for k in range(3))
        (x1, y1), (x2, y2), (x, y) = (one - origin).T, (two - origin).T, (drawn - origin).T
        double = x1 * y2 - x2 * y1
        second, third = (x * y2 - x2 * y) / double, (x1 * y - x * y1) / double
        return triangle, np.column_stack([1 - second - third, second, third])

    def between(self, one: np.ndarray, other: np.ndarray) -> np.ndarray:
        """The point (n, 2) half-way between points given by number, on the circle where the two are neighbours on it."""
        middle = 0.5 * (self.points_mm[one] + self.points_mm[other])
        same = (self.circle[one] >= 0) & (self.circle[one] == self.circle[other])
        centre, radius, steps = (self.circles_mm[self.circle[one[same]]][:, part] for part in (slice(0, 2), 2, 3))
        apart = np.abs(self.angle[one[same]] - self.angle[other[same]])
        neighbours = (apart == 1) | (apart == steps - 1)
        arm = middle[same] - centre
        onto = centre + arm * (radius / np.maximum(np.linalg.norm(arm, axis=1), 1e-300))[:, None]
        middle[same] = np.where(neighbours[:, None], onto, middle[same])
        return middle


def even_plan(layout: Layout, *, spacing_mm: float) -> Plan:
    """Points of a triangular lattice, at most `spacing_mm` apart, which fit modules of equal sides exactly."""
    side = np.linalg.norm(layout.corners_mm[0, 1] - layout.corners_mm[0, 0])
    points = _merged(np.concatenate([_lattice(corners, int(np.ceil(side / spacing_mm))) for corners in layout.corners_mm]))
    return _plain(points)


def taxel_plan(layout: Layout, *, spacing_mm: float, refinement: int = 1) -> Plan:
    """Points on circles of and around each taxel, and of a lattice at about `spacing_mm` elsewhere.

    refinement: 1 has one element across the gap between taxel and guard; 2 and 3 have more of them, beside both edges as well, and
    ask for taxels that stand apart
    """
    radius, guard = layout.radius_mm, layout.guard_radius_mm
    steps = min(refinement, 2) * 4 * int(np.ceil(max(16, 2 * np.pi * guard / (_CHORD * (guard - radius))) / 4))
    rings = _rings(radius, guard, steps, refinement)
    angles = [2 * np.pi * np.arange(count) / count for _, count in rings]
    disc = np.concatenate(
        [[[0.0, 0.0]], *(r * np.column_stack([np.cos(a), np.sin(a)]) for (r, _), a in zip(rings, angles, strict=True))]
    )
    own_circle = np.concatenate([[-1], *(np.full(count, k) for k, (_, count) in enumerate(rings))])
    own_angle = np.concatenate([[0], *(np.arange(count) for _, count in rings)])
    taxels = len(layout.centres_mm)
    on_discs = (layout.centres_mm[:, None] + disc).reshape(-1, 2)
    circle = np.where(own_circle >= 0, own_circle + len(rings) * np.arange(taxels)[:, None], -1).ravel()
    circles = np.array([(*centre, r, count) for centre in layout.centres_mm for r, count in rings])
    rest = _merged(
        np.concatenate(
            [_lattice(corners, int(np.ceil(np.linalg.norm(corners[1] - corners[0]) / spacing_mm))) for corners in layout.corners_mm]
        )
    )
    near, _ = cKDTree(layout.centres_mm).query(rest)
    on_side = ~layout.inside(rest, margin_mm=1e-6)
    rest = rest[on_side | (near > guard + 0.4 * spacing_mm)]
    plan = Plan(
        np.concatenate([on_discs, rest]),
        np.concatenate([circle, np.full(len(rest), -1)]),
        np.concatenate([np.tile(own_angle, taxels), np.zeros(len(rest), dtype=int)]),
        circles,
    )
    _check_circles(plan, layout)
    return plan


def _rings(radius, guard, steps, refinement):
    """Radii and numbers of points of the circles around a taxel: finer towards the gap, where the field is steep."""
    near = {1: (), 2: (0.14,), 3: (0.14, 0.05)}[refinement]  # mm from either edge
    within = {1: (), 2: (0.25, 0.5, 0.75), 3: (0.1, 0.25, 0.5, 0.75, 0.9)}[refinement]  # shares of the gap
    fine = [
        *(radius - off for off in near),
        radius,
        *(radius + (guard - radius) * share for share in within),
        guard,
        *(guard + off for off in reversed(near)),
    ]
    return [(0.5 * radius, steps // 2), (0.8 * radius, steps), *((r, steps) for r in fine)]


def _check_circles(plan, layout):
    """See that each step around a taxel's and its guard's circle is an edge of the triangulation."""
    t = plan.triangles
    edges = np.unique(np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [0, 2]]]), axis=1), axis=0)
    of = plan.circle[edges]
    same = edges[(of[:, 0] >= 0) & (of[:, 0] == of[:, 1])]
    apart, steps = np.abs(np.diff(plan.angle[same], axis=1))[:, 0], plan.circles_mm[plan.circle[same[:, 0]], 3]
    found = np.bincount(plan.circle[same[(apart == 1) | (apart == steps - 1), 0]], minlength=len(plan.circles_mm))
    marked = np.isclose(plan.circles_mm[:, 2], layout.radius_mm) | np.isclose(plan.circles_mm[:, 2], layout.guard_radius_mm)
    if (found < plan.circles_mm[:, 3])[marked].any():
        raise InputError(
            f"module: taxels of radius {layout.radius_mm:g} mm with guards from {layout.guard_radius_mm:g} mm lie too "
            "close to be meshed; choose a larger pitch or a smaller guard gap."
        )


def _lattice(corners, count):
    """Points (n, 2) of a triangle divided into count parts a side."""
    i, j = np.array([(i, j) for i in range(count + 1) for j in range(count + 1 - i)]).T
    weights = np.column_stack([count - i - j, i, j]) / count
    return weights @ corners


def _merged(points):
    """The points without those that two modules share."""
    _, first = np.unique(np.round(points, 6), axis=0, return_index=True)
    return points[np.sort(first)]


def _plain(points):
    none = np.full(len(points), -1)
    return Plan(points, none, np.zeros(len(points), dtype=int), np.zeros((0, 4)))


@dataclass(frozen=True)
class LayerMesh:
    """The tetrahedra between the levels z (rising, the first 0 is the floor) over a plan; nodes are corners and edges' middles."""

    plan: Plan
    levels_mm: np.ndarray
    """(level,)"""

    @cached_property
    def corners(self) -> np.ndarray:
        """(tetrahedron, 4) numbers of corners: of point p in level l, l * points + p; three follow each other in a prism."""
        t, points = self.plan.triangles, len(self.plan.points_mm)
        low = t[None] + points * np.arange(len(self.levels_mm) - 1)[:, None, None]
        v0, v1, v2 = np.moveaxis(low, 2, 0)
        up = points
        prism = np.stack(
            [
                np.stack([v0, v1, v2, v2 + up], -1),
                np.stack([v0, v1, v1 + up, v2 + up], -1),
                np.stack([v0, v0 + up, v1 + up, v2 + up], -1),
            ],
            axis=2,
        )
        return prism.reshape(-1, 4)

    @cached_property
    def mesh(self) -> MeshTet2:
        """scikit-fem's mesh of order two, with edges on the circles of the plan curved."""
        points, levels = self.plan.points_mm, self.levels_mm
        corners = np.column_stack([np.tile(points, (len(levels), 1)), np.repeat(levels, len(points))])
        # The corners of each tetrahedron rise, so that scikit-fem keeps them in this order.
        straight = MeshTet(np.ascontiguousarray(corners.T), np.ascontiguousarray(self.corners.T), sort_t=False, validate=False)
        mesh = MeshTet2.from_mesh(straight)
        edges = straight.edges % len(points)
        nodes = np.array(mesh.doflocs)
        nodes[:2, corners.shape[0] :] = self.plan.between(*edges).T
        return displaced(mesh, nodes.T)

    @cached_property
    def basis(self) -> Basis:
        """Scalar quadratic functions, numbered as the nodes."""
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
        """Values at points (n, 3) from those at the nodes, as a matrix (n, node); for a mesh without curved edges."""
        triangle, flat = self.plan.locate(points_mm[:, :2])
        layer = np.clip(np.searchsorted(self.levels_mm, points_mm[:, 2], side="right") - 1, 0, len(self.levels_mm) - 2)
        share = np.clip((points_mm[:, 2] - self.levels_mm[layer]) / np.diff(self.levels_mm)[layer], 0.0, 1.0)
        part, weights = _within_prism(flat, share)
        tet = 3 * (layer * len(self.plan.triangles) + triangle) + part
        element = ElementTetP2()
        values = np.stack([element.lbasis(weights[:, 1:].T, k)[0] for k in range(10)])
        columns = self.basis.element_dofs[:, tet]
        rows = np.broadcast_to(np.arange(len(points_mm)), columns.shape)
        return sp.csr_matrix((values.ravel(), (rows.ravel(), columns.ravel())), shape=(len(points_mm), self.mesh.doflocs.shape[1]))


def displaced(mesh: MeshTet2, nodes_mm: np.ndarray) -> MeshTet2:
    """The same elements with their nodes at (node, 3)."""
    return MeshTet2(np.ascontiguousarray(nodes_mm.T), mesh.t, sort_t=False, validate=False)


def _within_prism(flat, share):
    """Which of a prism's three tetrahedra (n,) holds a point, and its barycentric coordinates (n, 4) there.

    flat (n, 3): barycentric in the triangle;  share (n,): of the prism's height. Sums of them tell where the cuts lie.
    """
    l0, l1, l2 = flat.T
    first, second = share <= l2, share <= l1 + l2
    low = np.stack([l0, l1, l2 - share, share], -1)
    middle = np.stack([l0, l1 + l2 - share, share - l2, l2], -1)
    high = np.stack([1 - share, share - l1 - l2, l1, l2], -1)
    return np.where(first, 0, np.where(second, 1, 2)), np.where(first[:, None], low, np.where(second[:, None], middle, high))
