"""`softtact predict`: a user's maps through a trained network, and what it refuses."""

import json

import numpy as np
import pandas as pd
import pytest
import torch
from formula_study import X, Y, bump, make_press, make_samples

from softtact.cli import main
from softtact.files import read_dataset, write_dataset
from softtact.learning.network import ARCHITECTURES, predict, save_network

SENSOR = {"map_shape": (57, 33), "taxels": (7, 4)}
SMALL = {"printed": {"filters": (2, 2, 2), "dense": 4}, "compact": {"filters": (2, 3, 4)}}


@pytest.fixture
def network(request):
    """A small network: the compact one, or the architecture that a test asks for."""
    torch.manual_seed(0)
    name = getattr(request, "param", "compact")
    return ARCHITECTURES[name](**SENSOR, **SMALL[name], map_scale_mm=0.4, count_scale=1200)


@pytest.fixture
def model(network, tmp_path):
    """The file of a network that was trained on elastic maps from 0.05 to 0.5 mm at 5 to 40 N."""
    seen = {"map_max_mm": [0.05, 0.5], "force_n": [5.0, 40.0]}
    facts = {"model": "elastic", "source": "virtual sensor", "seed": 1, "range": seen}
    save_network(tmp_path / "model.pt", network, facts=facts)
    return tmp_path / "model.pt"


@pytest.fixture
def press(tmp_path):
    """A press of three load steps, as `softtact press` writes it."""
    return write_press(tmp_path / "press.nc")


def write_press(path, **changes):
    data = make_press("grasps", "object_1", "elastic", seed=0)
    data.deformation_map_mm.attrs["units"] = "mm"
    write_dataset(path, data.assign(changes), seed=0, settings={})
    return path


def run(capsys, *arguments):
    """(exit status, stdout, stderr) of the command."""
    status = main(["predict", *map(str, arguments)])
    said = capsys.readouterr()
    return status, said.out, said.err


@pytest.mark.parametrize("network", SMALL, indirect=True)
def test_every_force_of_a_press_is_predicted_in_counts(capsys, network, model, press):
    status, out, err = run(capsys, press, "--network", model, "--json")
    told = json.loads(out)
    assert (status, err, told["warnings"]) == (0, "", [])
    assert told["force_n"] == [10, 20, 30] and told["network"]["architecture"] == network.architecture
    assert np.array(told["tactile_map"]) == pytest.approx(predict(network, read_dataset(press).deformation_map_mm.values), rel=1e-6)


@pytest.mark.parametrize("write", [np.save, lambda path, values: np.savetxt(path.with_suffix(".csv"), values, delimiter=",")])
def test_a_map_alone_may_be_an_array_or_a_table(capsys, network, model, tmp_path, write):
    write(tmp_path / "map.npy", bump(0))
    path = next(iter(tmp_path.glob("map.*")))
    status, out, _ = run(capsys, path, "--network", model, "--json")
    told = json.loads(out)
    assert status == 0 and told["force_n"] is None
    assert np.array(told["tactile_map"]) == pytest.approx(predict(network, bump(0)[None]), rel=1e-6)


def test_counts_are_written_as_netcdf_and_csv_and_drawn(capsys, network, model, press, tmp_path):
    expected = predict(network, read_dataset(press).deformation_map_mm.values)
    for name in ("taxels.nc", "taxels.csv"):
        status, out, _ = run(capsys, press, "--network", model, "--out", tmp_path / name, "--plot", tmp_path / "taxels.png")
        assert status == 0 and out.count(" N (deepest") == 3
    data = read_dataset(tmp_path / "taxels.nc")
    assert data.tactile_map.values == pytest.approx(expected) and data.force_n.values.tolist() == [10, 20, 30]
    assert data.attrs["source"] == "network trained on: virtual sensor"
    table = pd.read_csv(tmp_path / "taxels.csv")
    assert table.columns.tolist() == ["map", "force_n", "row", "column", "counts"] and len(table) == 3 * 28
    one = table[(table.force_n == 20) & (table.row == 6) & (table.column == 3)].counts.item()
    assert one == pytest.approx(expected[1, 6, 3], rel=1e-5)
    assert (tmp_path / "taxels.png").stat().st_size > 20_000


