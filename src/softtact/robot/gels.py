"""What gels with a camera see in a loop: each gel follows the object from call to call, with stick and slip.

MuJoCo's pads are rigid. Its scene gives the normal force, the shear force, and how far the object has slid and turned on the pad
since it touched. A gel gives way under the shear besides: the object is moved aside until the gel carries the scene's shear force
within `_TOLERANCE`, up to `_SLIDES` of what friction carries. Near that bound the force says little of the way, and a load that
varies would drive the object on and on: there the scene's slide alone moves it. One call corrects at most `_CORRECTIONS` times;
what is missing then follows in the next call. A gel that loses contact begins at rest again. Tilt after the first touch is left
out, as in `taxels`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from softtact.contact.height_field import HeightField
from softtact.contact.motion import MotionStep
from softtact.errors import ConvergenceError, InputError
from softtact.geometry.meshes import check_over_sensor, place
from softtact.imaging.depth_image import MovedObject
from softtact.models.elastic.wide_sliding import WideObject, WideStep
from softtact.press.gel import gel_result
from softtact.press.kinds import layers_at_rest
from softtact.press.result import PressResult
from softtact.press.sensor import Sensor
from softtact.press.validity import flag_buried, flag_overloaded
from softtact.readout.registry import readings_of
from softtact.robot.events import FINGERS, pose_of, set_down

_TOUCH_N = 0.02           # normal force below which a gel is free
_CORRECTIONS = 3          # of the displacement aside in one call, and
_TOLERANCE = 0.02         # of the shear, as a share of what friction carries, at which none follows
_SLIDES = 0.85            # share of what friction carries, up to which the force moves the object; beyond, its slide alone
_SOFTEST = 0.2            # of a contact's first stiffness aside: what slips in part is softer, and a step shall not go too far
# Change of slide (mm, twice) and turn (degrees), and of forces as a share of them, below which the last reading stands.
_STILL, _STILL_N = np.array([1e-3, 1e-3, 0.01]), 1e-3


class _Touch:
    """One gel under an object, since it touched at a pose (7,)."""

    def __init__(self, sensor: Sensor, mesh: trimesh.Trimesh, pose: np.ndarray) -> None:
        spec, self.sensor, self.friction = sensor.spec, sensor, sensor.spec.friction.object
        self.placed = place(mesh, pose=set_down(mesh, pose_of(pose)))
        check_over_sensor(self.placed, spec.footprint_mm)
        surface, grid = HeightField(self.placed), (spec.map_x_mm, spec.map_y_mm)
        self.first_mm, self.about = surface.first_touch_mm(*grid), self.placed.bounds.mean(axis=0)[:2]
        self.mover = WideObject(sensor.prepared("elastic"), surface, grid, first_touch_mm=self.first_mm, friction=self.friction,
                                about_mm=(float(self.about[0]), float(self.about[1])))
        self._start, self._at, self._force, self._stiffness = np.array(pose), np.zeros(3), np.zeros(3), 0.0
        self.step: WideStep | None = None
        self.result: PressResult | None = None     # of that step

    def follow(self, pose: np.ndarray, force: np.ndarray) -> WideStep:
        """The gel's state where the object is in a pose (7,) and presses with a force (3,) in N; the last one where it is still."""
        at = self._way_to(pose)
        change = np.abs(force - self._force).max()
        if self.step is not None and (np.abs(at - self._at) < _STILL).all() and change < _STILL_N * np.abs(force).max():
            return self.step
        step = self._moved(at - self._at, -float(force[2]))
        self._at, self._force = at, np.array(force)
        self.step = self._drag(step, force[:2], -float(force[2]))
        return self.step

    def _drag(self, step, shear, load):
        """Move the object aside until the gel carries a shear force (2,) in N, as far as friction does."""
        carried = self.friction * load
        shear = shear * min(1.0, _SLIDES * carried / max(float(np.linalg.norm(shear)), 1e-300))
        stiffest = self._stiffest(step)
        self._stiffness = self._stiffness or stiffest
        for _ in range(_CORRECTIONS):
            before = step.force_n.sum(axis=(0, 1))[:2]
            if np.linalg.norm(shear - before) <= _TOLERANCE * carried:
                break
            way = (shear - before) / self._stiffness
            step = self._moved([*way, 0.0], load)
            gained = float((step.force_n.sum(axis=(0, 1))[:2] - before) @ way / (way @ way))
            self._stiffness = float(np.clip(gained, _SOFTEST * stiffest, stiffest))
        return step

    def object_at(self, step: WideStep) -> MovedObject:
        """Where the object is at a step."""
        return MovedObject(self.placed, self.first_mm, step.position[None, :2], step.position[None, 2], np.array([step.turned_deg]),
                           (float(self.about[0]), float(self.about[1])))

    def _way_to(self, pose):
        """How far the object has slid along x and y (mm) and turned (degrees) on the rigid pad since it touched, (3,)."""
        turn = pose_of(pose).rotation * pose_of(self._start).rotation.inv()
        _, _, z, w = turn.as_quat()
        angle = float((np.degrees(2 * np.arctan2(z, w)) + 180) % 360 - 180)
        arm = Rotation.from_euler("z", angle, degrees=True).apply([*(self._start[:2] - self.about), 0.0])[:2]
        return np.append(pose[:2] - self.about - arm, angle)

    def _moved(self, way, load):
        ways = {name: float(one) for name, one in zip(("x", "y", "rz"), way, strict=True) if one}
        return self.mover.follow(MotionStep(ways=ways), load)

    def _stiffest(self, step):
        """`stiffness_aside` of the contact at a step."""
        layer = self.mover.layer
        area = max(int((step.normal > 0).sum()), 1) * float(np.prod(layer.step_mm))
        return stiffness_aside(area, layer.thickness_mm, shear_mpa=layer.shear_mpa, poisson=layer.poisson)


