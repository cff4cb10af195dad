"""Contact forces of attached sensors, given to the engine in place of its own contacts: `hand_back` before each mj_step.

Each object that is in a sensor is pressed to its depth with the elastic model. From its pressure follow the force and the moments,
and a spring at each point under pressure, whose sum is the contact's stiffness K (6 x 6): along z that of the press, aside that of
the layer in shear, up to Coulomb's bound. The sensor is stiff (some 100 N/mm), so an explicit force would let a light object jump.
The force is therefore that at the end of the step, linearly implicit (Euler, backward):

    w+ = w - (dt + damping) K V+,     V+ = V* + dt J M^-1 J' w+

with the velocity V* that the step would give without the force, for all contacts of all sensors together. For K symmetric and not
negative it is stable for every dt and every mass. At rest V+ = 0 and w+ = w, the force of the press. While an object moves by less
than `_RENEWED` of its depth, w follows from K, and nothing is pressed; pressures move aside and turn with the object, up to
`_ASIDE_MM`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from softtact.errors import InputError
from softtact.press.fast import DepthPress
from softtact.robot.attached import AttachedSensor
from softtact.robot.gels import stiffness_aside
from softtact.robot.geoms import MM, contact_force, contacts_of, name_of

DAMPING_S = 0.002
# Change of depth at any point under pressure, as a share and in mm, beyond which it is pressed.
_RENEWED, _RENEWED_MM = 0.03, 2e-5
_ASIDE_MM = 0.5                        # way along the sensor beyond which it is pressed: at a border less of it is under the object
_POWER = 1.3                           # of depth in force, between a punch and a ball: for the stiffness, not for the force
_LOADS = np.repeat([1.0, MM], 3)       # N and N mm in units of the engine


@dataclass
class _Contact:
    """One object in one sensor, between calls. All is in the sensor's frame about its origin, in N, mm and radians."""

    press: DepthPress
    seen: tuple[np.ndarray, Rotation]     # pose of the object in that press
    stiffness: np.ndarray                 # (6, 6) of z and the tilts ...
    aside: np.ndarray                     # ... and (6, 6) of x, y and the turn about z
    last: tuple[np.ndarray, Rotation]
    stretch: np.ndarray = field(default_factory=lambda: np.zeros(6))     # of the layer in shear since it sticks

    @classmethod
    def of(cls, sensor: AttachedSensor, data: Any, body: int, depth_mm: float, before: "_Contact | None") -> "_Contact":
        """That of an object pressed anew; a contact before keeps its shear."""
        if before and not len(before.press.points_mm):      # on the shell alone: nothing of it is known
            before = None
        guess = (before.force_n * (depth_mm / before.reached_mm)**_POWER if before else
                 0.1 * sensor.sensor.spec.force_range_n[1] * depth_mm / sensor.sensor.spec.thickness_mm)
        press, pose = sensor.press_depth(data, body, depth_mm, guess), sensor.object_pose(data, body)
        here = pose.translation_mm, pose.rotation
        reached = float(press.result.indentation_mm[0])     # less than the depth beyond the sensor's largest force
        layer, area = sensor.sensor.spec.elastic_layer, press.areas_mm2.sum()
        shear = stiffness_aside(area, sensor.sensor.spec.thickness_mm, poisson=layer.poisson,
                                shear_mpa=layer.young_mpa / (2 * (1 + layer.poisson)))
        normal = _POWER * press.forces_n.sum() / reached
        springs = press.areas_mm2 / area
        stiffness, aside = (np.einsum("cai,ab,cbj,c->ij", grid := _motions(press.points_mm), np.diag(each), grid, springs)
                            for each in ((0, 0, normal), (shear, shear, 0)))
        seen = here[0] + [0.0, 0.0, depth_mm - reached], here[1]
        return cls(press, seen, stiffness, aside, before.last if before else here, before.stretch if before else np.zeros(6))

    @property
    def force_n(self) -> float:
        """Normal force of the press."""
        return float(self.press.forces_n.sum())

    @property
    def reached_mm(self) -> float:
        """Depth of the object in the press."""
        return float(self.press.result.indentation_mm[0])

    def load(self, here: tuple[np.ndarray, Rotation], friction: float) -> np.ndarray:
        """Force and moment (6,) on the object in a pose near that of the press."""
        x, y = (self.press.points_mm + self._ways(here)[:, :2]).T
        pressing = self.press.forces_n
        load = np.array([0.0, 0.0, pressing.sum(), y @ pressing, -x @ pressing, 0.0]) - self.stiffness @ _way(self.seen, here)
        self.stretch, self.last = self.stretch + _way(self.last, here), here
        return self._with_friction(load, friction)

    def _with_friction(self, load, friction):
        """The load with that of the layer in shear, whose stretch grows no more where all points slide."""
        stiffness, bound = self.aside[0, 0], friction * max(load[2], 0.0)
        shares = self.press.areas_mm2 / self.press.areas_mm2.sum()
        size = stiffness * float(shares @ np.linalg.norm((_motions(self.press.points_mm) @ self.stretch)[:, :2], axis=1))
        if size > bound:
            self.stretch = self.stretch * (bound / size)
        return load - self.aside @ self.stretch

    @property
    def now(self) -> np.ndarray:
        """The stiffness (6, 6) where the object is now."""
        along = np.eye(6)
        x, y, _ = self.last[0] - self.seen[0]
        along[[0, 1], 5], along[2, [3, 4]] = (-y, x), (y, -x)     # what a turn about the sensor's origin is at the old place
        return along.T @ (self.stiffness + self.aside) @ along

    def has_moved(self, here: tuple[np.ndarray, Rotation]) -> bool:
        """Whether the depth under pressure, or the place of that, has changed so much that the object is pressed anew."""
        if not len(self.press.points_mm):      # on the shell alone: where it touches the pad is not known
            return True
        ways = self._ways(here)
        sunk, aside = np.abs(ways[:, 2]).max(initial=0.0), np.linalg.norm(ways[:, :2], axis=1).max(initial=0.0)
        return bool(sunk > max(_RENEWED * self.reached_mm, _RENEWED_MM) or aside > _ASIDE_MM)

    def _ways(self, here):
        """Displacements (c, 3) in mm of the object at the points under pressure since it was pressed."""
        return _motions(self.press.points_mm) @ _way(self.seen, here)


