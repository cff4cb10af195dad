"""A sensor on a body of any MuJoCo model: taxels, force and map of what touches it.

    left = attach(model, "left_finger", "coro", pose=[0, 0, 8, 0, 0, 0])
    mujoco.mj_step(model, data)
    reading = left.read(data)

The load of an object comes from the engine's contact forces, or from its pose. Then the force is the one at which the object is
as deep in the sensor as in the scene, and `softtact.robot.hand_back` gives it to the engine. The object's true geometry is pressed
in its pose, tilt included. Objects that touch at the same time are pressed one by one, and their maps are added: by how much one
lowers the surface under another is left out.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from weakref import WeakKeyDictionary

import mujoco
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from softtact.contact.height_field import HeightField
from softtact.errors import ConvergenceError, InputError
from softtact.geometry.meshes import place
from softtact.geometry.pose import Pose
from softtact.press.choice import with_expected_error
from softtact.press.fast import DepthPress, first_touch_mm, press_to_depth, press_underside
from softtact.press.kinds import layers_at_rest
from softtact.press.making import layered_surface
from softtact.press.result import PressResult
from softtact.press.sensor import Sensor, load_sensor
from softtact.press.validity import flag_buried
from softtact.readout.registry import readings_of
from softtact.robot.events import set_down
from softtact.robot.gels import GelReadings, has_gel
from softtact.robot.geoms import MM, body_mesh, contact_force, contacts_of, geoms_of, name_of, pose_of_frame, rigid_body_of
from softtact.robot.scene import PAD_COLOUR, PAD_CONTACT, TORSION_M, quaternion
from softtact.robot.settings import number

SOURCES = ("contacts", "poses")
_RIM_MM, _OVER_MM = 0.5, 1.0      # beside the footprint and over the surface, within which a contact is on the sensor
_LEAST_N, _LEAST_MM = 1e-3, 1e-6     # force and depth below which nothing is pressed
_REACHED = 0.99                      # share of a depth from which on a press has reached it, within the search of its force
_STILL_MM, _STILL_N = 1e-5, 1e-6     # change of a pose (mm, and as a share of a turn) and share of a force: the same press
# Heights over the surface, in thicknesses, and the share of places there in the body, from which its frame points into the body.
_OVER, _WITHIN = (0.5, 1.0, 2.0), 0.5


@dataclass(frozen=True)
class Reading:
    """What a sensor reads at one time."""

    force_n: np.ndarray
    """(3,) in N: of all objects on the sensor, in its frame; z is negative where they press. From poses along z alone."""
    objects: dict[str, np.ndarray]
    """{body: (3,)} the same of each object that touches."""
    deformation_map_mm: np.ndarray
    """(y, x) in mm: how far the sensing surface moved towards the board, positive."""
    readings: dict[str, np.ndarray]
    """What each of the sensor's readouts reads, by its name: `taxels` (row, column), `camera`, `markers` and so on."""
    expected_error_mm: float
    """Expected root mean square error of the map; nan of sensors without frusta."""
    validity_reason: str
    """Why the reading is not valid; empty where it is."""

    @property
    def tactile_map(self) -> np.ndarray:
        """(row, column): counts of the taxels."""
        if "taxels" not in self.readings:
            raise InputError(f"This sensor reads {', '.join(self.readings) or 'nothing'}, and no taxels; use 'readings'.")
        return self.readings["taxels"]


