"""The UR10 as its maker's Denavit-Hartenberg table has it, and the small MJCF of primitives that stands for it.

Source: Universal Robots, "DH Parameters for calculations of kinematics and dynamics", table of the UR10 (CB3). Each joint turns by
its angle about z, then come d along z, a along x and alpha about x. The links are capsules between the frames: they show the arm
and give it inertia, nothing collides with them.
"""

from typing import Any

import numpy as np

D_M = (0.1273, 0.0, 0.0, 0.163941, 0.1157, 0.0922)
A_M = (0.0, -0.612, -0.5723, 0.0, 0.0, 0.0)
ALPHA_RAD = (np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0)
MASS_KG = (7.1, 12.7, 4.27, 2.0, 2.0, 0.365)     # of the same page; with balanced weights they matter for inertia alone
# Above the object, the hand downwards: from where the inverse kinematics starts.
HOME_RAD = tuple(np.radians([0.0, -90.0, -90.0, -90.0, 90.0, 0.0]))
JOINTS = tuple(f"arm_{number}" for number in range(1, 7))
_RADIUS_M = (0.075, 0.06, 0.05, 0.045, 0.045, 0.04)
# Of the joints' servos: the weight of an object moves the hand by less than 0.1 mm; what lags is gone after some 0.05 s.
_STIFFNESS_NM, _DAMPING_NMS = 4e4, 1.5e3
_GREY, _BLUE = (0.78, 0.79, 0.81, 1.0), (0.36, 0.55, 0.72, 1.0)


def add_arm(spec: Any) -> Any:
    """Add the arm with its servos to an `MjSpec`; return the body that turns with the last joint, and where its flange is.

    Weights are balanced (gravcomp): servos of a position would sag by some mm under them.
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
