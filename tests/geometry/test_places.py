"""Drawn places: over the sensor, spread, and the same again."""

from pathlib import Path

import numpy as np
import pytest

from softtact.geometry.meshes import place, read_mesh
from softtact.geometry.pose import RIM_MM, Pose, draw_poses

OBJECTS = Path(__file__).parents[2] / "config" / "objects"
FOOTPRINT = (22.0, 37.0)
HALF = np.array(FOOTPRINT) / 2 - RIM_MM


def poses_of(mesh, count=40, seed=(3, 5)):
    return draw_poses(mesh.triangles, count=count, footprint_mm=FOOTPRINT, seed=list(seed))


def pressing_points(mesh, pose):
    points = place(mesh, pose=Pose.from_values(pose)).triangles.reshape(-1, 3)
    assert points[:, 2].min() == pytest.approx(0, abs=1e-6)
    return points[points[:, 2] < 1.0, :2]


def test_what_presses_stays_over_the_sensor_and_off_its_rim():
    for name in ["indenters/triangle_right", "indenters/bordes_h", "unseen/l_form", "grasped/egg", "grasped/key"]:
        mesh = read_mesh(OBJECTS / f"{name}.stl", unit="mm")
        for pose in poses_of(mesh):
            assert (np.abs(pressing_points(mesh, pose)) <= HALF + 0.02).all(), name


def test_a_small_object_is_turned_all_around_and_moved_all_over():
    poses = np.array(poses_of(read_mesh(OBJECTS / "indenters/square_s.stl", unit="mm"), count=200))
    for column, reach in ((0, 3.5), (1, 10.0), (5, 165.0)):
        assert poses[:, column].min() < -reach and poses[:, column].max() > reach
        assert abs(poses[:, column].mean()) < 0.25 * reach
    assert (poses[:, [3, 4]] == 0).all()


def test_a_long_bar_is_turned_only_as_far_as_it_fits():
    poses = np.array(poses_of(read_mesh(OBJECTS / "indenters/bordes_v.stl", unit="mm"), count=200))
    from_axis = np.abs((poses[:, 5] + 90) % 180 - 90)
    assert 0.9 < from_axis.max() < 15 and (np.abs(poses[:, 5]) > 170).any()


def test_what_is_wider_than_the_sensor_stays_in_its_middle():
    mesh = read_mesh(OBJECTS / "grasped/object_6.stl", unit="mm")
    poses = np.array(poses_of(mesh))
    assert np.abs(poses[:, 0]).max() < 0.5 and np.abs(poses[:, 1]).max() > 3


def test_a_pose_depends_on_the_seed_and_its_number_only():
    mesh = read_mesh(OBJECTS / "indenters/star.stl", unit="mm")
    assert poses_of(mesh, count=3) == poses_of(mesh, count=9)[:3]
    assert poses_of(mesh, count=3) != poses_of(mesh, count=3, seed=(4, 5))
