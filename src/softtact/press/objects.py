"""Pressed objects: soft objects, which deform like the sensor, rigid ones with their positions, and the parts of a sensor that an
object touches first."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.motion import FREEDOMS, Motion
from softtact.contact.node_grid import NodeGrid
from softtact.contact.shell import Shell
from softtact.contact.undersides import Target
from softtact.errors import InputError
from softtact.fem.solid_mesh import SolidMesh
from softtact.geometry.meshes import misses_sensor, place
from softtact.geometry.pose import Pose
from softtact.materials.laws.base import Law

if TYPE_CHECKING:
    from softtact.imaging.pinhole import Pinhole
    from softtact.press.sensor import Sensor

OBJECT = "object"  # the frame of the pressed object
_MIRROR = np.diag([1.0, 1.0, -1.0])
_VARIABLES = {"object_points_mm": ("points_mm", ("object_point", "axis"), "mm"),
              "object_triangles": ("triangles", ("object_triangle", "corner"), "1"),
              "object_way_mm": ("way_mm", ("step", "axis"), "mm")}
_OF_TURN = {"object_turn": ("turn", ("step", "axis", "axis_at_rest"), "1"), "object_about_mm": ("about_mm", ("axis",), "mm")}


@dataclass(frozen=True)
class SoftObject:
    """A soft object, which deforms like the sensor.

    mesh: in mm, of one region;  law: its hyperelastic law;  held_share: share of its height, from the top, that a rigid holder
    carries;  friction: Coulomb's coefficient against the sensing surface
    """

    mesh: SolidMesh
    """The body in mm, of one region; `softtact.mesh_body` makes one of a closed surface."""
    law: Law
    """Its law."""
    held_share: float = 0.3
    """Share of its height, from the top down, whose surface a rigid holder carries."""
    friction: float = 0.0
    """Coulomb's coefficient against the sensing surface."""

    def __post_init__(self) -> None:
        if not 0 < self.held_share < 1:
            raise InputError(
                f"SoftObject: held_share={self.held_share:g} leaves nothing to hold or nothing to press; give a share "
                "between 0 and 1."
            )
        if len(self.mesh.regions) != 1:
            raise InputError(f"SoftObject: its mesh has the regions {', '.join(self.mesh.regions)}; give a mesh of one region.")

    def placed(self, pose: Pose | None, height_mm: float, shell: Shell) -> SolidMesh:
        """The body in the frame of the solid sensor, whose surface is at `height_mm`, where it just touches pad or shell.

        pose: by default centred; its height does not count. Raises InputError where no node is over the pad.
        """
        points = self.mesh.points
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        points = points - [middle[0], middle[1], 0.0] if pose is None else pose.apply(points)
        over = (np.abs(points[:, :2]) <= 0.5 * np.asarray(shell.footprint_mm)).all(axis=1)
        if not over.any():
            raise misses_sensor(points, shell.footprint_mm, name="The soft object")
        lift = height_mm - points[over, 2].min()
        if (beside := shell.beneath(points)).any():
            lift = max(lift, height_mm - shell.below_mm - points[beside, 2].min())
        return self.with_faces(points + [0.0, 0.0, lift], np.array([0.0, 0.0, -1.0]))

    def with_faces(self, points: np.ndarray, direction: np.ndarray) -> SolidMesh:
        """The body with its nodes at points (n, 3) and two faces: `held`, its rear along a unit vector (3,), and `pressed`."""
        along = points @ direction
        end = along.min() + self.held_share * np.ptp(along)
        return self.mesh.moved(lambda _: points).with_faces(
            held=lambda x: x @ direction < end, pressed=lambda x: x @ direction >= end
        )


@dataclass(frozen=True)
class PlacedObject:
    """A rigid object in the sensor frame at each load step."""

    points_mm: np.ndarray
    """(n, 3) in mm: in its pose, before the press."""
    triangles: np.ndarray
    """(m, 3) numbers of points."""
    way_mm: np.ndarray
    """(step, 3) in mm: displacement along x, y, z from its pose of the point about which it turns."""
    turn: np.ndarray | None = None
    """(step, 3, 3): rotation from its pose; None where it does not turn."""
    about_mm: np.ndarray | None = None
    """(3,) in mm: the point about which it turns, in its pose."""

    @property
    def displacement_mm(self) -> np.ndarray:
        """(step, n, 3) of its points."""
        moved = np.broadcast_to(self.way_mm[:, None], (len(self.way_mm), *self.points_mm.shape))
        if self.turn is None:
            return moved
        return moved + np.einsum("sij,nj->sni", self.turn - np.eye(3), self.points_mm - self.about_mm)

    def depths_mm(self, pinhole: "Pinhole", *, deepest_mm: float) -> np.ndarray:
        """(step, row, column) in mm, single precision: depth below the surface at rest, z = 0, that a camera sees.

        deepest_mm: where it ends. A z-buffer, `softtact.imaging.depth_image`.
        """
        from softtact.imaging.depth_image import DepthCamera

        images = np.empty((len(self.way_mm), pinhole.rows, pinhole.columns), dtype=np.float32)
        for step, points in enumerate(self.points_mm + self.displacement_mm):
            mesh = trimesh.Trimesh(points, self.triangles, process=False)
            camera = DepthCamera(mesh, pinhole, deepest_mm=deepest_mm, reach_mm=0.0, first_touch_mm=0.0)
            images[step] = camera.image(0.0, np.zeros(2))
        return images

    def variables(self) -> dict[str, tuple[tuple[str, ...], np.ndarray, dict[str, str]]]:
        """Variables of an xarray dataset; `of` reads them back."""
        return {name: (dimensions, getattr(self, field), {"units": units})
                for name, (field, dimensions, units) in (_VARIABLES | (_OF_TURN if self.turn is not None else {})).items()}

    @classmethod
    def of(cls, dataset: Mapping[Any, Any]) -> "PlacedObject | None":
        """The object of a press' dataset; None where it was not kept."""
        if not all(name in dataset for name in _VARIABLES):
            return None
        return cls(**{field: np.asarray(dataset[name])
                      for name, (field, _, _) in (_VARIABLES | _OF_TURN).items() if name in dataset})


