"""Many presses at once: the same as one by one, in order, whatever the processes, and none lost to one that fails."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
from support.sensors import CORO
from support.small_sensors import small_gel

import softtact
from softtact.errors import InputError
from softtact.fem.structured_meshes import cylinder
from softtact.files import read_dataset
from softtact.geometry.pose import Pose
from softtact.materials.laws.registry import make_law
from softtact.models.elastic.compliance import elastic_compliance
from softtact.press.objects import SoftObject
from softtact.press.sensor import Sensor
from softtact.studies.hybrid.stages import presses

SMALL = CORO.model_copy(update={"footprint_mm": (7.2, 7.2), "map_shape": (13, 13)})
MESHES = [trimesh.creation.cylinder(radius=1.5, height=2.0), trimesh.creation.icosphere(radius=4.0),
          trimesh.creation.box((2, 3, 2))]
POSES = [Pose.from_values((0.3, 0, 1.0, 0, 0, 0)), None, Pose.from_values((0, -0.5, 1.2, 3, 0, 20))]
BESIDE = Pose.from_values((50, 0, 1.0, 0, 0, 0))


@pytest.fixture(scope="module")
def sensor():
    return Sensor(SMALL, {}, prepared_models={"elastic": elastic_compliance(SMALL)})


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


@pytest.mark.parametrize(("model", "said"), [("hyperelastic", "grips: a press by the hyperelastic model takes about "),
                                             ("elastic", "")])
def test_a_long_model_states_its_time_before_the_first_press(sensor, model, said, capsys):
    sensor.press_many(MESHES[0], [BESIDE], force_n=1.0, model=model, workers=1, failures="keep", label="grips")
    told = capsys.readouterr().err
    assert told.startswith(said) and ("two idle cores" in told) == bool(said)


# --- as a stage of the workflow ---


@pytest.fixture
def stage(sensor, tmp_path):
    """(inputs, settings) of the stage that presses a cylinder in two places, and of each press alone."""
    sensor.prepared_models["elastic"].save(tmp_path / "compliance.npz")
    MESHES[0].export(tmp_path / "punch.stl")
    shared = {"sensor": SMALL.model_dump(mode="json"), "model": "layer", "kind": "elastic", "laws": {}, "mesh": {},
              "friction": None, "device": "cpu", "forces_n": [1.0, 4.0]}
    items = [{"name": name, "set": "indenters", "unit": "mm", "pose": pose}
             for name, pose in (("punch", None), ("punch-1", [0.3, 0.2, 1.0, 0.0, 0.0, 30.0]))]
    return {"object": tmp_path / "punch.stl", "compliance": tmp_path / "compliance.npz"}, shared, items


def test_an_objects_places_pressed_together_are_written_as_each_press_alone(stage, tmp_path):
    inputs, shared, items = stage
    together = [tmp_path / f"{item['name']}.nc" for item in items]
    presses.simulate_presses(inputs=inputs, outputs={"press": together}, settings={**shared, "items": items})
    for path, item in zip(together, items, strict=True):
        presses.simulate_press(inputs=inputs, outputs={"press": tmp_path / "alone.nc"}, settings={**shared, "item": item})
        one, alone = read_dataset(path), read_dataset(tmp_path / "alone.nc")
        for data in (one, alone):
            del data.attrs["wall_time_s"]
        assert one.attrs == alone.attrs and one.attrs["item"] == item["name"] and one.attrs["model"] == "layer"
        np.testing.assert_allclose(one.deformation_map_mm, alone.deformation_map_mm, rtol=0, atol=1e-6)
    first, second = map(read_dataset, together)
    assert np.abs(first.deformation_map_mm - second.deformation_map_mm).max() > 0.01     # places apart


def test_a_place_that_fails_is_named_and_no_press_of_its_job_is_written(stage, tmp_path):
    inputs, shared, items = stage
    items = [*items, {**items[1], "name": "punch-2", "pose": [50.0, 0, 1, 0, 0, 0]}]
    outputs = [tmp_path / f"{item['name']}.nc" for item in items]
    with pytest.raises(InputError, match="^indenters/punch-2/layer: The object misses the sensor"):
        presses.simulate_presses(inputs=inputs, outputs={"press": outputs}, settings={**shared, "items": items})
    assert not any(path.exists() for path in outputs)
    with pytest.raises(InputError, match="2 outputs 'press' for 3 items; give one for each"):
        presses.simulate_presses(inputs=inputs, outputs={"press": outputs[:2]}, settings={**shared, "items": items})


@pytest.mark.skipif(torch.cuda.is_available(), reason="a GPU is here")
def test_a_gpu_that_is_not_there_is_refused(sensor):
    with pytest.raises(InputError, match="torch finds no GPU here; write 'cpu'"):
        sensor.press_many(MESHES[0], [None], force_n=1.0, model="elastic", device="cuda")


def test_a_model_that_has_no_batch_is_refused_on_a_gpu(sensor):
    with pytest.raises(InputError, match="only the elastic model presses on a GPU"):
        sensor.press_many(MESHES[0], [None], force_n=1.0, model="hyperelastic", device="cuda")


@pytest.mark.parametrize("what", ["gel", "free lower side", "soft object"])
def test_a_gpu_that_would_not_be_used_is_refused(sensor, what, tmp_path):
    mesh = MESHES[0]
    if what == "soft object":
        mesh = SoftObject(cylinder(1.5, 2.0, (3, 2)), make_law("neo_hooke", {"c10": 0.1}, bulk_over_shear=20))
    elif what == "gel":
        sensor = softtact.load_sensor(small_gel(tmp_path))
    elif what == "free lower side":
        sensor = softtact.load_sensor("sheet")
        sensor = replace(sensor, spec=sensor.spec.model_copy(update={"support": "none"}))
    with pytest.raises(InputError, match=f"device='cuda': only the elastic model presses on a GPU, rigid .*{sensor.spec.name}"):
        sensor.press_many(mesh, [None], force_n=1.0, model="elastic", device="cuda")


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
def test_a_gpu_gives_the_presses_of_the_processor(sensor):
    for one, other in zip(sensor.press_many(MESHES, POSES, force_n=[1.0, 4.0], model="elastic", device="cuda"),
                          sensor.press_many(MESHES, POSES, force_n=[1.0, 4.0], model="elastic", device="cpu"), strict=True):
        np.testing.assert_allclose(one.deformation_map_mm, other.deformation_map_mm, rtol=0, atol=1e-6)
