"""Compiled loops over the points of a surface in contact with another one: gaps, forces and consistent tangents.

With the closest point x_m(xi) on the other surface, its tangents a_k, normal n and curvature kappa_kl = n . d2x/dxi_k dxi_l:
    gap g = n . (x - x_m),   dg = n . (dx - dx_m),   D = M^-1 (a . (dx - dx_m) + g n . d(a)),   M_kl = a_k . a_l - g kappa_kl
    d2g = -(n.da_k D_k + D_k n.da_k + kappa_kl D_k D_l) + g a^kl (n.da_k + kappa_km D_m) (n.da_l + kappa_ln D_n)
Reference: Wriggers, Computational Contact Mechanics, 2nd ed. (2006), section 4.1.
"""

from typing import NamedTuple

import numpy as np

from softtact.compiled import compiled
from softtact.contact.facet_shapes import (
    LINE2,
    MARGIN,
    NODES_OF,
    QUAD8,
    closest_on,
    evaluate_shapes,
    place_on,
    room_for_shapes,
    unit_normal,
)
from softtact.contact.facet_tree import FacetTree, nearest
from softtact.contact.surface_places import place_of_point
from softtact.contact.surfaces import SurfacePoints

_AT_EDGE = 1e-9
_LEAVES = 8.0  # hysteresis: a point in contact leaves a rim at so many times the distance at which contact begins


class Projection(NamedTuple):
    """The points' closest-point projections on the other surface."""

    facet: np.ndarray
    """(p,) facet, -1 where none is within reach."""
    coordinates: np.ndarray
    """(p, 2) on that facet."""
    gap: np.ndarray
    """(p,) in mm, negative where the point is inside; infinite without a facet."""
    normal: np.ndarray
    """(p, 3) outwards from the other surface."""
    inner: np.ndarray
    """(p,) whether the projection is inside its facet or margin; at the margin's end the normal does not rotate with the point."""


@compiled
def project(
    points: SurfacePoints,
    nodes: np.ndarray,
    kinds: np.ndarray,
    rims: np.ndarray,
    tree: FacetTree,
    x: np.ndarray,
    reach: float,
    rim: float,
    least_cosine: float,
    itself: bool,
    before: np.ndarray,
    near: np.ndarray,
) -> Projection:
    """`Projection` of points on the surface of facets nodes (f, 9) and kinds (f,), all nodes at x (n, 3) in mm.

    rims (f, 4): which edges end the surface;  rim: how far (mm) beside such an edge a point still meets the plane of its facet
    reach: farthest distance in mm;  least_cosine: of the angle between the surfaces' opposite normals;  itself: leave out the
    facets that share a node with the point's own
    before (p,), near (p, 2): last facets and coordinates, which a point keeps as long as its projection lies on them: otherwise a
    point on the edge between two facets would alternate between them from iteration to iteration
    """
    count = len(points.facet)
    out = Projection(
        np.full(count, -1), np.zeros((count, 2)), np.full(count, np.inf), np.zeros((count, 3)), np.zeros(count, np.bool_)
    )
    room, nobody, own, tangents, normal = room_for_shapes(), np.full(1, -1), np.empty(3), np.empty((2, 3)), np.empty(3)
    for p in range(count):
        place_of_point(points, p, x, own, tangents)
        unit_normal(tangents, normal)
        if (
            before[p] >= 0
            and _meets(out, p, before[p], near[p, 0], near[p, 1], own, nodes, kinds, rims, x, _LEAVES * rim, room)
            and (out.inner[p] and abs(out.gap[p]) < reach and -_product(out.normal[p], normal) >= least_cosine)
        ):
            continue
        out.facet[p], out.gap[p] = -1, np.inf
        facet, xi, eta = nearest(tree, x, own, normal, least_cosine, reach, points.nodes[p] if itself else nobody)
        if facet >= 0 and not (
            _meets(out, p, facet, xi, eta, own, nodes, kinds, rims, x, rim, room)
            and (out.gap[p] >= 0 or _beside2(out, p, own, nodes, kinds, x, room) <= max(rim, -out.gap[p]) ** 2)
        ):
            out.facet[p], out.gap[p] = -1, np.inf
    return out


@compiled(inline="always")
def _beside2(out, p, own, nodes, kinds, x, room):
    """Squared tangential distance (mm2) of point p, at `own` (3,), from its facet.

    A point behind the plane of its nearest facet penetrates only if it projects on that facet. Beside the facet there may be walls,
    which the search leaves out, and the plane continues beyond the surface.
    """
    facet, (xi, eta), total = out.facet[p], out.coordinates[p], 0.0
    kind = kinds[facet]
    if kind >= QUAD8:
        xi, eta = min(max(xi, -1.0), 1.0), min(max(eta, -1.0), 1.0)
    else:
        xi, eta = max(xi, 0.0), max(eta, 0.0)
        size = max(xi + eta, 1.0)
        xi, eta = xi / size, eta / size
    evaluate_shapes(kind, xi, eta, room)
    for i in range(3):
        place = 0.0
        for a in range(NODES_OF[kind]):
            place += room.values[a] * x[nodes[facet, a], i]
        total += (own[i] - place) ** 2
    return total - out.gap[p] ** 2


