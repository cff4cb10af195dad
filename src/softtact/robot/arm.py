"""The UR10: the Denavit-Hartenberg table of its maker, a small MJCF of primitives, and inverse kinematics.

Source of the table: Universal Robots, "DH Parameters for calculations of kinematics and dynamics", UR10 (CB3). Each joint turns by
its angle about z; then follow d along z, a along x and alpha about x. The links are capsules between the frames: they show the arm
and give it inertia, and nothing collides with them.

The inverse kinematics is damped least squares on MuJoCo's Jacobians: S. R. Buss, J.-S. Kim: Selectively damped least squares for
inverse kinematics. J. Graphics Tools 10 (2005) 37-49, eq. 11.
"""

from typing import Any

import mujoco
import numpy as np

from softtact.errors import InputError

D_M = (0.1273, 0.0, 0.0, 0.163941, 0.1157, 0.0922)
A_M = (0.0, -0.612, -0.5723, 0.0, 0.0, 0.0)
ALPHA_RAD = (np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0)
MASS_KG = (7.1, 12.7, 4.27, 2.0, 2.0, 0.365)     # of the same page; weights are balanced, so these act by inertia alone
# Hand above the object and downwards: where the inverse kinematics starts.
HOME_RAD = tuple(np.radians([0.0, -90.0, -90.0, -90.0, 90.0, 0.0]))
JOINTS = tuple(f"arm_{number}" for number in range(1, 7))
_RADIUS_M = (0.075, 0.06, 0.05, 0.045, 0.045, 0.04)
# Of the joints' servos: an object's weight moves the hand by less than 0.1 mm; a lag decays in about 0.05 s.
_STIFFNESS_NM, _DAMPING_NMS = 4e4, 1.5e3
_GREY, _BLUE = (0.78, 0.79, 0.81, 1.0), (0.36, 0.55, 0.72, 1.0)


def add_arm(spec: Any) -> Any:
    """Add the arm with its servos to an `MjSpec`; return the flange, the body that rotates with the last joint.

    Weights are balanced (gravcomp): position servos would sag by some mm under them.
    """
    import mujoco

    place: dict[str, Any] = {}
    body = spec.worldbody
    for number, name in enumerate(JOINTS):
        body = body.add_body(name=name, gravcomp=1.0, **place)
        body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=(0, 0, 1), range=(-2 * np.pi, 2 * np.pi), armature=0.1)
        end = (A_M[number], 0.0, D_M[number])
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_CAPSULE, fromto=(0, 0, 0, *end), size=(_RADIUS_M[number], 0, 0),
                      mass=MASS_KG[number], rgba=_GREY, contype=0, conaffinity=0)
        body.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=(1.15 * _RADIUS_M[number], 0, 0), mass=0.0, rgba=_BLUE, contype=0,
                      conaffinity=0)
        half = 0.5 * ALPHA_RAD[number]
        place = {"pos": end, "quat": (np.cos(half), np.sin(half), 0, 0)}
        servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
        servo.set_to_position(kp=_STIFFNESS_NM, kv=_DAMPING_NMS)
    return body.add_body(name="flange", gravcomp=1.0, **place)


_DAMPING, _ITERATIONS = 1e-3, 200
_NEAR_M, _NEAR_RAD, _LARGEST_STEP = 1e-8, 1e-8, 0.3


def inverse_kinematics(model: Any, position_m: np.ndarray, rotation: np.ndarray, *, start_rad: np.ndarray,
                       data: Any = None) -> np.ndarray:
    """Joint angles (6,) in rad at which the site `grip` has a position (3,) in m and a rotation (3, 3) in the world.

    start_rad: (6,) where the iteration starts; it finds the solution nearby
    data: a mujoco.MjData of the model to work in, whose state is lost, or None
    Raises InputError where the position is out of reach.
    """
    data = mujoco.MjData(model) if data is None else data
    addresses = [model.joint(name).qposadr[0] for name in JOINTS]
    freedoms = [model.joint(name).dofadr[0] for name in JOINTS]
    site = model.site("grip").id
    angles = np.array(start_rad, dtype=float)
    jacobian, quaternion, turn = np.zeros((6, model.nv)), np.zeros(4), np.zeros(3)
    for _ in range(_ITERATIONS):
        data.qpos[addresses] = angles
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        offset = position_m - data.site_xpos[site]
        mujoco.mju_mat2Quat(quaternion, (rotation @ data.site_xmat[site].reshape(3, 3).T).ravel())
        mujoco.mju_quat2Vel(turn, quaternion, 1.0)
        if np.linalg.norm(offset) < _NEAR_M and np.linalg.norm(turn) < _NEAR_RAD:
            return (angles + np.pi) % (2 * np.pi) - np.pi
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
        j = jacobian[:, freedoms]
        step = j.T @ np.linalg.solve(j @ j.T + _DAMPING**2 * np.eye(6), np.concatenate([offset, turn]))
        angles += step * min(1.0, _LARGEST_STEP / np.abs(step).max())
    raise InputError(f"grip_at_m: the hand does not reach {np.round(position_m, 4).tolist()} m with its fingers down; give a place "
                     "nearer to the robot.")