def hand_back(data: Any, sensors: Sequence[AttachedSensor], *, damping_s: float = DAMPING_S) -> dict[str, np.ndarray]:
    """Set `data.xfrc_applied` of all bodies in contact to the sensors' contact forces; call it before each mj_step.

    Sensors are attached with source `poses`. Rows of xfrc_applied of their bodies and objects are overwritten: apply forces of your
    own with qfrc_applied. All sensors of a scene go into one call.
    damping_s: of the contact, as a time: it takes out bouncing, and changes nothing at rest
    Returns {body: (3,) force in N on the object, in the world's frame}.
    Raises InputError where the engine, too, pushes a sensor and an object apart.
    """
    model, dt = data.model, data.model.opt.timestep
    for sensor in sensors:
        _check(sensor, data)
        data.xfrc_applied[[sensor.body_number(data), *sensor.object_numbers(data)]] = 0.0
    mujoco.mj_forward(model, data)
    found = [(sensor, body, *_contact(sensor, data, body, depth)) for sensor in sensors
             for body, depth in _in_contact(sensor, data).items()]
    if not found:
        return {}
    loads, stiffness = np.concatenate([load for *_, load in found]), np.zeros((6 * len(found),) * 2)
    jacobian = np.concatenate([_jacobian(sensor, data, body) for sensor, body, *_ in found])
    for number, (_, _, contact, _) in enumerate(found):
        stiffness[6 * number:6 * number + 6, 6 * number:6 * number + 6] = _in_metres(contact.now)
    solved = np.empty_like(jacobian)
    mujoco.mj_solveM(model, data, solved, jacobian)
    velocity = jacobian @ (data.qvel + dt * data.qacc)
    held = (dt + damping_s) * stiffness
    wrenches = np.linalg.solve(np.eye(len(loads)) + dt * held @ jacobian @ solved.T, loads - held @ velocity)
    return _apply(data, found, wrenches.reshape(-1, 6))


