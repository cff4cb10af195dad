"""Modules placed side by side on a robot's link, and their taxels for other programs.

Modules are placed from a start along straightest geodesics (Polthier and Schmies, Straightest Geodesics, 1998). On a cylinder or a
cone the flat tiling closes without gaps. On a surface that bends in two directions it cannot: gaps or overlaps appear between
modules that were reached along different paths.
"""

from collections import deque
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as xml

import numpy as np
import pandas as pd
import trimesh
from scipy.spatial.transform import Rotation

import softtact
from softtact.errors import InputError
from softtact.files import atomic_path
from softtact.skin.layout import Layout

_PARALLEL = 1e-12  # inner product below which a path runs along an edge
_MOST_FACES = 100_000
_NEAR = 0.9  # of the distance between neighbours' middles: a module that is nearer to another is left out
_NO_BEND = 1e-9
_SHARES = (1.0, 0.4)  # of the paths to the corners: long ones smooth over facets, short ones detect sharp bends
_M = 1e-3  # metres in a millimetre: all three formats are in metres
_SHARP = np.cos(np.radians(40.0))  # beyond this angle between facets an edge belongs to the body, like a lid's


@dataclass(frozen=True)
class SurfaceFrame:
    """A point of the surface with a direction along it, which is the x axis of a module there."""

    face: int
    """Number of the facet."""
    point: np.ndarray
    """(3,) in mm."""
    direction: np.ndarray
    """(3,) unit vector in the facet's plane."""


class GeodesicMesh:
    """A closed mesh with its straightest geodesics."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        self.mesh = mesh
        self._corners, self._normals = np.asarray(mesh.triangles), np.asarray(mesh.face_normals)
        self._angles = np.asarray(mesh.face_angles)
        flat = np.asarray(mesh.faces).ravel()
        self._order = np.argsort(flat, kind="stable")     # corners of facets, vertex by vertex
        self._first = np.searchsorted(flat[self._order], np.arange(len(mesh.vertices) + 1))
        self._neighbour = _neighbours(np.asarray(mesh.faces))

    def at(self, point: np.ndarray, direction: np.ndarray) -> SurfaceFrame:
        """The frame nearest to a point, with a direction made tangential; one along the normal is refused."""
        nearest = trimesh.triangles.closest_point(self._corners, np.broadcast_to(point, (len(self._corners), 3)))
        face = int(np.linalg.norm(nearest - point, axis=1).argmin())
        return SurfaceFrame(face, self._inside(face, nearest[face]), self._tangent(face, direction))

    def walk(self, start: SurfaceFrame, *, angle: float, length_mm: float) -> SurfaceFrame:
        """The end of a geodesic that starts at an angle to the left of the start's direction, with its direction there."""
        face, point = start.face, start.point
        direction = self.turned(start, angle)
        crossed, left = -1, length_mm
        for _ in range(_MOST_FACES):
            edge, ahead = self._exit(face, point, direction, crossed)
            if ahead >= left:
                return SurfaceFrame(face, point + left * direction, direction)
            point, left = point + ahead * direction, left - ahead
            face, crossed, direction = self._cross(face, edge, direction)
        raise InputError(f"link.mesh: a path of {length_mm:g} mm on it crosses more than {_MOST_FACES} facets; simplify the mesh.")

    def turned(self, place: SurfaceFrame, angle: float) -> np.ndarray:
        """The frame's direction turned to the left by an angle, seen from outside."""
        aside = np.cross(self._normals[place.face], place.direction)
        return np.cos(angle) * place.direction + np.sin(angle) * aside

    def normal(self, place: SurfaceFrame) -> np.ndarray:
        """Outward unit normal (3,), interpolated over facets except across sharp edges."""
        weights = trimesh.triangles.points_to_barycentric(self._corners[place.face][None], place.point[None])[0]
        normal = weights @ np.array([self._corner_normal(place.face, corner) for corner in range(3)])
        return normal / np.linalg.norm(normal)

    def _corner_normal(self, face, corner):
        """Normal at a facet's corner: mean of the facets there up to sharp edges, weighted by their angles."""
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
            raise InputError("link.direction: it is normal to the surface at the start; give one along the surface.")
        return flat / length

    def _inside(self, face, point):
        """The point, moved off the facet's edges by 1e-6 of the distance to its middle."""
        return point + 1e-6 * (self._corners[face].mean(axis=0) - point)

    def _inwards(self, face, edge):
        """Unit vectors (3,) along an edge, and normal to it into the facet."""
        a, b = self._corners[face][edge], self._corners[face][(edge + 1) % 3]
        along = (b - a) / np.linalg.norm(b - a)
        return along, np.cross(self._normals[face], along)

    def _exit(self, face, point, direction, crossed):
        """The edge where a path leaves a facet, and the distance to it."""
        best, ahead = 0, np.inf
        for edge in range(3):
            if edge == crossed:
                continue
            _, inwards = self._inwards(face, edge)
            speed = direction @ inwards
            if speed < -_PARALLEL:
                distance = max(0.0, -((point - self._corners[face][edge]) @ inwards) / speed)
                if distance < ahead:
                    best, ahead = edge, distance
        return best, ahead

    def _cross(self, face, edge, direction):
        """The facet behind an edge, the edge's number in it, and the direction there when both are unfolded."""
        along, inwards = self._inwards(face, edge)
        other, number = self._neighbour[face, edge]
        if other < 0:
            raise InputError("link.mesh: the surface has an open edge within the modules; close the mesh.")
        _, behind = self._inwards(other, number)
        turned = (direction @ along) * along - (direction @ inwards) * behind
        return int(other), int(number), turned / np.linalg.norm(turned)


