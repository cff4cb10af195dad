"""An environment for learning: a gripper with two sensors closes on an object, slides over it and lifts it.

    import gymnasium, softtact.robot.environment
    env = gymnasium.make("softtact/Grasp-v0")

Importing this module registers the environment.
"""

import copy
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium
import mujoco
import numpy as np
import trimesh
from gymnasium.utils import seeding
from scipy.spatial.transform import Rotation

from softtact.errors import InputError
from softtact.geometry.meshes import facets_over, place, read_mesh
from softtact.press.sensor import load_sensor
from softtact.robot.arm import HOME_RAD, JOINTS, inverse_kinematics
from softtact.robot.events import FINGERS
from softtact.robot.gels import GelReadings, has_gel
from softtact.robot.grasp import contacts, object_poses, pad_forces
from softtact.robot.render import Painter
from softtact.robot.scene import DOWN, MM, Placement, Scene, build_scene, mass_of, start
from softtact.robot.settings import load_scene, number
from softtact.robot.taxels import STEP_MM, TaxelMemory

ENVIRONMENT = "softtact/Grasp-v0"
STEP_S = 0.01                 # of an action: 100 observations for each second of the scene
LIFT_MM, SLIDE_MM = 40.0, 8.0     # largest lift, and largest slide to either side
_LIFT_MM_S, _SLIDE_MM_S, _FINGER_MM_S = 50.0, 20.0, 20.0
_BEGIN_MM = 2.0               # between object and each pad at first
_LETS_GO_MM, _DROPPED_MM = 0.5, 20.0
_CLOSED_M, _MOVES_N = -0.1, 1.0      # aim of closed fingers; force that moves open ones
_SPREAD = {"x_mm": 2.0, "y_mm": 4.0, "angle_deg": 45.0}     # of the object's drawn placement, to either side


class Beginning(NamedTuple):
    """How an episode begins."""

    scene: Scene
    """The hand around the object."""
    random: np.random.Generator
    """What later episodes are drawn from."""
    seed: int
    """Of that."""


