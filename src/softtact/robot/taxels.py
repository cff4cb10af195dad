"""Readings of a sensor for a loop with a hundred calls per second: each place is pressed once, and its maps are cached.

A place is the object's x and y in the sensor's frame and its rotation about z, on a grid. At a new place the true mesh is pressed
with several forces at once; between two forces its maps are interpolated (`Ladder`).

Between places the map of the nearest one is moved and rotated with the object, and scaled to keep the volume by which the sensor
sinks. The effect of the sensor's edges does not move with the object. So along x, where a hand slides, the maps of both places
beside the object are interpolated. `benchmarks/environment.py` measures the error of the readings.

Readings do not depend on earlier calls. Tilt is left out: a held object's tilt follows from MuJoCo's contacts, not from the rubber.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import trimesh
from scipy.ndimage import affine_transform
from scipy.spatial.transform import Rotation

from softtact.contact.height_field import HeightField
from softtact.errors import InputError
from softtact.geometry.meshes import place
from softtact.geometry.pose import Pose
from softtact.linalg.workers import one_thread_each
from softtact.press.fast import thinning_maps
from softtact.press.ladder import Ladder, even_in_root
from softtact.press.sensor import Sensor
from softtact.readout.taxels import counts_of
from softtact.robot.events import FINGERS, set_down

# The mesh in each finger's frame: the right finger is behind it, and rotations about z change their sign.
_FACING = (Rotation.identity(), Rotation.from_euler("y", 180, degrees=True))
_SENSE = (1.0, -1.0)
_FORCES = 5              # of the ladder
STEP_MM = 2.0            # of the grid of places: as exact in the elastic model as 1 mm
_STEP_DEG = 2.0          # of the grid of rotations, which hardly change while a hand slides
_SURFACES = 8            # most cached undersides: some MB each for a fine mesh
_AT_PLACE = 0.02         # of a step along x: nearer to a place, its map is taken alone
_MOST = 2.0              # largest factor of a moved map; beyond it the object is hardly over the sensor


@dataclass
class TaxelMemory:
    """Counts of both sensors under one object.

    model: elastic or foundation;  largest_force_n: limit of the forces
    step_mm: of the grid of places along x and y
    """

    sensor: Sensor
    mesh: trimesh.Trimesh
    model: str
    largest_force_n: float
    step_mm: float = STEP_MM
    _ladders: dict = field(default_factory=dict)
    _surfaces: dict = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.sensor.spec.need_taxels("the environment")
        side = min(self.sensor.spec.footprint_mm)
        if not 0 < self.step_mm < side:
            raise InputError(f"place_step_mm={self.step_mm:g}: give a length in mm above 0 and below the sensor's shorter side, "
                             f"{side:g}.")
        self.forces_n = even_in_root(self.sensor.checked_forces(self.largest_force_n)[0], _FORCES)
        self._step = np.array([self.step_mm, self.step_mm, _STEP_DEG])
        spec = self.sensor.spec
        self._first_mm = np.array([spec.map_y_mm[0], spec.map_x_mm[0]])     # as maps are indexed: y, x
        self._pitch_mm = np.array([np.ptp(line) / (len(line) - 1) for line in (spec.map_y_mm, spec.map_x_mm)])

    @property
    def at_rest(self) -> dict[str, np.ndarray]:
        """{tactile: (finger, row, column)} of free sensors."""
        taxels = self.sensor.spec.need_taxels("the environment")
        return {"tactile": np.zeros((len(FINGERS), taxels.rows, taxels.columns), dtype=np.uint16)}

    def begin(self) -> None:
        """An episode begins: what was pressed is kept."""

    def observe(self, poses: np.ndarray, forces: np.ndarray) -> dict[str, np.ndarray]:
        """{tactile: (finger, row, column)} of both sensors under an object at poses (finger, 7) with forces (finger, 3) in N."""
        counts = [self.counts(finger, poses[finger], -forces[finger, 2]) for finger in range(len(FINGERS))]
        return {"tactile": np.round(counts).astype(np.uint16)}

    def facts(self) -> dict[str, Any]:
        """What an environment tells beside the readings."""
        return {"places_pressed": self.places}

    @property
    def places(self) -> int:
        """Number of places that were pressed."""
        return len(self._ladders)

    def counts(self, finger: int, pose: np.ndarray, force_n: float) -> np.ndarray:
        """(row, column) of a finger, 0 left or 1 right, under an object at a pose (7,) and a normal force (N) up to the largest."""
        if force_n <= 0:
            return counts_of(self.sensor.spec, np.zeros(self.sensor.spec.map_shape))
        at = self._place(finger, pose)
        carried: Any = 0.0
        for number, share in self._beside(at):
            ladder = self._ladder(finger, number)
            pressed = np.tensordot(ladder.weights(np.array([force_n]))[0], ladder.maps_mm, 1)
            carried = carried + share * self._carried(pressed, number * self._step, at, _SENSE[finger])
        return counts_of(self.sensor.spec, carried)

    @staticmethod
    def _place(finger, pose):
        """x, y in mm and the rotation about z in degrees (3,) of a pose; the tilt is left out."""
        seen = (_FACING[finger].inv() * Rotation.from_quat(pose[3:], scalar_first=True)).as_quat()
        return np.array([*pose[:2], np.degrees(2 * np.arctan2(seen[2], seen[3]))])

    def _beside(self, at):
        """Numbers (3,) of the places on both sides along x, with their weights; one place where it is near."""
        steps = at / self._step
        nearest = np.round(steps).astype(int)
        beyond = steps[0] - nearest[0]
        if abs(beyond) < _AT_PLACE:
            return [(nearest, 1.0)]
        return [(nearest, 1 - abs(beyond)), (nearest + [np.sign(beyond).astype(int), 0, 0], abs(beyond))]

    def _ladder(self, finger, number):
        """The `Ladder` of a place by its numbers (3,), pressed at its first use."""
        key = finger, *(int(one) for one in number[:2]), int(number[2]) % round(360 / _STEP_DEG)
        if key not in self._ladders:
            self._ladders[key] = self._pressed(*key)
        return self._ladders[key]

    def _pressed(self, finger, x, y, turn):
        surface = self._surface(finger, turn).moved(np.array([x, y, 0]) * self.step_mm)
        self.sensor.prepared(self.model)
        try:
            with one_thread_each():
                maps = thinning_maps(self.sensor, surface, self.forces_n, model=self.model)
        except InputError:     # the object is beside this sensor
            maps = np.zeros((_FORCES, *self.sensor.spec.map_shape))
        return Ladder(self.forces_n, maps.astype(np.float32))

    def _surface(self, finger, turn):
        """The underside of the object in the sensor's middle; those of the last few rotations are kept."""
        if (finger, turn) not in self._surfaces:
            if len(self._surfaces) == _SURFACES:
                self._surfaces.pop(next(iter(self._surfaces)))
            pose = Pose(np.zeros(3), _FACING[finger] * Rotation.from_euler("z", turn * _STEP_DEG, degrees=True))
            self._surfaces[finger, turn] = HeightField(place(self.mesh, pose=set_down(self.mesh, pose)))
        return self._surfaces[finger, turn]

    def _carried(self, pressed, here, there, sense):
        """A map (y, x) of an object in one place (x, y, rotation), moved to another one nearby."""
        angle = sense * np.radians(here[2] - there[2])
        back = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])     # of y, x, from there to here
        offset = back @ (self._first_mm - there[1::-1]) + here[1::-1] - self._first_mm
        carried = affine_transform(pressed, back * self._pitch_mm / self._pitch_mm[:, None], offset / self._pitch_mm, order=1,
                                   mode="nearest")
        sunk, now = np.maximum(pressed, 0.0).sum(), np.maximum(carried, 0.0).sum()
        return carried * min(sunk / now, _MOST) if now > 0 else carried
