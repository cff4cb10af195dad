"""The scene of a grasp in MuJoCo: arm, gripper, a sensor on both fingers, and the object in a fixture.

Frames. Tool: z points out of the hand, x from the left finger to the right one. Sensor: z out of the pad towards the object, y
along its long side, from the fingertip to the palm. In the left sensor's frame the object's mesh lies as `Sensor.press` places it
by default, its bounding box centred, then shifted by (x, y) and rotated about z. So its lower side touches the left sensor, and its
upper side the right one.

The fixture is a carriage that slides along the closing direction without friction. Until it lets go the object follows the fingers,
so both press with the same force. MuJoCo collides the object's convex hull with the pads. It gives force and pose; the shape of the
contact comes from a press of the true mesh.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from softtact.errors import InputError
from softtact.progress import announce
from softtact.robot.arm import HOME_RAD, JOINTS, add_arm
from softtact.robot.events import FINGERS
from softtact.robot.settings import SceneSettings, number

if TYPE_CHECKING:
    from softtact.sensors.specification import AnySpec

MM = 1e-3
DOWN = np.array([[0.0, -1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])     # tool frame of a vertical grip: x closes along -y
# Columns are the sensor's x, y, z in the tool frame.
SENSOR_IN_TOOL = {"left": np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]),
                  "right": np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])}
_PAD_TIME_S, _FIXTURE_TIME_S = 0.004, 0.004     # time constants of MuJoCo's contacts and welds, at least two time steps
# Of contacts: stiffness grows with the lighter body's mass, and 0.3 g must still bear 50 N between the pads.
_STIFF = (0.99, 0.9999, 0.0001, 0.5, 2.0)
PAD_CONTACT: dict[str, Any] = {"condim": 4, "solref": (_PAD_TIME_S, 1), "solimp": _STIFF}
_RIGID = (0.9999, 0.9999, 0.001, 0.5, 2.0)      # moves by nanometres under an object's weight
_TURNING = 10.0                 # weight of rotations in a weld: 20 N at 5 mm from the middle tilt an object by 0.03 mrad
TORSION_M = 0.005            # radius of the patch that resists torsion: pads are soft, hulls touch in points
_FINGER_N_PER_M, _FINGER_NS_PER_M, _FINGER_KG = 2e4, 120.0, 0.1
_DARK, PAD_COLOUR, _OBJECT, _FLOOR = (0.2, 0.2, 0.22, 1.0), (0.1, 0.55, 0.45, 1.0), (0.88, 0.5, 0.2, 1.0), (0.93, 0.93, 0.94, 1.0)
_GREY, _FLOOR_M = (0.6, 0.6, 0.62, 1.0), -0.4
_NEEDED = {"joint": (*JOINTS, "finger_left", "finger_right"), "actuator": (*JOINTS, "finger_left", "finger_right"),
           "site": ("grip", "sensor_left", "sensor_right"), "geom": ("pad_left", "pad_right")}


@dataclass(frozen=True)
class Placement:
    """Placement of the object between the pads, in the left sensor's frame."""

    x_mm: float = 0.0
    """Of the middle of its bounding box, along the sensor's short side."""
    y_mm: float = 0.0
    """Along its long side, positive towards the palm."""
    angle_deg: float = 0.0
    """About the closing direction, which is the sensor's z."""


@dataclass(frozen=True)
class Scene:
    """A compiled scene with its settings, and mass and width of the object."""

    model: Any
    """mujoco.MjModel"""
    settings: SceneSettings
    mass_kg: float
    """Of the object."""
    width_mm: float
    """Of the object along the closing direction."""

    def opening_mm(self, data: Any) -> float:
        """Between the pads' faces, from a mujoco.MjData."""
        left, right = (data.site(f"sensor_{finger}").xpos for finger in FINGERS)
        return float(np.linalg.norm(right - left) / MM)


def build_scene(mesh: trimesh.Trimesh, spec: "AnySpec", settings: SceneSettings, placement: Placement = Placement(), *,
                mass_kg: float | None = None) -> Scene:
    """The `Scene` of an object (trimesh in mm) between two sensors.

    mass_kg: of the object; by default its volume times `density_kg_m3`
    Raises InputError where the object is wider than the gripper opens, or a user's MJCF lacks a name.
    """
    mujoco.set_mju_user_warning(_warn)     # without it MuJoCo writes MUJOCO_LOG.TXT into the working folder
    robot = _user_robot(settings) if settings.mjcf else _ur10_with_gripper(settings, spec)
    width = float(np.ptp(mesh.bounds[:, 2]))
    if not settings.mjcf and width >= settings.stroke_mm - 2 * spec.thickness_mm:
        raise InputError(f"The object is {width:g} mm wide along z, and the pads open to "
                         f"{settings.stroke_mm - 2 * spec.thickness_mm:g} mm; turn its mesh so that a narrower side lies along z.")
    mass = abs(mesh.volume) * MM**3 * settings.density_kg_m3 if mass_kg is None else mass_of(mass_kg)
    _add_object(robot, mesh, settings, placement, mass)
    return Scene(model=robot.compile(), settings=settings, mass_kg=float(mass), width_mm=width)


