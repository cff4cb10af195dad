"""Where the arm's joints must be for the hand to be at a place: inverse kinematics by damped least squares.

S. R. Buss, J.-S. Kim: Selectively damped least squares for inverse kinematics. J. Graphics Tools 10 (2005) 37-49, eq. 11, on the
Jacobians that MuJoCo computes.
"""

from typing import Any

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from softtact.errors import InputError
from softtact.robot.arm import JOINTS

_DAMPING, _ITERATIONS = 1e-3, 200
_NEAR_M, _NEAR_RAD, _LARGEST_STEP = 1e-8, 1e-8, 0.3


def inverse_kinematics(model: Any, position_m: np.ndarray, rotation: np.ndarray, *, start_rad: np.ndarray) -> np.ndarray:
    """Joint angles (6,) in rad that bring the site `grip` to a position (3,) in m with a rotation (3, 3), in the world.

    start_rad: (6,) where the search starts; the solution nearby is found
    Raises InputError where the place is out of reach.
    """
    data = mujoco.MjData(model)
    addresses = [model.joint(name).qposadr[0] for name in JOINTS]
    freedoms = [model.joint(name).dofadr[0] for name in JOINTS]
    site = model.site("grip").id
    angles = np.array(start_rad, dtype=float)
    jacobian = np.zeros((6, model.nv))
    for _ in range(_ITERATIONS):
        data.qpos[addresses] = angles
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        away = position_m - data.site_xpos[site]
        turn = Rotation.from_matrix(rotation @ data.site_xmat[site].reshape(3, 3).T).as_rotvec()
        if np.linalg.norm(away) < _NEAR_M and np.linalg.norm(turn) < _NEAR_RAD:
            return (angles + np.pi) % (2 * np.pi) - np.pi
        mujoco.mj_jacSite(model, data, jacobian[:3], jacobian[3:], site)
        j = jacobian[:, freedoms]
        step = j.T @ np.linalg.solve(j @ j.T + _DAMPING**2 * np.eye(6), np.concatenate([away, turn]))
        angles += step * min(1.0, _LARGEST_STEP / np.abs(step).max())
    raise InputError(f"grip_at_m: the hand does not reach {np.round(position_m, 4).tolist()} m with its fingers down; give a place "
                     "that is nearer to the robot.")