def attach(model: Any, body: str, sensor: Sensor | str | Path, *, pose: Pose | Sequence[float] | np.ndarray | str | None = None,
           source: str = "contacts", press: str = "elastic", objects: Sequence[str] | None = None,
           friction: float | None = None) -> "AttachedSensor":
    """Put a sensor on a body of a scene; read it with `AttachedSensor.read`.

    model: a mujoco.MjModel, whose geoms stay as they are; or a mujoco.MjSpec, to which the sensor is added as a geom `BODY_pad`,
    without mass and with a stiff contact, and a site of the same name: compile it afterwards. Lengths of the scene are in m.
    pose: of the sensor's frame on the body, which has its origin in the middle of the sensing surface and z out of it: a `Pose`, a
    4 x 4 matrix, six numbers (mm, degrees), or the name of a site; by default the body's own frame
    source: `contacts`, the engine's contact forces; or `poses`, how deep an object is in the sensor. With it the engine must not
    let sensor and object collide (a geom added here does not), and the force goes back with `softtact.robot.hand_back`
    press: elastic or foundation, the model that presses;  objects: names of the bodies that count; by default all that touch,
    from poses all with a free joint
    friction: Coulomb's coefficient of objects on the sensor: of an added geom, gels and forces that go back; by default the
    sensor's own; an added geom of a sensor without friction has the engine's 1
    Raises InputError for a body that the scene lacks, a frame that points into the body, an object that cannot be pressed.
    """
    if not isinstance(model, mujoco.MjModel | mujoco.MjSpec):
        raise InputError(f"attach: the scene is a mujoco.MjSpec or MjModel, not {type(model).__name__}; read a file with "
                         "mujoco.MjSpec.from_file.")
    sensor = load_sensor(sensor) if isinstance(sensor, str | Path) else sensor
    _check_sensor(sensor, source, press)
    if friction is not None:
        sensor = sensor.with_friction(number("friction", friction, low=0.0))
    added = isinstance(model, mujoco.MjSpec)
    compiled = model.compile() if added else model
    here = _body_of(compiled, body)
    place_on = _frame(compiled, here, pose)
    attached = AttachedSensor(sensor, body, place_on, source, press, None if objects is None else tuple(objects))
    _refuse_frame_into_body(compiled, here, place_on, sensor.spec)
    _check_objects(compiled, here, objects)
    if added:
        _add_pad(model, body, place_on, attached, friction)
    return attached


@dataclass
class _Memory:
    """What a sensor keeps of one state of the scene from call to call, by the numbers of objects."""

    time: float = -np.inf
    held: dict[int, Any] = field(default_factory=dict)
    gels: dict[int, GelReadings] = field(default_factory=dict)
    last: dict[int, tuple[np.ndarray, PressResult]] = field(default_factory=dict)
    followed: tuple[float, dict[int, np.ndarray]] = -np.inf, {}     # when gels were read, and poses (7,) of what they followed