def stiffness_aside(area_mm2: float, thickness_mm: float, *, shear_mpa: float, poisson: float) -> float:
    """Stiffness in N/mm of a contact that sticks: of a half-space (Mindlin) and of a thin layer, one beside the other."""
    return float(shear_mpa * (8 * np.sqrt(area_mm2 / np.pi) / (2 - poisson) + area_mm2 / thickness_mm))


def has_gel(sensor: Sensor) -> bool:
    """Whether a sensor is a gel: layers whose sides are far, which the elastic model follows."""
    return sensor.spec.has_layers and sensor.spec.edge.far


@dataclass
class GelReadings:
    """Readings of both gels under one object, by the names of the sensor's readouts.

    mesh: of the object, in mm;  friction: Coulomb's coefficient of the scene, which the gels take over
    model: elastic, the one that follows an object;  largest_force_n: limit of the forces
    Raises InputError for another model or force.
    """

    sensor: Sensor
    mesh: trimesh.Trimesh
    friction: float
    model: str
    largest_force_n: float
    _touches: dict[int, _Touch] = field(default_factory=dict)
    _told: list[str] = field(default_factory=lambda: [""] * len(FINGERS))

    def __post_init__(self) -> None:
        if self.model != "elastic":
            raise InputError(f"model={self.model!r}: a gel with a camera has the elastic model alone in the environment; use "
                             "'elastic'.")
        self.sensor.checked_forces(self.largest_force_n)
        self.sensor = self.sensor.with_friction(self.friction)
        at_rest = readings_of(self.sensor.readouts, layers_at_rest(self.sensor))
        self._at_rest = {name: np.asarray(values)[0] for name, values in at_rest.items()}

    def begin(self) -> None:
        """Both gels are free, as at the beginning of an episode."""
        self._touches.clear()

    @property
    def at_rest(self) -> dict[str, np.ndarray]:
        """{readout: (finger, ...)} of free gels."""
        return {name: np.stack([values] * len(FINGERS)) for name, values in self._at_rest.items()}

    def observe(self, poses: np.ndarray, forces: np.ndarray) -> dict[str, np.ndarray]:
        """{readout: (finger, ...)} under an object at poses (finger, 7) in each sensor's frame with forces (finger, 3) in N."""
        seen = [self.one(finger, poses[finger], forces[finger]) for finger in range(len(FINGERS))]
        self._told = [why for _, why in seen]
        return {name: np.stack([readings[name] for readings, _ in seen]) for name in self._at_rest}

    def facts(self) -> dict[str, Any]:
        """What an environment tells beside the readings: why a finger's are not valid; empty where they are."""
        return {"validity_reason": list(self._told)}

    def result(self, finger: int) -> PressResult | None:
        """The press of a gel at its last reading; None where it is free."""
        return self._touches[finger].result if finger in self._touches else None

    def one(self, finger: int, pose: np.ndarray, force: np.ndarray) -> tuple[Mapping[str, np.ndarray], str]:
        """(readings by their names, why they are not valid) of one gel under an object at a pose (7,) with a force (3,) in N."""
        if -force[2] < _TOUCH_N:
            self._touches.pop(finger, None)
            return self._at_rest, ""
        try:
            if finger not in self._touches:
                self._touches[finger] = _Touch(self.sensor, self.mesh, pose)
            touch = self._touches[finger]
            before = touch.step
            step = touch.follow(pose, force)
        except (InputError, ConvergenceError) as error:     # off the gel, or too fast for the path of friction
            self._touches.pop(finger, None)
            return self._at_rest, f"free, for {error}"
        if step is not before:
            pressed = gel_result(self.sensor, [step], [0.0], touch.object_at(step))
            pressed = flag_buried(pressed, float(touch.placed.bounds[1, 2]) - touch.first_mm)
            touch.result = flag_overloaded(pressed, self.sensor.spec.force_range_n[1])
        result = touch.result
        assert result is not None     # made with the first step
        return {name: np.asarray(values)[0] for name, values in result.readings.items()}, str(result.validity_reason[0])