def _neighbours(faces):
    """(facet, 3, 2): facet behind each edge and the edge's number there, -1 where there is none."""
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    order = np.lexsort(edges.T)
    same = (edges[order[1:]] == edges[order[:-1]]).all(axis=1)
    found = np.full((len(edges), 2), -1)
    for one, other in ((order[:-1][same], order[1:][same]), (order[1:][same], order[:-1][same])):
        found[one] = np.column_stack([other // 3, other % 3])
    return found.reshape(-1, 3, 2)


@dataclass(frozen=True)
class LaidModules:
    """Modules on a surface."""

    positions_mm: np.ndarray
    """(taxel, 3): of all modules that fit, on the surface."""
    normals: np.ndarray
    """(taxel, 3): outward unit vectors."""
    corners_mm: np.ndarray
    """(module, 3, 3): of all modules."""
    fits: np.ndarray
    """(module,): whether it bends no more than the boards bear."""
    modules: pd.DataFrame
    """A row for each module: bend_radius_mm, fits."""
    seams: pd.DataFrame
    """A row for each two neighbours: gap_mm, negative where they overlap."""
    left_out: int
    """Number of modules of the tiling without a place beside those that lie already."""


def lay_modules(mesh: trimesh.Trimesh, module: Layout, *, start_mm: np.ndarray | None, direction: np.ndarray, rings: int,
                least_radius_mm: float = 10.0) -> LaidModules:
    """`LaidModules` around a start, out to `rings` neighbours of neighbours.

    start_mm: (3,) near the first module's middle, or None for the side towards +x at the mesh's middle
    direction: (3,) of the module's side, made tangential;  least_radius_mm: smallest bend radius that the boards bear
    Raises InputError where the first module does not fit.
    """
    surface = GeodesicMesh(mesh)
    start = np.array([mesh.bounds[1, 0], *mesh.bounds.mean(axis=0)[1:]]) if start_mm is None else np.asarray(start_mm, dtype=float)
    tiles, left_out = _tiles(surface, surface.at(start, np.asarray(direction, dtype=float)), module, rings)
    radii = np.array([_bend_radius(surface, place, module) for place in tiles.values()])
    fits = radii >= least_radius_mm
    if not fits[0]:
        raise InputError(f"link: at the start the surface bends with a radius of {radii[0]:.3g} mm, and the boards bear "
                         f"{least_radius_mm:g} mm; choose another start_mm or a smaller module.")
    corners = np.array([_points(surface, place, module, module.corners_mm[0])[0] for place in tiles.values()])
    taxels = [_points(surface, place, module, module.centres_mm) for place, fit in zip(tiles.values(), fits, strict=True) if fit]
    modules = pd.DataFrame({"module": np.arange(1, len(tiles) + 1), "bend_radius_mm": radii, "fits": fits})
    positions, normals = (np.concatenate(parts) for parts in zip(*taxels, strict=True))
    return LaidModules(positions, normals, corners, fits, modules, _seams(tiles, corners), left_out)


def _tiles(surface, first, module, rings):
    """{(x, y) of the flat tiling: SurfaceFrame} in the order in which they were reached, and the number of those left out."""
    apart = np.linalg.norm(module.corners_mm[0, 1] - module.corners_mm[0, 0]) / np.sqrt(3)
    tiles, left_out = {_key(np.zeros(2)): first}, 0
    queue = deque([(np.zeros(2), 0.0, first, 0)])  # flat middle, flat angle, place, ring
    seen = set(tiles)
    while queue:
        flat, angle, place, ring = queue.popleft()
        if ring == rings:
            continue
        for side in range(3):
            towards = np.pi / 6 * (4 * side - 3)  # from the module's middle to that of a side: -90, 30, 150 degrees
            step = angle + towards
            there = flat + apart * np.array([np.cos(step), np.sin(step)])
            if _key(there) in seen:
                continue
            seen.add(_key(there))
            end = surface.walk(place, angle=towards, length_mm=apart)
            # The neighbour's frame is rotated by half a turn, because the common side lies behind it.
            turned = SurfaceFrame(end.face, end.point, surface.turned(end, np.pi - towards))
            if min(np.linalg.norm(end.point - other.point) for other in tiles.values()) < _NEAR * apart:
                left_out += 1
                continue
            tiles[_key(there)] = turned
            queue.append((there, angle + np.pi, turned, ring + 1))
    return tiles, left_out


def _key(flat):
    return tuple(np.round(flat, 3) + 0.0)


def _points(surface, place, module, flat):
    """Points (n, 3) of the surface and normals for flat points (n, 2) of a module, along geodesics from its middle."""
    arms = np.asarray(flat) - module.corners_mm[0].mean(axis=0)
    ends = [surface.walk(place, angle=np.arctan2(y, x), length_mm=np.hypot(x, y)) for x, y in arms]
    return np.array([end.point for end in ends]), np.array([surface.normal(end) for end in ends])


def _bend_radius(surface, place, module):
    """Smallest radius of curvature below a module, from the normal's rotation towards its corners and sides."""
    corners = module.corners_mm[0]
    around = np.concatenate([corners, 0.5 * (corners + np.roll(corners, -1, axis=0))]) - corners.mean(axis=0)
    axes, upright = np.stack([surface.turned(place, angle) for angle in (0.0, np.pi / 2)]), surface.normal(place)
    largest = _NO_BEND
    for share in _SHARES:
        _, normals = _points(surface, place, module, corners.mean(axis=0) + share * around)
        aside = normals @ axes.T
        angle = np.arctan2(np.linalg.norm(aside, axis=1), normals @ upright)
        turns = aside * (angle / np.maximum(np.linalg.norm(aside, axis=1), 1e-300))[:, None]
        shape, *_ = np.linalg.lstsq(share * around, turns, rcond=None)
        largest = max(largest, np.abs(np.linalg.eigvalsh(0.5 * (shape + shape.T))).max())
    return 1 / largest


def _seams(tiles, corners):
    """Gaps between neighbours of the flat tiling, along the line between their middles."""
    places, flats = list(tiles.values()), np.array(list(tiles))
    side = np.linalg.norm(corners[0, 1] - corners[0, 0])
    apart = np.linalg.norm(flats[:, None] - flats, axis=2)
    nearest = apart[apart > 0].min(initial=side)
    rows = []
    for one, other in zip(*np.nonzero(np.triu(np.abs(apart - nearest) < 1e-2, 1)), strict=True):
        between = places[other].point - places[one].point
        edges = [_edge_towards(corners[k], sign * between) for k, sign in ((one, 1.0), (other, -1.0))]
        rows.append({"module": one + 1, "neighbour": other + 1,
                     "gap_mm": float((edges[1] - edges[0]) @ between / np.linalg.norm(between))})
    return pd.DataFrame(rows, columns=["module", "neighbour", "gap_mm"])


def _edge_towards(corners, direction):
    """Middle of the triangle's side that lies furthest along a direction."""
    middles = 0.5 * (corners + np.roll(corners, -1, axis=0))
    return middles[(middles @ direction).argmax()]


def write_exports(folder: str | Path, name: str, positions_mm: np.ndarray, normals: np.ndarray, *, radius_mm: float) -> list[Path]:
    """Write NAME.txt (iCub), NAME.urdf and NAME.xml (MuJoCo) of taxels (taxel, 3) with unit normals; return their paths."""
    folder = Path(folder)
    texts = {
        folder / f"{name}.txt": icub_text(name, positions_mm, normals),
        folder / f"{name}.urdf": urdf(name, positions_mm, normals),
        folder / f"{name}.xml": mujoco_xml(name, positions_mm, normals, radius_mm=radius_mm),
    }
    for path, text in texts.items():
        with atomic_path(path) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return list(texts)


def icub_text(name: str, positions_mm: np.ndarray, normals: np.ndarray) -> str:
    """The skin of an iCub part as its skinManager reads it: four lines, then `x y z nx ny nz` in m for each taxel."""
    rows = [" ".join(f"{value:.6f}" for value in (*(_M * place), *normal))
            for place, normal in zip(positions_mm, normals, strict=True)]
    head = [f"name {name}", f"version softtact_{softtact.__version__}", f"numTaxels {len(rows)}", "[calibration]"]
    return "\n".join([*head, *rows, ""])


def urdf(name: str, positions_mm: np.ndarray, normals: np.ndarray) -> str:
    """A link with a massless frame for each taxel, its z axis along the normal."""
    robot = xml.Element("robot", name=name)
    xml.SubElement(robot, "link", name=name)
    for number, (place, normal) in enumerate(zip(positions_mm, normals, strict=True), start=1):
        xml.SubElement(robot, "link", name=f"{name}_taxel_{number}")
        joint = xml.SubElement(robot, "joint", name=f"{name}_joint_{number}", type="fixed")
        xml.SubElement(joint, "parent", link=name)
        xml.SubElement(joint, "child", link=f"{name}_taxel_{number}")
        roll, pitch = -np.arcsin(np.clip(normal[1], -1.0, 1.0)), np.arctan2(normal[0], normal[2])  # rotate z to the normal
        xml.SubElement(joint, "origin", xyz=_row(_M * place), rpy=_row((roll, pitch, 0.0)))
    return _text(robot)


def mujoco_xml(name: str, positions_mm: np.ndarray, normals: np.ndarray, *, radius_mm: float) -> str:
    """A body with a site and a touch sensor for each taxel; include it, or copy the sites into your body."""
    model = xml.Element("mujoco", model=name)
    body = xml.SubElement(xml.SubElement(model, "worldbody"), "body", name=name)
    sensors = xml.SubElement(model, "sensor")
    for number, (place, normal) in enumerate(zip(positions_mm, normals, strict=True), start=1):
        x, y, z, w = upright(normal).as_quat()
        xml.SubElement(body, "site", name=f"{name}_{number}", type="cylinder", size=_row((_M * radius_mm, 0.5 * _M)),
                       pos=_row(_M * place), quat=_row((w, x, y, z)))
        xml.SubElement(sensors, "touch", name=f"{name}_touch_{number}", site=f"{name}_{number}")
    return _text(model)


def upright(normal: np.ndarray) -> Rotation:
    """The smallest rotation from z to a unit normal."""
    axis = np.cross([0.0, 0.0, 1.0], normal)
    sine, cosine = np.linalg.norm(axis), float(normal[2])
    if sine < 1e-12:
        return Rotation.from_rotvec([0.0 if cosine > 0 else np.pi, 0.0, 0.0])
    return Rotation.from_rotvec(axis / sine * np.arctan2(sine, cosine))


def _row(values):
    return " ".join(f"{value:.9g}" for value in values)


def _text(root):
    xml.indent(root)
    return xml.tostring(root, encoding="unicode") + "\n"