@dataclass
class AttachedSensor:
    """A sensor on a body of a scene; see `attach`.

    It serves any states of the scene side by side, each with its own contacts, and compiled anew any model with its names.
    """

    sensor: Sensor
    body: str
    frame: Pose
    """Of the sensor on the body, in mm."""
    source: str
    press: str
    objects: tuple[str, ...] | None
    _model: Any = None
    _meshes: dict[int, trimesh.Trimesh] = field(default_factory=dict)
    _memories: WeakKeyDictionary[Any, _Memory] = field(default_factory=WeakKeyDictionary)     # by the mujoco.MjData

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in self.__dict__.items() if name != "_memories"}     # of states that stay here

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _memories=WeakKeyDictionary())

    def begin(self, data: Any) -> None:
        """Forget what touches in a state: an episode begins. Unasked it is forgotten where the state's time goes back."""
        self._memories.pop(data, None)

    def read(self, data: Any) -> Reading:
        """The `Reading` of a mujoco.MjData, after mj_step or mj_forward.

        Raises InputError where a body touches that cannot be pressed (see `attach`): name those that can in `objects`.
        """
        self._bind(data)
        if self.source == "poses":
            pressed = {body: self._to_depth(data, body, depth) for body, depth in self.touching(data).items()}
            forces = {body: np.array([0.0, 0.0, -result.normal_force_n[0]]) for body, (result, _) in pressed.items()}
            return self._reading(forces, pressed)
        forces = self.contact_forces(data)
        if has_gel(self.sensor):
            return self._gel_reading(data, forces)
        return self._reading(forces, {body: self._pressed(data, body, -force[2]) for body, force in forces.items()})

    def contact_forces(self, data: Any) -> dict[int, np.ndarray]:
        """{body: force (3,) in N on the sensor, in its frame} of the engine's contacts on the sensing surface."""
        self._bind(data)
        model, (origin, turn) = data.model, self.pose(data)
        low = np.array([*(-0.5 * np.asarray(self.sensor.spec.footprint_mm) - _RIM_MM), -self.sensor.spec.thickness_mm])
        forces: dict[int, np.ndarray] = {}
        for contact, _, other, sign in contacts_of(data, self.geoms(data)):
            at, gap = turn.inv().apply(data.contact[contact].pos / MM - origin), max(data.contact[contact].dist, 0.0) / MM
            on_sensor = (at >= low).all() and (at <= [*-low[:2], _OVER_MM + gap]).all()
            if on_sensor and other < 0 and self.objects is None:
                raise InputError(f"A flex touches the sensor on {self.body!r}, which a sensor cannot press; name in 'objects' the "
                                 "bodies that count.")
            body = self.object_of(int(model.geom_bodyid[other]))
            if on_sensor and other >= 0 and (self.objects is None or body in self._named):
                force = turn.inv().apply(contact_force(model, data, contact, sign))
                forces[body] = forces.get(body, np.zeros(3)) + force
        return {body: force for body, force in forces.items() if -force[2] >= _LEAST_N}

    def touching(self, data: Any) -> dict[int, float]:
        """{body: depth in mm below the sensing surface} of the objects that are in it, by their poses.

        One that reaches below the board is driven in where its middle is above the board, else it lies beneath and does not touch.
        """
        origin, turn = self.pose(data)
        within = [*(0.5 * np.asarray(self.sensor.spec.footprint_mm)), self.sensor.spec.thickness_mm]
        depths = {}
        for body in self._named:
            centre = turn.inv().apply(data.xpos[body] / MM - origin)
            if (np.abs(centre) > within + self._reach[body]).any():
                continue
            placed = self._placed(data, body)
            lowest, middle = first_touch_mm(self.sensor, HeightField(placed)), placed.bounds[:, 2].mean()
            if lowest < -_LEAST_MM and max(lowest, middle) >= -self.sensor.spec.thickness_mm:
                depths[body] = -lowest
        return depths

    def pose(self, data: Any) -> tuple[np.ndarray, Rotation]:
        """(origin (3,) in mm, rotation) of the sensor's frame in the world."""
        self._bind(data)
        if not data.xmat[self._body].any():
            raise InputError("The scene's state has no places yet; call mujoco.mj_forward(model, data) before the first reading.")
        at, turn = pose_of_frame(data.xpos[self._body], data.xmat[self._body])
        return at + turn.apply(self.frame.translation_mm), turn * self.frame.rotation

    def object_pose(self, data: Any, body: int) -> Pose:
        """Of an object's mesh in the sensor's frame."""
        origin, turn = self.pose(data)
        at, of_object = pose_of_frame(data.xpos[body], data.xmat[body])
        return Pose(turn.inv().apply(at - origin), turn.inv() * of_object)

    def underside(self, data: Any, body: int) -> HeightField:
        """The underside of an object in its place over the sensor."""
        return HeightField(self._placed(data, body))

    def _placed(self, data, body):
        return place(self._mesh(body), pose=self.object_pose(data, body))

    def press_depth(self, data: Any, body: int, depth_mm: float, guess_n: float) -> DepthPress:
        """The press of an object to its depth in the scene, at most as deep as the sensor is thick."""
        surface = self.underside(data, body).moved(np.array([0.0, 0.0, depth_mm]))
        return press_to_depth(self.sensor, surface, min(depth_mm, self.sensor.spec.thickness_mm), guess_n=guess_n)

    def body_number(self, data: Any) -> int:
        """Of the sensor's body."""
        self._bind(data)
        return self._body

    def object_numbers(self, data: Any) -> list[int]:
        """Of the bodies whose poses are read."""
        self._bind(data)
        return self._named

    def object_of(self, body: int) -> int:
        """The object that a body belongs to: the named one that it is or hangs on without a joint, else the one it is fixed to."""
        one, model = body, self._model
        while one not in self._named:
            above = int(model.body_parentid[one])
            if one == 0 or model.body_weldid[above] != model.body_weldid[body]:
                return rigid_body_of(model, body)
            one = above
        return one

    def geoms(self, data: Any) -> set[int]:
        """Numbers of the geoms of the sensor's body that the engine collides."""
        self._bind(data)
        return self._geoms

    def held(self, data: Any) -> dict[int, Any]:
        """{object: its contact} of `softtact.robot.hand_back` in a state of the scene."""
        return self._bind(data).held

    def _bind(self, data):
        """The `_Memory` of a state, a new one where its time goes back; find body, geoms and objects in a model that is new."""
        if not isinstance(data, mujoco.MjData):
            raise InputError(f"A sensor is read from a mujoco.MjData, not from {type(data).__name__}.")
        if data.model is not self._model:
            self._find(data.model)
        if data not in self._memories or data.time < self._memories[data].time:
            self._memories[data] = _Memory()
        self._memories[data].time = data.time
        return self._memories[data]

    def _find(self, model):
        """Set all that depends on the model; where something is missing, the next call looks again."""
        self._model = None
        self._body = _body_of(model, self.body)
        self._geoms = {int(geom) for geom in geoms_of(model, self._body)}
        free = model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
        carrier = rigid_body_of(model, self._body)
        self._named = [int(body) for body in free if body != carrier and self.source == "poses" and _has_geoms(model, body)]
        if self.objects is not None:
            self._named = [_body_of(model, name) for name in self.objects]
        self._meshes = {body: body_mesh(model, body) for body in self._named}
        self._reach = {body: np.linalg.norm(mesh.vertices, axis=1).max() for body, mesh in self._meshes.items()}
        self._model = model

    def _mesh(self, body):
        if body not in self._meshes:
            self._meshes[body] = body_mesh(self._model, body)
        return self._meshes[body]

    def _pressed(self, data, body, force_n):
        """(`PressResult` or None, why it is not valid) of an object under a normal force."""
        most = self.sensor.spec.force_range_n[1]
        over = "" if force_n <= most else self._over
        pose, force_n = self.object_pose(data, body), min(force_n, most)
        state, last = np.array([*pose.translation_mm, *pose.rotation.as_quat(canonical=True), force_n]), self._bind(data).last
        if body not in last or _moved(last[body][0], state):
            mesh = self._mesh(body)
            placed = place(mesh, pose=set_down(mesh, pose))
            surface = HeightField(placed)
            try:
                result = press_underside(self.sensor, surface, np.array([force_n]), model=self.press)
            except (InputError, ConvergenceError) as error:
                return None, str(error)
            last[body] = state, self._judged(result, placed.bounds[1, 2] - first_touch_mm(self.sensor, surface))
        return last[body][1], over

    @property
    def _over(self):
        return f"the force is above {self.sensor.spec.force_range_n[1]:g} N, the sensor's limit"

    def _to_depth(self, data, body, depth_mm):
        """(`PressResult`, why it is not valid) of an object at its depth; its force before is the guess."""
        last = self._bind(data).last
        guess = float(last[body][1].normal_force_n[0]) if body in last else 0.1 * self.sensor.spec.force_range_n[1]
        result = self._judged(self.press_depth(data, body, depth_mm, guess).result,
                              self._placed(data, body).bounds[1, 2] + depth_mm)
        last[body] = np.zeros(0), result
        wanted, most = min(depth_mm, self.sensor.spec.thickness_mm), self.sensor.spec.force_range_n[1]
        if result.indentation_mm[0] >= _REACHED * wanted:
            return result, ""
        return result, self._over if result.normal_force_n[0] >= _REACHED * most else "the object rests on the shell beside the pad"

    def _judged(self, result, height_mm):
        """A result with its expected error, and flagged where an object of this height is wholly below the surface."""
        return with_expected_error(self.sensor, flag_buried(result, float(height_mm)))

    def _reading(self, forces, pressed):
        """The sum of the presses of several objects."""
        spec, results = self.sensor.spec, [result for result, _ in pressed.values() if result is not None]
        maps, thinning = (np.sum([getattr(one, name) for one in results], axis=0) if results else np.zeros((1, *spec.map_shape))
                          for name in ("deformation_map_mm", "thinning_map_mm"))
        surface = layers_at_rest(self.sensor)
        if results:
            surface = layered_surface(spec, thinning, -maps[..., None] * [np.nan, np.nan, 1.0])
        errors = [float(one.expected_error_mm[0]) for one in results]
        reasons = [f"{name_of(self._model, body)}: {why}" for body, (result, reason) in pressed.items()
                   for why in (reason, "" if result is None else str(result.validity_reason[0])) if why]
        readings = {name: np.asarray(values)[0] for name, values in readings_of(self.sensor.readouts, surface).items()}
        return Reading(**self._forces(forces), deformation_map_mm=maps[0], readings=readings,
                       expected_error_mm=float(np.sum(errors)), validity_reason="; ".join(reasons))

    def _gel_reading(self, data, forces):
        """The reading of a gel, which follows the object that presses most from call to call."""
        memory, poses = self._bind(data), {body: _seven(self.object_pose(data, body)) for body in forces}
        gels, (seen_s, before) = memory.gels, memory.followed
        for body in [*gels]:     # one that left, or is elsewhere at the same time: in another episode, that is
            if body not in forces or data.time <= seen_s and (np.abs(poses[body] - before[body]) > _STILL_MM).any():
                del gels[body]
        spec, reason, result, readings = self.sensor.spec, "", None, None
        for body in sorted(forces, key=lambda one: forces[one][2])[:1]:
            if body not in gels:
                gels[body] = GelReadings(self.sensor, self._mesh(body), spec.friction.object, self.press, spec.force_range_n[1])
            readings, reason = gels[body].one(0, poses[body], forces[body])
            result = gels[body].result(0)
        memory.followed = data.time, poses
        if len(forces) > 1:
            reason = f"{len(forces)} objects touch, and a gel follows the one that presses most" + f"; {reason}" * bool(reason)
        if readings is None:
            readings = {name: np.asarray(one)[0] for name, one in
                        readings_of(self.sensor.readouts, layers_at_rest(self.sensor)).items()}
        maps = np.zeros(spec.map_shape) if result is None else result.deformation_map_mm[0]
        return Reading(**self._forces(forces), deformation_map_mm=maps, readings=dict(readings), expected_error_mm=np.nan,
                       validity_reason=reason)

    def _forces(self, forces):
        return {"force_n": np.sum([*forces.values(), np.zeros(3)], axis=0),
                "objects": {name_of(self._model, body): force for body, force in forces.items()}}


