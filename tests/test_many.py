"""Many presses at once: the same as one by one, in order, whatever the processes, and none lost to one that fails."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from softtact.errors import InputError
from softtact.geometry.pose import Pose
from softtact.geometry.sensor_spec import SensorSpec
from softtact.mechanics.elastic import elastic_compliance
from softtact.sensor import Sensor

CORO = SensorSpec.from_yaml(Path(__file__).parents[1] / "config/sensors/coro.yaml")
SMALL = CORO.model_copy(update={"footprint_mm": (7.2, 7.2), "map_shape": (13, 13)})
MESHES = [trimesh.creation.cylinder(radius=1.5, height=2.0), trimesh.creation.icosphere(radius=4.0),
          trimesh.creation.box((2, 3, 2))]
POSES = [Pose.from_values((0.3, 0, 1.0, 0, 0, 0)), None, Pose.from_values((0, -0.5, 1.2, 3, 0, 20))]
BESIDE = Pose.from_values((50, 0, 1.0, 0, 0, 0))


@pytest.fixture(scope="module")
def sensor():
    return Sensor(SMALL, {}, files={"elastic": elastic_compliance(SMALL)})


@pytest.mark.parametrize("workers", [1, 2])
def test_many_presses_are_those_one_by_one_in_their_order(sensor, workers):
    together = sensor.press_many(MESHES, POSES, force_n=[1.0, 4.0], model="elastic", workers=workers)
    for mesh, pose, result in zip(MESHES, POSES, together, strict=True):
        alone = sensor.press(mesh, pose=pose, force_n=[1.0, 4.0], model="elastic")
        np.testing.assert_allclose(result.deformation_map_mm, alone.deformation_map_mm, rtol=0, atol=1e-6)    # mm, the tolerance


def test_one_mesh_goes_through_all_poses(sensor):
    results = sensor.press_many(MESHES[0], POSES[:2], force_n=2.0, model="elastic", workers=1)
    assert [len(result.force_n) for result in results] == [1, 1]


def test_a_press_that_fails_is_named_after_the_others_are_done_or_kept_in_its_place(sensor):
    with pytest.raises(InputError, match="press 1 of 2: The object misses the sensor"):
        sensor.press_many(MESHES[0], [POSES[0], BESIDE], force_n=1.0, model="elastic", workers=1)
    first, second = sensor.press_many(MESHES[0], [POSES[0], BESIDE], force_n=1.0, model="elastic", workers=1, failures="keep")
    assert first.converged.all() and isinstance(second, InputError)
