"""Presses and trainings of a long study, kept in small files and put back: what later stages read is the same."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import xarray

from softtact.errors import InputError
from softtact.files import read_dataset, write_dataset
from softtact.studies.jobs import Job

ROOT = Path(__file__).parents[2]


@pytest.fixture
def script(tmp_path, monkeypatch):
    """The script, whose records lie in a folder of the test."""
    spec = importlib.util.spec_from_file_location("keep_presses", ROOT / "scripts/keep_presses.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "RECORD", tmp_path / "record")
    return module


def jobs(folder, **settings):
    """A drawn object, and its press."""
    return [Job("draw_object", {}, {"mesh": f"{folder}/ball.stl"}),
            Job("press", {}, {"press": f"{folder}/{{model}}/{{item}}.nc"}, {"forces_n": [5, 10], **settings},
                {"model": "a", "item": "ball"})]


def pressed(job):
    """A press of two load steps, of which the second was not reached; its data set and its file."""
    y, x = np.linspace(-18.5, 18.5, 57), np.linspace(-11, 11, 33)
    maps = np.stack([0.3 * np.exp(-(x / 3)**2 - (y[:, None] / 4)**2), np.full((57, 33), np.nan)])
    data = xarray.Dataset({"deformation_map_mm": (("step", "y", "x"), maps, {"units": "mm"}),
                           "displacement_mm": (("step", "y", "x", "axis"), np.zeros((2, 57, 33, 3))),
                           "tactile_map": (("step", "row", "column"), np.arange(56.0).reshape(2, 7, 4)),
                           "converged": ("step", np.array([1, 0], np.int8)),
                           "validity_reason": ("step", np.array(["", "the load step was not reached"]))},
                          coords={"x": x, "y": y}, attrs={"model": "a", "wall_time_s": np.array([3.0, np.nan]), "tips_bonded": 1})
    path = Path(job.made()["press"])
    path.parent.mkdir(parents=True, exist_ok=True)
    write_dataset(path, data, seed=None, settings=job.settings)
    return read_dataset(path), path


def test_a_press_comes_back_with_its_map_rounded_to_a_tenth_of_a_micrometre_and_all_else_as_it_was(script, tmp_path):
    _, job = made = jobs(tmp_path)
    before, path = pressed(job)
    assert script.keep(made, "study") == 1 and script.keep(made, "study") == 0
    assert list(script.commits("study").values()) == [1] and not script.commits("another study")
    path.unlink()
    (tmp_path / "ball.stl").touch()
    assert script.restore(made, "study") == (1, 0)
    after = read_dataset(path)
    np.testing.assert_allclose(after.deformation_map_mm, before.deformation_map_mm, rtol=0, atol=5.1e-5)     # nan stays nan
    assert after.attrs.pop("commit")
    left = before.drop_vars(["displacement_mm", "deformation_map_mm"])
    xarray.testing.assert_identical(after.drop_vars("deformation_map_mm"), left)
    assert next((tmp_path / "record").rglob("*.npz")).stat().st_size < 0.25 * after.deformation_map_mm.nbytes


def test_a_press_of_other_settings_is_not_put_back(script, tmp_path):
    _, job = made = jobs(tmp_path)
    _, path = pressed(job)
    script.keep(made, "study")
    path.unlink()
    (tmp_path / "ball.stl").touch()
    assert script.restore(jobs(tmp_path, friction=0.3), "study") == (0, 1) and not path.exists()


def test_a_record_of_other_settings_is_replaced_by_the_press_of_these(script, tmp_path):
    for settings in ({}, {"friction": 0.3}):
        _, job = made = jobs(tmp_path, **settings)
        _, path = pressed(job)
        assert script.keep(made, "study") == 1
        path.unlink()
    (tmp_path / "ball.stl").touch()
    assert script.restore(made, "study") == (1, 0)


def test_presses_are_put_back_after_the_objects_are_drawn(script, tmp_path):
    """Else Snakemake draws them later, takes the presses for older, and makes them again."""
    with pytest.raises(InputError, match=r"ball.stl is missing, .* draw the study's objects before"):
        script.restore(jobs(tmp_path), "study")


def trainings(folder, **settings):
    """Two trainings from the same readings."""
    return [Job("learn", {"readings": f"{folder}/readings.nc", "maps": f"{folder}/maps.nc"},
                {"scores": f"{folder}/{{truth}}/{{model}}_{{network}}.csv"}, {"seeds": [seed], **settings},
                {"truth": "a", "model": "elastic", "network": f"printed_{seed}"}) for seed in range(2)]


def scored(job):
    """The scores of a training and their file."""
    path = Path(job.made()["scores"])
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("truth,seed,error_share\na,1,0.161524\na,1,1e-07\n")
    return path


def test_trainings_come_back_once_their_readings_are_there_and_unchanged(script, tmp_path):
    made = trainings(tmp_path)
    path = scored(made[1])
    assert script.keep_trainings(made, "study") == 1
    before = path.read_text()
    path.unlink()
    assert script.keep_trainings(made, "study") == 1 and script.restore_trainings(made, "study") == (0, 1) and not path.exists()
    for name in ("readings.nc", "maps.nc"):
        (tmp_path / name).touch()
    assert script.restore_trainings(trainings(tmp_path, batch=8), "study") == (0, 1)
    assert script.restore_trainings(made, "study") == (1, 0) and path.read_text() == before


def test_a_learning_curve_comes_back_after_the_training_at_its_end(script, tmp_path):
    """Else that training is made later, and the curve anew, though it was kept."""
    *_, training = trainings(tmp_path)
    curve = Job("trace_curve", training.inputs | {"whole": training.made()["scores"]}, {"curve": f"{tmp_path}/curve.csv"}, {},
                {"truth": "a", "model": "elastic", "network": "printed"})
    kept = [scored(training), Path(curve.made()["curve"])]
    kept[1].write_text("truth,share\na,0.5\n")
    assert script.keep_trainings([curve, training], "study") == 2
    before = [path.read_text() for path in kept]
    for path in kept:
        path.unlink()
    for name in ("readings.nc", "maps.nc"):
        (tmp_path / name).touch()
    assert script.restore_trainings([curve], "study") == (0, 1)
    assert script.restore_trainings([curve, training], "study") == (2, 0) and [path.read_text() for path in kept] == before
