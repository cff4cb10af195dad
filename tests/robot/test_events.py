"""Presses of the true mesh at the events with the scene's forces, mirrored where the grasp is."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import softtact
from softtact.errors import InputError
from softtact.geometry.pose import Pose
from softtact.robot.events import (
    NO_PRESS,
    press_events,
    press_with_shear,
    read_events,
    record_of,
    to_dataset,
    write_events,
)
from softtact.robot.grasp import GraspRun
from softtact.robot.scene import Placement, build_scene
from softtact.robot.settings import load_scene


@pytest.fixture(scope="module")
def sensor():
    return softtact.load_sensor("coro")


@pytest.fixture(scope="module")
def stud():
    """A block with a stud of 3 mm radius beside its middle, on its lower side; its hull has none of that shape."""
    block = trimesh.creation.box((16, 24, 10))
    pin = trimesh.creation.cylinder(radius=3, height=2, sections=48)
    pin.apply_translation((3, 5, -5.5))
    return trimesh.boolean.union([block, pin], engine="manifold")


MIDDLE = Placement()


def grasped(mesh, placement=MIDDLE):
    return GraspRun(build_scene(mesh, softtact.load_sensor("coro").spec, load_scene(), placement)).run(20.0, lift=False)


@pytest.fixture(scope="module")
def record(stud):
    return grasped(stud)


@pytest.fixture(scope="module")
def maps(sensor, stud, record):
    return press_events(sensor, stud, record, model="elastic", workers=1, label="")


def test_the_pressure_adds_up_to_the_force_of_the_scene(maps, record):
    scene = -record.force_n[record.event_row, :, 2]
    assert np.abs(maps.pressed_force_n - scene).max() < 6e-4     # N: forces are pressed with to 1 mN


def test_the_maps_are_of_the_true_mesh_not_of_its_hull(maps, sensor):
    left, right = maps.deformation_map_mm[1]
    y, x = np.unravel_index(left.argmax(), left.shape)
    assert np.hypot(sensor.spec.map_x_mm[x] - 3, sensor.spec.map_y_mm[y] - 5) < 3     # under the stud, as the mesh has it
    assert left[28, 4] < 0.05 * left.max()                                            # the block's face does not touch here
    assert np.ptp(right[20:37, 12:21]) < 0.05 * right.max()                           # the flat upper side presses evenly


def test_a_mirrored_grasp_gives_mirrored_maps(sensor, stud, maps):
    mirrored = stud.copy()
    mirrored.apply_transform(np.diag([-1.0, 1, 1, 1]))      # trimesh turns the facets
    other = press_events(sensor, mirrored, grasped(mirrored), model="elastic", workers=1, label="")
    grip = maps.deformation_map_mm[1], other.deformation_map_mm[1]
    assert np.abs(grip[0] - grip[1][..., ::-1]).max() < 0.005 * grip[0].max()     # single precision, and a facet over a node


def test_an_object_that_is_shifted_is_felt_as_far_away(sensor, stud):
    moved = press_events(sensor, stud, grasped(stud, Placement(x_mm=-4.0, y_mm=2.0)), model="elastic", workers=1, label="")
    left = moved.deformation_map_mm[1, 0]
    y, x = np.unravel_index(left.argmax(), left.shape)
    assert np.hypot(sensor.spec.map_x_mm[x] + 1, sensor.spec.map_y_mm[y] - 7) < 3


def test_a_finger_that_touches_nothing_feels_nothing(sensor, stud, record):
    forces = record.force_n.copy()
    forces[record.event_row[0], 1] = 0.0
    maps = press_events(sensor, stud, replace(record, force_n=forces, event_row=record.event_row[:1]), model="elastic", workers=1,
                        label="")
    assert maps.model.tolist() == [["elastic", NO_PRESS]] and maps.pressed_force_n[0, 1] == 0
    assert not maps.deformation_map_mm[0, 1].any() and maps.deformation_map_mm[0, 0].any()


def test_a_file_pressed_again_is_the_same_file(sensor, stud, record, maps, tmp_path):
    write_events(tmp_path / "one.nc", to_dataset(record, maps, sensor, {"x_mm": 0.0}))
    data = read_events(tmp_path / "one.nc")
    assert data.deformation_map_mm.dims == ("event", "finger", "y", "x") and data.force_n.attrs["units"] == "N"
    again = press_events(sensor, stud, record_of(data), model="elastic", workers=1, label="")
    write_events(tmp_path / "two.nc", to_dataset(record_of(data), again, sensor, {"x_mm": 0.0}))
    assert (tmp_path / "one.nc").read_bytes() == (tmp_path / "two.nc").read_bytes()


@pytest.mark.slow
def test_the_shear_of_an_event_is_pressed_where_it_is_asked_for(record):
    pad, ball = softtact.load_sensor("pad4x4"), trimesh.creation.icosphere(3, radius=4.0)
    forces, poses = record.force_n.copy(), record.object_pose_sensor.copy()
    contact, grip = record.event_row
    poses[[contact, grip]] = [0, 0, 4, 1, 0, 0, 0]
    forces[contact], forces[grip] = [[0, 0, -0.5], [0, 0, -0.5]], [[0.0, -0.3, -1.0], [0.0, 0.0, -1.0]]
    sheared = replace(record, force_n=forces, object_pose_sensor=poses)
    maps = press_events(pad, ball, sheared, model="elastic", workers=1, label="", friction=0.8)
    np.testing.assert_allclose(maps.pressed_shear_n, [[[0, 0], [0, 0]], [[0, -0.3], [0, 0]]], atol=4e-3)
    np.testing.assert_allclose(maps.pressed_force_n, [[0.5, 0.5], [1, 1]], rtol=1e-3)
    left, right = maps.deformation_map_mm[1]
    alone = press_with_shear(pad.with_friction(0.8), ball, Pose(np.array([0.0, 0.0, 4.0])), force_n=1.0,
                             shear_n=np.array([0.0, -0.3]), threads=1).result
    np.testing.assert_array_equal(left, alone.deformation_map_mm[-1])
    assert np.abs(left - alone.deformation_map_mm[0]).max() > 0.005 * right.max()      # shear is in it
    with pytest.raises(InputError, match="shear is pressed with elastic or hyperelastic"):
        press_events(pad, ball, sheared, model="auto", workers=1, label="", friction=0.8)