class GraspEnv(gymnasium.Env):
    """Close, slide, lift: 100 steps for each second of the scene.

    Action (3,) in -1 to 1: grip (force of each pad from 0, open, to `largest_force_n`), lift (speed of the hand, up to 50 mm/s) and
    slide (along the sensors' short side, up to 20 mm/s). The fixture lets go when the hand begins to rise; until then the hand can
    slide over the object.
    Observation: `force_n` (2, 3) on each sensor in its frame, `object_pose` (7,) in the left sensor's frame, mm and quaternion w,
    x, y, z. Of a sensor with taxels `tactile` (2, row, column), counts of the ideal readout; of a gel with a camera each of its
    readouts by name, (2, ...), such as `camera`, `markers`, `depth`.
    Reward: height gained by the object, as a share of 40 mm. An episode ends when the object is lifted by 40 mm, or dropped.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": round(1 / STEP_S)}

    def __init__(self, mesh: trimesh.Trimesh | str | Path | None = None, *, unit: str | None = None, sensor: str = "coro",
                 model: str = "elastic", largest_force_n: float = 30.0, mass_kg: float | None = None,
                 scene: Mapping[str, Any] | None = None, place_step_mm: float = STEP_MM, device: str = "cpu",
                 render_mode: str | None = None) -> None:
        """mesh: trimesh in mm, or a file with its `unit`; by default a cylinder with its flat ends on the pads

        model: elastic or foundation;  scene: keys of a scene file, such as {"friction": 0.4}
        place_step_mm: grid of the places that are pressed (`TaxelMemory`);
        device: cpu, cuda or auto, where they are pressed; both of taxels alone
        render_mode: rgb_array, for pictures of the hand by `render`, or None
        Raises InputError for a model that is too slow, and as `build_scene` does.
        """
        if model not in ("elastic", "foundation"):
            raise InputError(f"model={model!r}: an environment needs a reading in milliseconds; use 'elastic' or 'foundation'.")
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise InputError(f"render_mode={render_mode!r}: the environment draws images only; use 'rgb_array', or leave it out.")
        self.render_mode, self._painter = render_mode, Painter()
        self._sensor, self._settings = load_sensor(sensor), load_scene(**_keys(scene))
        self._scene_steps = _steps_of(self._settings.time_step_s)
        self._mass_kg = None if mass_kg is None else mass_of(mass_kg)
        self._mesh = _mesh_of(mesh, unit)
        self.largest_force_n = number("largest_force_n", largest_force_n, unit="N")
        self._model, self._place_step_mm = model, number("place_step_mm", place_step_mm, unit="mm")
        self._device = device
        self.readings = self._new_readings()
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (3,), np.float32)
        self.observation_space = gymnasium.spaces.Dict({
            **{name: _space_of(values) for name, values in self.readings.at_rest.items()},
            "force_n": gymnasium.spaces.Box(-np.inf, np.inf, (2, 3), np.float32),
            "object_pose": gymnasium.spaces.Box(-np.inf, np.inf, (7,), np.float32)})
        self._joints: np.ndarray | None = None

    def _new_readings(self) -> TaxelMemory | GelReadings:
        if has_gel(self._sensor):
            if self._device not in ("cpu", "auto"):
                raise InputError(f"device={self._device!r}: gels follow their objects on the processor; leave it out for "
                                 f"{self._sensor.spec.name}.")
            return GelReadings(self._sensor, self._mesh, self._settings.friction, self._model, self.largest_force_n)
        return TaxelMemory(self._sensor, self._mesh, self._model, self.largest_force_n, self._place_step_mm,
                           self._device)

    def beside(self) -> "GraspEnv":
        """Another environment with the same options; both share object, sensor and the memory of taxels, not the gels."""
        other = copy.copy(self)
        other._np_random, other._np_random_seed, other._painter = None, None, Painter()
        if isinstance(self.readings, GelReadings):
            other.readings = self._new_readings()
        return other

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Any], dict[str, Any]]:
        """A new episode: the hand around the object, in a random placement.

        options: x_mm, y_mm, angle_deg, in place of random values
        """
        self.begin(self.draw(seed=seed, options=options))
        return self._observe(), self._info()

    def draw(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> "Beginning":
        """The scene of an episode to come, as of `reset`; nothing has changed where it is refused."""
        random, number = (copy.deepcopy(self.np_random), self.np_random_seed) if seed is None else seeding.np_random(seed)
        drawn = {name: float(random.uniform(-side, side)) for name, side in _SPREAD.items()}
        scene = build_scene(self._mesh, self._sensor.spec, self._settings, self._placement(drawn, options or {}),
                            mass_kg=self._mass_kg)
        return Beginning(scene, random, number)

    def begin(self, drawn: "Beginning") -> None:
        """The beginning of an episode, as of `reset`, without an observation."""
        self._scene, self._np_random, self._np_random_seed = drawn.scene, drawn.random, drawn.seed
        self._place_hand()
        self.readings.begin()

    def _placement(self, drawn, given):
        """The drawn placement with the values that are given; one beside the pads is refused."""
        for name in set(given) - set(_SPREAD):
            raise InputError(f"reset: the option {name!r} is unknown; use one of {', '.join(_SPREAD)}.")
        placement = Placement(**drawn | {name: number(f"reset: {name}", value) for name, value in given.items()})
        turn = Rotation.from_euler("z", placement.angle_deg, degrees=True).as_matrix()
        triangles = place(self._mesh).triangles @ turn.T + [placement.x_mm, placement.y_mm, 0.0]
        width, length = self._sensor.spec.footprint_mm
        if given and not facets_over(triangles, (width, length)).any():
            raise InputError(f"reset: x_mm={placement.x_mm:g}, y_mm={placement.y_mm:g}: no part of the object is between the pads "
                             f"of {width:g} x {length:g} mm; give a place nearer to their middle, 0, 0.")
        return placement

    def step(self, action: np.ndarray) -> tuple[dict[str, Any], float, bool, bool, dict[str, Any]]:
        """Ten milliseconds of the scene."""
        reward, ended = self.advance(action)
        return self._observe(), reward, ended, False, self._info()

    def advance(self, action: np.ndarray) -> tuple[float, bool]:
        """The scene's part of a step: the reward, and whether the episode ends."""
        self.need_scene()
        grip, lift, slide = np.clip(three_numbers(action), -1.0, 1.0)
        self._move_hand(lift, slide)
        self._move_fingers(0.5 * (grip + 1.0))
        before = self._risen_mm()
        mujoco.mj_step(self._scene.model, self._data, nstep=self._scene_steps)
        mujoco.mj_forward(self._scene.model, self._data)
        risen = self._risen_mm()
        ended = risen < -_DROPPED_MM or risen > 0.98 * LIFT_MM
        return float((risen - before) / LIFT_MM), bool(ended)

    @property
    def has_scene(self) -> bool:
        """Whether an episode has begun."""
        return hasattr(self, "_scene")

    def need_scene(self) -> None:
        """Raise InputError before the first reset."""
        if not self.has_scene:
            raise InputError("step: there is no scene yet; call reset first.")

    def render(self) -> np.ndarray | None:
        """Image (480, 640, 3), uint8, of the hand and the object; None without a `render_mode`."""
        return None if self.render_mode is None else self._painter.draw(self._scene, self._data)

    def close(self) -> None:
        """End the process that draws."""
        self._painter.close()

    def _place_hand(self):
        """Put the hand at the grip, at rest, with open fingers."""
        scene: Scene = self._scene
        if self._joints is None:
            self._joints = inverse_kinematics(scene.model, np.asarray(self._settings.grip_at_m), DOWN, start_rad=np.array(HOME_RAD))
        self._data, self._scratch = start(scene), mujoco.MjData(scene.model)
        self._arm = [scene.model.actuator(name).id for name in JOINTS]
        self._fingers = [scene.model.actuator(f"finger_{finger}").id for finger in FINGERS]
        self._half_mm = self._open_mm = 0.5 * scene.width_mm + _BEGIN_MM
        for name, angle in zip(JOINTS, self._joints, strict=True):
            self._data.joint(name).qpos[0] = angle
        for finger in FINGERS:
            self._data.joint(f"finger_{finger}").qpos[0] = self._half_mm * MM
        self._data.ctrl[self._arm], self._data.ctrl[self._fingers] = self._joints, self._half_mm * MM
        self._aim, self._hand_mm = self._joints, np.zeros(2)     # targets of the arm's servos; offset of the hand: slide, lift
        mujoco.mj_forward(scene.model, self._data)
        self._ground_mm = self._height_mm()

    def _move_hand(self, lift, slide):
        """Set the arm's servos to the hand's place at the end of the step."""
        wanted = self._hand_mm + np.array([slide * _SLIDE_MM_S, lift * _LIFT_MM_S]) * STEP_S
        wanted = np.clip(wanted, [-SLIDE_MM, 0.0], [SLIDE_MM, LIFT_MM])
        if (wanted != self._hand_mm).any():
            self._hand_mm = wanted
            aside, up = wanted * MM
            place = np.asarray(self._settings.grip_at_m) + aside * DOWN[:, 1] + [0.0, 0.0, up]
            self._aim = inverse_kinematics(self._scene.model, place, DOWN, start_rad=self._aim, data=self._scratch)
        self._data.ctrl[self._arm] = self._aim
        if self._hand_mm[1] > _LETS_GO_MM:
            self._data.eq_active[self._scene.model.equality("fixture").id] = 0

    def _move_fingers(self, share):
        """Close with a share of the largest force, or open where it is zero."""
        force, touch = share * self.largest_force_n, contacts(self._scene.model, self._data).all()
        if share == 0.0:
            self._half_mm = min(self._half_mm + _FINGER_MM_S * STEP_S, self._open_mm)
        elif not touch:
            self._half_mm = max(self._half_mm - _FINGER_MM_S * STEP_S, 0.0)
        closed = share > 0.0 and touch
        most = force if closed else max(force, _MOVES_N)
        self._scene.model.actuator_forcerange[self._fingers] = (-most, most)
        self._data.ctrl[self._fingers] = _CLOSED_M if closed else self._half_mm * MM

    def _risen_mm(self):
        return self._height_mm() - self._ground_mm

    def _height_mm(self):
        """Of the object's middle of mass: its mesh may have its origin far from it, which rises where the object turns."""
        return float(self._data.body("object").xipos[2] / MM)

    def _observe(self):
        poses, forces = loads_of([self])
        return {**self.readings.observe(poses[0], forces[0]), **observed_loads(poses[0], forces[0])}

    def scene_facts(self) -> dict[str, Any]:
        """What `info` says of the scene."""
        return {"risen_mm": self._risen_mm(), "opening_mm": self._scene.opening_mm(self._data)}

    def _info(self):
        return {**self.scene_facts(), **self.readings.facts()}


