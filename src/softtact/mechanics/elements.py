"""Shape functions and quadrature of the elements in use: 20-node hexahedron, its 8-node face, 4-node tetrahedron."""

import numpy as np

# Parent coordinates: 8 corners, then the mid-side nodes of the bottom, of the top, and of the vertical edges.
_CORNERS = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], dtype=float)
_MIDS = np.array([[0, -1], [1, 0], [0, 1], [-1, 0]], dtype=float)


def _at_height(plan, zeta):
    return np.column_stack([plan, np.full(len(plan), float(zeta))])


HEX20_NODES = np.vstack([_at_height(_CORNERS, -1), _at_height(_CORNERS, 1), _at_height(_MIDS, -1),
                         _at_height(_MIDS, 1), _at_height(_CORNERS, 0)])
QUAD8_NODES = np.vstack([_CORNERS, _MIDS])
HEX20_BOTTOM = np.array([0, 1, 2, 3, 8, 9, 10, 11])   # each face in the order of QUAD8_NODES
HEX20_TOP = np.array([4, 5, 6, 7, 12, 13, 14, 15])
HEX20_SIDES = np.array([[0, 1, 5, 4, 8, 17, 12, 16],   # the sides eta=-1, xi=1, eta=1, xi=-1
                        [1, 2, 6, 5, 9, 18, 13, 17],
                        [2, 3, 7, 6, 10, 19, 14, 18],
                        [3, 0, 4, 7, 11, 16, 15, 19]])


def gauss(points, dimension):
    """Gauss rule on [-1, 1]^dimension: points (n, dimension) and weights (n,)."""
    x, w = np.polynomial.legendre.leggauss(points)
    grids = np.meshgrid(*[x] * dimension, indexing="ij")
    weights = np.meshgrid(*[w] * dimension, indexing="ij")
    return np.column_stack([g.ravel() for g in grids]), np.prod([g.ravel() for g in weights], axis=0)


def serendipity(points, nodes):
    """Quadratic serendipity shape functions in 2 or 3 dimensions.

    points (n, d) parent coordinates; nodes (m, d) parent coordinates of the nodes (0 marks a mid-side direction).
    Returns values (n, m) and derivatives (n, m, d). (Zienkiewicz and Taylor, vol. 1, ch. 8.)
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


def hex20(points):
    """Values (n, 20) and parent derivatives (n, 20, 3) of the 20-node hexahedron."""
    return serendipity(points, HEX20_NODES)


def quad8(points):
    """Values (n, 8) and parent derivatives (n, 8, 2) of the 8-node quadrilateral."""
    return serendipity(points, QUAD8_NODES)


def reference_gradients(coordinates, derivatives, weights):
    """Gradients in the reference configuration.

    coordinates (e, m, 3) in mm, derivatives (g, m, 3), weights (g,).
    Returns gradients (e, g, m, 3) in 1/mm and volumes (e, g) in mm3. Raises ValueError on an inverted element.
    """
    jacobian = np.einsum("emi,gmj->egij", coordinates, derivatives, optimize=True)
    determinant = np.linalg.det(jacobian)
    if determinant.min() <= 0:
        raise ValueError(f"element {int(np.argmin(determinant.min(axis=1)))} is inverted")
    inverse = np.linalg.inv(jacobian)
    return np.ascontiguousarray(np.matmul(derivatives[None], inverse)), determinant * weights
