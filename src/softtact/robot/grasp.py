"""One grasp: down to the object, fingers closed until first contact, force up to what is asked for, lift; recorded in time.

Events: `contact`, the first contact of a finger; `grip`, the force at what was asked for and steady; `lift`, the object lifted.
"""

from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from softtact.errors import ConvergenceError
from softtact.robot.arm import HOME_RAD, JOINTS, inverse_kinematics
from softtact.robot.events import FINGERS, PHASES, GraspRecord
from softtact.robot.scene import DOWN, MM, Scene, quaternion, start

_APPROACH_S, _DESCENT_S, _SETTLE_S = 1.0, 0.5, 0.3
_BESIDE_MM = 1.0              # between the object and each pad, from where the fingers close slowly
_WAYPOINTS = 9                # of a straight vertical way; between them joints move alike
_CLOSED_M = -0.1              # what the fingers' servos aim at with a force: far inside, so that they press with all of it
_LONGEST_S = 5.0              # that a grip may take to become steady


class GraspRun:
    """A grasp that goes on step by step. It sets forces in the scene's model, so one scene serves one run at a time."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.data = scene, start(scene)
        self._rows: list[dict[str, Any]] = []
        self._events: list[int] = []
        self._next_s, self._phase = 0.0, 0
        self._arm = [scene.model.actuator(name).id for name in JOINTS]
        self._fingers = [scene.model.actuator(f"finger_{finger}").id for finger in FINGERS]

    def run(self, force_n: float, *, lift: bool = True) -> GraspRecord:
        """The whole grasp with a force (N) of each pad.

        Raises ConvergenceError where the fingers close on nothing, or the force does not become steady.
        """
        self.approach()
        self.close()
        self.grip(force_n)
        if lift:
            self.lift()
        return self.record()

    def approach(self) -> None:
        """From home to above the object, and down; the fingers open as wide as needed."""
        settings = self.scene.settings
        at = np.asarray(settings.grip_at_m)
        self._press_with(settings.closing_force_n * 20)     # of empty fingers that move fast
        ways = self._vertical_way(at + [0, 0, settings.clearance_mm * MM], at, np.array(HOME_RAD))
        self._aim_fingers(0.5 * self.scene.width_mm * MM + _BESIDE_MM * MM)
        self._follow([np.array(HOME_RAD), ways[0]], _APPROACH_S)
        self._follow(ways, _DESCENT_S)
        self.wait(_SETTLE_S)

    def close(self) -> None:
        """Close slowly until a finger touches: event `contact`."""
        settings = self.scene.settings
        self._phase = PHASES.index("close")
        self._press_with(settings.closing_force_n)
        half = 0.5 * self.scene.opening_mm(self.data) * MM
        while not contacts(self.scene.model, self.data).any():
            half -= settings.closing_mm_s * MM * settings.time_step_s
            if half < -_BESIDE_MM * MM:
                raise ConvergenceError("The fingers closed without touching the object; shift it less (--x, --y), so that it lies "
                                       "between the pads.")
            self._aim_fingers(half)
            self._step()
        self._event()

    def grip(self, force_n: float) -> None:
        """Let the force grow to `force_n` on each pad and wait until it is steady: event `grip`."""
        settings, last = self.scene.settings, []
        self._phase = PHASES.index("grip")
        begin, begin_n = self.data.time, min(settings.closing_force_n, force_n)
        self._aim_fingers(_CLOSED_M)
        window = round(settings.steady_s / settings.time_step_s)
        while True:
            grown = min(1.0, (self.data.time - begin) / settings.ramp_s)
            self._press_with(begin_n + grown * (force_n - begin_n))
            self._step()
            last.append(-pad_forces(self.scene.model, self.data)[:, 2])
            recent = np.array(last[-window:])
            if grown == 1.0 and len(last) > window and _is_steady(recent, force_n, settings.steady_change):
                return self._event()
            if self.data.time - begin > _LONGEST_S:
                pressed = ", ".join(f"{value + 0.0:.3g}" for value in recent[-1])
                raise ConvergenceError(f"The grip did not become steady in {_LONGEST_S:g} s: the pads press with {pressed} N where "
                                       f"{force_n:g} N were asked for; shift or turn the object, or make it heavier (--mass).")

    def let_go(self) -> None:
        """Open the fixture: from now on the fingers alone hold the object."""
        self.data.eq_active[self.scene.model.equality("fixture").id] = 0

    def lift(self) -> None:
        """Open the fixture and lift the object: event `lift`. Whether the fingers still hold it is in `contact`."""
        settings = self.scene.settings
        self._phase = PHASES.index("lift")
        self.let_go()
        self.wait(_SETTLE_S)
        at = np.asarray(settings.grip_at_m)
        here = np.array([self.data.joint(name).qpos[0] for name in JOINTS])
        self._follow(self._vertical_way(at, at + [0, 0, settings.lift_mm * MM], here), settings.lift_s)
        self.wait(_SETTLE_S)
        self._event()

    def record(self) -> GraspRecord:
        """The `GraspRecord` of what has been done so far."""
        arrays = {name: np.array([row[name] for row in self._rows]) for name in self._rows[0]}
        return GraspRecord(**arrays, event_row=np.array(self._events, dtype=np.int32))

    def wait(self, seconds: float) -> None:
        """Let so much time pass."""
        end = self.data.time + seconds
        while self.data.time < end:
            self._step()

    def _vertical_way(self, first, last, near):
        """Joint angles (6,) at points of a straight way between two places (3,) in m."""
        ways = []
        for share in np.linspace(0, 1, _WAYPOINTS):
            near = inverse_kinematics(self.scene.model, first + share * (last - first), DOWN, start_rad=near)
            ways.append(near)
        return ways

    def _follow(self, ways, seconds):
        """Move the arm's servos along joint angles, with a speed that begins and ends at zero."""
        begin, places = self.data.time, np.linspace(0, 1, len(ways))
        while (share := (self.data.time - begin) / seconds) < 1:
            smooth = 0.5 - 0.5 * np.cos(np.pi * share)
            self.data.ctrl[self._arm] = [np.interp(smooth, places, angles) for angles in np.transpose(ways)]
            self._step()
        self.data.ctrl[self._arm] = ways[-1]

    def _aim_fingers(self, half_opening_m):
        self.data.ctrl[self._fingers] = half_opening_m

    def _press_with(self, force_n):
        self.scene.model.actuator_forcerange[self._fingers] = (-force_n, force_n)

    def _step(self):
        mujoco.mj_step(self.scene.model, self.data)
        if self.data.time >= self._next_s:
            self._note()
            self._next_s += self.scene.settings.record_s

    def _event(self):
        self._note()
        self._events.append(len(self._rows) - 1)

    def _note(self):
        mujoco.mj_forward(self.scene.model, self.data)     # poses and forces of this very state
        self._rows.append(row_of(self.scene, self.data) | {"phase": self._phase})


