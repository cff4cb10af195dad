"""Quadrature rules in parent coordinates."""

from typing import NamedTuple

import numpy as np


class Quadrature(NamedTuple):
    """points (g, d) and weights (g,), exact for polynomials up to `degree`, counted over all coordinates together."""

    points: np.ndarray
    weights: np.ndarray
    degree: int


def gauss(points: int, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """Gauss rule on [-1, 1]^dimension: points (n, dimension) and weights (n,)."""
    x, w = np.polynomial.legendre.leggauss(points)
    grids = np.meshgrid(*[x] * dimension, indexing="ij")
    weights = np.meshgrid(*[w] * dimension, indexing="ij")
    return np.column_stack([g.ravel() for g in grids]), np.prod([g.ravel() for g in weights], axis=0)


def midpoints(parts: int, dimension: int) -> tuple[np.ndarray, np.ndarray]:
    """The middles of equal parts of [-1, 1]^dimension: points (n, dimension) and weights (n,)."""
    places = np.indices((parts,) * dimension).reshape(dimension, -1).T
    return (2 * places + 1) / parts - 1, np.full(len(places), (2 / parts) ** dimension)


def gauss_rule(points: int, dimension: int) -> Quadrature:
    """The same as a `Quadrature`."""
    return Quadrature(*gauss(points, dimension), degree=2 * points - 1)


def lobatto_rule(dimension: int) -> Quadrature:
    """Simpson's rule along each side, whose ends are among its three points: the corners of the cell are points."""
    x, w = np.array([-1.0, 0.0, 1.0]), np.array([1.0, 4.0, 1.0]) / 3
    places = np.indices((3,) * dimension).reshape(dimension, -1).T
    return Quadrature(x[places], w[places].prod(axis=1), degree=3)


def lobatto_gauss_rule(dimension: int) -> Quadrature:
    """Two fifths of Simpson's rule and three of Gauss's with two points a side: more points inside, and two degrees more.

    Along a side the integral of x^4 is 2/5, of which Simpson's rule makes 2/3 and Gauss's 2/9.
    """
    simpson, inner = lobatto_rule(dimension), gauss_rule(2, dimension)
    return Quadrature(np.vstack([simpson.points, inner.points]), np.append(0.4 * simpson.weights, 0.6 * inner.weights), degree=5)


def densest_rule(dimension: int) -> Quadrature:
    """Half of `lobatto_gauss_rule` and half of Gauss's with three points a side, of the same degree."""
    outer, inner = lobatto_gauss_rule(dimension), gauss_rule(3, dimension)
    return Quadrature(np.vstack([outer.points, inner.points]), 0.5 * np.append(outer.weights, inner.weights), degree=5)


def triangle_rule() -> Quadrature:
    """Six points of the triangle (0, 0), (1, 0), (0, 1), of degree 4. (Dunavant, Int. J. Numer. Meth. Engng 21 (1985) 1129.)"""
    near, far = (0.445948490915965, 0.223381589678011), (0.091576213509771, 0.109951743655322)
    plane = np.array([[c, c] for c, _ in (near, far)] + [[1 - 2 * c, c] for c, _ in (near, far)]
                     + [[c, 1 - 2 * c] for c, _ in (near, far)])
    return Quadrature(plane, 0.5 * np.array([w for _, w in (near, far)] * 3), degree=4)


def wedge_rule() -> Quadrature:
    """The triangle's six points times three along the height: 18 points."""
    plane, weight, degree = triangle_rule()
    z, wz = np.polynomial.legendre.leggauss(3)
    points = np.column_stack([np.tile(plane, (3, 1)), np.repeat(z, 6)])
    return Quadrature(points, np.tile(weight, 3) * np.repeat(wz, 6), degree)


def tetrahedron_rule() -> Quadrature:
    """The one point in the middle of the tetrahedron of the origin and the unit vectors, of degree 1."""
    return Quadrature(np.full((1, 3), 0.25), np.array([1 / 6]), degree=1)


def tetrahedron_rule4() -> Quadrature:
    """Four points of the same tetrahedron, of degree 2."""
    near, far = (5 - np.sqrt(5)) / 20, (5 + 3 * np.sqrt(5)) / 20
    return Quadrature(np.vstack([[near] * 3, near + (far - near) * np.eye(3)]), np.full(4, 1 / 24), degree=2)


def tetrahedron_rule15() -> Quadrature:
    """Fifteen points of the same tetrahedron, of degree 5. (Keast, Comput. Methods Appl. Mech. Engng 55 (1986) 339, rule 6.)"""
    points, weights = [[0.25] * 3], [0.1817020685825351]
    for near, weight in ((1 / 3, 0.0361607142857143), (1 / 11, 0.0698714945161738)):
        far = 1 - 3 * near
        points += [[near] * 3, [far, near, near], [near, far, near], [near, near, far]]
        weights += [weight] * 4
    a, b = 0.0665501535736643, 0.4334498464263357
    points += [[a, b, b], [b, a, b], [b, b, a], [a, a, b], [a, b, a], [b, a, a]]
    weights += [0.0656948493683187] * 6
    return Quadrature(np.array(points), np.array(weights) / 6, degree=5)
