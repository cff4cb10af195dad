"""Data sets of random presses: the same by the same seed, whole after an interruption, in forms that other programs read."""

import multiprocessing
import os
import resource
import signal
import subprocess
import sys
from dataclasses import replace

import h5py
import numpy as np
import pytest
import torch
import trimesh
import xarray
from support.sensors import zeroed_at
from support.small_sensors import small_block

import softtact
from softtact import files
from softtact.cli import main
from softtact.errors import InputError, OutputError
from softtact.geometry.pose import Pose
from softtact.learning import press_blocks, press_data
from softtact.learning.press_data import PressPlan, behind, presses_left, write_press_data
from softtact.models.hyperelastic.mesh_settings import MeshSettings, NewtonSettings
from softtact.outputs import held


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
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(press_blocks, "BLOCK", 2)     # presses of one block are solved together, and round together
        assert write_press_data(path, plan(sensor, meshes), workers=1, label="") == 0
    return path


def arrays(path):
    with h5py.File(path) as file:
        return {name: values[:] for name, values in file.items()}


def test_a_sample_is_the_press_that_its_pose_and_force_name(whole, sensor, meshes):
    found = arrays(whole)
    assert found["deformation_map_mm"].shape == (4, 2, 1, 57, 33) and found["object"].tolist() == [0, 1, 0, 1]
    again = sensor.press(meshes["disc"], pose=Pose.from_values(found["pose"][3]), force_n=[5.0, 20.0], model="elastic", threads=1)
    assert np.allclose(found["deformation_map_mm"][3, :, 0], again.deformation_map_mm, rtol=0, atol=2e-6)     # mm
    assert np.abs(found["tactile_map"][3, :, 0] - again.tactile_map).max() < 0.51      # whole counts


# --- data sets that are interrupted, and faults of the disk ---


@pytest.fixture
def ours(sensor, meshes, monkeypatch):
    """Four presses in blocks of two."""
    monkeypatch.setattr(press_blocks, "BLOCK", 2)
    return plan(sensor, meshes)


def stopped(path, plan, monkeypatch, stop):
    """Write a data set in which stop() is called before the second block."""
    pressed = press_data._pressed
    with monkeypatch.context() as patch:
        patch.setattr(press_data, "_pressed", lambda plan, numbers, workers:
                      stop() if numbers[0] else pressed(plan, numbers, workers))
        write_press_data(path, plan, workers=1, label="")


def interrupt():
    raise KeyboardInterrupt


def assert_goes_on(path, plan, whole, *, left):
    """A data set of which some presses are left becomes that which nothing disturbed, byte for byte, and nothing else stays."""
    assert not path.exists() and presses_left(path, plan) == left
    assert write_press_data(path, plan, workers=1, label="") == 0
    assert path.read_bytes() == whole.read_bytes() and [one.name for one in path.parent.iterdir()] == [path.name]


def test_an_interrupted_data_set_goes_on_and_ends_as_if_it_had_not_been(whole, ours, tmp_path, monkeypatch):
    with pytest.raises(KeyboardInterrupt):
        stopped(tmp_path / "stopped.h5", ours, monkeypatch, interrupt)
    assert_goes_on(tmp_path / "stopped.h5", ours, whole, left=2)


def test_a_killed_data_set_goes_on_and_ends_as_if_it_had_not_been(whole, ours, tmp_path, monkeypatch):
    path = tmp_path / "killed.h5"
    run = multiprocessing.get_context("fork").Process(
        target=lambda: stopped(path, ours, monkeypatch, lambda: os.kill(os.getpid(), signal.SIGKILL)))
    run.start()
    run.join()
    assert run.exitcode == -signal.SIGKILL
    assert_goes_on(path, ours, whole, left=2)