@compiled
def _meets(out, p, facet, xi, eta, own, nodes, kinds, rims, x, rim, room):
    """Write the projection of point p, at `own` (3,), on a facet; returns whether it lies within the surface's rim."""
    corners, tangents, normal, place, kind = np.zeros((9, 3)), np.empty((2, 3)), np.empty(3), np.empty(3), kinds[facet]
    for a in range(NODES_OF[kind]):
        for i in range(3):
            corners[a, i] = x[nodes[facet, a], i]
    xi, eta = closest_on(kind, corners, own, xi, eta, room)
    evaluate_shapes(kind, xi, eta, room)
    place_on(kind, corners, room, place, tangents)
    unit_normal(tangents, normal)
    out.facet[p], out.coordinates[p, 0], out.coordinates[p, 1], out.gap[p] = facet, xi, eta, 0.0
    for i in range(3):
        out.normal[p, i] = normal[i]
        out.gap[p] += normal[i] * (own[i] - place[i])
    out.inner[p] = _inside(kind, xi, eta)
    return not _beyond_rim(kind, xi, eta, rims[facet], tangents, rim)


@compiled(inline="always")
def _product(a, b):
    """The scalar product of two vectors (3,)."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled(inline="always")
def _inside(kind, xi, eta):
    limit = 1 + 2 * MARGIN - _AT_EDGE
    if kind >= LINE2:
        return abs(xi) < limit
    if kind >= QUAD8:
        return abs(xi) < limit and abs(eta) < limit
    return xi > -MARGIN + _AT_EDGE and eta > -MARGIN + _AT_EDGE and xi + eta < 1 + MARGIN - _AT_EDGE


@compiled(inline="always")
def _beyond_rim(kind, xi, eta, rims, tangents, rim):
    """Whether coordinates lie farther than `rim` (mm) beyond an edge that ends the surface."""
    a, b = np.sqrt(_product(tangents[0], tangents[0])), np.sqrt(_product(tangents[1], tangents[1]))
    if kind >= LINE2:
        return (rims[0] and (-1 - xi) * a > rim) or (rims[1] and (xi - 1) * a > rim)
    if kind >= QUAD8:
        return (
            (rims[0] and (-1 - eta) * b > rim)
            or (rims[1] and (xi - 1) * a > rim)
            or (rims[2] and (eta - 1) * b > rim)
            or (rims[3] and (-1 - xi) * a > rim)
        )
    return (rims[0] and -eta * b > rim) or (rims[1] and (xi + eta - 1) * min(a, b) > rim) or (rims[2] and -xi * a > rim)


@compiled
def add_forces_of(
    force: np.ndarray,
    points: SurfacePoints,
    facet: np.ndarray,
    coordinates: np.ndarray,
    nodes: np.ndarray,
    kinds: np.ndarray,
    traction: np.ndarray,
) -> None:
    """Subtract tractions (p, 3) in MPa on the points' surface from nodal forces (n, 3), and add them on the other surface.

    So `force` is the gradient of the contact potential: its contribution to the residual.
    """
    room = room_for_shapes()
    for p in range(len(facet)):
        if facet[p] < 0 or not (traction[p, 0] != 0 or traction[p, 1] != 0 or traction[p, 2] != 0):
            continue
        w = points.weight[p]
        for a in range(9):
            node = points.nodes[p, a]
            if node < 0:
                break
            for i in range(3):
                force[node, i] -= w * points.values[p, a] * traction[p, i]
        evaluate_shapes(kinds[facet[p]], coordinates[p, 0], coordinates[p, 1], room)
        for a in range(NODES_OF[kinds[facet[p]]]):
            for i in range(3):
                force[nodes[facet[p], a], i] += w * room.values[a] * traction[p, i]


@compiled
def _forms(points, p, kind, room, width, coupled, rows):
    """Write both sides' shape values into row 0 of `rows`, the other side's derivatives into rows 1, 2, from column `width` on."""
    rows[:] = 0.0
    for a in range(NODES_OF[points.kind[p]]):
        rows[0, a] = points.values[p, a]
    if coupled:
        for a in range(NODES_OF[kind]):
            rows[0, width + a] = -room.values[a]
            rows[1, width + a], rows[2, width + a] = room.slopes[0, a], room.slopes[1, a]


@compiled
def add_pair_tangents(
    out: np.ndarray,
    pair: np.ndarray,
    points: SurfacePoints,
    projection: Projection,
    nodes: np.ndarray,
    kinds: np.ndarray,
    x: np.ndarray,
    pressure: np.ndarray,
    slope: np.ndarray,
    width: int,
    coupled: bool,
) -> None:
    """Add the second derivative of the contact's energy to the matrices (pairs, k, k) of pairs of facets.

    pair (p,): the points' pairs, -1 for none;  pressure (p,) in MPa and its slope (p,) in N/mm3;  width: nodes of a facet of the
    points' side, after which those of the other side follow if `coupled`
    """
    room, corners, k = room_for_shapes(), np.zeros((9, 3)), out.shape[1] // 3
    rows, G, place, tangents, kappa = np.empty((3, k)), np.empty(3 * k), np.empty(3), np.empty((2, 3)), np.empty((2, 2))
    for p in range(len(pair)):
        if pair[p] < 0:
            continue
        facet = projection.facet[p]
        kind, n = kinds[facet], projection.normal[p]
        for a in range(NODES_OF[kind]):
            for i in range(3):
                corners[a, i] = x[nodes[facet, a], i]
        evaluate_shapes(kind, projection.coordinates[p, 0], projection.coordinates[p, 1], room)
        place_on(kind, corners, room, place, tangents)
        _forms(points, p, kind, room, width, coupled, rows)
        _along(rows[0], n, G)
        _add_square(out[pair[p]], points.weight[p] * slope[p], G)
        if pressure[p] != 0 and projection.inner[p]:
            _curvature(kind, corners, room, n, kappa)
            _add_turning(out[pair[p]], -points.weight[p] * pressure[p], rows, n, tangents, kappa, projection.gap[p])


@compiled(inline="always")
def _along(values, direction, form):
    """The form (3 k,) of nodal values (k,) along a direction (3,)."""
    for a in range(len(values)):
        for i in range(3):
            form[3 * a + i] = values[a] * direction[i]


@compiled(inline="always")
def _add_turning(matrix, factor, rows, n, tangents, kappa, gap):
    """The upper triangle of factor times d2g, see the module's docstring; rows: see `_forms`."""
    columns = len(matrix)
    N, D, T = np.empty((2, columns)), np.empty((2, columns)), np.empty((2, columns))
    M, metric = np.empty((2, 2)), np.empty((2, 2))
    for i in range(2):
        for j in range(2):
            metric[i, j] = _product(tangents[i], tangents[j])
            M[i, j] = metric[i, j] - gap * kappa[i, j]
    _invert(M)
    _invert(metric)
    for d in range(2):
        _along(rows[1 + d], n, N[d])
        _along(rows[0], tangents[d], T[d])
    for c in range(columns):
        for d in range(2):
            T[d, c] += gap * N[d, c]
        for d in range(2):
            D[d, c] = M[d, 0] * T[0, c] + M[d, 1] * T[1, c]
        for d in range(2):
            T[d, c] = N[d, c] + kappa[d, 0] * D[0, c] + kappa[d, 1] * D[1, c]
    for r in range(columns):
        for c in range(r, columns):
            value = 0.0
            for i in range(2):
                value -= N[i, r] * D[i, c] + D[i, r] * N[i, c]
                for j in range(2):
                    value += gap * metric[i, j] * T[i, r] * T[j, c] - kappa[i, j] * D[i, r] * D[j, c]
            matrix[r, c] += factor * value


