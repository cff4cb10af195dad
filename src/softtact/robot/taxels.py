"""Readings of a sensor for a loop that asks a hundred times a second: pressed once for a place, then taken from memory.

A place is the object's x and y in the sensor's frame and its turn about z, rounded to a grid. At a new place the true mesh is
pressed through a ladder of forces, all at once. Between two forces the counts are interpolated linearly, as the virtual sensor
does it.
Tilt is left out: how far a held object tilts in the scene follows from MuJoCo's contacts, not from the rubber.
"""

from dataclasses import dataclass, field

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from softtact.errors import InputError
from softtact.geometry.pose import Pose
from softtact.press.sensor import Sensor
from softtact.robot.events import set_down

# The mesh as each finger sees it: the right one from behind.
_FACING = (Rotation.identity(), Rotation.from_euler("y", 180, degrees=True))
_LADDER = (0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.75, 1.0)     # of the largest force; a contact grows fastest at first


@dataclass
class TaxelMemory:
    """Counts of both sensors under one object.

    largest_force_n: up to which forces are asked for;  step_mm, step_deg: of the grid of places
    """

    sensor: Sensor
    mesh: trimesh.Trimesh
    model: str
    largest_force_n: float
    step_mm: float = 0.2
    step_deg: float = 1.0
    _kept: dict = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.forces_n = self.sensor.checked_forces(self.largest_force_n) * np.array(_LADDER)

    @property
    def places(self) -> int:
        """How many places were pressed."""
        return len(self._kept)

    def counts(self, finger: int, pose: np.ndarray, force_n: float) -> np.ndarray:
        """(row, column) of a finger, 0 left or 1 right, under an object at a pose (7,) and a normal force (N) up to the largest."""
        if force_n <= 0:
            return np.zeros((self.sensor.spec.taxels.rows, self.sensor.spec.taxels.columns))
        steps = self._at(finger, pose)
        place = np.searchsorted(self.forces_n, min(force_n, self.largest_force_n))
        low = self.forces_n[place - 1] if place else 0.0
        share = (min(force_n, self.largest_force_n) - low) / (self.forces_n[place] - low)
        return (1 - share) * (steps[place - 1] if place else 0.0) + share * steps[place]

    def _at(self, finger, pose):
        """Counts (force, row, column) at the place of the grid nearest to a pose."""
        seen = _FACING[finger].inv() * Rotation.from_quat(pose[3:], scalar_first=True)
        turn = np.degrees(2 * np.arctan2(seen.as_quat()[2], seen.as_quat()[3]))      # about z: the swing, a tilt, is left out
        x, y = (round(float(value) / self.step_mm) for value in pose[:2])
        key = finger, x, y, round(float(turn) / self.step_deg) % round(360 / self.step_deg)
        if key not in self._kept:
            self._kept[key] = self._pressed(*key)
        return self._kept[key]

    def _pressed(self, finger, x, y, turn):
        rotation = _FACING[finger] * Rotation.from_euler("z", turn * self.step_deg, degrees=True)
        pose = set_down(self.mesh, Pose(np.array([x * self.step_mm, y * self.step_mm, 0.0]), rotation))
        try:
            return self.sensor.press(self.mesh, pose=pose, force_n=self.forces_n, model=self.model, threads=1, label="").tactile_map
        except InputError:     # the object is beside this sensor
            return np.zeros((len(self.forces_n), self.sensor.spec.taxels.rows, self.sensor.spec.taxels.columns))
