"""The undersides of objects in many poses: what `HeightField`, `Underside.nodes` and `Shell` give, by one compiled function.

A mesh is checked once (`ObjectSurface`), and no mesh is placed in a pose.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh

from softtact.compiled import compiled
from softtact.contact.height_field import HeightField
from softtact.contact.lower_envelope import (
    NO_CONTACT_MM,
    facing_down,
    lowest_between,
    lowest_corner,
    lowest_in_box,
    lowest_over_lines,
)
from softtact.contact.narrow_parts import margin
from softtact.contact.node_grid import NodeGrid
from softtact.contact.shell import Shell
from softtact.contact.underside import MISSES
from softtact.errors import InputError, MissError
from softtact.geometry.meshes import check_given, check_over_sensor, default_pose, place
from softtact.geometry.pose import Pose


class ObjectSurface:
    """A rigid object, a closed mesh in mm in its own frame, prepared for any number of poses."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        """Raises InputError for anything but a mesh, and for one that is empty, not finite or inside out."""
        if not isinstance(mesh, trimesh.Trimesh):
            raise InputError(f"ObjectSurface: {mesh!r} is no mesh; read one with softtact.read_mesh(path, unit='mm').")
        check_given(mesh)
        self.mesh = mesh.copy()      # a later change of the caller's is not this surface's
        self._points = np.array(self.mesh.vertices, dtype=float)
        self._facets = np.ascontiguousarray(self.mesh.faces, dtype=np.int64)

    @cached_property
    def centred(self) -> Pose:
        """The pose of a press without a stated one."""
        return default_pose(self.mesh)

    def over(self, target: "Target", pose: Pose | None) -> "PosedUnderside":
        """Its underside in a pose, None for the centred one. Raises MissError where it misses the sensor."""
        points = (pose or self.centred).apply(self._points)
        try:
            return underside_of(facing_down(points, self._facets)[0], target, top_mm=float(points[:, 2].max()))
        except MissError:
            check_over_sensor(place(self.mesh, pose=pose), target.footprint_mm)      # says where it is
            raise

    def height_field(self, pose: Pose | None) -> HeightField:
        """Its underside in a pose, None for the centred one, with its facets."""
        return HeightField(trimesh.Trimesh((pose or self.centred).apply(self._points), self._facets, process=False))


@dataclass(frozen=True)
class Target:
    """What undersides are found over: the nodes of a sensor's surface, the points of its map, and its shell."""

    grid: NodeGrid
    x_mm: np.ndarray
    """(nx,): columns of the map, on which first touch is found."""
    y_mm: np.ndarray
    """(ny,): its rows."""
    footprint_mm: tuple[float, float]
    """Sides of the sensor along x and y."""
    shell: Shell
    reach_mm: float
    """Height over first touch beyond which the object cannot touch."""

    @cached_property
    def arrays(self) -> tuple:
        """The target as the compiled function takes it."""
        return (self.grid.x, self.grid.y, np.asarray(self.x_mm, dtype=float), np.asarray(self.y_mm, dtype=float),
                self.shell.boxes, margin(self.grid), self.reach_mm)


@dataclass(frozen=True)
class PosedUnderside:
    """An object's underside in one pose."""

    height_mm: np.ndarray
    """(n,): over the grid's nodes; NO_CONTACT_MM where there is none within reach."""
    touch_mm: float
    """Descent to first touch."""
    stop_mm: float
    """Descent until it rests on the shell; infinite where it never does."""
    top_mm: float
    """Height of its top over first touch."""


def underside_of(triangles: np.ndarray, target: Target, *, top_mm: float = np.nan) -> PosedUnderside:
    """The underside of an object by its triangles that face down, (t, 3, 3) in mm in its pose; top_mm: height of its top.

    Raises MissError where it misses all free points of the sensor's surface.
    """
    heights, touch, shell = _underside(triangles, *target.arrays)
    if max(touch, heights.min()) >= NO_CONTACT_MM:
        raise MissError(MISSES)
    stop = shell + target.shell.below_mm if shell < NO_CONTACT_MM else np.inf
    return PosedUnderside(heights, touch, stop, top_mm - touch)


@compiled
def _underside(triangles, x, y, map_x, map_y, boxes, beside, reach):
    """Heights (n,) over the nodes of lines x, y with parts between nodes, first touch, and the lowest height over the shell."""
    lowest, _ = lowest_over_lines(triangles, x, y)
    touch = min(lowest_corner(triangles, map_x, map_y), lowest_over_lines(triangles, map_x, map_y)[0].min())
    shell = NO_CONTACT_MM
    for b in range(len(boxes)):
        shell = min(shell, lowest_in_box(triangles, boxes[b]))
    below = min(touch, lowest.min()) + reach
    missed = lowest_between(triangles, lowest, x, y, beside, below)
    for n in range(len(lowest)):
        lowest[n] = min(lowest[n], missed[n])
        if lowest[n] >= below:
            lowest[n] = NO_CONTACT_MM
    return lowest, touch, shell