@compiled(inline="always")
def _add_square(matrix, factor, form):
    """The upper triangle of factor times form form^T."""
    for r in range(len(form)):
        if form[r] != 0.0:
            scaled = factor * form[r]
            for c in range(r, len(form)):
                matrix[r, c] += scaled * form[c]


@compiled(inline="always")
def _curvature(kind, corners, room, n, kappa):
    kappa[:] = 0.0
    for a in range(NODES_OF[kind]):
        along = n[0] * corners[a, 0] + n[1] * corners[a, 1] + n[2] * corners[a, 2]
        kappa[0, 0] += room.curvatures[0, a] * along
        kappa[1, 1] += room.curvatures[1, a] * along
        kappa[0, 1] += room.curvatures[2, a] * along
    kappa[1, 0] = kappa[0, 1]


@compiled(inline="always")
def _invert(m):
    determinant = m[0, 0] * m[1, 1] - m[0, 1] * m[1, 0]
    m[0, 0], m[1, 1], m[0, 1], m[1, 0] = (
        m[1, 1] / determinant,
        m[0, 0] / determinant,
        -m[0, 1] / determinant,
        -m[1, 0] / determinant,
    )


@compiled
def add_friction_tangents(
    out: np.ndarray,
    pair: np.ndarray,
    points: SurfacePoints,
    facet: np.ndarray,
    coordinates: np.ndarray,
    kinds: np.ndarray,
    stiffness: np.ndarray,
    width: int,
    coupled: bool,
) -> None:
    """Add w F^T stiffness F, with stiffnesses (p, 3, 3) in N/mm3 and F = (shape values, minus those of the other side)."""
    room, columns = room_for_shapes(), out.shape[1]
    k = columns // 3
    rows = np.empty((3, k))
    for p in range(len(pair)):
        if pair[p] < 0:
            continue
        kind = kinds[facet[p]]
        evaluate_shapes(kind, coordinates[p, 0], coordinates[p, 1], room)
        _forms(points, p, kind, room, width, coupled, rows)
        for a in range(k):
            for b in range(a, k):
                factor = points.weight[p] * rows[0, a] * rows[0, b]
                if factor != 0.0:
                    for i in range(3):
                        for j in range(i if a == b else 0, 3):
                            out[pair[p], 3 * a + i, 3 * b + j] += factor * stiffness[p, i, j]
