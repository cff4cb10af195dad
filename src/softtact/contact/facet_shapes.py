"""Facets of surfaces for compiled loops: shape functions with their second derivatives, and the closest point on a facet.

A surface may have facets of several kinds with up to nine nodes, padded with -1. Lines are facets of a surface that is infinite
along z, so that plane and spatial contact share one implementation: a line's second coordinate is along z, and the shape functions
do not depend on it.
"""

from typing import NamedTuple

import numpy as np

from softtact.compiled import compiled

MOST_NODES = 9
TRI3, TRI6, QUAD8, QUAD9, LINE2, LINE3 = range(6)  # kinds
KIND_OF = {"triangle": TRI3, "triangle6": TRI6, "quad8": QUAD8, "quad9": QUAD9, "line": LINE2, "line3": LINE3}  # by meshio's names
NODES_OF = np.array([3, 6, 8, 9, 2, 3])
_QUAD_XI = np.array([-1.0, 1.0, 1.0, -1.0, 0.0, 1.0, 0.0, -1.0, 0.0])
_QUAD_ETA = np.array([-1.0, -1.0, 1.0, 1.0, -1.0, 0.0, 1.0, 0.0, 0.0])
MARGIN = 0.5  # of a facet's width
_ITERATIONS, _CONVERGED, _LONGEST_STEP = 25, 1e-13, 0.5


class ShapesAt(NamedTuple):
    """Shape functions of a facet at a point: values (9,), derivatives (2, 9), second derivatives (3, 9): xi xi, eta eta, xi eta."""

    values: np.ndarray
    slopes: np.ndarray
    curvatures: np.ndarray


@compiled
def room_for_shapes() -> ShapesAt:
    """Workspace that `evaluate_shapes` fills."""
    return ShapesAt(np.zeros(9), np.zeros((2, 9)), np.zeros((3, 9)))


@compiled
def evaluate_shapes(kind: int, xi: float, eta: float, out: ShapesAt) -> None:
    """Write the shape functions of a facet of the given kind at (xi, eta) into `out`."""
    N, d, c = out.values, out.slopes, out.curvatures
    N[:], d[:], c[:] = 0.0, 0.0, 0.0
    if kind == TRI3:
        N[0], N[1], N[2] = 1 - xi - eta, xi, eta
        d[0, 0], d[0, 1], d[1, 0], d[1, 2] = -1.0, 1.0, -1.0, 1.0
    elif kind == TRI6:
        _triangle6(xi, eta, N, d, c)
    elif kind == QUAD8:
        _serendipity(xi, eta, N, d, c)
    elif kind == QUAD9:
        _quad9(xi, eta, N, d, c)
    elif kind == LINE2:
        N[0], N[1] = 0.5 * (1 - xi), 0.5 * (1 + xi)
        d[0, 0], d[0, 1] = -0.5, 0.5
    else:
        N[0], N[1], N[2] = 0.5 * xi * (xi - 1), 0.5 * xi * (xi + 1), 1 - xi * xi
        d[0, 0], d[0, 1], d[0, 2] = xi - 0.5, xi + 0.5, -2 * xi
        c[0, 0], c[0, 1], c[0, 2] = 1.0, 1.0, -2.0


@compiled(inline="always")
def _triangle6(xi, eta, N, d, c):
    L0 = 1 - xi - eta
    N[0], N[1], N[2] = L0 * (2 * L0 - 1), xi * (2 * xi - 1), eta * (2 * eta - 1)
    N[3], N[4], N[5] = 4 * L0 * xi, 4 * xi * eta, 4 * eta * L0
    d[0, 0], d[0, 1], d[0, 3], d[0, 4], d[0, 5] = 1 - 4 * L0, 4 * xi - 1, 4 * (L0 - xi), 4 * eta, -4 * eta
    d[1, 0], d[1, 2], d[1, 3], d[1, 4], d[1, 5] = 1 - 4 * L0, 4 * eta - 1, -4 * xi, 4 * xi, 4 * (L0 - eta)
    c[0, 0], c[0, 1], c[0, 3] = 4.0, 4.0, -8.0
    c[1, 0], c[1, 2], c[1, 5] = 4.0, 4.0, -8.0
    c[2, 0], c[2, 3], c[2, 4], c[2, 5] = 4.0, -4.0, 4.0, -4.0


@compiled(inline="always")
def _quad9(xi, eta, N, d, c):
    for a in range(9):
        x, dx, cx = _quadratic(xi, _QUAD_XI[a])
        y, dy, cy = _quadratic(eta, _QUAD_ETA[a])
        N[a], d[0, a], d[1, a] = x * y, dx * y, x * dy
        c[0, a], c[1, a], c[2, a] = cx * y, x * cy, dx * dy


@compiled(inline="always")
def _quadratic(t, node):
    """Value, derivative and second derivative of the quadratic function of a node at -1, 0 or 1."""
    if node == 0.0:
        return 1 - t * t, -2 * t, -2.0
    return 0.5 * t * (t + node), t + 0.5 * node, 1.0


