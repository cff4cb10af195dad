"""Data sets of random presses: the same by the same seed, whole after an interruption, in forms that other programs read."""

import h5py
import numpy as np
import pytest
import torch
import trimesh
import xarray

import softtact
from softtact.cli import main
from softtact.errors import InputError
from softtact.geometry.pose import Pose
from softtact.learning import press_data
from softtact.learning.press_data import PressPlan, behind, presses_left, write_press_data


@pytest.fixture(scope="module")
def sensor():
    return softtact.load_sensor("coro")


@pytest.fixture(scope="module")
def meshes():
    return {"box": trimesh.creation.box((8, 12, 5)), "disc": trimesh.creation.cylinder(radius=4, height=6)}


def plan(sensor, meshes, **changes):
    return PressPlan(sensor, meshes, **{"presses": 4, "forces_n": [5.0, 20.0], "model": "elastic", "seed": 3} | changes)


@pytest.fixture(scope="module")
def whole(sensor, meshes, tmp_path_factory):
    path = tmp_path_factory.mktemp("data") / "whole.h5"
    assert write_press_data(path, plan(sensor, meshes), workers=1, label="") == 0
    return path


def arrays(path):
    with h5py.File(path) as file:
        return {name: values[:] for name, values in file.items()}


def test_a_sample_is_the_press_that_its_pose_and_force_name(whole, sensor, meshes):
    found = arrays(whole)
    assert found["deformation_map_mm"].shape == (4, 2, 1, 57, 33) and found["object"].tolist() == [0, 1, 0, 1]
    again = sensor.press(meshes["disc"], pose=Pose.from_values(found["pose"][3]), force_n=[5.0, 20.0], model="elastic", threads=1)
    assert np.allclose(found["deformation_map_mm"][3, :, 0], again.deformation_map_mm, rtol=0, atol=1e-7)     # single precision
    assert np.array_equal(found["tactile_map"][3, :, 0], np.round(again.tactile_map))


def test_an_interrupted_data_set_goes_on_and_ends_as_if_it_had_not_been(whole, sensor, meshes, tmp_path, monkeypatch):
    monkeypatch.setattr(press_data, "_BLOCK", 2)
    pressed = press_data._pressed

    def stop_at_the_second(plan, numbers, workers):
        if numbers[0] >= 2:
            raise KeyboardInterrupt
        return pressed(plan, numbers, workers)

    monkeypatch.setattr(press_data, "_pressed", stop_at_the_second)
    path, ours = tmp_path / "stopped.h5", plan(sensor, meshes)
    with pytest.raises(KeyboardInterrupt):
        write_press_data(path, ours, workers=1, label="")
    assert not path.exists() and presses_left(path, ours) == 2
    monkeypatch.setattr(press_data, "_pressed", pressed)
    write_press_data(path, ours, workers=1, label="")
    assert all(np.array_equal(values, arrays(path)[name]) for name, values in arrays(whole).items())
    assert [one.name for one in tmp_path.iterdir()] == ["stopped.h5"]


def test_another_seed_draws_other_places_and_another_begun_data_set_is_refused(sensor, meshes, tmp_path):
    assert not np.array_equal(plan(sensor, meshes).poses, plan(sensor, meshes, seed=4).poses)
    assert np.array_equal(plan(sensor, meshes).poses, plan(sensor, meshes, presses=9).poses[:4])
    with press_data._opened(tmp_path / "a.h5.part", "a") as file:
        press_data._begin(file, plan(sensor, meshes, seed=4))
    with pytest.raises(InputError, match="there is an unfinished data set of other objects or settings; delete it, or give"):
        write_press_data(tmp_path / "a.h5", plan(sensor, meshes), workers=1, label="")


def test_from_behind_the_upper_side_touches_and_x_turns_round(meshes):
    turned = behind(meshes["box"], Pose.from_values([2, 1, 2.5, 0, 0, 0]))
    corners = turned.apply(meshes["box"].vertices)
    assert corners[:, 2].min() == pytest.approx(0, abs=1e-12) and corners[:, :2].mean(axis=0) == pytest.approx([-2, 1])


def test_a_press_that_fails_is_marked_and_the_others_stand(sensor, meshes, tmp_path, monkeypatch):
    many = softtact.press.sensor.Sensor.press_many
    monkeypatch.setattr(softtact.press.sensor.Sensor, "press_many", lambda *given, **options: [
        InputError("no") if number == 1 else one for number, one in enumerate(many(*given, **options))])
    assert write_press_data(tmp_path / "f.h5", plan(sensor, meshes, presses=2), workers=1, label="") == 1
    assert arrays(tmp_path / "f.h5")["status"].tolist() == [1, 2]


def test_netcdf_has_names_and_units_and_lerobot_a_row_for_each_frame(sensor, meshes, tmp_path):
    two = plan(sensor, meshes, presses=2, fingers=2)
    write_press_data(tmp_path / "a.nc", two, form="netcdf", workers=1, label="")
    write_press_data(tmp_path / "a.h5", two, form="lerobot", workers=1, label="")
    labelled, rows = xarray.load_dataset(tmp_path / "a.nc", engine="h5netcdf"), arrays(tmp_path / "a.h5")
    assert labelled.tactile_map.dims == ("press", "force", "finger", "row", "column") and labelled.force_n.attrs["units"] == "N"
    assert rows["observation.tactile.left"].shape == rows["observation.tactile.right"].shape == (4, 7, 4)
    assert rows["episode_index"].tolist() == [0, 0, 1, 1] and rows["frame_index"].tolist() == [0, 1, 0, 1]
    assert np.array_equal(rows["observation.tactile.right"][1], labelled.tactile_map[0, 1, 1])


def test_the_command_writes_a_data_set_that_torch_batches(tmp_path, monkeypatch, capsys):
    import runpy
    from pathlib import Path

    monkeypatch.chdir(tmp_path)
    trimesh.creation.box((8, 12, 5)).export("part.stl")
    line = "dataset part.stl --unit mm --presses 3 --force 5 --force 10 --workers 1 --out data.h5"
    assert main([*line.split(), "--cost"]) == 0 and "3 of 3 presses left" in capsys.readouterr().out
    assert main(line.split()) == 0 and not (tmp_path / "data.h5.part").exists()
    example = runpy.run_path(str(Path(__file__).resolve().parents[2] / "examples/load_press_data.py"))
    batch = next(iter(torch.utils.data.DataLoader(example["PressDataset"]("data.h5"), batch_size=4)))
    assert batch["tactile"].shape == (4, 1, 7, 4) and batch["force_n"].tolist() == [5, 10, 5, 10]


@pytest.mark.parametrize(("more", "said"), [
    ("--presses 0 --out d.h5", "0 presses is empty"), ("--presses 2 --out d.txt", "d.txt: the format hdf5 is written as .h5"),
    ("--presses 2 --format netcdf --out d.h5", "the format netcdf is written as .nc"),
    ("--presses 2 --force 70 --out d.h5", "--force 70: 70 N is out of the range"),
    ("--presses 2 --out none/d.h5", "there is no folder none"),
    ("--presses 2 --out there.h5", "there is already a finished data set")])
def test_what_cannot_be_used_is_refused_and_leaves_nothing(more, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    trimesh.creation.box((8, 12, 5)).export("part.stl")
    (tmp_path / "there.h5").touch()
    assert main(f"dataset part.stl --unit mm --workers 1 {more}".split()) == 1
    assert said in capsys.readouterr().err and len(list(tmp_path.iterdir())) == 2
