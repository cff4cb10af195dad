"""Readings from memory: as of a press at that very place and force, and the same whatever was asked for before."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation
from support.sensors import CORO, zeroed_at
from support.small_sensors import small_gel

from softtact.errors import InputError
from softtact.geometry.pose import Pose
from softtact.press.sensor import load_sensor
from softtact.robot.events import pose_of, set_down
from softtact.robot.taxels import TaxelMemory, _add_carried

CYLINDER = trimesh.creation.cylinder(radius=8.0, height=20.0, sections=64)
LARGEST_N = 30.0
FROM_BEHIND = Rotation.from_euler("y", 180, degrees=True)


def places(count, seed=2):
    """(finger, pose (7,), force) of an object that the hand has slid over: x to both sides, y and turn as a reset draws them."""
    rng = np.random.default_rng(seed)
    for k in range(count):
        x, y, turn = rng.uniform([-8, -4, -45], [8, 4, 45])
        rotation = (Rotation.identity(), FROM_BEHIND)[k % 2] * Rotation.from_euler("z", turn, degrees=True)
        yield k % 2, np.array([x, y, 12.0, *rotation.as_quat(scalar_first=True)]), LARGEST_N * rng.uniform(0.1, 1.0)


def errors(sensor, mesh, model, count):
    """Largest error of a taxel in each of some places, as a share of the largest reading there."""
    memory = TaxelMemory(sensor, mesh, model, LARGEST_N)
    found = []
    for finger, pose, force in places(count):
        at = Pose(pose[:3] * [1, 1, 0], pose_of(pose).rotation)
        exact = sensor.press(mesh, pose=set_down(mesh, at), force_n=force, model=model, threads=1, label="").tactile_map[0]
        found.append(np.abs(memory.counts(finger, pose, force) - exact).max() / exact.max())
    return np.array(found)


@pytest.mark.slow
def test_elastic_readings_are_those_of_a_press_at_the_very_place_and_force():
    """Measured: 2.1 % in the mean and 3.3 % at most, where 2 % is what the contact's nodes, 0.34 mm apart, leave of any press."""
    found = errors(load_sensor("coro"), CYLINDER, "elastic", 16)
    assert found.mean() < 0.025 and found.max() < 0.04


@pytest.mark.slow
def test_foundation_readings_are_those_of_a_press_at_the_very_place_and_force():
    """Measured: 2.7 % in the mean and 4.7 % at most, the most where the object reaches over the sensor's side."""
    found = errors(load_sensor("coro"), CYLINDER, "foundation", 8)
    assert found.mean() < 0.03 and found.max() < 0.06


def test_readings_do_not_depend_on_what_was_asked_for_before():
    sensor, asked = load_sensor("coro"), list(places(6))
    forwards, backwards = (TaxelMemory(sensor, CYLINDER, "elastic", LARGEST_N) for _ in range(2))
    first = [forwards.counts(*one) for one in asked]
    second = [backwards.counts(*one) for one in reversed(asked)][::-1]
    assert all((a == b).all() for a, b in zip(first, second, strict=True))


def test_between_two_places_readings_hardly_jump():
    """A slide of 6 mm in steps of 0.1 mm: no step departs from a steady change by more than 4 % of the largest."""
    memory = TaxelMemory(load_sensor("coro"), CYLINDER, "elastic", LARGEST_N)
    slide = np.array([memory.counts(0, np.array([x, 0.4, 0, 1, 0, 0, 0]), 15.0) for x in np.arange(-3, 3, 0.1)])
    assert np.abs(np.diff(slide, n=2, axis=0)).max() < 0.04 * slide.max()


def test_readings_of_many_hands_at_once_are_those_of_each_alone():
    memory, asked = TaxelMemory(load_sensor("coro"), CYLINDER, "elastic", LARGEST_N), list(places(4))
    poses, forces = np.array([one[1] for one in asked]).reshape(2, 2, 7), np.zeros((2, 2, 3))
    forces[..., 2] = -np.array([one[2] for one in asked]).reshape(2, 2)
    seen, errors = memory.observe_many(poses, forces)
    assert (seen["tactile"].reshape(4, 7, 4) == np.round([memory.counts(*one) for one in asked])).all()
    assert (memory.observe(poses[1], forces[1])["tactile"] == seen["tactile"][1]).all() and (errors > 0).all()


def test_places_pressed_in_one_batch_read_as_pressed_alone():
    alone = TaxelMemory(load_sensor("coro"), CYLINDER, "elastic", LARGEST_N)
    batch = TaxelMemory(alone.sensor, CYLINDER, "elastic", LARGEST_N)
    keys = [(0, 1, -2, 3), (1, -1, 0, 170), (0, 30, 0, 0)]     # the last one is beside the sensor
    batch._press_together(keys)     # as on a GPU, here on the processor
    alone._press({*keys})
    for key in keys:
        one, other = alone._ladders[key], batch._ladders[key]
        assert np.abs(one.maps_mm - other.maps_mm).max() < 1e-3 * max(one.maps_mm.max(), 1e-9)     # patches of the ladder
        assert (one.relative_error == other.relative_error).all()


