"""Contact points between non-matching meshes: every facet of one surface is cut along the facets of the other.

On each segment the shape functions of both surfaces are polynomials, so the forces on both sides are integrated exactly where the
surfaces are flat: the contact patch test is passed to round-off. Curved facets are cut as the flat polygons of their corners.
Reference: Puso and Laursen, Comput. Methods Appl. Mech. Engng 193 (2004) 601, section 3 (segments of a mortar method).
"""

from typing import Any

import numpy as np

from softtact.compiled import compiled
from softtact.contact.facet_shapes import QUAD8
from softtact.contact.surfaces import TRIANGLE_POINTS, TRIANGLE_WEIGHTS, Surface, SurfacePoints, points_at

_TRIANGLES = np.array([[0, 1, 2], [0, 2, 3]])  # of a quadrilateral's corners
_TRIANGLE_PLACES = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
_QUAD_PLACES = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
_LINE_POINTS, _LINE_WEIGHTS = np.polynomial.legendre.leggauss(3)
_SLIVER = 1e-10  # share of a facet below which a piece is ignored


def segment_points(
    surface: Surface,
    other: Surface,
    x: np.ndarray,
    at_rest: np.ndarray,
    *,
    reach: float,
    axisymmetric: bool = False,
    thickness_mm: float = 1.0,
) -> SurfacePoints:
    """Points on the pieces of a surface's facets over those of another one, nodes at x (n, 3) and at rest at `at_rest`, in mm.

    reach: farthest distance in mm at which the surfaces can meet
    """
    options: dict[str, Any] = {"axisymmetric": axisymmetric, "thickness_mm": thickness_mm}
    if surface.is_line:
        return points_at(surface, at_rest, *_line_pieces(surface, other, x, reach), **options)
    facets, corners, places = _triangles(surface)
    which, pieces = _pieces(x[corners], places, x[_triangles(other)[1]], reach)
    if not len(which):
        return points_at(surface, at_rest, np.zeros(0, int), np.zeros((0, 2)), np.zeros(0), **options)
    a, b, c = pieces.transpose(1, 0, 2)
    twice = np.abs((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0])
    u, v = TRIANGLE_POINTS.T
    coordinates = a[:, None] + u[None, :, None] * (b - a)[:, None] + v[None, :, None] * (c - a)[:, None]
    facet, share = np.repeat(facets[which], len(u)), (twice[:, None] * TRIANGLE_WEIGHTS).ravel()
    return points_at(surface, at_rest, facet, coordinates.reshape(-1, 2), share, **options)


def _triangles(surface):
    """Facets (t,), corners' nodes (t, 3) and coordinates (t, 3, 2) of the flat triangles between the corners of all facets."""
    quads, triangles = np.flatnonzero(surface.kinds >= QUAD8), np.flatnonzero(surface.kinds < QUAD8)
    corners = np.concatenate([surface.nodes[triangles, :3], surface.nodes[quads][:, _TRIANGLES].reshape(-1, 3)])
    places = np.concatenate(
        [np.tile(_TRIANGLE_PLACES, (len(triangles), 1, 1)), np.tile(_QUAD_PLACES[_TRIANGLES], (len(quads), 1, 1))]
    )
    return np.concatenate([triangles, np.repeat(quads, 2)]), corners, places


def _pieces(own, places, others, reach):
    """Pieces s of triangles (t, 3, 3) with facet coordinates (t, 3, 2): the triangle (s,) of each piece, and its corners' facet
    coordinates (s, 3, 2)."""
    low, high = others.min(axis=1), others.max(axis=1)
    order = np.argsort(low[:, 0], kind="stable")
    return _cut_all(own, places, others[order], low[order], high[order], float(np.max(high[:, 0] - low[:, 0], initial=0.0)), reach)


@compiled
def _cut_all(own, places, others, low, high, widest, reach):
    which, pieces, used = np.empty(64, np.int64), np.empty((64, 3, 2)), 0
    starts = low[:, 0].copy()
    for t in range(len(own)):
        a, e, f, n = own[t, 0], np.empty(3), np.empty(3), np.empty(3)
        size = _plane(own[t], e, f, n)
        if not size > 0:
            continue
        lowest, highest = np.empty(3), np.empty(3)
        for i in range(3):
            lowest[i], highest[i] = own[t, :, i].min() - reach, own[t, :, i].max() + reach
        base = _in_plane(own[t], a, e, f)
        for k in range(np.searchsorted(starts, lowest[0] - widest), np.searchsorted(starts, highest[0], side="right")):
            if (high[k] < lowest).any() or (low[k] > highest).any() or not _faces(others[k], n, a, reach):
                continue
            polygon = _clip(base, _in_plane(others[k], a, e, f))
            for corner in range(1, len(polygon) - 1):
                if _area(polygon[0], polygon[corner], polygon[corner + 1]) <= _SLIVER * size:
                    continue
                if used == len(which):
                    which, pieces = _longer(which, pieces)
                for c, place in enumerate((0, corner, corner + 1)):
                    pieces[used, c, 0], pieces[used, c, 1] = _coordinates(base, places[t], polygon[place])
                which[used] = t
                used += 1
    return which[:used].copy(), pieces[:used].copy()