def placed_object(placed: trimesh.Trimesh, *, touch_mm: float, indentation_mm: np.ndarray, motion: Motion) -> PlacedObject:
    """The `PlacedObject` of a mesh in its pose, from depths (step,) below first touch and a motion along x, y and about z.

    touch_mm: descent from the pose to first touch
    """
    down = -(touch_mm + np.asarray(indentation_mm))
    angle = np.cumsum([step.ways.get("rz", 0.0) for step in motion.steps])[:len(down)]
    turn = Rotation.from_euler("z", angle[:, None], degrees=True).as_matrix() if angle.any() else None
    middle = None if turn is None else np.append(placed.bounds.mean(axis=0)[:2], 0.0)
    return PlacedObject(points_mm=np.asarray(placed.vertices, dtype=float), triangles=np.asarray(placed.faces, dtype=np.int64),
                        way_mm=np.column_stack([motion.aside_mm[:len(down)], down]), turn=turn, about_mm=middle)


# --- what an object touches, and where first ---


def shell_of(sensor: "Sensor") -> Shell:
    """The shell that a sensor's `edge` states."""
    edge = sensor.spec.edge
    return Shell(sensor.spec.footprint_mm, edge.held_below_mm, edge.shell_width_mm)


def target_of(sensor: "Sensor", grid: NodeGrid) -> Target:
    """What the elastic model finds undersides over, on the grid of its compliance."""
    spec = sensor.spec
    return Target(grid, spec.map_x_mm, spec.map_y_mm, spec.footprint_mm, shell_of(sensor), spec.deepest_mm)


def first_direction(motion: Motion) -> np.ndarray:
    """Unit vector (3,) along which a motion's first step loads the object or, without a force, moves it; else down."""
    for given in (motion.steps[0].loads, motion.steps[0].ways):
        along = np.array([given.get(name, 0.0) for name in FREEDOMS[:3]])
        if along.any():
            return np.asarray(along / np.linalg.norm(along))
    return np.array([0.0, 0.0, -1.0])


def distance_to_touch(approaching: np.ndarray, surface: np.ndarray, direction: np.ndarray) -> float:
    """Displacement (mm) along a unit vector (3,) until triangles (t, 3, 3) first touch those of a surface (u, 3, 3), all in mm.

    Facets are counter-clockwise from outside. It is negative where they overlap already, and inf where they miss each other.
    """
    turned = _turn_down(direction)
    approaching, surface = approaching @ turned.T, surface @ turned.T
    from_above = _gap(approaching, surface)
    from_below = _gap(surface[:, ::-1] @ _MIRROR, approaching[:, ::-1] @ _MIRROR)     # upside down, the surface approaches
    return min(from_above, from_below)


def _gap(above, surface):
    """Least height (mm) of the underside of triangles over the corners of others."""
    base = np.array([0.0, 0.0, above[..., 2].min()])
    field = HeightField(trimesh.Trimesh(*_corners(above - base), process=False))
    points = np.unique((surface - base).reshape(-1, 3), axis=0)
    height, _ = field(points[:, 0], points[:, 1])
    return float(np.min((height - points[:, 2])[height < NO_CONTACT_MM], initial=np.inf))


def _corners(triangles):
    return triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3)


def _turn_down(direction):
    """Rotation (3, 3) that takes a unit vector to -z."""
    down = -np.asarray(direction, dtype=float)
    aside = np.eye(3)[np.argmin(np.abs(down))]
    x = np.cross(aside, down)
    x /= np.linalg.norm(x)
    return np.array([x, np.cross(down, x), down])


@dataclass(frozen=True)
class Origin:
    """What a press by forces was of, for its gradient."""

    sensor: "Sensor"
    """Its sensor."""
    mesh: trimesh.Trimesh
    """The object as it was given, in mm."""
    pose: Pose
    """Its pose in the sensor frame."""
    mesh_hash: int
    """Of the mesh when it was pressed."""

    @property
    def underside(self) -> HeightField:
        """The object's underside in its pose; found again, as it takes more memory than a result."""
        return HeightField(place(self.mesh, pose=self.pose))