def _seven(pose):
    """Numbers (7,) of a pose, as a grasp's record has them: mm and a quaternion."""
    return np.concatenate([pose.translation_mm, quaternion(pose.rotation)])


def _moved(before, now):
    """Whether a state of pose and force differs from the one before."""
    return (np.abs(before[:-1] - now[:-1]) > _STILL_MM).any() or abs(before[-1] - now[-1]) > _STILL_N * now[-1]


def _check_sensor(sensor, source, press):
    if source not in SOURCES:
        raise InputError(f"source={source!r}: use one of {', '.join(SOURCES)}.")
    if press not in ("elastic", "foundation") or (source == "poses" or has_gel(sensor)) and press != "elastic":
        raise InputError(f"press={press!r}: a sensor in a scene is pressed with 'elastic', or 'foundation' where it has frusta and "
                         "source is 'contacts'; name one of them.")
    if not sensor.spec.has_layers:
        raise InputError(f"{sensor.spec.name} is of kind solid, which takes minutes for a press; attach a sensor of layers.")
    if source == "poses" and has_gel(sensor):
        raise InputError(f"source='poses': {sensor.spec.name} is a gel, which follows contact forces alone; use 'contacts'.")
    sensor.spec.check_for(press)


def _check_objects(model, here, objects):
    """Raise InputError for objects that cannot be pressed, or that are the sensor's own body."""
    if isinstance(objects, str):
        raise InputError(f"objects={objects!r}: give a list of names, such as [{objects!r}].")
    for name in objects or ():
        body_mesh(model, body := _body_of(model, name))
        if rigid_body_of(model, body) == rigid_body_of(model, here):
            raise InputError(f"objects: {name!r} carries the sensor; name the bodies that touch it.")