@compiled
def _longer(which, pieces):
    more, larger = np.empty(2 * len(which), np.int64), np.empty((2 * len(which), 3, 2))
    for k in range(len(which)):
        more[k] = which[k]
        for c in range(3):
            larger[k, c, 0], larger[k, c, 1] = pieces[k, c, 0], pieces[k, c, 1]
    return more, larger


@compiled(inline="always")
def _plane(triangle, e, f, n):
    """Fill unit vectors e, f in a triangle's plane and its normal n; returns twice its area."""
    p, q = triangle[1] - triangle[0], triangle[2] - triangle[0]
    n[0], n[1], n[2] = p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]
    size, length = np.sqrt((n * n).sum()), np.sqrt((p * p).sum())
    if size > 0:
        n /= size
        e[0], e[1], e[2] = p[0] / length, p[1] / length, p[2] / length
        f[0], f[1], f[2] = n[1] * e[2] - n[2] * e[1], n[2] * e[0] - n[0] * e[2], n[0] * e[1] - n[1] * e[0]
    return size


@compiled(inline="always")
def _in_plane(triangle, origin, e, f):
    out = np.empty((3, 2))
    for c in range(3):
        away = triangle[c] - origin
        out[c, 0], out[c, 1] = (away * e).sum(), (away * f).sum()
    return out


@compiled(inline="always")
def _faces(other, n, origin, reach):
    """Whether a triangle's normal is opposite to n, and the triangle is within reach of the plane through `origin`."""
    p, q = other[1] - other[0], other[2] - other[0]
    turned = (p[1] * q[2] - p[2] * q[1]) * n[0] + (p[2] * q[0] - p[0] * q[2]) * n[1] + (p[0] * q[1] - p[1] * q[0]) * n[2]
    nearest = np.inf
    low, high = np.inf, -np.inf
    for c in range(3):
        height = ((other[c] - origin) * n).sum()
        nearest, low, high = min(nearest, abs(height)), min(low, height), max(high, height)
    return turned < 0 and (nearest <= reach or low * high < 0)


@compiled(inline="always")
def _area(a, b, c):
    return abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


@compiled(inline="always")
def _clip(base, other):
    """The polygon (k, 2) that two triangles in the plane have in common. (Sutherland and Hodgman, Comm. ACM 17 (1974) 32.)"""
    turn = (other[1, 0] - other[0, 0]) * (other[2, 1] - other[0, 1]) - (other[1, 1] - other[0, 1]) * (other[2, 0] - other[0, 0])
    polygon, count = np.empty((9, 2)), 3
    for c in range(3):
        polygon[c, 0], polygon[c, 1] = base[c, 0], base[c, 1]
    for side in range(3):
        a, b = other[side], other[(side + 1) % 3]
        kept, fresh = np.empty((9, 2)), 0
        for k in range(count):
            here, there = polygon[k], polygon[(k + 1) % count]
            inside, outside = _left(a, b, here) * turn, _left(a, b, there) * turn
            if inside >= 0:
                kept[fresh, 0], kept[fresh, 1] = here[0], here[1]
                fresh += 1
            if (inside >= 0) != (outside >= 0):
                share = inside / (inside - outside)
                kept[fresh, 0], kept[fresh, 1] = here[0] + share * (there[0] - here[0]), here[1] + share * (there[1] - here[1])
                fresh += 1
        polygon, count = kept, fresh
        if count == 0:
            break
    return polygon[:count]


@compiled(inline="always")
def _left(a, b, p):
    return (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])


@compiled(inline="always")
def _coordinates(base, places, point):
    """Coordinates on the facet of a point in the plane of one of its triangles."""
    p, q, r = base[1] - base[0], base[2] - base[0], point - base[0]
    whole = p[0] * q[1] - p[1] * q[0]
    u, v = (r[0] * q[1] - r[1] * q[0]) / whole, (p[0] * r[1] - p[1] * r[0]) / whole
    first, second, third = places[0], places[1], places[2]
    return (first[0] + u * (second[0] - first[0]) + v * (third[0] - first[0]),
            first[1] + u * (second[1] - first[1]) + v * (third[1] - first[1]))


def _line_pieces(surface, other, x, reach):
    """Facets (p,), coordinates (p, 2) and shares (p,) of points on lines cut at the feet of the other line's ends."""
    facets, coordinates, shares = [], [], []
    ends = x[np.unique(other.nodes[:, :2])]
    for facet, (a, b) in enumerate(surface.nodes[:, :2]):
        along = x[b] - x[a]
        length = np.linalg.norm(along)
        at = (ends - x[a]) @ along / length**2
        near = np.linalg.norm(ends - x[a] - at[:, None] * along, axis=1) <= reach
        cuts = np.unique(np.clip(np.concatenate([[0.0, 1.0], at[near & (at > _SLIVER) & (at < 1 - _SLIVER)]]), 0, 1))
        for low, high in zip(cuts[:-1], cuts[1:], strict=True):
            facets.append(np.full(3, facet))
            coordinates.append(np.column_stack([(low + high - 1) + (high - low) * _LINE_POINTS, np.zeros(3)]))
            shares.append((high - low) * _LINE_WEIGHTS)
    return np.concatenate(facets), np.concatenate(coordinates), np.concatenate(shares)
