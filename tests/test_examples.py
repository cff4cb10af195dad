"""The programs in examples/ run as their docstrings say, on less."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from softtact.files import read_dataset

ROOT = Path(__file__).resolve().parents[1]
OBJECT = ROOT / "config/objects/indenters/circle_s.stl"


@pytest.fixture(autouse=True)
def in_project(monkeypatch):
    monkeypatch.chdir(ROOT)


def run(name, *arguments):
    return runpy.run_path(str(ROOT / f"examples/{name}.py"))["main"]([str(argument) for argument in arguments])


def test_press_a_mesh_prints_a_line_a_force_and_draws(tmp_path, capsys):
    result = run("press_a_mesh", OBJECT, "--unit", "mm", "--force", 5, 20, "--out", tmp_path / "p.png")
    assert result.tactile_map.shape == (2, 7, 4) and (tmp_path / "p.png").stat().st_size > 0
    assert capsys.readouterr().out.count(" N: ") == 2


@pytest.mark.slow
def test_higher_frusta_gain_more_per_pressure_and_every_curve_flattens(tmp_path):
    table = run("sweep_frustum_height", "--heights", 0.4, 0.6, "--out", tmp_path / "h.svg")
    low, high = (table[table.height_mm == height] for height in (0.4, 0.6))
    assert (high.gain > low.gain).all()
    for rows in (low, high):
        assert (np.diff(rows.gain) > 0).all() and rows.gain.iloc[-1] / rows.gain.iloc[0] < 100 / 2
    assert "relative gain of capacitance" in (tmp_path / "h.svg").read_text()


def test_a_training_set_pairs_each_map_with_a_reading_of_the_virtual_sensor(tmp_path):
    run("make_training_set", "--presses", 2, "--workers", 1, "--out", tmp_path / "set.nc")
    data = read_dataset(tmp_path / "set.nc")
    assert data.deformation_map_mm.shape == (8, 57, 33) and data.tactile_map.shape == (8, 7, 4)
    assert data.attrs["source"] == "virtual sensor"
    deepest, most = data.deformation_map_mm.values.max(axis=(1, 2)), data.tactile_map.values.max(axis=(1, 2))
    assert (np.diff(deepest.reshape(2, 4)) > 0).all() and (np.diff(most.reshape(2, 4)) > 0).all()


def test_the_robot_loop_feels_where_the_object_is_and_says_that_it_is_no_robot(capsys):
    last = run("robot_loop", "--steps", 1, "--batch", 2)
    assert last.shape == (2, 7, 4) and "no robot" in capsys.readouterr().out
    example = runpy.run_path(str(ROOT / "examples/robot_loop.py"))
    feel = example["TactileSensor"](*loaded())
    ends = feel([[0, -8, 0, 0, 0, 0], [0, 8, 0, 0, 0, 0]], force_n=15.0)
    rows = example["centre_of_touch"](ends)[:, 0]
    assert rows[0] < 0.35 and rows[1] > 0.65


@pytest.mark.slow
def test_a_small_network_learns_the_grip_s_force_from_the_taxels(tmp_path):
    pytest.importorskip("mujoco", reason="pip install 'softtact[robot]'")
    errors = run("learn_grip_force", "--episodes", 12, "--out", tmp_path / "force.png")
    assert errors["network"] < 0.5 * errors["mean force"] and (tmp_path / "force.png").stat().st_size > 0


def test_sensors_on_a_gripper_of_one_s_own_read_the_force_of_its_motors(tmp_path):
    pytest.importorskip("mujoco", reason="pip install 'softtact[robot]'")
    readings = run("attach_to_a_gripper", "--force", 8, "--out", tmp_path / "gripper.png")
    assert [-reading.force_n[2] for reading in readings] == pytest.approx([8.0, 8.0], rel=0.01)
    assert (tmp_path / "gripper.png").stat().st_size > 0


def loaded():
    import softtact
    from softtact.geometry.meshes import read_mesh

    return softtact.load_sensor("coro"), read_mesh(OBJECT, unit="mm")


@pytest.mark.slow
def test_a_thinner_skin_answers_more_on_a_taxel_than_beside_it(capsys):
    table = run("skin_of_your_own", "--thickness", 1, 3)
    assert (table.on_ff > table.beside_ff).all() and table.on_ff.iloc[0] > table.on_ff.iloc[1]
    assert capsys.readouterr().out.count("fF on the taxel") == 2
