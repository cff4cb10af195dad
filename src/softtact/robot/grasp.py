"""One grasp: approach, closing until first contact, grip with a force, lift; recorded over time.

Events: `contact`, first contact of a finger; `grip`, the force reached and steady; `lift`, the object lifted.
"""

from typing import Any

import mujoco
import numpy as np

from softtact.errors import ConvergenceError
from softtact.robot.arm import HOME_RAD, JOINTS, inverse_kinematics
from softtact.robot.events import FINGERS, PHASES, GraspRecord
from softtact.robot.geoms import contact_force, contacts_of, pose_of_frame
from softtact.robot.scene import DOWN, MM, Scene, quaternion, start

_APPROACH_S, _DESCENT_S, _SETTLE_S = 1.0, 0.5, 0.3
_BESIDE_MM = 1.0              # between object and pad, from which the fingers close slowly
_WAYPOINTS = 9                # of a straight vertical path; between them joints move in proportion
_CLOSED_M = -0.1              # target of the fingers' servos under force control: far inside, so the force limit acts
_LONGEST_S = 5.0              # limit of time in which a grip must become steady


class GraspRun:
    """A grasp in phases. It sets forces in the scene's model, so one scene serves one run at a time."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.data = scene, start(scene)
        self._rows: list[dict[str, Any]] = []
        self._events: list[int] = []
        self._next_s, self._phase = 0.0, 0
        self._arm = [scene.model.actuator(name).id for name in JOINTS]
        self._fingers = [scene.model.actuator(f"finger_{finger}").id for finger in FINGERS]

    def run(self, force_n: float, *, lift: bool = True) -> GraspRecord:
        """The whole grasp, with a force (N) on each pad.

        Raises ConvergenceError where the fingers close on nothing, or the force does not become steady.
        """
        self.approach()
        self.close()
        self.grip(force_n)
        if lift:
            self.lift()
        return self.record()

    def approach(self) -> None:
        """From home to above the object, and down, with the fingers open."""
        settings = self.scene.settings
        at = np.asarray(settings.grip_at_m)
        self._limit_force(settings.closing_force_n * 20)     # the empty fingers move fast
        path = self._vertical_path(at + [0, 0, settings.clearance_mm * MM], at, np.array(HOME_RAD))
        self._aim_fingers(0.5 * self.scene.width_mm * MM + _BESIDE_MM * MM)
        self._follow([np.array(HOME_RAD), path[0]], _APPROACH_S)
        self._follow(path, _DESCENT_S)
        self.wait(_SETTLE_S)

    def close(self) -> None:
        """Close slowly until a finger touches: event `contact`."""
        settings = self.scene.settings
        self._phase = PHASES.index("close")
        self._limit_force(settings.closing_force_n)
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
        """Increase the force to `force_n` on each pad and wait until it is steady: event `grip`."""
        settings, last = self.scene.settings, []
        self._phase = PHASES.index("grip")
        begin, begin_n = self.data.time, min(settings.closing_force_n, force_n)
        self._aim_fingers(_CLOSED_M)
        window = round(settings.steady_s / settings.time_step_s)
        while True:
            grown = min(1.0, (self.data.time - begin) / settings.ramp_s)
            self._limit_force(begin_n + grown * (force_n - begin_n))
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
        """Open the fixture: then only the fingers hold the object."""
        self.data.eq_active[self.scene.model.equality("fixture").id] = 0

    def lift(self) -> None:
        """Open the fixture and lift the object: event `lift`; `contact` shows whether the fingers still hold it."""
        settings = self.scene.settings
        self._phase = PHASES.index("lift")
        self.let_go()
        self.wait(_SETTLE_S)
        at = np.asarray(settings.grip_at_m)
        here = np.array([self.data.joint(name).qpos[0] for name in JOINTS])
        self._follow(self._vertical_path(at, at + [0, 0, settings.lift_mm * MM], here), settings.lift_s)
        self.wait(_SETTLE_S)
        self._event()

    def record(self) -> GraspRecord:
        """The `GraspRecord` up to now."""
        arrays = {name: np.array([row[name] for row in self._rows]) for name in self._rows[0]}
        return GraspRecord(**arrays, event_row=np.array(self._events, dtype=np.int32))

    def wait(self, seconds: float) -> None:
        """Step the scene for a time."""
        end = self.data.time + seconds
        while self.data.time < end:
            self._step()

    def _vertical_path(self, first, last, near):
        """Joint angles (6,) at points of a straight path between two places (3,) in m."""
        path = []
        for share in np.linspace(0, 1, _WAYPOINTS):
            near = inverse_kinematics(self.scene.model, first + share * (last - first), DOWN, start_rad=near)
            path.append(near)
        return path

    def _follow(self, path, seconds):
        """Move the arm's servos along joint angles, from rest to rest."""
        begin, places = self.data.time, np.linspace(0, 1, len(path))
        while (share := (self.data.time - begin) / seconds) < 1:
            smooth = 0.5 - 0.5 * np.cos(np.pi * share)
            self.data.ctrl[self._arm] = [np.interp(smooth, places, angles) for angles in np.transpose(path)]
            self._step()
        self.data.ctrl[self._arm] = path[-1]

    def _aim_fingers(self, half_opening_m):
        self.data.ctrl[self._fingers] = half_opening_m

    def _limit_force(self, force_n):
        self.scene.model.actuator_forcerange[self._fingers] = (-force_n, force_n)

    def _step(self):
        mujoco.mj_step(self.scene.model, self.data)
        if self.data.time >= self._next_s:
            self._record_row()
            self._next_s += self.scene.settings.record_s

    def _event(self):
        self._record_row()
        self._events.append(len(self._rows) - 1)

    def _record_row(self):
        mujoco.mj_forward(self.scene.model, self.data)     # updates poses and forces
        self._rows.append(row_of(self.scene, self.data) | {"phase": self._phase})


