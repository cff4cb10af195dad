"""Readings of a sensor for a loop with a hundred calls per second: each place is pressed once, and its maps are cached.

A place is the object's x and y in the sensor's frame and its rotation about z, on a grid. At a new place the true mesh is pressed
with several forces at once; between two forces its maps are interpolated (`Ladder`).

Between places the map of the nearest one is moved and rotated with the object, and scaled to keep the volume by which the sensor
sinks. The effect of the sensor's edges does not move with the object. So along x, where a hand slides, the maps of both places
beside the object are interpolated. `benchmarks/environment.py` measures the error of the readings.

Readings do not depend on earlier calls. Above the largest force they stay as at it (`above_largest`). Tilt is left out: a held
object's tilt follows from MuJoCo's contacts, not from the rubber.
"""

import warnings
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from softtact.compiled import compiled
from softtact.contact.height_field import HeightField
from softtact.contact.undersides import ObjectSurface
from softtact.errors import InputError, MissError, SofttactError
from softtact.geometry.meshes import place
from softtact.geometry.pose import Pose
from softtact.linalg.workers import Workers, one_thread_each
from softtact.press.batch import batch_device, press_together
from softtact.press.choice import ELASTIC_RELATIVE, rms, with_expected_error
from softtact.press.fast import press_underside, thinning_maps
from softtact.press.ladder import Ladder, even_in_root
from softtact.press.sensor import Sensor
from softtact.press.task import cores
from softtact.readout.taxels import counts_of, need_whole_counts, whole_counts
from softtact.robot.events import FINGERS, set_down

# The mesh in each finger's frame: the right finger is behind it, and rotations about z change their sign.
_FACING = (Rotation.identity(), Rotation.from_euler("y", 180, degrees=True))
_SENSE = (1.0, -1.0)
_FORCES = 5              # of the ladder
STEP_MM = 2.0            # of the grid of places: as exact in the elastic model as 1 mm
_STEP_DEG = 2.0          # of the grid of rotations, which hardly change while a hand slides
_AT_PLACE = 0.02         # of a step along x: nearer to a place, its map is taken alone
_MOST = 2.0              # largest factor of a moved map; beyond it the object is hardly over the sensor


@dataclass(frozen=True)
class _Place(Ladder):
    """The ladder of a place, with the expected errors (l,) of its maps over their root mean squares."""

    relative_error: np.ndarray


