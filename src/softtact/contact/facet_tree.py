"""Search for the facet closest to a point: a bounding-volume hierarchy of the facets, built once and refitted as they move.

The search uses flat triangles between the nodes of curved facets; the closest point on the facet itself is found afterwards.
"""

from typing import NamedTuple

import numpy as np

from softtact.compiled import compiled
from softtact.contact.facet_shapes import LINE2, LINE3, QUAD8, QUAD9, TRI3, TRI6

_LEAF = 4  # triangles in a box that is not divided further
_DEPTH = 64
# Flat triangles between the nodes of each kind, and the coordinates of the nodes. A line is a triangle with two equal corners.
_PARTS = {
    TRI3: [[0, 1, 2]],
    TRI6: [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
    QUAD8: [[0, 4, 7], [4, 1, 5], [5, 2, 6], [6, 3, 7], [4, 5, 7], [5, 6, 7]],
    QUAD9: [[0, 4, 8], [0, 8, 7], [4, 1, 5], [4, 5, 8], [8, 5, 2], [8, 2, 6], [7, 8, 6], [7, 6, 3]],
    LINE2: [[0, 1, 1]],
    LINE3: [[0, 2, 2], [2, 1, 1]],
}
_QUAD = [[-1, -1], [1, -1], [1, 1], [-1, 1], [0, -1], [1, 0], [0, 1], [-1, 0], [0, 0]]
_PLACES = {
    TRI3: [[0, 0], [1, 0], [0, 1]],
    TRI6: [[0, 0], [1, 0], [0, 1], [0.5, 0], [0.5, 0.5], [0, 0.5]],
    QUAD8: _QUAD[:8],
    QUAD9: _QUAD,
    LINE2: [[-1, 0], [1, 0]],
    LINE3: [[-1, 0], [1, 0], [0, 0]],
}


class FacetTree(NamedTuple):
    """Triangles t of facets in a binary tree of boxes b; the children of a box are adjacent."""

    corners: np.ndarray
    """(t, 3) nodes of the triangles, in the tree's order."""
    facets: np.ndarray
    """(t,) facet that each triangle is a part of."""
    places: np.ndarray
    """(t, 3, 2) coordinates of the triangles' corners on their facets."""
    first: np.ndarray
    """(b,) first triangle of a leaf, or first of the two children."""
    sizes: np.ndarray
    """(b,) triangles of a leaf; 0 of a box with children."""
    low: np.ndarray
    """(b, 3) lowest corners of the boxes in mm."""
    high: np.ndarray
    """(b, 3) highest corners."""


def build_tree(nodes: np.ndarray, kinds: np.ndarray, x: np.ndarray) -> FacetTree:
    """The tree of facets (f, 9) of kinds (f,), with nodes at x (n, 3) in mm."""
    parts_of: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for kind in np.unique(kinds):
        alike, parts = np.flatnonzero(kinds == kind), np.array(_PARTS[int(kind)])
        places_of_kind = np.tile(np.array(_PLACES[int(kind)], float)[parts], (len(alike), 1, 1))
        parts_of.append((nodes[alike][:, parts].reshape(-1, 3), np.repeat(alike, len(parts)), places_of_kind))
    corners, facets, places = (np.concatenate(arrays) for arrays in zip(*parts_of, strict=True))
    order, first, count = _divide(x[corners].mean(axis=1))
    tree = FacetTree(
        np.ascontiguousarray(corners[order]),
        facets[order],
        np.ascontiguousarray(places[order]),
        first,
        count,
        np.empty((len(first), 3)),
        np.empty((len(first), 3)),
    )
    refit(tree, x)
    return tree


def _divide(centres):
    """Order of the triangles, and the boxes' `first` and `count`: boxes are halved along the longest side down to small leaves.

    All boxes of one level are halved at once; those of the next level follow them.
    """
    order, first, count, boxes = np.arange(len(centres)), [], [], 0
    begin, end = np.zeros(1, dtype=np.int64), np.full(1, len(centres))
    while len(begin):
        halved = end - begin > _LEAF
        boxes += len(begin)
        first.append(np.where(halved, boxes + 2 * (np.cumsum(halved) - 1), begin))
        count.append(np.where(halved, 0, end - begin))
        begin, end = begin[halved], end[halved]
        _sort_along_longest_sides(order, centres, begin, end)
        middle = (begin + end) // 2
        begin, end = np.column_stack([begin, middle]).ravel(), np.column_stack([middle, end]).ravel()
    return order, np.concatenate(first), np.concatenate(count)


def _sort_along_longest_sides(order, centres, begin, end):
    """Sort the parts from `begin` to `end` (b,) of the order (n,) of triangles, each along its box' longest side, in place."""
    sizes = end - begin
    if not len(sizes):
        return
    starts = np.cumsum(sizes) - sizes
    box = np.repeat(np.arange(len(sizes)), sizes)
    places = np.arange(len(box)) + (begin - starts)[box]
    inside = centres[order[places]]
    longest = (np.maximum.reduceat(inside, starts) - np.minimum.reduceat(inside, starts)).argmax(axis=1)
    along = inside[np.arange(len(box)), longest[box]]
    order[places] = order[places[np.lexsort((along, box))]]


@compiled
def refit(tree: FacetTree, x: np.ndarray) -> None:
    """Fit the boxes to nodes at x (n, 3) in mm."""
    for box in range(len(tree.first) - 1, -1, -1):  # children come after their parents
        first = tree.first[box]
        for i in range(3):
            low, high = np.inf, -np.inf
            if tree.sizes[box] == 0:
                low, high = min(tree.low[first, i], tree.low[first + 1, i]), max(tree.high[first, i], tree.high[first + 1, i])
            for t in range(first, first + tree.sizes[box]):
                for c in range(3):
                    value = x[tree.corners[t, c], i]
                    low, high = min(low, value), max(high, value)
            tree.low[box, i], tree.high[box, i] = low, high


@compiled
def nearest(
    tree: FacetTree, x: np.ndarray, point: np.ndarray, against: np.ndarray, least_cosine: float, reach: float, excluded: np.ndarray
) -> tuple[int, float, float]:
    """The facet closest to a point (3,) within `reach` (mm), and a first guess of the coordinates there; -1 where there is none.

    against (3,), least_cosine: only facets with normals n for which -n . against >= least_cosine count; `against` is the normal of
    the point's surface
    excluded (k,): nodes whose facets are left out, for self-contact; entries of -1 are ignored
    """
    best, found, xi, eta = reach * reach, -1, 0.0, 0.0
    stack, left = np.empty(_DEPTH, np.int64), 1
    stack[0] = 0
    while left > 0:
        left -= 1
        box = stack[left]
        if _box_distance(tree, box, point) >= best:
            continue
        first = tree.first[box]
        if tree.sizes[box] == 0:
            near = 0 if _box_distance(tree, first, point) <= _box_distance(tree, first + 1, point) else 1
            stack[left], stack[left + 1] = first + 1 - near, first + near
            left += 2
            continue
        for t in range(first, first + tree.sizes[box]):
            if _touches(tree.corners[t], excluded):
                continue
            a, b, c = x[tree.corners[t, 0]], x[tree.corners[t, 1]], x[tree.corners[t, 2]]
            if _cosine(a, b, c, against, tree.corners[t, 1] == tree.corners[t, 2]) < least_cosine:
                continue
            distance, u, v = closest_in_triangle(a, b, c, point)
            if distance < best:
                best, found = distance, tree.facets[t]
                p = tree.places[t]
                xi = p[0, 0] + u * (p[1, 0] - p[0, 0]) + v * (p[2, 0] - p[0, 0])
                eta = p[0, 1] + u * (p[1, 1] - p[0, 1]) + v * (p[2, 1] - p[0, 1])
    return found, xi, eta


@compiled(inline="always")
def _touches(corners, excluded):
    for node in excluded:
        if node >= 0 and (corners[0] == node or corners[1] == node or corners[2] == node):
            return True
    return False


@compiled(inline="always")
def _box_distance(tree, box, point):
    total = 0.0
    for i in range(3):
        out = max(tree.low[box, i] - point[i], point[i] - tree.high[box, i], 0.0)
        total += out * out
    return total


@compiled(inline="always")
def _cosine(a, b, c, against, line):
    """-n . against of a triangle's unit normal n; a line's is its tangent's, turned to the right."""
    if line:
        n0, n1, n2 = b[1] - a[1], a[0] - b[0], 0.0
    else:
        p0, p1, p2, q0, q1, q2 = b[0] - a[0], b[1] - a[1], b[2] - a[2], c[0] - a[0], c[1] - a[1], c[2] - a[2]
        n0, n1, n2 = p1 * q2 - p2 * q1, p2 * q0 - p0 * q2, p0 * q1 - p1 * q0
    size = np.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
    return -(n0 * against[0] + n1 * against[1] + n2 * against[2]) / size if size > 0 else -2.0


@compiled(inline="always")
def closest_in_triangle(a: np.ndarray, b: np.ndarray, c: np.ndarray, p: np.ndarray) -> tuple[float, float, float]:
    """Squared distance (mm2) of p (3,) from a triangle, and the closest point's u, v in a + u (b - a) + v (c - a).

    Ericson, Real-Time Collision Detection (2005), section 5.1.5.
    """
    d1, d2, d3, d4, d5, d6 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for i in range(3):
        ab, ac = b[i] - a[i], c[i] - a[i]
        d1 += ab * (p[i] - a[i])
        d2 += ac * (p[i] - a[i])
        d3 += ab * (p[i] - b[i])
        d4 += ac * (p[i] - b[i])
        d5 += ab * (p[i] - c[i])
        d6 += ac * (p[i] - c[i])
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    if d1 <= 0 and d2 <= 0:
        u, v = 0.0, 0.0
    elif d3 >= 0 and d4 <= d3:
        u, v = 1.0, 0.0
    elif vc <= 0 and d1 >= 0 and d3 <= 0:
        u, v = (d1 / (d1 - d3) if d1 != d3 else 0.0), 0.0
    elif d6 >= 0 and d5 <= d6:
        u, v = 0.0, 1.0
    elif vb <= 0 and d2 >= 0 and d6 <= 0:
        u, v = 0.0, (d2 / (d2 - d6) if d2 != d6 else 0.0)
    elif va <= 0 and d4 - d3 >= 0 and d5 - d6 >= 0:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6)) if (d4 - d3) + (d5 - d6) > 0 else 0.0
        u, v = 1 - w, w
    else:
        scale = 1 / (va + vb + vc)
        u, v = vb * scale, vc * scale
    total = 0.0
    for i in range(3):
        off = a[i] + u * (b[i] - a[i]) + v * (c[i] - a[i]) - p[i]
        total += off * off
    return total, u, v