def _is_steady(recent, force_n, share):
    """Whether forces (t, finger) in N vary by less than a share of the wanted force, and reach it within that share."""
    return max(np.ptp(recent, axis=0).max(), np.abs(recent[-1] - force_n).max()) < share * force_n


def row_of(scene: Scene, data: Any) -> dict[str, Any]:
    """The row of a `GraspRecord` for one state, without the phase."""
    sites = [data.site(f"sensor_{finger}") for finger in FINGERS]
    at, turn = pose_of_frame([site.xpos for site in sites], [site.xmat for site in sites])
    return {"time_s": data.time, "joint_rad": [data.joint(name).qpos[0] for name in JOINTS],
            "opening_mm": scene.opening_mm(data), "sensor_pose_world": np.column_stack([at, quaternion(turn)]),
            "object_pose_sensor": object_poses(data)[0], "force_n": pad_forces(scene.model, data),
            "contact": contacts(scene.model, data)}


def object_poses(*states: Any) -> np.ndarray:
    """(state, finger, 7) of some mujoco.MjData: the object's mesh in each sensor's frame, in mm with the quaternion w, x, y, z."""
    sites = [data.site(f"sensor_{finger}") for data in states for finger in FINGERS]
    bodies = [data.body("object") for data in states for _ in FINGERS]
    origin, sensor = pose_of_frame([site.xpos for site in sites], [site.xmat for site in sites])
    at, turn = pose_of_frame([body.xpos for body in bodies], [body.xmat for body in bodies])
    back = sensor.inv()
    return np.column_stack([back.apply(at - origin), quaternion(back * turn)]).reshape(len(states), len(FINGERS), 7)


def pad_forces(model: Any, data: Any) -> np.ndarray:
    """(finger, 3) in N: the object's force on each sensor, in the sensor's frame."""
    forces, pads = np.zeros((2, 3)), _pads(model)
    for number, pad, _, sign in contacts_of(data, pads):
        finger = pads.index(pad)
        world = contact_force(model, data, number, sign)
        forces[finger] += data.site(f"sensor_{FINGERS[finger]}").xmat.reshape(3, 3).T @ world
    return forces


def contacts(model: Any, data: Any) -> np.ndarray:
    """(finger,) of bool: whether the object touches each pad."""
    pads = _pads(model)
    touched = {pad for _, pad, _, _ in contacts_of(data, pads)}
    return np.array([pad in touched for pad in pads])


def _pads(model):
    return [model.geom(f"pad_{finger}").id for finger in FINGERS]
