"""The arm's frames are those of its maker's table, and the inverse kinematics brings the hand where it is asked for."""

import mujoco
import numpy as np
import pytest

from softtact.errors import InputError
from softtact.robot.arm import HOME_RAD, JOINTS, inverse_kinematics
from softtact.robot.scene import DOWN, build_scene
from softtact.robot.settings import load_scene

# Universal Robots' "DH Parameters for calculations of kinematics and dynamics", UR10: d, a in m, alpha.
TABLE = [(0.1273, 0.0, np.pi / 2), (0.0, -0.612, 0.0), (0.0, -0.5723, 0.0), (0.163941, 0.0, np.pi / 2), (0.1157, 0.0, -np.pi / 2),
         (0.0922, 0.0, 0.0)]


@pytest.fixture(scope="module")
def model(block, coro):
    return build_scene(block, coro, load_scene()).model


def by_the_table(angles):
    """4 x 4 of the flange: the product of the table's rows, written out."""
    frame = np.eye(4)
    for angle, (d, a, alpha) in zip(angles, TABLE, strict=True):
        c, s, ca, sa = np.cos(angle), np.sin(angle), np.cos(alpha), np.sin(alpha)
        frame = frame @ [[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]]
    return frame


def flange(model, angles):
    data = mujoco.MjData(model)
    for name, angle in zip(JOINTS, angles, strict=True):
        data.joint(name).qpos[0] = angle
    mujoco.mj_kinematics(model, data)
    return data.body("flange").xpos.copy(), data.body("flange").xmat.reshape(3, 3).copy()


def test_the_flange_is_where_the_makers_table_has_it(model):
    for angles in [np.zeros(6), HOME_RAD, *np.random.default_rng(1).uniform(-np.pi, np.pi, (20, 6))]:
        place, turn = flange(model, angles)
        assert np.allclose(place, by_the_table(angles)[:3, 3], rtol=0, atol=1e-12)     # round-off of six products
        assert np.allclose(turn, by_the_table(angles)[:3, :3], rtol=0, atol=1e-12)


def test_the_stretched_arm_is_as_long_as_its_sizes_add_up_to(model):
    # All angles zero: a2 + a3 along x, d4 + d6 along -y, d1 - d5 high.
    assert np.allclose(flange(model, np.zeros(6))[0], [-1.1843, -0.256141, 0.0116], rtol=0, atol=1e-12)


def test_the_hand_comes_where_it_is_asked_for(model):
    place = np.array([0.6, 0.2, 0.3])
    angles = inverse_kinematics(model, place, DOWN, start_rad=np.array(HOME_RAD))
    data = mujoco.MjData(model)
    for name, angle in zip(JOINTS, angles, strict=True):
        data.joint(name).qpos[0] = angle
    mujoco.mj_kinematics(model, data)
    assert np.allclose(data.site("grip").xpos, place, rtol=0, atol=1e-7)     # what counts as there is 1e-8 m
    assert np.allclose(data.site("grip").xmat.reshape(3, 3), DOWN, rtol=0, atol=1e-7)


def test_a_place_out_of_reach_is_refused(model):
    with pytest.raises(InputError, match="grip_at_m: the hand does not reach .* nearer to the robot"):
        inverse_kinematics(model, np.array([1.6, 0.0, 0.2]), DOWN, start_rad=np.array(HOME_RAD))