def _has_geoms(model, body):
    """Whether a body, or one fixed to it, has a geom."""
    return bool((model.body_weldid[model.geom_bodyid] == body).any())


def _body_of(model, name):
    """The number of a body by its name. Raises InputError with the names that there are."""
    number_of = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name) if isinstance(name, str) else -1
    if number_of < 0:
        known = [model.body(one).name for one in range(model.nbody) if model.body(one).name]
        raise InputError(f"The scene has no body {name!r}; use one of {', '.join(known)}.")
    return number_of


def _frame(model, body, pose):
    """The pose of the sensor's frame on a body: stated, or of a site."""
    if not isinstance(pose, str):
        return Pose.of(pose) or Pose(np.zeros(3))
    site = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_SITE, pose)
    if site < 0 or model.site_bodyid[site] != body:
        raise InputError(f"pose={pose!r}: the body {name_of(model, body)!r} has no such site; name one of its sites, or give six "
                         "numbers (mm, degrees).")
    return Pose(model.site_pos[site] / MM, Rotation.from_quat(model.site_quat[site], scalar_first=True))


def _refuse_frame_into_body(model, body, frame, spec):
    """Raise InputError where what lies over the sensing surface is the body itself."""
    heights = spec.thickness_mm * np.array(_OVER)
    grid = np.stack(np.meshgrid(*2 * [[-0.3, 0.0, 0.3]]), axis=-1).reshape(-1, 2)
    over = np.array([np.column_stack([grid * spec.footprint_mm, np.full(len(grid), height)]) for height in heights])
    points, inside = frame.apply(over.reshape(-1, 3)), np.zeros(over[..., 0].size, dtype=bool)
    for hull in _hulls(model, body):
        inside |= (points @ hull.face_normals.T <= np.einsum("fj,fj->f", hull.triangles[:, 0], hull.face_normals)).all(axis=1)
    if inside.reshape(len(heights), -1).mean(axis=1).max() > _WITHIN:
        raise InputError(f"The sensor's frame on the body {name_of(model, body)!r} points into the body: its z axis must point out "
                         "of it, from the surface on; turn or shift 'pose'.")


