"""A sensor of `kind: solid`: any soft body of elements, pressed by a rigid mesh or a soft object from any side.

    sensor = softtact.load_solid_sensor("dome.yaml")
    result = sensor.press("ball.stl", unit="mm", force_n=[1, 5])
    result.load("object"), result.reading_pressure_mpa
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from softtact.contact.motion import Motion
from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface
from softtact.errors import InputError
from softtact.fem.mesh_files import read_mesh_file, with_named_faces
from softtact.fem.solid_mesh import SolidMesh, fine_triangles
from softtact.geometry.pose import Pose
from softtact.materials.laws.base import Law
from softtact.models.solid.body import SolidBody
from softtact.models.solid.readings import ReadingPoints
from softtact.models.solid.result import SolidResult, gathered
from softtact.press.asked import check_loads, cores, mesh_of, motion_of
from softtact.press.soft_object import OBJECT, SoftObject
from softtact.press.solid import pressed_solid
from softtact.press.touching import first_direction, way_to_touch
from softtact.sensors.library import sensor_file
from softtact.sensors.solid import SolidSpec

_PENALTY = 20.0       # times E / h of the softer surface
_REACH = 2.0          # times the length of a facet: how far apart surfaces may be that meet


def load_solid_sensor(name_or_yaml: str | Path, *, laws: dict[str, Law] | None = None, device: str = "cpu") -> "SolidSensor":
    """The `SolidSensor` of a name or of a YAML file of `kind: solid`; the mesh and cards that it names lie relative to that file.

    laws: {region: Law} in place of those of the file;  device: where elements are summed up: `cpu`, `warp`, `cuda`, or `auto`
    Raises InputError that names the file and the field: a mesh that is not there or not spatial, a region without a law, a face
    that does not exist or would be empty, a place for readings without any surface.
    """
    path = sensor_file(name_or_yaml)
    spec = SolidSpec.from_yaml(path)
    mesh = read_mesh_file(spec.mesh_path, unit=spec.mesh.unit)
    try:
        mesh = _checked_mesh(spec, with_named_faces(mesh, spec.faces), laws or {})
        sensor = SolidSensor(spec, mesh, {name: (laws or {}).get(name) or spec.law_of(name) for name in mesh.regions}, device)
        sensor.reading_points()
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return sensor


def _checked_mesh(spec: SolidSpec, mesh: SolidMesh, laws: dict[str, Law]) -> SolidMesh:
    """The mesh, where regions and faces of the file and of the mesh are the same ones."""
    if mesh.geometry != "solid":
        raise InputError(f"the mesh {spec.mesh.file} is of the geometry {mesh.geometry!r}, and objects are spatial; give a spatial "
                         "mesh.")
    stated = [*spec.regions, *laws]
    if strange := [name for name in stated if name not in mesh.regions]:
        raise InputError(f"there is no region {strange[0]!r} in {spec.mesh.file}; its regions are {', '.join(mesh.regions)}.")
    if without := [name for name in mesh.regions if name not in stated]:
        raise InputError(f"the region {without[0]!r} of {spec.mesh.file} has no law; name one under 'regions'.")
    for face in (*spec.held, spec.contact.face, *([spec.readings.face] if spec.readings and spec.readings.face else [])):
        mesh.face(face)
    return mesh


@dataclass
class SolidSensor:
    """A soft body as a sensor, with a law for each region of its mesh."""

    spec: SolidSpec
    """What its file says."""
    mesh: SolidMesh
    """The body at rest, in mm."""
    laws: dict[str, Law]
    """By region."""
    device: str = "cpu"
    """Where elements are summed up: `cpu`, `warp`, `cuda`, or `auto`: a GPU where there is one."""

    def press(self, mesh: "trimesh.Trimesh | SoftObject | str | Path", *, unit: str | None = None,
              pose: Pose | np.ndarray | Sequence[float] | None = None, force_n: float | Sequence[float] | None = None,
              motion: Motion | None = None, label: str = "press", threads: int | None = None, time_limit_s: float | None = None,
              on_step: Callable[[SolidResult], None] | None = None) -> SolidResult:
        """Press a mesh (trimesh in mm, or a file with its `unit`) or a `SoftObject`; a `SolidResult` of all load steps.

        force_n: one force down (N), or an increasing list;  motion: steps of any of the six freedoms in place of it
        pose: `Pose`, 4 x 4 matrix or six numbers (mm, degrees) of the object in the mesh's frame; by default its bounding box is
        centred over that of the contact's face. Along the way of the motion's first step the object is moved to where it first
        touches; ways count from there. It turns about the middle of its bounding box.
        threads: by default one for each core;  time_limit_s: seconds after which the press ends in a TimeLimitError
        on_step: called with the result so far at each load step that is reached but the last
        Raises InputError where the object misses the contact's face, ConvergenceError at a step that is not reached; its `result`
        holds the steps before, as those of a KeyboardInterrupt and of a TimeLimitError do.
        """
        motion = motion_of(force_n, motion)
        check_loads(motion, self.spec.force_range_n, self.spec.name)
        body = self.body_with(mesh if isinstance(mesh, SoftObject) else mesh_of(mesh, unit), pose, motion,
                              threads=threads or cores())
        return pressed_solid(body, OBJECT, motion, partial(gathered, body, readings=self.reading_points()), label=label,
                             time_limit_s=time_limit_s, on_step=on_step)

    def reading_points(self) -> ReadingPoints | None:
        """Where readings are taken; None where the file names no places."""
        places = self.spec.readings
        if places is None:
            return None
        face = Surface.of(self.mesh.face(places.face or self.spec.contact.face))
        return ReadingPoints(face, np.array(places.points_mm), places.radius_mm, self.mesh.points)

    def body_with(self, pressed: "trimesh.Trimesh | SoftObject", pose: Any, motion: Motion, *, threads: int = 1) -> SolidBody:
        """The sensor and the object (mm) where it first touches, as a `SolidBody` with the frame `object` and one pair."""
        pose, direction = Pose.of(pose), first_direction(motion)
        if isinstance(pressed, SoftObject):
            return self._with_soft(pressed, pose, direction, threads)
        vertices = self._placed(np.asarray(pressed.vertices), pose)
        triangles = vertices[pressed.faces]
        triangles = triangles + self._touching(triangles, direction)
        ends = triangles.reshape(-1, 3)
        body = SolidBody(self.mesh, self.laws, held=self.spec.held, threads=threads, device=self.device,
                         rigid={OBJECT: (0.5 * (ends.min(axis=0) + ends.max(axis=0)), triangles)})
        body.add(self._pair(body, Surface.of({"triangle": body.surface_nodes(OBJECT)}), rigid=True))
        return body

    def _with_soft(self, soft: SoftObject, pose: Pose | None, direction: np.ndarray, threads: int) -> SolidBody:
        points = self._placed(soft.mesh.points, pose)
        points = points + self._touching(fine_triangles(soft.mesh.boundary, points), direction)
        placed = soft.with_faces(points, direction)
        region = placed.regions[0]
        mesh = self.mesh.joined(placed, prefix="object ")
        body = SolidBody(mesh, self.laws | {f"object {region}": soft.law}, held=self.spec.held, threads=threads, device=self.device,
                         carried={OBJECT: (0.5 * (points.min(axis=0) + points.max(axis=0)), ["object held"], "xyz")})
        body.add(self._pair(body, Surface.of(mesh.face("object pressed")), soft=soft))
        return body

    def _placed(self, points: np.ndarray, pose: Pose | None) -> np.ndarray:
        """An object's points (n, 3) in its pose, or with the middle of their bounding box at that of the contact's face."""
        if pose is not None:
            return pose.apply(points)
        face = self.mesh.points[self.mesh.face_nodes(self.spec.contact.face)]
        over, own = (0.5 * (ends.min(axis=0) + ends.max(axis=0)) for ends in (face, points))
        return points + (over - own)

    def _touching(self, triangles: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """The way (3,) in mm to where triangles (t, 3, 3) first touch the contact's face."""
        face = fine_triangles(self.mesh.face(self.spec.contact.face), self.mesh.points)
        way = way_to_touch(triangles, face, direction)
        if not np.isfinite(way):
            (x0, y0, z0), (x1, y1, z1) = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
            raise InputError(f"The object misses the face {self.spec.contact.face!r} of {self.spec.name}: it spans x {x0:.4g} to "
                             f"{x1:.4g}, y {y0:.4g} to {y1:.4g}, z {z0:.4g} to {z1:.4g} mm, and its way along ({direction[0]:.3g}, "
                             f"{direction[1]:.3g}, {direction[2]:.3g}) does not meet it; correct its pose or its motion.")
        return way * direction

    def _pair(self, body: SolidBody, other: Surface, *, rigid: bool = False, soft: SoftObject | None = None) -> ContactPair:
        """The contact's face against the object's surface; two soft surfaces are cut along each other."""
        face = Surface.of(self.mesh.face(self.spec.contact.face))
        size = face.size_mm(body.points) if soft is None else other.size_mm(body.points)
        moduli = [3 * law.mu0 for law in self.laws.values()] + ([3 * soft.law.mu0] if soft else [])
        friction = max(self.spec.contact.friction, soft.friction if soft else 0.0)
        return ContactPair(face, other, stiffness=_PENALTY * min(moduli) / size, reach_mm=_REACH * size, friction=friction,
                           segments=soft is not None, rigid=rigid)
