"""The stage writes what data sets are built from, and the study on an archive goes through to its scores."""

import json

import numpy as np
import pandas as pd
import pytest
from small_archive import Archive
from support.sensors import CORO

from softtact.errors import InputError
from softtact.files import read_dataset
from softtact.learning.dataset import read_samples
from softtact.studies.hybrid.stages import build_dataset, import_published

SPLITS = ("train", "validation", "unseen", "grasps")


def settings_for(folder, **changes):
    sensor = CORO.model_dump(mode="json")
    return {"folder": str(folder), "variant": None, "models": ["elastic", "hyperelastic"], "unseen": ["donut_m"],
            "without": [], "taxel_order": "rows", "outliers": "leave_out", "largest_outlier_share": 0.1, "sensor": sensor,
            "seed": 5} | changes


def run_import(folder, results, **changes):
    outputs = {"presses": results / "presses", "tactile": results / "tactile", "item_list": results / "items.json",
               "inventory": results / "inventory.json", "counts": results / "counts.csv", "outliers": results / "outliers.csv"}
    import_published.run(inputs={}, outputs=outputs, settings=settings_for(folder, **changes))
    return outputs


@pytest.fixture(scope="module")
def imported(tmp_path_factory):
    """A generated archive, its folder, and what the stage made of it."""
    folder = tmp_path_factory.mktemp("archive")
    archive = Archive()
    return archive, run_import(archive.write(folder / "csv"), folder / "results")


def test_every_object_has_its_maps_and_readings_with_the_forces_of_its_tests(imported):
    archive, outputs = imported
    press = read_dataset(outputs["presses"] / "indenters/echo_h/hyperelastic.nc")
    reading = read_dataset(outputs["tactile"] / "indenters/echo_h.nc")
    assert dict(press.sizes) == {"step": 10, "y": 57, "x": 33}
    assert list(np.unique(press.path)) == ["EchoH/test_0", "EchoH/test_1"]
    assert np.array_equal(press.normal_force_n, reading.force_n)
    assert reading.tactile_map.shape == (1, 10, 7, 4)
    assert press.attrs["source"] == reading.attrs["source"] == "published archive"
    real = archive.real["Flat"]
    own = real[real.Path == "EchoH/test_1"]
    assert np.array_equal(reading.tactile_map.values[0, 5:].reshape(5, 28), np.float32(own.iloc[:, 1:29]))


def test_row_0_of_a_map_lies_at_the_most_negative_y(imported):
    archive, outputs = imported
    press = read_dataset(outputs["presses"] / "grasps/mug/elastic.nc")
    frame = archive.maps["Curved", "elastic"]
    assert press.y.values[0] == -18.5 and press.x.values[0] == -11
    assert np.array_equal(press.deformation_map_mm.values[0], np.float32(frame.iloc[:57, :33]))


def test_objects_go_to_the_sets_that_the_configuration_tells(imported):
    items = {}
    for entry in json.loads(imported[1]["item_list"].read_text()):
        items.setdefault(entry["set"], set()).add(entry["item"])
    assert items == {"indenters": {"circle_g", "echo", "echo_h", "cruz", "bordes_h"}, "unseen": {"donut_m"},
                     "grasps": {"mug", "big_ball"}}


def test_the_inventory_tells_how_the_archive_was_read(imported):
    facts = json.loads(imported[1]["inventory"].read_text())
    assert (facts["tests"], facts["tests_used"], facts["tests_left_out"]) == (16, 16, 0)
    assert facts["taxel_order"]["best"] == facts["taxel_order"]["read_as"] == "rows"
    assert list(pd.read_csv(imported[1]["counts"]).columns) == ["what", "where", "printed", "found", "meets"]


def test_outliers_are_left_out_of_the_files_and_listed_in_the_report(tmp_path):
    archive = Archive()
    archive.maps["Flat", "elastic"] = archive.maps["Flat", "elastic"].iloc[1:]
    outputs = run_import(archive.write(tmp_path / "csv"), tmp_path / "results")
    (outliers,) = pd.read_csv(outputs["outliers"]).to_dict("records")
    assert (outliers["file"], outliers["row"], outliers["path"], outliers["done"]) == ("Flat_Simulation_Isaac.csv", 2,
                                                                                       "CircleG/test_0", "left out")
    assert set(read_dataset(outputs["tactile"] / "indenters/circle_g.nc").path.values) == {"CircleG/test_1"}


def test_a_test_and_an_object_may_be_left_aside(tmp_path):
    folder = Archive().write(tmp_path / "csv")
    outputs = run_import(folder, tmp_path / "results", without=["Echo/test_0", "big_ball"])
    assert not (outputs["tactile"] / "grasps/big_ball.nc").exists()
    assert set(read_dataset(outputs["tactile"] / "indenters/echo.nc").path.values) == {"Echo/test_1"}
    assert json.loads(outputs["inventory"].read_text())["tests_used"] == 13
    with pytest.raises(InputError, match="no usable test and no object 'Echoo'"):
        run_import(folder, tmp_path / "results", without=["Echoo"])


def test_a_second_import_leaves_nothing_of_the_first(imported, tmp_path):
    first = run_import(Archive(curved=("Mug", "Cup")).write(tmp_path / "a"), tmp_path / "results")
    assert (first["tactile"] / "grasps/cup.nc").exists()
    run_import(Archive().write(tmp_path / "b"), tmp_path / "results")
    assert not (first["tactile"] / "grasps/cup.nc").exists()


def test_a_sensor_of_another_grid_is_refused(tmp_path):
    sensor = settings_for(tmp_path)["sensor"] | {"taxels": {"rows": 4, "columns": 4}}
    with pytest.raises(InputError, match="16 taxels and maps of 57 x 33; the archive is of 28"):
        run_import(tmp_path, tmp_path / "results", sensor=sensor)


def test_data_sets_are_built_from_what_was_imported(imported, tmp_path):
    archive, made = imported
    models = ["elastic", "hyperelastic"]
    outputs = {split: [tmp_path / model / f"{split}.nc" for model in models] for split in SPLITS}
    outputs["manifest"] = tmp_path / "manifest.csv"
    build_dataset.run(inputs={name: made[name] for name in ("presses", "tactile", "item_list")}, outputs=outputs,
                      settings={"models": models, "train_fraction": 0.8, "seed": 3})
    samples = {split: read_samples(outputs[split][1]) for split in SPLITS}
    assert [len(samples[split]) for split in SPLITS] == [40, 10, 10, 20]
    assert {one.source for one in samples.values()} == {"published archive"}
    # The formula behind the archive ties each reading to its own map: 0.8 of the elastic map that it was made from.
    for one in samples.values():
        maps = one.maps_mm / 0.8
        expected = 3000 * maps[:, :56, :32].reshape(-1, 7, 8, 4, 8).mean(axis=(2, 4))
        assert np.allclose(one.counts, expected, atol=0.02)
