"""A rigid object with rounded edges, and how far points are from it: a continuous function of their places.

The planes of facets over points (`height_field`) are discontinuous where a point slides past an edge; under edges sharper than the
cover's elements each new plane then raises the potential, which the next step lowers again, without end. The distance to the object
is continuous, and so is its direction where the edges are rounded.

The rounded object is the set of all balls of the radius r that fit into the object: it has the same faces and, at convex edges,
the radius r. A point's distance from it is that from the object shrunk by r, less r. The shrunk object has the same facets, whose
corners have moved into the object by r along the normals of all facets around them. Where a part is thinner than that, facets would
turn over; a smaller r is taken then.

That leaves inner edges sharp, such as those between the facets of a bore. One facet and the other would push a point in one
in turn, and Newton's method would never end. So distances near the surface are means over a small sphere (`averaged`).
"""

from dataclasses import dataclass, replace

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from softtact.compiled import compiled
from softtact.contact.lower_envelope import NO_CONTACT_MM

EDGE_RADIUS_MM = 0.05      # a twelfth of a draft element; most objects' own edges are rounder
REACH_MM = 0.4             # farther points are neither in contact nor soon
_HALVINGS = 3              # of the radius, before edges stay sharp
_BIN_MM = 0.25
_LEVEL = 0.02              # of the normals' largest moment: below it the facets around a corner do not resist a movement
_SAME = 1e-12              # mm2: squared distances that differ by less are of one point
_ON_MM = 1e-6              # distance below which a point's direction is the facet's normal
_INSIDE_MM = 0.2           # points deeper inside are not averaged: some of the sphere's might be out of reach
_CLEAR = 0.5               # length of a mean of directions; in the middle of a wall its two sides' cancel each other
_SPHERE_MM = 0.02          # of the means, which are 1.3 um more at rounded edges and 3 um at corners
# Turned, so that an edge along an axis of the object parts its points one by one.
_SPHERE = _SPHERE_MM * Rotation.from_euler("xyz", [0.3, 0.5, 0.7]).apply(trimesh.creation.icosahedron().vertices)