@pytest.fixture
def room():
    """Sets the most bytes that a file may have: a file that grows beyond them meets the error of a full disk."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def size_of_a_block(tmp_path):
    return next((tmp_path / "full.h5.part").glob("*.npz")).stat().st_size


@pytest.mark.parametrize("size", [1000, "a block"])
def test_a_full_disk_is_a_sentence_and_finished_blocks_stay(size, whole, ours, tmp_path, monkeypatch, room):
    """Full at the first block, or where the blocks are put together."""
    path = tmp_path / "full.h5"
    if size == "a block":
        with pytest.raises(KeyboardInterrupt):
            stopped(path, ours, monkeypatch, interrupt)
        size = size_of_a_block(tmp_path) + 1000
    room(size)
    with pytest.raises(OutputError, match="cannot be written .File too large.; make room on the disk"):
        write_press_data(path, ours, workers=1, label="")
    room(resource.RLIM_INFINITY)
    assert_goes_on(path, ours, whole, left=4 if size == 1000 else 0)


def test_what_the_disk_did_not_keep_is_found_before_the_data_set_has_its_name(whole, ours, tmp_path, monkeypatch):
    path = tmp_path / "lost.h5"
    with monkeypatch.context() as patch:
        write = files._Unfailing.write
        patch.setattr(files._Unfailing, "write", lambda file, data: write(file, bytes(len(memoryview(data).cast("B")))
                                                                          if memoryview(data).nbytes > 10_000 else data))
        with pytest.raises(OutputError, match="lost.h5.part/whole.h5: what was written is not what is read back; check the disk"):
            write_press_data(path, ours, workers=1, label="")
    assert_goes_on(path, ours, whole, left=0)


def test_a_damaged_block_is_named_and_pressed_again(whole, ours, tmp_path, monkeypatch, capsys):
    path = tmp_path / "flipped.h5"
    with pytest.raises(KeyboardInterrupt):
        stopped(path, ours, monkeypatch, interrupt)
    block = tmp_path / "flipped.h5.part/00000000.npz"
    content = bytearray(block.read_bytes())
    content[len(content) // 2] ^= 1
    block.write_bytes(content)
    assert_goes_on(path, ours, whole, left=4)
    assert "00000000.npz: this block is damaged; presses 0 to 1 are pressed again." in capsys.readouterr().err


def test_a_data_set_that_is_being_written_is_told_from_a_damaged_one(ours, tmp_path):
    with held(tmp_path / "a.h5.part"), pytest.raises(InputError, match="a.h5.part: another run writes this data set; wait"):
        write_press_data(tmp_path / "a.h5", ours, workers=1, label="")


def test_no_refusal_advises_to_delete_what_holds_finished_presses(whole, ours, tmp_path, monkeypatch):
    path = tmp_path / "a.h5"
    with pytest.raises(InputError, match="finished data set; give another name"):
        write_press_data(whole, ours, workers=1, label="")
    with pytest.raises(KeyboardInterrupt):
        stopped(path, ours, monkeypatch, interrupt)
    for act in (presses_left, write_press_data):
        with pytest.raises(InputError, match="unfinished data set of other objects or settings; finish it with those, move"):
            act(path, replace(ours, seed=4))
    (tmp_path / "old.h5.part").write_bytes(b"of an earlier version")
    with pytest.raises(InputError, match="of an earlier version; give another name, or finish it with that"):
        write_press_data(tmp_path / "old.h5", ours, workers=1, label="")


def test_a_data_set_does_not_go_on_with_other_laws_meshes_or_solver_settings(sensor, ours, tmp_path, monkeypatch):
    """The sensor's file names its materials; their constants may change between two runs."""
    path, cover = tmp_path / "a.h5", sensor.laws["cover"]
    with pytest.raises(KeyboardInterrupt):
        stopped(path, ours, monkeypatch, interrupt)
    for change in ({"laws": sensor.laws | {"cover": cover.scaled(1 + 1e-9)}}, {"mesh": MeshSettings(refinement=1)},
                   {"solver": NewtonSettings.draft()}, {"scatter": (np.full(2000, 1.0), np.full(2000, 1.1))}):
        with pytest.raises(InputError, match="unfinished data set of other objects or settings"):
            presses_left(path, replace(ours, sensor=replace(sensor, **change)))
    assert presses_left(path, replace(ours, sensor=softtact.load_sensor("coro"))) == 2