@compiled(inline="always")
def _serendipity(xi, eta, N, d, c):
    for a in range(8):
        p, q = _QUAD_XI[a], _QUAD_ETA[a]
        if p == 0.0:
            N[a], d[0, a], d[1, a] = 0.5 * (1 - xi * xi) * (1 + q * eta), -xi * (1 + q * eta), 0.5 * q * (1 - xi * xi)
            c[0, a], c[2, a] = -(1 + q * eta), -q * xi
        elif q == 0.0:
            N[a], d[0, a], d[1, a] = 0.5 * (1 - eta * eta) * (1 + p * xi), 0.5 * p * (1 - eta * eta), -eta * (1 + p * xi)
            c[1, a], c[2, a] = -(1 + p * xi), -p * eta
        else:
            x, y = 1 + p * xi, 1 + q * eta
            N[a] = 0.25 * x * y * (p * xi + q * eta - 1)
            d[0, a], d[1, a] = 0.25 * p * y * (2 * p * xi + q * eta), 0.25 * q * x * (p * xi + 2 * q * eta)
            c[0, a], c[1, a], c[2, a] = 0.5 * y, 0.5 * x, 0.25 * p * q * (1 + 2 * p * xi + 2 * q * eta)


@compiled
def place_on(kind: int, corners: np.ndarray, shapes: ShapesAt, x: np.ndarray, tangents: np.ndarray) -> None:
    """Place x (3,) and tangents (2, 3) of a facet whose nodes are at `corners` (9, 3), by its shape functions there."""
    for i in range(3):
        x[i], tangents[0, i], tangents[1, i] = 0.0, 0.0, 0.0
        for a in range(NODES_OF[kind]):
            x[i] += shapes.values[a] * corners[a, i]
            tangents[0, i] += shapes.slopes[0, a] * corners[a, i]
            tangents[1, i] += shapes.slopes[1, a] * corners[a, i]
    if kind >= LINE2:
        tangents[1, 2] = 1.0


@compiled
def unit_normal(tangents: np.ndarray, normal: np.ndarray) -> float:
    """Fill the unit normal (3,) of tangents (2, 3); returns the area that they span."""
    a, b = tangents[0], tangents[1]
    normal[0], normal[1], normal[2] = a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
    size = np.sqrt(normal[0] ** 2 + normal[1] ** 2 + normal[2] ** 2)
    if size > 0:
        normal /= size
    return size


@compiled(inline="always")
def clamp(kind: int, xi: float, eta: float) -> tuple[float, float]:
    """The nearest coordinates within a facet and a margin around it.

    The margin lets a point that crosses the edge between two facets within Newton's iterations keep its facet, so that force and
    tangent are those of one smooth function.
    """
    if kind >= LINE2:
        return min(1 + 2 * MARGIN, max(-1 - 2 * MARGIN, xi)), 0.0
    if kind >= QUAD8:
        return min(1 + 2 * MARGIN, max(-1 - 2 * MARGIN, xi)), min(1 + 2 * MARGIN, max(-1 - 2 * MARGIN, eta))
    over = xi + eta - (1 + MARGIN)
    if over > 0:
        xi, eta = xi - 0.5 * over, eta - 0.5 * over
        if xi < -MARGIN:
            return -MARGIN, 1 + 2 * MARGIN
        if eta < -MARGIN:
            return 1 + 2 * MARGIN, -MARGIN
    return max(-MARGIN, xi), max(-MARGIN, eta)


@compiled(inline="always")
def closest_on(kind: int, corners: np.ndarray, x: np.ndarray, xi: float, eta: float, shapes: ShapesAt) -> tuple[float, float]:
    """Coordinates of the point of a facet (nodes at `corners`, (9, 3)) that is closest to x (3,), from a first guess.

    Newton's method, limited to the facet and its margin; `shapes` is a workspace for shape functions.
    """
    place, tangents, normal = np.empty(3), np.empty((2, 3)), np.empty(3)
    for _ in range(_ITERATIONS):
        evaluate_shapes(kind, xi, eta, shapes)
        place_on(kind, corners, shapes, place, tangents)
        unit_normal(tangents, normal)
        r0, r1, h00, h11, h01 = 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(3):
            away = x[i] - place[i]
            if kind >= LINE2 and i == 2:
                away = 0.0
            bend0, bend1, bend2 = 0.0, 0.0, 0.0
            for a in range(NODES_OF[kind]):
                bend0 += shapes.curvatures[0, a] * corners[a, i]
                bend1 += shapes.curvatures[1, a] * corners[a, i]
                bend2 += shapes.curvatures[2, a] * corners[a, i]
            r0 += away * tangents[0, i]
            r1 += away * tangents[1, i]
            h00 += tangents[0, i] ** 2 - away * bend0
            h11 += tangents[1, i] ** 2 - away * bend1
            h01 += tangents[0, i] * tangents[1, i] - away * bend2
        determinant = h00 * h11 - h01 * h01
        if not (h00 > 0 and determinant > 1e-12 * h00 * h11):  # far from the facet: the tangents' metric alone
            h00 = (tangents[0] ** 2).sum()
            h11 = (tangents[1] ** 2).sum()
            h01 = (tangents[0] * tangents[1]).sum()
            determinant = h00 * h11 - h01 * h01
        step0, step1 = (h11 * r0 - h01 * r1) / determinant, (h00 * r1 - h01 * r0) / determinant
        size = max(abs(step0), abs(step1))
        share = min(1.0, _LONGEST_STEP / max(size, 1e-300))
        new_xi, new_eta = clamp(kind, xi + share * step0, eta + share * step1)
        moved = max(abs(new_xi - xi), abs(new_eta - eta))
        xi, eta = new_xi, new_eta
        if moved < _CONVERGED:
            break
    return xi, eta