@dataclass(frozen=True)
class RoundedObject:
    """Facets of an object that was shrunk by `radius_mm`, found by bins in plan that list all facets within reach."""

    radius_mm: float
    """Of its convex edges."""
    triangles: np.ndarray
    """(t, 3, 3) in mm: of the shrunk object."""
    normals: np.ndarray
    """(t, 3): unit normals, outwards."""
    origin: np.ndarray
    """(2,) in mm: corner of the first bin."""
    bins: tuple[int, int]
    """Numbers along x and y."""
    starts: np.ndarray
    """(bins + 1,): each bin's first place among the members."""
    members: np.ndarray
    """Numbers of the triangles that come near each bin."""

    @classmethod
    def of(cls, points: np.ndarray, facets: np.ndarray) -> "RoundedObject":
        """Of a closed surface with points (n, 3) in mm and facets (f, 3)."""
        mesh = trimesh.Trimesh(points, facets, process=True)      # merges the corners that facets share
        mesh.update_faces(mesh.area_faces > 0)                    # facets without an area have no normal along which to shrink
        radius, corners = _shrunk_without_turning(mesh)
        triangles, normals = corners[mesh.faces], np.asarray(mesh.face_normals)
        low, high = triangles[..., :2].min(axis=1) - REACH_MM, triangles[..., :2].max(axis=1) + REACH_MM
        origin = low.min(axis=0)
        first, last = (((ends - origin) / _BIN_MM).astype(np.int64) for ends in (low, high))
        across, along = (int(count) + 1 for count in last.max(axis=0))
        return cls(radius, triangles, normals, origin, (across, along), *_listed(first, last, across, along))

    def moved(self, way_mm: np.ndarray) -> "RoundedObject":
        """The object after a displacement (3,) in mm."""
        return replace(self, triangles=self.triangles + way_mm, origin=self.origin + way_mm[:2])

    def __call__(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances (n,) in mm of points (n, 3), below 0 inside, and their directions (n, 3), outwards.

        Beyond `REACH_MM` of the shrunk object they are NO_CONTACT_MM, and downwards.
        """
        found_on = self.triangles, self.normals, self.origin, self.bins, self.starts, self.members
        nearest, squared, seen, number = _nearest(np.ascontiguousarray(points), *found_on)
        found = number >= 0
        signed = np.where(seen < 0, -1.0, 1.0) * np.sqrt(squared)
        away = (points[found] - nearest[found]) / np.where(np.abs(signed[found]) > _ON_MM, signed[found], 1.0)[:, None]
        directions = np.tile([0.0, 0.0, -1.0], (len(points), 1))
        directions[found] = np.where(np.abs(signed[found]) > _ON_MM, away.T, self.normals[number[found]].T).T
        return np.where(found, signed - self.radius_mm, NO_CONTACT_MM), directions

    def averaged(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Distances (n,) in mm of points (n, 3) and their derivatives (n, 3), shorter than 1 where directions differ.

        Near the surface both are means over a small sphere around the point, so that the derivative changes little by little across
        inner edges, too; elsewhere they are those of the point.
        """
        distance, directions = self(points)
        near = np.flatnonzero((distance > -_INSIDE_MM) & (distance < _SPHERE_MM))      # no point beyond touches the object
        around, along = self((points[near, None] + _SPHERE).reshape(-1, 3))
        mean, slope = around.reshape(-1, len(_SPHERE)).mean(axis=1), along.reshape(-1, len(_SPHERE), 3).mean(axis=1)
        clear = np.linalg.norm(slope, axis=1) > _CLEAR
        distance[near[clear]], directions[near[clear]] = mean[clear], slope[clear]
        return distance, directions


def _shrunk_without_turning(mesh):
    """The largest radius of `EDGE_RADIUS_MM` and its halves at which no facet turns over, or 0, and the shrunk corners (n, 3)."""
    inwards = _inwards(mesh)
    for halving in range(_HALVINGS + 1):
        radius = 0.5**halving * EDGE_RADIUS_MM
        corners = mesh.vertices + radius * inwards
        first, second, third = corners[mesh.faces].transpose(1, 0, 2)
        areas = np.einsum("ti,ti->t", np.cross(second - first, third - first), mesh.face_normals)
        if (areas > 0).all():
            return radius, corners
    return 0.0, np.array(mesh.vertices)


def _inwards(mesh):
    """The smallest movements (n, 3) of corners that carry each facet around them inwards by 1, as nearly as can be."""
    moment, wanted = np.zeros((len(mesh.vertices), 3, 3)), np.zeros((len(mesh.vertices), 3))
    for corner in range(3):
        weighted = mesh.face_angles[:, corner, None] * mesh.face_normals
        np.add.at(wanted, mesh.faces[:, corner], -weighted)
        np.add.at(moment, mesh.faces[:, corner], weighted[:, :, None] * mesh.face_normals[:, None, :])
    size, turn = np.linalg.eigh(moment)
    inverse = np.where(size > _LEVEL * size[:, 2:], 1.0 / np.maximum(size, np.finfo(float).tiny), 0.0)
    return np.einsum("nij,nj,nkj,nk->ni", turn, inverse, turn, wanted)


@compiled
def _listed(first, last, across, along):
    """Triangles by bins, from those of their boxes' first to last corners (t, 2): starts (across along + 1,), members."""
    starts = np.zeros(across * along + 1, dtype=np.int64)
    for t in range(len(first)):
        for j in range(first[t, 1], last[t, 1] + 1):
            for i in range(first[t, 0], last[t, 0] + 1):
                starts[j * across + i + 1] += 1
    starts = np.cumsum(starts)
    members, fill = np.empty(starts[-1], dtype=np.int64), starts[:-1].copy()
    for t in range(len(first)):
        for j in range(first[t, 1], last[t, 1] + 1):
            for i in range(first[t, 0], last[t, 0] + 1):
                members[fill[j * across + i]] = t
                fill[j * across + i] += 1
    return starts, members


@compiled
def _nearest(points, triangles, normals, origin, bins, starts, members):
    """Nearest place (n, 3) on the triangles, its squared distance, the distance over its triangle's plane, the triangle or -1.

    At an edge or corner, the triangle that is seen most directly decides on which side of the object a point is.
    """
    place, squared = np.zeros((len(points), 3)), np.full(len(points), REACH_MM * REACH_MM)
    seen, number = np.zeros(len(points)), np.full(len(points), -1)
    for n in range(len(points)):
        p = points[n, 0], points[n, 1], points[n, 2]
        i, j = int(np.floor((p[0] - origin[0]) / _BIN_MM)), int(np.floor((p[1] - origin[1]) / _BIN_MM))
        if i < 0 or j < 0 or i >= bins[0] or j >= bins[1]:
            continue
        for k in range(starts[j * bins[0] + i], starts[j * bins[0] + i + 1]):
            t = members[k]
            x, y, z = _on_triangle(p, triangles[t])
            dx, dy, dz = p[0] - x, p[1] - y, p[2] - z
            distance, over = dx * dx + dy * dy + dz * dz, dx * normals[t, 0] + dy * normals[t, 1] + dz * normals[t, 2]
            if distance < squared[n] - _SAME or (distance <= squared[n] + _SAME and abs(over) > abs(seen[n])):
                squared[n], seen[n], number[n] = distance, over, t
                place[n, 0], place[n, 1], place[n, 2] = x, y, z
    return place, squared, seen, number


@compiled(inline="always")
def _on_triangle(p, t):
    """The place on a triangle (3, 3) nearest to a point. (Ericson, Real-Time Collision Detection, 2005, section 5.1.5.)"""
    bx, by, bz = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    cx, cy, cz = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    px, py, pz = p[0] - t[0, 0], p[1] - t[0, 1], p[2] - t[0, 2]
    along_b, along_c = bx * px + by * py + bz * pz, cx * px + cy * py + cz * pz
    bb, bc, cc = bx * bx + by * by + bz * bz, bx * cx + by * cy + bz * cz, cx * cx + cy * cy + cz * cz
    b_from_b, c_from_b, b_from_c, c_from_c = along_b - bb, along_c - bc, along_b - bc, along_c - cc
    of_a = b_from_b * c_from_c - b_from_c * c_from_b
    of_b = b_from_c * along_c - along_b * c_from_c
    of_c = along_b * c_from_b - b_from_b * along_c
    if along_b <= 0 and along_c <= 0:
        u, v = 0.0, 0.0
    elif b_from_b >= 0 and c_from_b <= b_from_b:
        u, v = 1.0, 0.0
    elif c_from_c >= 0 and b_from_c <= c_from_c:
        u, v = 0.0, 1.0
    elif of_c <= 0 and along_b >= 0 and b_from_b <= 0:
        u, v = along_b / (along_b - b_from_b), 0.0
    elif of_b <= 0 and along_c >= 0 and c_from_c <= 0:
        u, v = 0.0, along_c / (along_c - c_from_c)
    elif of_a <= 0 and c_from_b >= b_from_b and b_from_c >= c_from_c:
        v = (c_from_b - b_from_b) / (c_from_b - b_from_b + b_from_c - c_from_c)
        u = 1.0 - v
    else:
        u, v = of_b / (of_a + of_b + of_c), of_c / (of_a + of_b + of_c)
    return t[0, 0] + u * bx + v * cx, t[0, 1] + u * by + v * cy, t[0, 2] + u * bz + v * cz
