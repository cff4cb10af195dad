"""Pose of an object in the sensor frame: translation and rotation of its reference point, stated or drawn with a seed.

A drawn pose turns the object about z by any angle at which its pressing part fits on the sensor as well as without the turn, and
puts it anywhere in the remaining space. It does not tilt the object.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from softtact.errors import InputError

_FORM = "x,y,z,rx,ry,rz in mm and degrees"
PRESSING_MM = 1.0    # height above the lowest point of the part that carries the force
RIM_MM = 1.0         # strip along the sensor's border, where the layers' sides are held, without pressing parts
_LEAST_TURN_DEG = 1.0


@dataclass(frozen=True)
class Pose:
    """Pose of an object's reference point RP_O, the origin of its mesh: `p_sensor = rotation * p_mesh + translation`.

    translation_mm : (3,) in the sensor frame
    rotation : scipy `Rotation`
    angles_deg : (3,) rx, ry, rz, where the pose was given by them: other angles have the same rotation, but other rates
    """

    translation_mm: np.ndarray
    rotation: Rotation = field(default_factory=Rotation.identity)
    angles_deg: np.ndarray | None = None

    @classmethod
    def from_values(cls, values: Sequence[float | str]) -> "Pose":
        """Pose of six numbers: translation in mm; angles in degrees about the sensor's fixed x, then y, then z axis.

        That is scipy's `Rotation.from_euler("xyz", ...)`, and roll, pitch, yaw of robot descriptions.
        """
        try:
            numbers = np.array([float(value) for value in values])
        except (TypeError, ValueError):
            raise InputError(f"The pose {values!r} is not six numbers; write it as {_FORM}.") from None
        if numbers.shape != (6,) or not np.all(np.isfinite(numbers)):
            raise InputError(f"The pose {values!r} is not six finite numbers; write it as {_FORM}.")
        return cls(numbers[:3], Rotation.from_euler("xyz", numbers[3:], degrees=True), numbers[3:])

    @classmethod
    def of(cls, value: "Pose | np.ndarray | Sequence[float] | None") -> "Pose | None":
        """The pose of a `Pose`, a 4 x 4 homogeneous matrix or six numbers (`from_values`); None stays None."""
        if value is None or isinstance(value, Pose):
            return value
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError):     # texts, or rows of different lengths
            raise InputError(f"The pose {value!r} is not six numbers; write it as {_FORM}.") from None
        if array.shape != (4, 4):
            return cls.from_values(array.ravel().tolist())
        turn, last = array[:3, :3], array[3]
        rigid = np.allclose(turn @ turn.T, np.eye(3), atol=1e-6) and np.linalg.det(turn) > 0
        if not (np.isfinite(array).all() and np.allclose(last, [0, 0, 0, 1]) and rigid):
            raise InputError(f"The pose {array.tolist()} is no rigid motion: its upper left 3 x 3 must be a rotation, its last row "
                             "0, 0, 0, 1 and all numbers finite; correct it, and scale the mesh by its unit.")
        return cls(array[:3, 3], Rotation.from_matrix(turn))

    @classmethod
    def parse(cls, text: str) -> "Pose":
        """Pose of a command line's `x,y,z,rx,ry,rz`; see `from_values`."""
        return cls.from_values(text.split(","))

    def apply(self, points: np.ndarray) -> np.ndarray:
        """Points (n, 3) in mm of the mesh, in the sensor frame."""
        return self.rotation.apply(points) + self.translation_mm

    def rates(self, points: np.ndarray) -> np.ndarray:
        """Velocities (6, n, 3) of an object's points (n, 3) in mm, in the sensor frame, by the pose's six numbers (`from_values`).

        In mm per mm by x, y, z, and in mm per degree by rx, ry, rz. Where ry is 90 degrees, rx and rz turn about the same axis.
        A pose without angles has those with ry from -90 to 90 degrees, and there rz = 0.
        """
        with warnings.catch_warnings(action="ignore", category=UserWarning):      # of that angle
            _, ry, rz = self.rotation.as_euler("xyz") if self.angles_deg is None else np.radians(self.angles_deg)
        last, middle = Rotation.from_euler("z", rz), Rotation.from_euler("y", ry)
        axes = np.stack([(last * middle).apply([1.0, 0.0, 0.0]), last.apply([0.0, 1.0, 0.0]), [0.0, 0.0, 1.0]])
        turned = np.radians(np.cross(axes[:, None], points - self.translation_mm))
        return np.concatenate([np.broadcast_to(np.eye(3)[:, None], turned.shape), turned])


def draw_poses(triangles: np.ndarray, *, count: int, footprint_mm: tuple[float, float],
               seed: Sequence[int]) -> list[list[float]]:
    """`count` poses, each [x, y, z in mm, rx, ry, rz in degrees] of the object's origin, of facets (n, 3, 3) in mm.

    seed: a list of whole numbers; the k-th pose depends on it and k only
    """
    points = triangles.reshape(-1, 3)
    lowest = points[:, 2].min()
    pressing = np.unique(points[points[:, 2] < lowest + PRESSING_MM, :2], axis=0)
    return [_draw_pose(pressing, lowest, np.asarray(footprint_mm, float), np.random.default_rng([*seed, k])) for k in range(count)]


def _draw_pose(pressing, lowest, footprint, rng):
    turn, along = rng.uniform(-180, 180), rng.uniform(-1, 1, 2)
    needed = np.minimum(_room(pressing, 0.0, footprint)[0], 0.0)      # negative for a part wider than the sensor
    room, middle = _room(pressing, turn, footprint)
    while (room < needed).any():
        turn = rng.uniform(-abs(turn), abs(turn)) if abs(turn) > _LEAST_TURN_DEG else 0.0     # a smaller angle, until it fits
        room, middle = _room(pressing, turn, footprint)
    x, y = np.round(along * np.maximum(room, 0.0) - middle, 2)
    pose = [x, y, -lowest, 0.0, 0.0, np.round(turn, 1)]
    return [float(value) + 0.0 for value in pose]     # no negative zeros


def _room(points, turn_deg, footprint):
    """Largest displacement (2,) of the turned points (n, 2) to either side, in mm, and the middle (2,) of their bounding box."""
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    turned = points @ np.array([[c, s], [-s, c]])
    low, high = turned.min(axis=0), turned.max(axis=0)
    return 0.5 * (footprint - (high - low)) - RIM_MM, 0.5 * (low + high)