def test_the_expected_error_of_a_reading_is_that_of_its_press():
    memory = TaxelMemory(load_sensor("coro"), CYLINDER, "elastic", LARGEST_N)
    _, errors = memory.observe_many(np.array([[[0.0, 0, 0, 1, 0, 0, 0]]]), np.array([[[0.0, 0.0, -10.0]]]))
    exact = memory.sensor.press(CYLINDER, force_n=10.0, model="elastic", threads=1, label="")
    assert errors[0, 0] == pytest.approx(exact.expected_error_mm[0], rel=0.02)


@pytest.mark.parametrize("origin_mm", [(300.0, 0.0, 0.0), (0.0, -200.0, 50.0)])
def test_readings_are_the_same_wherever_the_mesh_has_its_origin(origin_mm):
    """Places are those of the object's middle: of an origin 300 mm away, a turn of a degree is a way of 5 mm."""
    moved = CYLINDER.copy().apply_translation(origin_mm)
    near, far = (TaxelMemory(load_sensor("coro"), mesh, "elastic", LARGEST_N) for mesh in (CYLINDER, moved))
    for finger, pose, force in places(4):
        there = np.append(pose[:3] - pose_of(pose).rotation.apply(origin_mm), pose[3:])
        expected = near.counts(finger, pose, force)
        assert far.counts(finger, there, force) == pytest.approx(expected, abs=1e-3 * expected.max())


def test_an_object_beside_the_sensor_is_not_felt():
    memory = TaxelMemory(load_sensor("coro"), CYLINDER, "elastic", LARGEST_N)
    assert memory.counts(0, np.array([30.0, 0, 0, 1, 0, 0, 0]), 5.0).max() < 1e-9


def test_any_other_fault_of_a_press_is_no_reading_of_zero(tmp_path, monkeypatch):
    (tmp_path / "gel.yaml").write_text(small_gel(tmp_path).read_text() + "taxels: {rows: 2, columns: 2}")
    gel = TaxelMemory(load_sensor(tmp_path / "gel.yaml"), CYLINDER, "elastic", 10.0)
    with pytest.raises(InputError, match="small_gel is a gel with far sides, of which no maps over force are kept"):
        gel.counts(0, np.array([0.0, 0, 0, 1, 0, 0, 0]), 5.0)
    monkeypatch.setattr("softtact.robot.taxels.press_together", lambda *given, **options: [InputError("The mesh is not closed.")])
    with pytest.raises(InputError, match="The mesh is not closed"):
        TaxelMemory(load_sensor("coro"), CYLINDER, "elastic", LARGEST_N)._press_together([(0, 0, 0, 0)])


def test_counts_of_a_calibrated_sensor_below_its_baseline_are_read_as_zero():
    sensor = load_sensor("coro")
    memory = TaxelMemory(replace(sensor, spec=zeroed_at(sensor.spec, -3.0)), CYLINDER, "elastic", LARGEST_N)
    poses, forces = np.tile([0.0, 0, 0, 1, 0, 0, 0], (2, 1, 1)), np.array([[[0.0, 0, 0]], [[0, 0, -10.0]]])
    free, pressed = memory.observe_many(poses, forces)[0]["tactile"]
    assert (free == 0).all() and 100 < pressed.max() < 2400 and pressed.min() == 0


def test_a_sensor_whose_counts_16_bits_do_not_hold_is_refused():
    wide = replace(load_sensor("coro"), spec=CORO.model_copy(update={"largest_counts": 1e5}))
    with pytest.raises(InputError, match="coro: its largest_counts, 100000, are more than the 65535 that 16 bits hold"):
        TaxelMemory(wide, CYLINDER, "elastic", LARGEST_N)


def test_a_gpu_is_taken_by_itself_where_it_serves_alone(monkeypatch):
    monkeypatch.setattr("softtact.press.batch.find_device", lambda name: "cuda")
    for model, device in (("elastic", "cuda"), ("foundation", "cpu")):
        assert TaxelMemory(load_sensor("coro"), CYLINDER, model, LARGEST_N, device="auto").device == device


def test_a_map_that_is_carried_over_the_side_keeps_its_volume():
    sensor = load_sensor("coro")
    memory = TaxelMemory(sensor, CYLINDER, "elastic", LARGEST_N)
    x, y = np.meshgrid(sensor.spec.map_x_mm, sensor.spec.map_y_mm)
    pressed = np.exp(-((x - 8) ** 2 + (y + 5) ** 2) / 8)      # 3 mm from the side, to which it is moved by 1 mm
    carried = np.zeros_like(pressed)
    _add_carried(pressed[None], np.ones(1), *memory._carrying(np.zeros(3), np.array([1.0, 0.0, 0.0]), 1.0), 1.0, carried)
    assert carried.sum() == pytest.approx(pressed.sum(), rel=1e-9)
    _, column = np.unravel_index(carried.argmax(), carried.shape)
    assert sensor.spec.map_x_mm[column] == pytest.approx(9, abs=0.4)      # half a step of the map
