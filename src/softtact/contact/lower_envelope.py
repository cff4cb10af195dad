"""Compiled functions of the lower envelope of triangles: the one way in which heights over lines of points are found.

Each triangle that faces down lowers the heights of the points above which it lies, which asks for no search. Lines x (nx,) and
y (ny,) rise, need not be even, and number points x fastest; heights without a triangle are NO_CONTACT_MM.
"""

import numpy as np

from softtact.compiled import compiled

NO_CONTACT_MM = 1e3   # height reported where the object is not above the point
SPACING = 0.5     # of a step: distance of points along an edge, so that none of the cells that it crosses is left out
SEEN = 0.6         # slope between a node and a point up to which both belong to one part; a surface without an edge is less steep
_LEVEL = 1e-9       # cosine below which a facet is a wall; a point's slack beside a facet, as a share of the facet


@compiled
def facing_down(points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Triangles (t, 3, 3) of the facets (f, 3) that can be touched from below, their unit normals (t, 3) and numbers (t,)."""
    triangles, normals, numbers = np.empty((len(facets), 3, 3)), np.empty((len(facets), 3)), np.empty(len(facets), dtype=np.int64)
    count = 0
    for f in range(len(facets)):
        a, b, c = points[facets[f, 0]], points[facets[f, 1]], points[facets[f, 2]]
        px, py, pz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        qx, qy, qz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
        size = np.sqrt(nx * nx + ny * ny + nz * nz)
        if nz < -_LEVEL * max(size, 1e-300):     # walls and upper sides cannot be touched
            normals[count, 0], normals[count, 1], normals[count, 2] = nx / size, ny / size, nz / size
            for axis in range(3):
                triangles[count, 0, axis], triangles[count, 1, axis], triangles[count, 2, axis] = a[axis], b[axis], c[axis]
            numbers[count] = f
            count += 1
    return triangles[:count], normals[:count], numbers[:count]


@compiled
def lowest_over_lines(triangles: np.ndarray, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Heights (ny nx,) of the lowest triangle over each point, and its number (ny nx,), -1 for none."""
    lowest, number = np.full(len(y) * len(x), NO_CONTACT_MM), np.full(len(y) * len(x), -1)
    for t in range(len(triangles)):
        a, b, c = _corners(triangles[t])
        first_i, last_i = _within(x, min(a[0], b[0], c[0]), max(a[0], b[0], c[0]))
        first_j, last_j = _within(y, min(a[1], b[1], c[1]), max(a[1], b[1], c[1]))
        for j in range(first_j, last_j):
            for i in range(first_i, last_i):
                inside, z = _plane(a, b, c, x[i], y[j])
                if inside and z < lowest[j * len(x) + i]:
                    lowest[j * len(x) + i], number[j * len(x) + i] = z, t
    return lowest, number


@compiled
def heights_of(triangles: np.ndarray, numbers: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Heights (n,) over points (n,), (n,) of the planes of triangles by their numbers (n,); NO_CONTACT_MM for -1."""
    heights = np.full(len(numbers), NO_CONTACT_MM)
    for n in range(len(numbers)):
        if numbers[n] >= 0:
            a, b, c = _corners(triangles[numbers[n]])
            heights[n] = _plane(a, b, c, x[n], y[n])[1]
    return heights


@compiled(inline="always")
def _corners(t):
    """A triangle's corners as numbers, which a loop over points keeps in registers."""
    return (t[0, 0], t[0, 1], t[0, 2]), (t[1, 0], t[1, 1], t[1, 2]), (t[2, 0], t[2, 1], t[2, 2])


@compiled(inline="always")
def _plane(a, b, c, x, y):
    """Whether a point lies over a triangle, and the height of the triangle's plane there."""
    bx, by, cx, cy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]
    px, py, double_area = x - a[0], y - a[1], bx * cy - by * cx
    u, v = (px * cy - py * cx) / double_area, (bx * py - by * px) / double_area
    return u >= -_LEVEL and v >= -_LEVEL and u + v <= 1 + _LEVEL, a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2])


@compiled(inline="always")
def _within(line, low, high):
    """Indices, from the first to before the last, of a rising line's points from low to high, with a triangle's slack."""
    slack, per_mm, count = 4 * _LEVEL * (high - low), (len(line) - 1) / max(line[-1] - line[0], 1e-300), len(line)
    first, last = 0, 0
    if low - slack <= line[-1] and high + slack >= line[0]:
        first = min(max(int((low - line[0]) * per_mm), 0), count)      # exact on even lines, nearly so on others
        while first < count and line[first] < low - slack:
            first += 1
        while first > 0 and line[first - 1] >= low - slack:
            first -= 1
        last = min(max(int((high - line[0]) * per_mm), first), count)
        while last < count and line[last] <= high + slack:
            last += 1
        while last > first and line[last - 1] > high + slack:
            last -= 1
    return first, last