def loads_of(environments: Sequence[GraspEnv]) -> tuple[np.ndarray, np.ndarray]:
    """Poses (n, 2, 7) of the object in each sensor's frame, and its forces (n, 2, 3) in N on them."""
    states = [one._data for one in environments]
    return object_poses(*states), np.array([pad_forces(data.model, data) for data in states])


def observed_loads(poses: np.ndarray, forces: np.ndarray) -> dict[str, np.ndarray]:
    """The part of an observation that the scene gives, of poses (..., 2, 7) and forces (..., 2, 3)."""
    return {"force_n": forces.astype(np.float32), "object_pose": poses[..., 0, :].astype(np.float32)}


def three_numbers(action: Any) -> np.ndarray:
    """An action as three finite numbers (3,). Raises InputError that shows it where it is not."""
    try:
        values = np.asarray(action)
        values = values.astype(float) if values.dtype.kind in "fiu" else np.array(np.nan)
    except (TypeError, ValueError):
        values = np.array(np.nan)
    if values.shape != (3,) or not np.isfinite(values).all():
        shown = np.asarray(action, dtype=object).tolist()
        raise InputError(f"step: the action {shown} is not three finite numbers from -1 to 1; give grip, lift and slide.")
    return values


def _keys(scene):
    """The keys of a scene."""
    if not isinstance(scene, Mapping | None) or any(not isinstance(name, str) for name in scene or {}):
        raise InputError(f"scene={scene!r}: give keys and values of a scene file, such as {{'friction': 0.4}}.")
    return scene or {}