def _contact(sensor, data, body, depth):
    """The `_Contact` of an object and its load (6,) in N and N m."""
    pose = sensor.object_pose(data, body)
    here, held = (pose.translation_mm, pose.rotation), sensor.held(data)
    contact = held.get(body)
    if contact is None or contact.has_moved(here):
        contact = held[body] = _Contact.of(sensor, data, body, depth, contact)
    return contact, contact.load(here, sensor.sensor.spec.friction.object) * _LOADS


def _in_contact(sensor, data):
    """{body: depth in mm} of the objects in a sensor; those that left are forgotten."""
    touching, held = sensor.touching(data), sensor.held(data)
    for body in [*held]:
        if body not in touching:
            del held[body]
    return touching


def _apply(data, found, wrenches):
    """Set the forces on objects and sensors; a contact does not pull, and holds aside as far as friction does."""
    pushed: dict[str, np.ndarray] = {}
    for (sensor, body, _, _), wrench in zip(found, wrenches, strict=True):
        if wrench[2] <= 0:
            continue
        bound = sensor.sensor.spec.friction.object * wrench[2]
        wrench[[0, 1, 5]] *= min(1.0, bound / max(float(np.linalg.norm(wrench[:2])), 1e-300))
        origin, turn = sensor.pose(data)
        force, moment = turn.apply(wrench[:3]), turn.apply(wrench[3:])
        for one, sign in ((body, 1.0), (sensor.body_number(data), -1.0)):
            arm = origin * MM - data.xipos[one]
            data.xfrc_applied[one] += sign * np.concatenate([force, moment + np.cross(arm, force)])
        name = name_of(data.model, body)
        pushed[name] = pushed.get(name, np.zeros(3)) + force
    return pushed


def _jacobian(sensor, data, body):
    """(6, nv): velocity and spin of the object over the sensor, at the sensor's origin and in its frame."""
    origin, turn = sensor.pose(data)
    rows = np.zeros((2, 6, data.model.nv))
    for each, one in zip(rows, (body, sensor.body_number(data)), strict=True):
        mujoco.mj_jac(data.model, data, each[:3], each[3:], origin * MM, one)
    relative, into = rows[0] - rows[1], turn.inv().as_matrix()
    return np.concatenate([into @ relative[:3], into @ relative[3:]])


def _motions(points):
    """(c, 3, 6): displacement of points (c, 2) on a body that moves and turns, by its six displacements."""
    motions = np.zeros((len(points), 3, 6))
    motions[:, :, :3] = np.eye(3)
    motions[:, 0, 5], motions[:, 1, 5] = -points[:, 1], points[:, 0]
    motions[:, 2, 3], motions[:, 2, 4] = points[:, 1], -points[:, 0]
    return motions


def _way(before, now):
    """Displacement and small turn (6,) from one pose of a body to another, at the sensor's origin."""
    turn = now[1] * before[1].inv()
    return np.concatenate([now[0] - turn.apply(before[0]), turn.as_rotvec()])


def _in_metres(stiffness):
    """A stiffness (6, 6) in N, mm and radians, in N, m and radians."""
    return stiffness * np.outer(_LOADS, 1 / np.roll(_LOADS, 3))


def _check(sensor, data):
    """Raise InputError for a sensor that reads forces, or that the engine pushes, too."""
    if sensor.source != "poses":
        raise InputError(f"hand_back: the sensor on {sensor.body!r} reads the engine's own contact forces; attach it with "
                         "source='poses'.")
    objects = sensor.object_numbers(data)
    for number, _, other, sign in contacts_of(data, sensor.geoms(data)):
        body = sensor.object_of(int(data.model.geom_bodyid[other]))
        if other >= 0 and body in objects and np.linalg.norm(contact_force(data.model, data, number, sign)) > 0:
            raise InputError(f"hand_back: the engine, too, pushes {name_of(data.model, body)!r} off {sensor.body!r}; set contype "
                             "and conaffinity of that body's geoms to 0, or exclude the pair.")
