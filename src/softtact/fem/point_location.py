"""Where points lie in a plan of curved quadrilaterals and triangles, and how its nodes' values interpolate there."""

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from softtact.fem.elements import QUAD9, TRI6
from softtact.fem.extruded_mesh import Mesh2D

_NEAREST = 16        # elements, by their middles, in which a point is looked for
_NEWTON_STEPS = 30
_INSIDE = 1e-6       # in parent coordinates, of which an element spans 2 or 1
_SAME = 1e-9         # mm
_STARTS = np.linspace(0.0, 1.0, 9)


def interpolation_2d(mesh_2d: Mesh2D, points: np.ndarray) -> sp.csr_matrix:
    """Sparse matrix (p, plan points) that interpolates a nodal field of a full quadratic `Mesh2D` at points (p, 2) in mm.

    Raises ValueError for a point outside the plan.
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
    """Which points (p,) lie in elements of a kind; of those found the element (f,) and the shape values (f, w)."""
    _, near = cKDTree(corners.mean(axis=1)).query(points, k=min(_NEAREST, len(elements)))
    near = near.reshape(len(points), -1)
    element, values = np.full(len(points), -1), np.zeros((len(points), elements.shape[1]))
    for candidates in near.T:
        open_ = np.flatnonzero(element < 0)
        parent = _parent(kind, corners[candidates[open_]], points[open_])
        shape = kind.shape(parent)[0]
        there = np.abs(np.einsum("pa,pad->pd", shape, corners[candidates[open_]]) - points[open_]).max(axis=1) < _SAME
        inside = there & (kind.outside(parent) < _INSIDE)
        element[open_[inside]], values[open_[inside]] = candidates[open_[inside]], shape[inside]
    found = element >= 0
    return found, element[found], values[found]


def _parent(kind, corners, points):
    """Parent coordinates (p, 2) of points (p, 2), each in its element (p, w, 2), by Newton's method.

    It starts from the nearest of many places: triangles between touching circles have a cusp, into which no path leads from
    far away.
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