def _steps_of(time_step_s):
    """The engine's steps in one of the environment; refuses a time step of which it is no multiple."""
    steps = round(STEP_S / time_step_s)
    if steps < 1 or abs(steps * time_step_s - STEP_S) > 1e-6 * STEP_S:
        raise InputError(f"scene: time_step_s={time_step_s:g}: an action takes {STEP_S:g} s, which is no multiple of it; give "
                         "0.001, 0.002 or another whole fraction.")
    return steps


def _space_of(values):
    """The space of a reading that is (2, ...) at rest."""
    low, high = (0, np.iinfo(values.dtype).max) if values.dtype.kind == "u" else (-np.inf, np.inf)
    return gymnasium.spaces.Box(low, high, values.shape, values.dtype.type)


def _mesh_of(mesh, unit):
    if mesh is None:
        return trimesh.creation.cylinder(radius=8.0, height=20.0, sections=64)
    if isinstance(mesh, trimesh.Trimesh):
        return mesh
    return read_mesh(mesh, unit=unit)


if ENVIRONMENT not in gymnasium.registry:
    gymnasium.register(ENVIRONMENT, entry_point="softtact.robot.environment:GraspEnv", max_episode_steps=400,
                       vector_entry_point="softtact.robot.vector_environment:GraspVectorEnv")