def mass_of(mass_kg: Any) -> float:
    """The mass of an object in kg, checked."""
    return number("mass_kg", mass_kg, low=1e-6, high=100.0, unit="kg")


def _warn(text):
    announce(f"MuJoCo: {text}")


def to_mjcf(spec: "AnySpec", settings: SceneSettings) -> str:
    """The robot without an object as MJCF text, from which a user's robot can start."""
    robot = _ur10_with_gripper(settings, spec)
    robot.compile()
    return str(robot.to_xml())


def quaternion(rotation: Rotation) -> np.ndarray:
    """(..., 4) w, x, y, z, the largest positive, so the sign does not change from row to row at half a turn."""
    values = np.asarray(rotation.as_quat(scalar_first=True))
    largest = np.take_along_axis(values, np.abs(values).argmax(axis=-1)[..., None], axis=-1)
    return values * np.sign(largest)


def _user_robot(settings):
    """A user's MJCF; it must have all names that a grasp needs."""
    try:
        robot = mujoco.MjSpec.from_file(str(settings.mjcf))
    except (ValueError, OSError) as error:
        raise InputError(f"{settings.mjcf}: not readable as MJCF ({' '.join(str(error).split())[:160]}); correct it.") from None
    for kind, names in _NEEDED.items():
        for name in names:
            if getattr(robot, kind)(name) is None:
                raise InputError(f"{settings.mjcf}: it has no {kind} named {name!r}, which a grasp needs; add it, or rename yours "
                                 "(docs/how-to/grasp_in_simulation.md lists all names).")
    _set_options(robot, settings)
    return robot


def _ur10_with_gripper(settings, spec):
    robot = mujoco.MjSpec()
    robot.modelname, robot.compiler.degree = "ur10_2f85", False
    _set_options(robot, settings)
    robot.visual.global_.offwidth, robot.visual.global_.offheight = 1280, 960
    robot.visual.headlight.ambient, robot.visual.headlight.diffuse = (0.45, 0.45, 0.45), (0.5, 0.5, 0.5)
    robot.add_texture(name="sky", type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
                      rgb1=(1, 1, 1), rgb2=(0.85, 0.88, 0.92), width=64, height=384)
    robot.worldbody.add_light(pos=(-0.5, -0.8, 2.0), dir=(0.1, 0.5, -1.0), castshadow=False)
    robot.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=(2, 2, 0.1), pos=(0, 0, _FLOOR_M), rgba=_FLOOR, contype=0,
                             conaffinity=0)
    robot.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, size=(0.1, 0.2, 0), pos=(0, 0, -0.2), rgba=_DARK, contype=0,
                             conaffinity=0)
    _add_gripper(robot, add_arm(robot), settings, spec)
    return robot


def _set_options(robot, settings):
    option = robot.option
    option.timestep, option.integrator = settings.time_step_s, mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # Elliptic cones are Coulomb's; a ratio above 1 prevents creep of a held object.
    option.cone, option.impratio = mujoco.mjtCone.mjCONE_ELLIPTIC, 10.0


def _add_gripper(robot, flange, settings, spec):
    reach = settings.flange_to_grip_mm * MM
    hand = flange.add_body(name="hand", gravcomp=1.0)
    hand.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, fromto=(0, 0, 0, 0, 0, 0.02), size=(0.0375, 0, 0), mass=0.1, rgba=_DARK,
                  contype=0, conaffinity=0)
    hand.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=(0, 0, 0.055), size=(0.055, 0.03, 0.035), mass=0.7, rgba=_DARK, contype=0,
                  conaffinity=0)
    hand.add_site(name="grip", pos=(0, 0, reach), size=(0.002, 0, 0))
    half_stroke = 0.5 * settings.stroke_mm * MM - spec.thickness_mm * MM
    for finger, side in zip(FINGERS, (-1, 1), strict=True):
        _add_finger(robot, hand, finger, side, reach, half_stroke, spec)
    robot.add_equality(name="coupled", type=mujoco.mjtEq.mjEQ_JOINT, objtype=mujoco.mjtObj.mjOBJ_JOINT, name1="finger_left",
                       name2="finger_right", data=[0, 1, *[0] * (mujoco.mjNEQDATA - 2)], solref=(_FIXTURE_TIME_S, 1), solimp=_STIFF)


