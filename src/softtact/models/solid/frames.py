"""Rigid frames: what carries an object, or the held side of a soft one, through its six freedoms."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from softtact.contact.motion import FREEDOMS
from softtact.fem.solid_mesh import SolidMesh


@dataclass(frozen=True)
class Frame:
    """A rigid frame and the nodes that it carries.

    name: by which steps drive it;  point (3,): its reference point at rest in mm, about which it turns;  nodes (k,): what it
    carries
    axes: along which it carries them: with "z" alone they slide on a smooth plate
    """

    name: str
    point: np.ndarray
    nodes: np.ndarray
    axes: str = "xyz"

    @property
    def carried(self) -> Any:
        """Index of the carried components in an array (n, 3)."""
        return np.ix_(self.nodes, np.array(["xyz".index(axis) for axis in self.axes]))


@dataclass(frozen=True)
class FramePose:
    """Where a frame is."""

    translation: np.ndarray = field(default_factory=lambda: np.zeros(3))
    """(3,) in mm, of its reference point."""
    rotation: np.ndarray = field(default_factory=lambda: np.eye(3))
    """(3, 3), from rest."""

    def moved(self, step: np.ndarray) -> "FramePose":
        """The pose after a step (6,): a translation in mm and a rotation vector in radians, both in the fixed frame."""
        return FramePose(self.translation + step[:3], Rotation.from_rotvec(step[3:]).as_matrix() @ self.rotation)

    def step_from(self, before: "FramePose") -> np.ndarray:
        """The step (6,) in mm and radians by which `before.moved` leads here; a turn is less than half of a full one."""
        turn = Rotation.from_matrix(self.rotation @ before.rotation.T).as_rotvec()
        return np.concatenate([self.translation - before.translation, turn])

    def displacement(self, frame: Frame, points: np.ndarray) -> np.ndarray:
        """Displacements (k, 3) in mm of the frame's nodes, all nodes at rest at points (n, 3)."""
        arm = points[frame.nodes] - frame.point
        return self.translation + arm @ (self.rotation - np.eye(3)).T

    def loads(self, frame: Frame, points: np.ndarray, force: np.ndarray) -> np.ndarray:
        """Force (N) and torque (N mm) about the reference point (6,) of nodal forces (n, 3) on the frame's nodes."""
        carried = force[frame.nodes] * [axis in frame.axes for axis in "xyz"]
        arm = (points[frame.nodes] - frame.point) @ self.rotation.T
        return np.concatenate([carried.sum(axis=0), np.cross(arm, carried).sum(axis=0)])


def step_vector(prescribed: dict[str, float]) -> np.ndarray:
    """Prescribed freedoms of a step {freedom: mm or degrees} as (6,): mm and radians."""
    out = np.array([prescribed.get(name, 0.0) for name in FREEDOMS])
    out[3:] = np.radians(out[3:])
    return out


def make_frames(mesh: SolidMesh, carried: Mapping[str, tuple], rigid: Mapping[str, tuple]
                ) -> tuple[np.ndarray, list[Frame], dict[str, np.ndarray]]:
    """All nodes (n, 3) in mm, the frames, and the facets (t, 3) of each rigid object; arguments as `SolidBody` takes them."""
    points, frames, surfaces = [mesh.points], [], {}
    for name, (point, faces, *axes) in carried.items():
        nodes = np.unique(np.concatenate([mesh.face_nodes(face) for face in faces]))
        frames.append(Frame(name, np.asarray(point, float), nodes, *axes))
    start = len(mesh.points)
    for name, (point, triangles) in rigid.items():
        corners, inverse = np.unique(np.asarray(triangles, float).reshape(-1, 3), axis=0, return_inverse=True)
        surfaces[name] = start + inverse.reshape(-1, 3)
        frames.append(Frame(name, np.asarray(point, float), np.arange(start, start + len(corners))))
        points.append(corners)
        start += len(corners)
    return np.ascontiguousarray(np.vstack(points)), frames, surfaces