def _is_steady(recent, force_n, share):
    """Whether forces (t, finger) in N changed by less than a share of what was asked for, and are it within that share."""
    return max(np.ptp(recent, axis=0).max(), np.abs(recent[-1] - force_n).max()) < share * force_n


def row_of(scene: Scene, data: Any) -> dict[str, Any]:
    """What a `GraspRecord` holds of one state, but for the phase."""
    sensors = [_pose(data.site(f"sensor_{finger}").xpos, data.site(f"sensor_{finger}").xmat) for finger in FINGERS]
    return {"time_s": data.time, "joint_rad": [data.joint(name).qpos[0] for name in JOINTS],
            "opening_mm": scene.opening_mm(data), "sensor_pose_world": [_seven(*sensor) for sensor in sensors],
            "object_pose_sensor": object_poses(data), "force_n": pad_forces(scene.model, data),
            "contact": contacts(scene.model, data)}


def object_poses(data: Any) -> np.ndarray:
    """(finger, 7): the object's mesh in each sensor's frame, in mm with the quaternion w, x, y, z."""
    body = data.body("object")
    at, turn = _pose(body.xpos, body.xmat)
    poses = []
    for finger in FINGERS:
        origin, rotation = _pose(data.site(f"sensor_{finger}").xpos, data.site(f"sensor_{finger}").xmat)
        poses.append(_seven(rotation.inv().apply(at - origin), rotation.inv() * turn))
    return np.array(poses)


def pad_forces(model: Any, data: Any) -> np.ndarray:
    """(finger, 3) in N: the object's force on each sensor, in the sensor's frame."""
    forces, wrench = np.zeros((2, 3)), np.zeros(6)
    for number, finger, sign in _contacts_of(model, data):
        mujoco.mj_contactForce(model, data, number, wrench)
        world = sign * data.contact[number].frame.reshape(3, 3).T @ wrench[:3]
        forces[finger] += data.site(f"sensor_{FINGERS[finger]}").xmat.reshape(3, 3).T @ world
    return forces


def contacts(model: Any, data: Any) -> np.ndarray:
    """(finger,) of bool: whether the object touches each pad."""
    touching = np.zeros(2, dtype=bool)
    for _, finger, _ in _contacts_of(model, data):
        touching[finger] = True
    return touching


def _contacts_of(model, data):
    """(number, finger, sign) of the contacts of pads with the object. Contact forces act on the second body of a pair."""
    pads = [model.geom(f"pad_{finger}").id for finger in FINGERS]
    for number in range(data.ncon):
        pair = data.contact[number].geom
        for finger, pad in enumerate(pads):
            if pad in pair and data.contact[number].dist <= 0:
                yield number, finger, 1.0 if pair[1] == pad else -1.0


def _pose(position_m, matrix):
    return np.array(position_m) / MM, Rotation.from_matrix(np.reshape(matrix, (3, 3)))


def _seven(position_mm, rotation):
    return np.concatenate([position_mm, quaternion(rotation)])