@dataclass
class TaxelMemory:
    """Counts of both sensors under one object. Places are those of its middle, wherever the mesh has its origin.

    model: elastic or foundation;  largest_force_n: limit of the forces
    step_mm: of the grid of places along x and y;  device: cpu, cuda or auto: a GPU where there is one, for the elastic model
    surfaces: number of undersides that are kept, some MB each for a fine mesh
    """

    sensor: Sensor
    mesh: trimesh.Trimesh
    model: str
    largest_force_n: float
    step_mm: float = STEP_MM
    device: str = "cpu"
    surfaces: int = 8
    _warned: bool = False
    _ladders: dict = field(default_factory=dict)
    _surfaces: dict = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.sensor.spec.need_taxels("the environment")
        need_whole_counts(self.sensor.spec, "the environment")
        self.device = batch_device(self.sensor, self.model, self.device)
        self._middle = self.mesh.bounds.mean(axis=0)
        self.mesh = place(self.mesh, pose=Pose(-self._middle))
        side = min(self.sensor.spec.footprint_mm)
        if not 0 < self.step_mm < side:
            raise InputError(f"place_step_mm={self.step_mm:g}: give a length in mm above 0 and below the sensor's shorter side, "
                             f"{side:g}.")
        self.forces_n = even_in_root(self.sensor.checked_forces(self.largest_force_n)[0], _FORCES)
        self._blank = Ladder(self.forces_n, np.empty(0))
        self._errors_mm, self._above_n = np.zeros((2, len(FINGERS)))
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
        seen, errors = self.observe_many(poses[None], forces[None])
        self._errors_mm, self._above_n = errors[0], self.above_largest(forces)
        return {name: values[0] for name, values in seen.items()}

    def observe_many(self, poses: np.ndarray, forces: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """{tactile: (n, finger, row, column)} and expected errors of the maps (n, finger) in mm of n pairs of sensors at once.

        poses (n, finger, 7), forces (n, finger, 3): as of `observe`, whose readings are the same
        """
        count, fingers = forces.shape[:2]
        counts, errors = self._read(np.tile(np.arange(fingers), count), poses.reshape(-1, 7), -forces[..., 2].ravel())
        shape = count, fingers
        return {"tactile": whole_counts(counts).reshape(*shape, *counts.shape[1:])}, errors.reshape(shape)

    def facts(self) -> dict[str, Any]:
        """What an environment tells beside the readings: the number of places, expected errors (finger,) of the last maps in mm, by
        how much (finger,) in N the forces are above the largest.
        """
        return {"places_pressed": self.places, "expected_error_mm": self._errors_mm, "force_above_largest_n": self._above_n}

    def above_largest(self, forces: np.ndarray) -> np.ndarray:
        """By how much (...) in N forces (..., 3) press harder than the largest one, whose map is then the reading; 0 where none."""
        return np.maximum(-forces[..., 2] - self.largest_force_n, 0.0)

    @property
    def places(self) -> int:
        """Number of places that were pressed."""
        return len(self._ladders)

    def counts(self, finger: int, pose: np.ndarray, force_n: float) -> np.ndarray:
        """(row, column) of a finger, 0 left or 1 right, under an object at a pose (7,) and a normal force (N) up to the largest."""
        return self._read(np.array([finger]), pose[None], np.array([force_n]))[0][0]

    def _read(self, fingers, poses, forces):
        """Counts (k, row, column) and expected errors (k,) in mm of fingers (k,) under objects at poses (k, 7) with forces (k,)."""
        at, weights = self._places(fingers, poses), self._blank.weights(np.maximum(forces, 0.0))
        parts = [(row, number, share) for row in np.flatnonzero(forces > 0) for number, share in self._beside(at[row])]
        keys = [_key(fingers[row], number) for row, number, _ in parts]
        self._press({*keys} - {*self._ladders})
        carried, relative = np.zeros((len(forces), *self.sensor.spec.map_shape)), np.zeros(len(forces))
        levels = np.minimum(np.searchsorted(self.forces_n, forces), _FORCES - 1)
        for key, (row, number, share) in zip(keys, parts, strict=True):
            ladder = self._ladders[key]
            back, offset = self._carrying(number * self._step, at[row], _SENSE[fingers[row]])
            _add_carried(ladder.maps_mm, weights[row], back, offset, share, carried[row])
            relative[row] = max(relative[row], ladder.relative_error[levels[row]])
        return counts_of(self.sensor.spec, carried), relative * rms(carried)

    def _places(self, fingers, poses):
        """x, y in mm of the middle and the rotation about z in degrees (k, 3) of poses (k, 7); the tilt is left out."""
        facing = Rotation.concatenate([_FACING[finger].inv() for finger in fingers])
        turn = Rotation.from_quat(poses[:, 3:], scalar_first=True)
        seen, middle = (facing * turn).as_quat(), poses[:, :3] + turn.apply(self._middle)
        return np.column_stack([middle[:, :2], np.degrees(2 * np.arctan2(seen[:, 2], seen[:, 3]))])

    def _beside(self, at):
        """Numbers (3,) of the places on both sides along x, with their weights; one place where it is near."""
        steps = at / self._step
        nearest = np.round(steps).astype(int)
        beyond = steps[0] - nearest[0]
        if abs(beyond) < _AT_PLACE:
            return [(nearest, 1.0)]
        return [(nearest, 1 - abs(beyond)), (nearest + [np.sign(beyond).astype(int), 0, 0], abs(beyond))]

    def _press(self, keys):
        """Press places by their keys: on a processor as many at a time as there are cores, on a GPU all together."""
        if not keys:
            return
        self.sensor.prepared(self.model)
        if self.device != "cpu":
            return self._press_together(sorted(keys))
        surfaces = {key: self._surface(key[0], key[3]).moved(np.array([key[1], key[2], 0]) * self.step_mm) for key in sorted(keys)}
        workers = Workers(min(len(surfaces), cores()))
        with one_thread_each(), warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always")
            found = workers.map(self._pressed, surfaces.values())
        workers.close()
        if heard and not self._warned:     # one sentence an object: others say the same of other places
            self._warned = True
            warnings.warn(heard[0].message, stacklevel=2)
        self._ladders.update(zip(surfaces, found, strict=True))

    def _press_together(self, keys):
        """Press places in one batch, with which a processor would take twice as long."""
        poses = [Pose(np.array([x, y, 0.0]) * self.step_mm, self._turned(finger, turn)) for finger, x, y, turn in keys]
        results = press_together(self.sensor, [ObjectSurface(self.mesh)] * len(keys), poses, self.forces_n, device=self.device)
        for key, result in zip(keys, results, strict=True):
            beside = isinstance(result, MissError)
            if isinstance(result, SofttactError) and not beside:
                raise result
            maps = np.zeros((_FORCES, *self.sensor.spec.map_shape)) if beside else result.thinning_map_mm
            self._ladders[key] = self._place(maps, np.full(_FORCES, 0.0 if beside else ELASTIC_RELATIVE))

    def _pressed(self, surface):
        """The ladder of an underside in its place."""
        try:
            if self.model == "elastic":
                maps = thinning_maps(self.sensor, surface, self.forces_n, model=self.model)
                relative = np.full(_FORCES, ELASTIC_RELATIVE)
            else:
                result = with_expected_error(self.sensor, press_underside(self.sensor, surface, self.forces_n, model=self.model))
                maps = result.deformation_map_mm
                relative = result.expected_error_mm / np.maximum(rms(maps), np.finfo(float).tiny)
        except MissError:     # the object is beside this sensor
            maps, relative = np.zeros((_FORCES, *self.sensor.spec.map_shape)), np.zeros(_FORCES)
        return self._place(maps, relative)

    def _place(self, maps, relative):
        unknown = np.isnan(self.sensor.spec.frustum_height_mm)     # errors were calibrated on sensors with frusta
        return _Place(self.forces_n, maps.astype(np.float32), np.where(unknown, np.nan, relative))

    def _surface(self, finger, turn):
        """The underside of the object in the sensor's middle; those of the last few rotations are kept."""
        if (finger, turn) not in self._surfaces:
            if len(self._surfaces) >= self.surfaces:
                self._surfaces.pop(next(iter(self._surfaces)))
            pose = Pose(np.zeros(3), self._turned(finger, turn))
            self._surfaces[finger, turn] = HeightField(place(self.mesh, pose=set_down(self.mesh, pose)))
        return self._surfaces[finger, turn]

    @staticmethod
    def _turned(finger, turn):
        return _FACING[finger] * Rotation.from_euler("z", turn * _STEP_DEG, degrees=True)

    def _carrying(self, here, there, sense):
        """Matrix (2, 2) and offset (2,) from a point of the map (y, x), for an object in one place (x, y, rotation), to where that
        point was in another one nearby."""
        angle = sense * np.radians(here[2] - there[2])
        back = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])     # of y, x, from there to here
        offset = back @ (self._first_mm - there[1::-1]) + here[1::-1] - self._first_mm
        return back * self._pitch_mm / self._pitch_mm[:, None], offset / self._pitch_mm