def _add_finger(robot, hand, finger, side, reach, half_stroke, spec):
    """A sliding finger; its joint is half of the opening. Each finger has a motor: one for both would halve a pad's force."""
    x, y, thick = (0.5 * size * MM for size in (*spec.footprint_mm, spec.thickness_mm))
    body = hand.add_body(name=f"finger_{finger}", pos=(0, 0, reach), gravcomp=1.0)
    body.add_joint(name=f"finger_{finger}", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=(side, 0, 0), range=(0, half_stroke),
                   limited=True)
    body.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, pos=(side * (2 * thick + 0.006), 0, -0.012), size=(0.006, 0.6 * x, y + 0.012),
                  mass=_FINGER_KG, rgba=_DARK, contype=0, conaffinity=0)
    body.add_geom(name=f"pad_{finger}", type=mujoco.mjtGeom.mjGEOM_BOX, pos=(side * thick, 0, 0), size=(thick, x, y), mass=0.0,
                  rgba=PAD_COLOUR, contype=1, conaffinity=2)
    rotation = Rotation.from_matrix(SENSOR_IN_TOOL[finger])
    body.add_site(name=f"sensor_{finger}", quat=quaternion(rotation), size=(0.001, 0, 0))
    motor = robot.add_actuator(name=f"finger_{finger}", target=f"finger_{finger}", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    motor.set_to_position(kp=_FINGER_N_PER_M, kv=_FINGER_NS_PER_M)
    motor.forcelimited, motor.forcerange = True, (-1.0, 1.0)


def _add_object(robot, mesh, settings, placement, mass):
    """The object at the middle of the grip, welded to a carriage that moves along the closing only."""
    at = np.asarray(settings.grip_at_m)
    pose = _object_in_sensor(mesh, placement)
    sensor = DOWN @ SENSOR_IN_TOOL["left"]
    turn, origin = sensor @ pose[1].as_matrix(), at + sensor @ pose[0] * MM
    closing = DOWN[:, 0]
    carriage = robot.worldbody.add_body(name="carriage", pos=at)
    carriage.add_joint(name="carriage", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=closing, damping=0.5)
    carriage.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(0.001, 0, 0), mass=0.02, contype=0, conaffinity=0, rgba=(0, 0, 0, 0))
    foot = float((turn @ (mesh.vertices * MM).T)[2].min() + origin[2])
    carriage.add_geom(type=mujoco.mjtGeom.mjGEOM_CYLINDER, fromto=(0, 0, _FLOOR_M - at[2], 0, 0, foot - at[2]), size=(0.004, 0, 0),
                      mass=0.0, contype=0, conaffinity=0, rgba=_GREY)
    robot.add_mesh(name="object", uservert=(mesh.vertices * MM).ravel(), userface=mesh.faces.ravel(),
                   inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
    body = robot.worldbody.add_body(name="object", pos=origin, quat=quaternion(Rotation.from_matrix(turn)))
    body.add_freejoint(name="object")
    body.add_geom(name="object", type=mujoco.mjtGeom.mjGEOM_MESH, meshname="object", mass=mass, rgba=_OBJECT, contype=2,
                  conaffinity=1, friction=(settings.friction, settings.friction * TORSION_M, 0.0), priority=1, **PAD_CONTACT)
    robot.add_equality(name="fixture", type=mujoco.mjtEq.mjEQ_WELD, objtype=mujoco.mjtObj.mjOBJ_BODY, name1="carriage",
                       name2="object", solref=(_FIXTURE_TIME_S, 1), solimp=_RIGID,
                       data=[*mesh.bounds.mean(axis=0) * MM, *[0] * 7, _TURNING, 0])     # about its middle, in the pose that it has


def _object_in_sensor(mesh, placement):
    """(translation (3,) in mm, Rotation) of the mesh in the left sensor's frame, moved to the middle of the grip."""
    turn = Rotation.from_euler("z", placement.angle_deg, degrees=True)
    centre = mesh.bounds.mean(axis=0)
    return np.array([placement.x_mm, placement.y_mm, 0.0]) - turn.apply(centre), turn


def start(scene: Scene) -> Any:
    """A mujoco.MjData at rest: arm at home, fingers open, the object in its fixture."""
    data = mujoco.MjData(scene.model)
    for name, angle in zip(JOINTS, HOME_RAD, strict=True):
        data.joint(name).qpos[0] = data.actuator(name).ctrl[0] = angle
    mujoco.mj_forward(scene.model, data)
    return data