def test_what_training_has_not_seen_is_predicted_with_a_warning(capsys, model, tmp_path):
    for changes, sentence in [
        ({"deformation_map_mm": (("step", "y", "x"), np.stack([2 * bump(0)] * 3))},
         "3 of 3 maps lie outside the training maps' range, 0.05 to 0.5 mm deep at most"),
        ({"normal_force_n": ("step", [10.0, 20.0, 50.0])},
         "1 of 3 maps lie outside the training maps' range, 5 to 40 N (the first with 50)"),
        ({"within_validity": ("step", [1, 1, 0])}, "1 of 3 load steps are outside the validity of the press' model"),
    ]:
        status, out, err = run(capsys, write_press(tmp_path / "far.nc", **changes), "--network", model, "--json")
        assert status == 0 and err.count("\n") == 1 and sentence in err, changes
        assert sentence in json.loads(out)["warnings"][0], changes


def test_maps_of_another_model_than_the_networks_are_warned_of(capsys, model, tmp_path):
    data = make_press("grasps", "object_1", "hyperelastic", seed=0)
    write_dataset(tmp_path / "other.nc", data, seed=0, settings={})
    status, _, err = run(capsys, tmp_path / "other.nc", "--network", model)
    assert status == 0 and "the maps are of the model hyperelastic and the network was trained on elastic" in err


def test_a_network_from_before_ranges_were_kept_warns_of_nothing(capsys, network, press, tmp_path):
    save_network(tmp_path / "old.pt", network, facts={"model": "elastic"})
    assert run(capsys, press, "--network", tmp_path / "old.pt")[2] == ""


def spoiled(values, kind):
    values[3, 3] = kind
    return values


def test_a_file_that_holds_no_map_is_refused(capsys, model, tmp_path):
    for name, values, sentence in [
        ("a.npy", bump(0).T, "its map has 33 x 57 values and the network needs 57 x 33 (y, x); it is transposed"),
        ("a.npy", np.stack([bump(0)] * 2), "it holds 3-dimensional float64 values; give one map"),
        ("a.npy", spoiled(bump(0), np.nan), "it holds values that are not finite"),
        ("a.npy", np.array([{}], dtype=object), "not an array of numbers"),
        ("a.csv", "x,y\n1,2\n", "not a table of numbers"),
        ("a.txt", "1,2\n", "maps are read from .nc, .npy, .csv"),
        ("a.nc", "no NetCDF", "not a readable NetCDF file"),
    ]:
        if isinstance(values, str):
            (tmp_path / name).write_text(values)
        else:
            np.save(tmp_path / name, values, allow_pickle=True)
        status, out, err = run(capsys, tmp_path / name, "--network", model, "--out", tmp_path / "taxels.nc")
        assert (status, out, err.count("\n")) == (1, "", 1), name
        assert sentence in err and not (tmp_path / "taxels.nc").exists(), name


def test_a_press_that_may_not_be_used_is_refused(capsys, model, tmp_path):
    for changes, sentence in [
        ({"deformation_map_mm": (("step", "y", "x"), np.zeros((3, 57, 33)), {"units": "m"})},
         "its maps are in 'm'; give them in mm"),
        ({"deformation_map_mm": (("sample", "y", "x"), np.zeros((3, 57, 33)))}, "not a press with deformation_map_mm (step, y, x)"),
        ({"converged": ("step", [1, 1, 0])}, "a load step of the press did not converge"),
    ]:
        status, _, err = run(capsys, write_press(tmp_path / "p.nc", **changes), "--network", model)
        assert status == 1 and sentence in err and err.count("\n") == 1, changes


def test_a_wrong_path_is_refused_in_one_sentence(capsys, model, press):
    for arguments, sentence in [
        (["none.nc", "--network", "{model}"], "none.nc: there is no such file"),
        (["{press}", "--network", "none.pt"], "none.pt: there is no such file"),
        (["{press}", "--network", "{press}"], "not a network's file"),
        (["{press}", "--network", "{model}", "--out", "taxels.xlsx"], "taxels are written as .nc or .csv"),
        (["{press}", "--network", "{model}", "--out", "no/such/taxels.nc"], "there is no folder no/such"),
    ]:
        status, out, err = run(capsys, *(text.format(model=model, press=press) for text in arguments))
        assert (status, out, err.count("\n")) == (1, "", 1) and sentence in err, arguments


def test_the_range_of_the_formulas_maps_is_what_they_span():
    samples = make_samples(5)
    assert len(X) == 33 and len(Y) == 57
    assert samples.range()["map_max_mm"] == pytest.approx([samples.maps_mm.max(axis=(1, 2)).min(), samples.maps_mm.max()])
