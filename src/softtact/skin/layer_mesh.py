"""Quadratic tetrahedra of a layer: a plan, extruded from level to level, each prism cut into three."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from skfem import Basis, ElementTetP2, MeshTet, MeshTet2

from softtact.skin.plan import Plan


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