def test_the_settings_of_a_data_set_are_the_same_in_another_process(ours):
    code = ("import softtact, trimesh; from softtact.learning.press_data import PressPlan; "
            "meshes = {'box': trimesh.creation.box((8, 12, 5)), 'disc': trimesh.creation.cylinder(radius=4, height=6)}; "
            "print(PressPlan(softtact.load_sensor('coro'), meshes, 4, [5.0, 20.0], 'elastic', 3).settings)")
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split()[-1] == ours.settings


@pytest.mark.parametrize(("change", "said"), [
    ({"seed": -1}, "seed -1: .* give 0 or more"), ({"meshes": {}}, "no meshes is empty; give 1 object"),
    ({"fingers": 3}, "fingers 3: .* give 1 or 2"), ({"model": "elastik"}, "Model 'elastik' is unknown; use one of auto, elastic")])
def test_a_plan_that_no_press_can_follow_is_refused_as_it_is_made(ours, change, said):
    with pytest.raises(InputError, match=said):
        replace(ours, **change)


def test_another_seed_draws_other_places_and_more_presses_begin_with_the_same(sensor, meshes):
    assert not np.array_equal(plan(sensor, meshes).poses, plan(sensor, meshes, seed=4).poses)
    assert np.array_equal(plan(sensor, meshes).poses, plan(sensor, meshes, presses=9).poses[:4])


def test_from_behind_the_upper_side_touches_and_x_turns_round(meshes):
    turned = behind(meshes["box"], Pose.from_values([2, 1, 2.5, 0, 0, 0]))
    corners = turned.apply(meshes["box"].vertices)
    assert corners[:, 2].min() == pytest.approx(0, abs=1e-12) and corners[:, :2].mean(axis=0) == pytest.approx([-2, 1])


def test_counts_below_the_baseline_of_a_calibrated_sensor_are_written_as_zero(sensor, meshes, tmp_path):
    known = replace(sensor, spec=zeroed_at(sensor.spec, -3.0))
    write_press_data(tmp_path / "z.h5", plan(known, meshes, presses=1), workers=1, label="")
    found = arrays(tmp_path / "z.h5")["tactile_map"]
    assert found.min() == 0 and 10 < found.max() <= sensor.spec.largest_counts


def test_a_sensor_whose_counts_a_data_set_does_not_hold_is_refused_before_a_press(sensor, meshes, tmp_path):
    with pytest.raises(InputError, match="coro: its largest_counts, 100000, are more than the 65535 that 16 bits hold"):
        plan(replace(sensor, spec=sensor.spec.model_copy(update={"largest_counts": 1e5})), meshes)
    with pytest.raises(InputError, match="block"):
        plan(softtact.load_sensor(small_block(tmp_path)), meshes)


def test_a_press_that_fails_is_marked_and_the_others_stand(sensor, meshes, tmp_path, monkeypatch):
    many = softtact.press.sensor.Sensor.press_many
    monkeypatch.setattr(softtact.press.sensor.Sensor, "press_many", lambda *given, **options: [
        InputError("no") if number == 1 else one for number, one in enumerate(many(*given, **options))])
    assert write_press_data(tmp_path / "f.h5", plan(sensor, meshes, presses=2), workers=1, label="") == 1
    assert arrays(tmp_path / "f.h5")["status"].tolist() == [1, 2]


def test_netcdf_has_names_and_units(sensor, meshes, tmp_path):
    write_press_data(tmp_path / "a.nc", plan(sensor, meshes, presses=2, fingers=2), form="netcdf", workers=1, label="")
    labelled = xarray.load_dataset(tmp_path / "a.nc", engine="h5netcdf")
    assert labelled.tactile_map.dims == ("press", "force", "finger", "row", "column") and labelled.force_n.attrs["units"] == "N"


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
    ("--presses 2 --seed -1 --out d.h5", "--seed -1: give 0 or more"),
    ("--presses 2 --out none/d.h5", "there is no folder none"),
    ("--presses 2 --out there.h5", "there is already a finished data set")])
def test_what_cannot_be_used_is_refused_and_leaves_nothing(more, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    trimesh.creation.box((8, 12, 5)).export("part.stl")
    (tmp_path / "there.h5").touch()
    assert main(f"dataset part.stl --unit mm --workers 1 {more}".split()) == 1
    assert said in capsys.readouterr().err and len(list(tmp_path.iterdir())) == 2
