"""Where an object stands: a translation and a rotation of its reference point in the sensor frame."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from softtact.errors import InputError

_FORM = "x,y,z,rx,ry,rz in mm and degrees"


@dataclass(frozen=True)
class Pose:
    """Pose of an object's reference point RP_O, the origin of its mesh: `p_sensor = rotation * p_mesh + translation`.

    translation_mm : (3,) in the sensor frame
    rotation : scipy `Rotation`
    """

    translation_mm: np.ndarray
    rotation: Rotation = field(default_factory=Rotation.identity)

    @classmethod
    def from_values(cls, values: Sequence[float | str]) -> "Pose":
        """Pose of six numbers: translation in mm; angles in degrees about the sensor's fixed x, then y, then z axis.

        That is scipy's `Rotation.from_euler("xyz", ...)`, and roll, pitch, yaw as robot descriptions have them.
        """
        try:
            numbers = np.array([float(value) for value in values])
        except (TypeError, ValueError):
            raise InputError(f"The pose {values!r} is not six numbers; write it as {_FORM}.") from None
        if numbers.shape != (6,) or not np.all(np.isfinite(numbers)):
            raise InputError(f"The pose {values!r} is not six finite numbers; write it as {_FORM}.")
        return cls(numbers[:3], Rotation.from_euler("xyz", numbers[3:], degrees=True))

    @classmethod
    def of(cls, value: "Pose | np.ndarray | Sequence[float] | None") -> "Pose | None":
        """The pose of a `Pose`, a 4 x 4 homogeneous matrix or six numbers (`from_values`); None stays None."""
        if value is None or isinstance(value, Pose):
            return value
        array = np.asarray(value, dtype=float)
        if array.shape != (4, 4):
            return cls.from_values(array.ravel().tolist())
        turn, last = array[:3, :3], array[3]
        if not (np.allclose(last, [0, 0, 0, 1]) and np.allclose(turn @ turn.T, np.eye(3), atol=1e-6) and np.linalg.det(turn) > 0):
            raise InputError(f"The pose {array.tolist()} is no rigid motion: its upper left 3 x 3 must be a rotation and its last "
                             "row 0, 0, 0, 1; correct it, and scale the mesh by its unit.")
        return cls(array[:3, 3], Rotation.from_matrix(turn))

    @classmethod
    def parse(cls, text: str) -> "Pose":
        """Pose of a command line's `x,y,z,rx,ry,rz`; see `from_values`."""
        return cls.from_values(text.split(","))

    def apply(self, points: np.ndarray) -> np.ndarray:
        """Points (n, 3) in mm of the mesh, in the sensor frame."""
        return self.rotation.apply(points) + self.translation_mm
