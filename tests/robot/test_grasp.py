"""A grasp obeys statics: both pads press with the wanted force, the object is at the commanded place, friction holds."""

import mujoco
import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from softtact.errors import ConvergenceError, InputError
from softtact.robot.events import EVENTS, PHASES
from softtact.robot.grasp import GraspRun, object_poses
from softtact.robot.scene import Placement, build_scene
from softtact.robot.settings import load_scene

FORCE_N, PLACE = 20.0, Placement(x_mm=2.0, y_mm=-1.0, angle_deg=20.0)
G = 9.81      # MuJoCo's


@pytest.fixture(scope="module")
def scene(block, coro):
    return build_scene(block, coro, load_scene(), PLACE)


@pytest.fixture(scope="module")
def record(scene):
    return GraspRun(scene).run(FORCE_N)


def at_event(record, name):
    return record.event_row[EVENTS.index(name)]


def test_a_grasp_goes_through_its_phases_and_events_in_order(record):
    assert (np.diff(record.phase) >= 0).all() and set(record.phase) == set(range(len(PHASES)))
    assert len(record.event_row) == 3 and (np.diff(record.event_row) > 0).all()
    assert not record.contact[:at_event(record, "contact")].any() and record.contact[at_event(record, "grip")].all()


def test_each_pad_presses_with_the_force_asked_for_and_against_the_other(record):
    left, right = record.force_n[at_event(record, "grip")]
    assert left[2] == pytest.approx(-FORCE_N, rel=1e-4) and right[2] == pytest.approx(-FORCE_N, rel=1e-4)
    assert np.hypot(*left[:2]) < 0.02 * FORCE_N     # no shear worth the name while the fixture bears the weight


@pytest.mark.parametrize("force_n", [5.0, 50.0])
def test_an_object_of_a_third_of_a_gram_bears_any_force(force_n, coro):
    light = GraspRun(build_scene(trimesh.creation.box((8, 8, 4)), coro, load_scene(), Placement(1.0, 1.0, 10.0))).run(force_n)
    assert np.allclose(light.force_n[light.event_row[1:], :, 2], -force_n, rtol=1e-3)


def test_lifted_the_pads_carry_the_weight(record, scene):
    forces, row = record.force_n, at_event(record, "lift")
    assert -forces[row, :, 1].sum() == pytest.approx(scene.mass_kg * G, rel=1e-3)     # y is upwards, the weight pulls pads down
    rise = np.diff(record.sensor_pose_world[[at_event(record, "grip"), row], 0, 2])[0]
    assert rise == pytest.approx(50.0, abs=0.1)     # the arm gives by less under the weight


def test_the_object_stands_in_both_sensors_frames_as_computed_by_hand(record, block):
    row = at_event(record, "contact")
    left, right = record.object_pose_sensor[row]
    half, turn = 12.0, Rotation.from_euler("z", 20, degrees=True)
    assert left[:3] == pytest.approx([2, -1, half], abs=0.01)      # one time step of closing is 5 um
    assert right[:3] == pytest.approx([-2, -1, half], abs=0.01)    # seen from behind: x turns round, y does not
    assert (Rotation.from_quat(left[3:], scalar_first=True) * turn.inv()).magnitude() < 1e-4
    seen = Rotation.from_euler("y", 180, degrees=True) * turn
    assert (Rotation.from_quat(right[3:], scalar_first=True) * seen.inv()).magnitude() < 1e-4
    assert record.opening_mm[row] == pytest.approx(24.0, abs=0.02)


def test_half_the_time_step_gives_the_same_poses_at_contact_and_grip(record, block, coro):
    fine = GraspRun(build_scene(block, coro, load_scene(time_step_s=0.0005), PLACE)).run(FORCE_N, lift=False)
    poses = [one.object_pose_sensor[one.event_row[:2], :, :3] for one in (record, fine)]
    assert np.abs(poses[0] - poses[1]).max() < 0.010     # mm


@pytest.mark.parametrize(("share", "held"), [(0.97, False), (1.03, True)])
def test_an_object_slips_below_half_its_weight_over_friction_and_not_above(share, held, block, coro):
    mass, friction = 1.0, 0.5
    needed = mass * G / (2 * friction)
    run = GraspRun(build_scene(block, coro, load_scene(friction=friction), mass_kg=mass))
    run.approach()
    run.close()
    run.grip(share * needed)
    before = object_poses(run.data)[0, 0, 1]
    run.let_go()
    run.wait(0.3)
    slipped = before - object_poses(run.data)[0, 0, 1]
    assert (slipped < 0.05) if held else (slipped > 2.0)     # mm; free fall in that time is 441 mm


def test_the_same_grasp_gives_the_same_record(record, block, coro):
    again = GraspRun(build_scene(block, coro, load_scene(), PLACE)).run(FORCE_N)
    assert all(np.array_equal(getattr(record, name), getattr(again, name)) for name in record.__dataclass_fields__)


def test_fingers_that_close_beside_the_object_say_so(block, coro):
    scene = build_scene(block, coro, load_scene(), Placement(x_mm=40.0))
    with pytest.raises(ConvergenceError, match="closed without touching the object; shift it less"):
        GraspRun(scene).run(FORCE_N)


def test_an_object_wider_than_the_gripper_opens_is_refused(block, coro):
    wide = block.copy()
    wide.apply_scale(4)
    with pytest.raises(InputError, match="is 96 mm wide along z, and the pads open to 80 mm; turn its mesh"):
        build_scene(wide, coro, load_scene())


def test_a_warning_of_mujoco_goes_to_stderr_and_into_no_file(scene, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    data = mujoco.MjData(scene.model)
    data.qvel[0] = 1e300
    mujoco.mj_step(scene.model, data)
    assert "MuJoCo: Nan, Inf or huge value in QVEL" in capsys.readouterr().err and list(tmp_path.iterdir()) == []