def _key(finger, number):
    """Of a place by its numbers (3,), on one finger."""
    return int(finger), int(number[0]), int(number[1]), int(number[2]) % round(360 / _STEP_DEG)


@compiled
def _add_carried(maps, weights, back, offset, share, out):
    """Add to a map (y, x) the weighted sum of maps (l, y, x), moved by a matrix and an offset, to a share.

    Bilinear; beyond the rim as at the rim. The factor keeps the volume by which the sensor sinks.
    """
    rows, columns = out.shape
    pressed, carried = np.empty((rows, columns)), np.empty((rows, columns))
    sunk, now = 0.0, 0.0
    for y in range(rows):
        for x in range(columns):
            value = 0.0
            for level in range(len(weights)):
                value += weights[level] * maps[level, y, x]
            pressed[y, x] = value
            sunk += max(value, 0.0)
    for y in range(rows):
        for x in range(columns):
            at_y = min(max(back[0, 0] * y + back[0, 1] * x + offset[0], 0.0), rows - 1.0)
            at_x = min(max(back[1, 0] * y + back[1, 1] * x + offset[1], 0.0), columns - 1.0)
            low_y, low_x = min(int(at_y), rows - 2), min(int(at_x), columns - 2)
            v, u = at_y - low_y, at_x - low_x
            value = ((1 - v) * ((1 - u) * pressed[low_y, low_x] + u * pressed[low_y, low_x + 1])
                     + v * ((1 - u) * pressed[low_y + 1, low_x] + u * pressed[low_y + 1, low_x + 1]))
            carried[y, x] = value
            now += max(value, 0.0)
    factor = share * (min(sunk / now, _MOST) if now > 0 else 1.0)
    for y in range(rows):
        for x in range(columns):
            out[y, x] += factor * carried[y, x]
