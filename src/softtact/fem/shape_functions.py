"""Shape functions in parent coordinates: each function gives values (n, m) and derivatives (n, m, d) at points (n, d)."""

from collections.abc import Callable

import numpy as np


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
    """Products of a plane element's functions `base` with the quadratic ones in height, of its bottom, top and middle nodes."""
    points = np.asarray(points, dtype=float)
    values, slopes = base(points[:, :2])
    (z, dz), order = _along(points[:, 2]), [2, 1, 0]
    z, dz = z[:, order], dz[:, order]
    shape = len(points), 3 * values.shape[1]
    product = (z[:, :, None] * values[:, None, :]).reshape(shape)
    in_plane = (z[:, :, None, None] * slopes[:, None]).reshape(*shape, 2)
    upwards = (dz[:, :, None] * values[:, None, :]).reshape(*shape, 1)
    return product, np.concatenate([in_plane, upwards], axis=2)
