"""Straight ways on a triangle mesh: along the surface, without turning (Polthier and Schmies, Straightest Geodesics, 1998)."""

from dataclasses import dataclass

import numpy as np
import trimesh

from softtact.errors import InputError

_AHEAD = 1e-12  # of an inner product below which a way runs along an edge
_MOST_FACES = 100_000
_SHARP = np.cos(np.radians(40.0))     # beyond this angle an edge between facets is one of the body, as a lid's


@dataclass(frozen=True)
class Place:
    """A point of the surface with a direction along it."""

    face: int
    """Number of the facet."""
    point: np.ndarray
    """(3,) in mm."""
    direction: np.ndarray
    """(3,) unit vector in the facet's plane."""


class Surface:
    """A closed mesh to walk on."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self.mesh = mesh
        self._corners, self._normals = np.asarray(mesh.triangles), np.asarray(mesh.face_normals)
        self._angles = np.asarray(mesh.face_angles)
        flat = np.asarray(mesh.faces).ravel()
        self._order = np.argsort(flat, kind="stable")     # corners of facets, vertex by vertex
        self._first = np.searchsorted(flat[self._order], np.arange(len(mesh.vertices) + 1))
        self._neighbour = _neighbours(np.asarray(mesh.faces))

    def at(self, point: np.ndarray, direction: np.ndarray) -> Place:
        """The place nearest to a point, with a direction made tangential; one along the normal is refused."""
        nearest = trimesh.triangles.closest_point(self._corners, np.broadcast_to(point, (len(self._corners), 3)))
        face = int(np.linalg.norm(nearest - point, axis=1).argmin())
        return Place(face, self._inside(face, nearest[face]), self._tangent(face, direction))

    def walk(self, start: Place, *, angle: float, length_mm: float) -> Place:
        """Where a straight way ends that begins at an angle to the left of the start's direction; its direction ends the way's."""
        face, point = start.face, start.point
        direction = self.turned(start, angle)
        crossed, left = -1, length_mm
        for _ in range(_MOST_FACES):
            edge, ahead = self._exit(face, point, direction, crossed)
            if ahead >= left:
                return Place(face, point + left * direction, direction)
            point, left = point + ahead * direction, left - ahead
            face, crossed, direction = self._cross(face, edge, direction)
        raise InputError(f"link.mesh: a way of {length_mm:g} mm on it crosses more than {_MOST_FACES} facets; simplify the mesh.")

    def turned(self, place: Place, angle: float) -> np.ndarray:
        """The place's direction turned to the left by an angle, seen from outside."""
        aside = np.cross(self._normals[place.face], place.direction)
        return np.cos(angle) * place.direction + np.sin(angle) * aside

    def normal(self, place: Place) -> np.ndarray:
        """Outward unit normal (3,), smooth over facets that bend little and sharp at edges."""
        weights = trimesh.triangles.points_to_barycentric(self._corners[place.face][None], place.point[None])[0]
        normal = weights @ np.array([self._corner_normal(place.face, corner) for corner in range(3)])
        return normal / np.linalg.norm(normal)

    def _corner_normal(self, face, corner):
        """Mean normal at a facet's corner of the facets there that are within sharp edges, weighted by their angles."""
        vertex = self.mesh.faces[face][corner]
        around = self._order[self._first[vertex]:self._first[vertex + 1]]
        normals = self._normals[around // 3]
        smooth = normals @ self._normals[face] > _SHARP
        mean = (self._angles[around // 3, around % 3] * smooth) @ normals
        return mean / np.linalg.norm(mean)

    def _tangent(self, face, direction):
        normal = self._normals[face]
        flat = np.asarray(direction, dtype=float) - (direction @ normal) * normal
        length = np.linalg.norm(flat)
        if length < 1e-6 * max(np.linalg.norm(direction), 1e-300) or length == 0:
            raise InputError("link.direction: it stands upright on the surface at the start; give one along the surface.")
        return flat / length

    def _inside(self, face, point):
        """The point moved a little towards the facet's middle, off its edges."""
        return point + 1e-6 * (self._corners[face].mean(axis=0) - point)

    def _inwards(self, face, edge):
        """Along an edge (3,), and across it into the facet (3,), both unit vectors."""
        a, b = self._corners[face][edge], self._corners[face][(edge + 1) % 3]
        along = (b - a) / np.linalg.norm(b - a)
        return along, np.cross(self._normals[face], along)

    def _exit(self, face, point, direction, crossed):
        """The edge where a way leaves a facet, and how far ahead."""
        best, ahead = 0, np.inf
        for edge in range(3):
            if edge == crossed:
                continue
            _, inwards = self._inwards(face, edge)
            speed = direction @ inwards
            if speed < -_AHEAD:
                way = max(0.0, -((point - self._corners[face][edge]) @ inwards) / speed)
                if way < ahead:
                    best, ahead = edge, way
        return best, ahead

    def _cross(self, face, edge, direction):
        """The facet behind an edge, the edge's number in it, and the direction there, as if both were unfolded."""
        along, inwards = self._inwards(face, edge)
        other, own = self._neighbour[face, edge]
        if other < 0:
            raise InputError("link.mesh: the surface has an open edge within the modules; close the mesh.")
        _, behind = self._inwards(other, own)
        turned = (direction @ along) * along - (direction @ inwards) * behind
        return int(other), int(own), turned / np.linalg.norm(turned)


def _neighbours(faces):
    """Facet behind each edge and the edge's number there: (facet, 3, 2), -1 where there is none."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    order = np.lexsort(edges.T)
    same = (edges[order[1:]] == edges[order[:-1]]).all(axis=1)
    found = np.full((len(edges), 2), -1)
    for one, other in ((order[:-1][same], order[1:][same]), (order[1:][same], order[:-1][same])):
        found[one] = np.column_stack([other // 3, other % 3])
    return found.reshape(-1, 3, 2)
