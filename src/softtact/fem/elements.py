"""Shape functions and quadrature of the elements in use: 20- and 27-node hexahedra, 18-node wedge, and their faces."""

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


# Full quadratic elements: a plan of 9-node quadrilaterals or 6-node triangles at the bottom, the top and the middle.
# Unlike the 20-node hexahedron they stay quadratic where they are distorted (Arnold, Boffi and Falk, Math. Comp. 71 (2002) 909).
QUAD9_NODES = np.vstack([_CORNERS, _MIDS, [[0.0, 0.0]]])
TRI6_NODES = np.array([[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]], dtype=float)
_LEVELS = (-1, 1, 0)
HEX27_NODES = np.vstack([_at_height(QUAD9_NODES, z) for z in _LEVELS])
WEDGE18_NODES = np.vstack([_at_height(TRI6_NODES, z) for z in _LEVELS])
HEX27_BOTTOM, HEX27_TOP = np.arange(9), np.arange(9, 18)
WEDGE18_TOP = np.arange(6, 12)


def _side(a, b, middle):
    """A side over the plan's edge a-b, in the order of QUAD9_NODES."""
    low, high, between = 0, 9, 18
    return [a + low, b + low, b + high, a + high, middle + low, b + between, middle + high, a + between, middle + between]


HEX27_SIDES = np.array([_side(k, (k + 1) % 4, 4 + k) for k in range(4)])   # eta=-1, xi=1, eta=1, xi=-1
_TRIANGLE_SIDES = np.array([[0, 1], [1, 2], [2, 0]])


def _area_coordinates(points):
    """Values (n, 3) and derivatives (3, 2) of the triangle's linear shape functions."""
    r, s = np.asarray(points, dtype=float).T[:2]
    return np.column_stack([1 - r - s, r, s]), np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]])


def tri6(points):
    """Values (n, 6) and parent derivatives (n, 6, 2) of the 6-node triangle."""
    L, dL = _area_coordinates(points)
    a, b = _TRIANGLE_SIDES.T
    values = np.hstack([L * (2 * L - 1), 4 * L[:, a] * L[:, b]])
    slopes = np.concatenate([(4 * L - 1)[..., None] * dL,
                             4 * (L[:, a, None] * dL[b] + L[:, b, None] * dL[a])], axis=1)
    return values, slopes


def _line3(t):
    """Values (n, 3) and derivatives (n, 3) of the quadratic shape functions at -1, 1 and 0."""
    t = np.asarray(t, dtype=float)[:, None]
    return np.hstack([0.5 * t * (t - 1), 0.5 * t * (t + 1), 1 - t**2]), np.hstack([t - 0.5, t + 0.5, -2 * t])


_QUAD9_FACTORS = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 0], [1, 2], [2, 1], [0, 2], [2, 2]])   # of _line3 in xi and eta


def quad9(points):
    """Values (n, 9) and parent derivatives (n, 9, 2) of the 9-node quadrilateral."""
    points = np.asarray(points, dtype=float)
    (x, dx), (y, dy) = _line3(points[:, 0]), _line3(points[:, 1])
    i, j = _QUAD9_FACTORS.T
    return x[:, i] * y[:, j], np.stack([dx[:, i] * y[:, j], x[:, i] * dy[:, j]], axis=2)


def _lifted(plan, points):
    """Product of a plan's shape functions with the quadratic ones in height."""
    points = np.asarray(points, dtype=float)
    values, slopes = plan(points[:, :2])
    z, dz = _line3(points[:, 2])
    product = (z[:, :, None] * values[:, None, :]).reshape(len(points), -1)
    in_plan = (z[:, :, None, None] * slopes[:, None]).reshape(len(points), -1, 2)
    upwards = (dz[:, :, None] * values[:, None, :]).reshape(len(points), -1, 1)
    return product, np.concatenate([in_plan, upwards], axis=2)


def hex27(points):
    """Values (n, 27) and parent derivatives (n, 27, 3) of the 27-node hexahedron."""
    return _lifted(quad9, points)


def wedge18(points):
    """Values (n, 18) and parent derivatives (n, 18, 3) of the 18-node wedge."""
    return _lifted(tri6, points)


def wedge_rule():
    """Quadrature of the wedge: six points of the triangle (degree 4, Dunavant) times three: points (18, 3), weights (18,)."""
    near, far = (0.445948490915965, 0.223381589678011), (0.091576213509771, 0.109951743655322)
    plane = np.array([[c, c] for c, _ in (near, far)] + [[1 - 2 * c, c] for c, _ in (near, far)]
                     + [[c, 1 - 2 * c] for c, _ in (near, far)])
    weight = 0.5 * np.array([w for _, w in (near, far)] * 3)
    z, wz = np.polynomial.legendre.leggauss(3)
    points = np.column_stack([np.tile(plane, (3, 1)), np.repeat(z, 6)])
    return points, np.tile(weight, 3) * np.repeat(wz, 6)


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