def _hulls(model, body):
    """Convex hulls in mm of a body's geoms that can be pressed, as the engine collides them."""
    try:
        return [part.convex_hull for part in body_mesh(model, body).split(only_watertight=False)]
    except InputError:     # no geoms, or a plane: nothing to compare with
        return []


def _add_pad(spec, body, frame, attached, friction):
    """Add the sensor to an MjSpec as a geom without mass, and its frame as a site.

    The engine collides it where its forces are read. Its contact is stiff: in a soft one an object would sink to what is below it.
    """
    name, here, quat = f"{body}_pad", spec.body(body), frame.rotation.as_quat(scalar_first=True)
    while spec.geom(name) is not None or spec.site(name) is not None:
        name += "_"
    sensor, collides = attached.sensor.spec, int(attached.source == "contacts")
    half = 0.5 * np.array([*sensor.footprint_mm, sensor.thickness_mm]) * MM
    middle = frame.apply(np.array([[0.0, 0.0, -0.5 * sensor.thickness_mm]]))[0] * MM
    pad = here.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=middle, quat=quat, mass=0.0, rgba=PAD_COLOUR,
                        contype=collides, conaffinity=collides, priority=1, **PAD_CONTACT)
    own = sensor.friction.object
    if friction is not None or own > 0:
        pad.friction = (own, own * TORSION_M, 0.0)
    here.add_site(name=name, pos=frame.translation_mm * MM, quat=quat, size=(1e-3, 1e-3, 1e-3))
