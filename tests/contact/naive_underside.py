"""Undersides of objects in plain NumPy, triangle by triangle and point by point: the specification of `contact.lower_envelope`."""

import numpy as np
import trimesh

from softtact.contact.height_field import HeightField
from softtact.contact.lower_envelope import NO_CONTACT_MM, SEEN
from softtact.contact.narrow_parts import along_edges_over


def lowest_crossing(x, y, mesh):
    """Heights (n,) of the lowest of a mesh's facets over points (n,), (n,), walls left out."""
    heights = np.full(len(x), NO_CONTACT_MM)
    for triangle in mesh.triangles:
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = triangle
        double_area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if abs(double_area) < 1e-14:
            continue
        u = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / double_area
        v = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / double_area
        inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
        heights[inside] = np.minimum(heights[inside], (az + u * (bz - az) + v * (cz - az))[inside])
    return heights


def over(x, y, mesh):
    """`lowest_crossing` (y, x) over lines x, y."""
    return lowest_crossing(*(places.ravel() for places in np.meshgrid(x, y)), mesh).reshape(len(y), len(x))


def first_touch(x, y, mesh):
    """Height of a closed mesh's lowest point over the map's points and of its corners over the map."""
    corners = mesh.vertices[(mesh.vertices[:, 0] >= x[0]) & (mesh.vertices[:, 0] <= x[-1])
                            & (mesh.vertices[:, 1] >= y[0]) & (mesh.vertices[:, 1] <= y[-1])]
    return min(over(x, y, mesh).min(), corners[:, 2].min(initial=NO_CONTACT_MM))


def lowest_missed(surface: HeightField, grid, seen, below):
    """Heights (n,) of the lowest points along edges, in each node's cell, that none of the four nodes around sees."""
    lowest, last = np.full(grid.count, NO_CONTACT_MM), np.array(grid.shape[::-1]) - 1
    for point, node in zip(*along_edges_over(surface, grid, below), strict=True):
        place = (point[:2] - grid.points[0]) / grid.step
        around = np.clip(np.floor(place).astype(int) + [(0, 0), (1, 0), (0, 1), (1, 1)], 0, last)
        away = np.linalg.norm((around - place) * grid.step, axis=1)
        if (seen[around[:, 1] * grid.shape[1] + around[:, 0]] > point[2] + SEEN * away).all():
            lowest[node] = min(lowest[node], point[2])
    return lowest


def lowest_in_box(box, mesh):
    """Lowest height of a closed mesh over a rectangle (low and high x, low and high y), by cutting it off at the sides."""
    planes = ((0, 1.0, box[0]), (0, -1.0, box[1]), (1, 1.0, box[2]), (1, -1.0, box[3]))
    vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
    for axis, sign, bound in planes:
        if not len(faces):
            return NO_CONTACT_MM
        normal = sign * np.eye(3)[axis]
        vertices, faces, _ = trimesh.intersections.slice_faces_plane(vertices, faces, normal, sign * bound * normal)
    return vertices[faces, 2].min(initial=NO_CONTACT_MM)