@compiled
def lowest_corner(triangles: np.ndarray, x: np.ndarray, y: np.ndarray) -> float:
    """Height of the triangles' lowest corner within the rectangle of lines x, y, its sides included; NO_CONTACT_MM for none."""
    lowest = NO_CONTACT_MM
    for t in range(len(triangles)):
        for k in range(3):
            if x[0] <= triangles[t, k, 0] <= x[-1] and y[0] <= triangles[t, k, 1] <= y[-1]:
                lowest = min(lowest, triangles[t, k, 2])
    return lowest


@compiled
def lowest_between(triangles: np.ndarray, seen: np.ndarray, x: np.ndarray, y: np.ndarray, beside: float,
                   below: float) -> np.ndarray:
    """Heights (ny nx,) of the lowest part of the triangles in each node's cell that no node sees (`narrow_parts`).

    seen (ny nx,): heights that the nodes see;  x, y: even lines;  beside: steps beside the outer nodes within which a part still
    touches;  below: height from which on parts cannot touch
    """
    lowest, spacing = np.full(len(seen), NO_CONTACT_MM), SPACING * min(x[1] - x[0], y[1] - y[0])
    for t in range(len(triangles)):
        if min(triangles[t, 0, 2], triangles[t, 1, 2], triangles[t, 2, 2]) < below:
            for k in range(3):
                a, b = triangles[t, k], triangles[t, (k + 1) % 3]
                parts = max(1, int(np.ceil(np.hypot(b[0] - a[0], b[1] - a[1]) / spacing)))
                for part in range(parts + 1):
                    _lower_to_point(lowest, seen, a, b, part / parts, x, y, beside, below)
    return lowest


@compiled(inline="always")
def _lower_to_point(lowest, seen, a, b, share, x, y, beside, below):
    height, nx, ny = a[2] + share * (b[2] - a[2]), len(x), len(y)
    step_x, step_y = x[1] - x[0], y[1] - y[0]
    u, v = (a[0] + share * (b[0] - a[0]) - x[0]) / step_x, (a[1] + share * (b[1] - a[1]) - y[0]) / step_y
    if height < below and -beside <= u <= nx - 1 + beside and -beside <= v <= ny - 1 + beside:
        found = False
        for corner in range(4):
            i, j = min(max(int(np.floor(u)) + corner % 2, 0), nx - 1), min(max(int(np.floor(v)) + corner // 2, 0), ny - 1)
            away = np.sqrt(((i - u) * step_x) ** 2 + ((j - v) * step_y) ** 2)
            found = found or seen[j * nx + i] <= height + SEEN * away
        if not found:
            place = int(np.rint(v)) * nx + int(np.rint(u))
            lowest[place] = min(lowest[place], height)


@compiled
def lowest_in_box(triangles: np.ndarray, box: np.ndarray) -> float:
    """Lowest height of triangles over a rectangle (low and high x, low and high y), exact, cut off at its sides."""
    lowest = NO_CONTACT_MM
    for t in range(len(triangles)):
        lowest = min(lowest, _cut_off(triangles[t], box))
    return lowest


@compiled(inline="always")
def _cut_off(triangle, box):
    corners, count, beside = np.empty((8, 3)), 3, False
    for axis in range(2):
        beside |= max(triangle[0, axis], triangle[1, axis], triangle[2, axis]) < box[2 * axis]
        beside |= min(triangle[0, axis], triangle[1, axis], triangle[2, axis]) > box[2 * axis + 1]
    if beside:
        return NO_CONTACT_MM
    for k in range(3):
        for axis in range(3):
            corners[k, axis] = triangle[k, axis]
    for side in range(4):
        cut, kept = np.empty((8, 3)), 0
        axis, sign = side // 2, 1.0 - 2.0 * (side % 2)
        for k in range(count):
            a, b = corners[k], corners[(k + 1) % count]
            inside_a, inside_b = sign * (a[axis] - box[side]), sign * (b[axis] - box[side])
            if inside_a >= 0:
                for d in range(3):
                    cut[kept, d] = a[d]
                kept += 1
            if (inside_a >= 0) != (inside_b >= 0):
                for d in range(3):
                    cut[kept, d] = a[d] + inside_a / (inside_a - inside_b) * (b[d] - a[d])
                kept += 1
        corners, count = cut, kept
    lowest = NO_CONTACT_MM
    for k in range(count):
        lowest = min(lowest, corners[k, 2])
    return lowest
