"""The undersides of objects in many poses: what `HeightField`, `Underside.nodes` and `Shell` give, in a thirtieth of the time.

What does not depend on the pose is prepared once for a mesh (`ObjectSurface`). In a pose each facet that faces down lowers the
heights of the nodes below it, which asks for no search; a compiled function does a pose at a time.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh

from softtact.compiled import compiled
from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.narrow_parts import SEEN, SPACING, margin
from softtact.contact.node_grid import NodeGrid
from softtact.contact.shell import Shell
from softtact.contact.underside import Underside
from softtact.errors import InputError
from softtact.geometry.meshes import check_given, check_over_sensor, default_pose, place
from softtact.geometry.pose import Pose

_LEVEL = 1e-9       # cosine below which a facet is a wall; a point's slack beside a facet, as in `HeightField`
_BESIDE = 1e-6      # of a step: by which a facet's box of nodes is enlarged for that slack


class ObjectSurface:
    """A rigid object, a closed mesh in mm in its own frame, prepared for any number of poses."""

    def __init__(self, mesh: trimesh.Trimesh) -> None:
        """Raises InputError for anything but a mesh, and for one that is empty, not finite or inside out."""
        if not isinstance(mesh, trimesh.Trimesh):
            raise InputError(f"ObjectSurface: {mesh!r} is no mesh; read one with softtact.read_mesh(path, unit='mm').")
        check_given(mesh)
        self.mesh = mesh
        self._points, self._facets = np.array(mesh.vertices, dtype=float), np.ascontiguousarray(mesh.faces, dtype=np.int64)
        ends = np.stack([self._facets, np.roll(self._facets, -1, axis=1)], axis=2).reshape(-1, 2)
        _, edge = np.unique(np.sort(ends, axis=1), axis=0, return_inverse=True)
        self._edges = edge.reshape(-1, 3).astype(np.int64)

    @cached_property
    def centred(self) -> Pose:
        """The pose of a press without a stated one."""
        return default_pose(self.mesh)

    def over(self, target: "Target", pose: Pose | None) -> "PosedUnderside":
        """Its underside in a pose, None for the centred one. Raises InputError where it misses the sensor."""
        points = (pose or self.centred).apply(self._points)
        heights, touch, shell = _underside(points, self._facets, self._edges, *target.arrays)
        if touch >= NO_CONTACT_MM:
            self._refuse(target, pose)
        stop = shell + target.shell.below_mm if shell < NO_CONTACT_MM else np.inf
        return PosedUnderside(heights, touch, stop, float(points[:, 2].max()) - touch)

    def _refuse(self, target, pose):
        """Raise what a press alone raises of an object that no point of the map is under."""
        placed = place(self.mesh, pose=pose)
        check_over_sensor(placed, target.footprint_mm)
        Underside(HeightField(placed), target.grid)
        raise InputError("The object misses every free point of the sensor's surface; move it over the sensor.")


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
                self.shell.boxes, SPACING * self.grid.step.min(), margin(self.grid), self.reach_mm)


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


def undersides(surfaces: Sequence[ObjectSurface], poses: Sequence[Pose | None],
               target: Target) -> list["PosedUnderside | InputError"]:
    """The underside of each object in its pose, or the error in its place."""
    found: list[PosedUnderside | InputError] = []
    for surface, pose in zip(surfaces, poses, strict=True):
        try:
            found.append(surface.over(target, pose))
        except InputError as error:
            found.append(error.with_traceback(None))
    return found


@compiled
def _underside(points, facets, edges, x, y, map_x, map_y, boxes, spacing, beside, reach):
    """Heights (n,) over the nodes of lines x, y with parts between nodes, first touch, and the lowest height over the shell."""
    facing, lowest = _facing_down(points, facets), np.full(len(y) * len(x), NO_CONTACT_MM)
    on_map = np.full(len(map_y) * len(map_x), NO_CONTACT_MM)
    _lower_to_facets(lowest, points, facets, facing, x, y)
    _lower_to_facets(on_map, points, facets, facing, map_x, map_y)
    touch, shell = on_map.min(), NO_CONTACT_MM
    for t in range(len(facets)):
        if facing[t]:
            for k in range(3):
                a = points[facets[t, k]]
                if map_x[0] <= a[0] <= map_x[-1] and map_y[0] <= a[1] <= map_y[-1]:
                    touch = min(touch, a[2])
            for b in range(len(boxes)):
                shell = min(shell, _lowest_in_box(points, facets[t], boxes[b]))
    below = min(touch, lowest.min()) + reach
    _lower_to_missed(lowest, points, facets, facing, edges, x, y, spacing, beside, below)
    for n in range(len(lowest)):
        if lowest[n] >= below:
            lowest[n] = NO_CONTACT_MM
    return lowest, touch, shell


@compiled(inline="always")
def _facing_down(points, facets):
    facing = np.zeros(len(facets), dtype=np.bool_)
    for t in range(len(facets)):
        a, b, c = points[facets[t, 0]], points[facets[t, 1]], points[facets[t, 2]]
        px, py, pz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        qx, qy, qz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
        facing[t] = nz < -_LEVEL * max(np.sqrt(nx * nx + ny * ny + nz * nz), 1e-300)
    return facing


@compiled
def _lower_to_facets(lowest, points, facets, facing, x, y):
    """Lower the heights over the nodes of evenly spaced lines x, y to the facets over them."""
    step_x, step_y = x[1] - x[0], y[1] - y[0]
    for t in range(len(facets)):
        if not facing[t]:
            continue
        a, b, c = points[facets[t, 0]], points[facets[t, 1]], points[facets[t, 2]]
        first_i = max(0, int(np.ceil((min(a[0], b[0], c[0]) - x[0]) / step_x - _BESIDE)))
        last_i = min(len(x) - 1, int(np.floor((max(a[0], b[0], c[0]) - x[0]) / step_x + _BESIDE)))
        first_j = max(0, int(np.ceil((min(a[1], b[1], c[1]) - y[0]) / step_y - _BESIDE)))
        last_j = min(len(y) - 1, int(np.floor((max(a[1], b[1], c[1]) - y[0]) / step_y + _BESIDE)))
        bx, by, cx, cy = b[0] - a[0], b[1] - a[1], c[0] - a[0], c[1] - a[1]
        double_area = bx * cy - by * cx
        for j in range(first_j, last_j + 1):
            for i in range(first_i, last_i + 1):
                px, py = x[i] - a[0], y[j] - a[1]
                u, v = (px * cy - py * cx) / double_area, (bx * py - by * px) / double_area
                if u >= -_LEVEL and v >= -_LEVEL and u + v <= 1 + _LEVEL:
                    lowest[j * len(x) + i] = min(lowest[j * len(x) + i], a[2] + u * (b[2] - a[2]) + v * (c[2] - a[2]))


@compiled
def _lower_to_missed(lowest, points, facets, facing, edges, x, y, spacing, beside, below):
    """Lower the heights over the nodes nearest to parts of the object that no node sees: `lowest_missed`, on the same points."""
    seen, done = lowest.copy(), np.zeros(edges.max() + 1, dtype=np.bool_)
    for t in range(len(facets)):
        if not facing[t] or min(points[facets[t, 0], 2], points[facets[t, 1], 2], points[facets[t, 2], 2]) >= below:
            continue
        for k in range(3):
            if not done[edges[t, k]]:
                done[edges[t, k]] = True
                a, b = points[facets[t, k]], points[facets[t, (k + 1) % 3]]
                parts = max(1, int(np.ceil(np.hypot(b[0] - a[0], b[1] - a[1]) / spacing)))
                for part in range(parts + 1):
                    _lower_to_point(lowest, seen, a, b, part / parts, x, y, beside, below)


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
def _lowest_in_box(points, facet, box):
    """Lowest height of a facet over a rectangle (low and high x, low and high y), cut off at its sides; else NO_CONTACT_MM."""
    corners, count = np.empty((8, 3)), 3
    for axis in range(2):
        low, high = NO_CONTACT_MM, -NO_CONTACT_MM
        for k in range(3):
            low, high = min(low, points[facet[k], axis]), max(high, points[facet[k], axis])
        if high < box[2 * axis] or low > box[2 * axis + 1]:
            return NO_CONTACT_MM
    for k in range(3):
        for axis in range(3):
            corners[k, axis] = points[facet[k], axis]
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
