"""Nothing is tied to the paper's sensor: the example of a second one, lying, of other frusta, taxels and readout, in every part."""

from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
import yaml
from support.studies import merged

import softtact
from softtact.errors import InputError
from softtact.learning.network import ARCHITECTURES
from softtact.models.elastic.compliance import elastic_compliance
from softtact.models.foundation.compliance import foundation_compliance
from softtact.readout.capacitance import ideal_counts
from softtact.readout.virtual_sensor import read_virtual_sensor
from softtact.sensors.library import sensor_file
from softtact.studies.hybrid.config import load_study

ROOT = Path(__file__).resolve().parents[1]
MAP, TAXELS, FORCES = (13, 21), (3, 5), [2.0, 6.0]


@pytest.fixture(autouse=True)
def in_project(monkeypatch):
    monkeypatch.chdir(ROOT)


@pytest.fixture(scope="module")
def pad():
    """A piece of the second sensor, 10 x 6 frusta: all of it would take a minute to prepare."""
    sensor = softtact.load_sensor("pad")
    sensor.spec = sensor.spec.model_copy(update={"footprint_mm": (16.5, 10.0), "map_shape": MAP})
    law, cover = sensor.laws["dielectric"], sensor.laws["cover"]
    sensor.prepared_models = {"elastic": elastic_compliance(sensor.spec),
                              "foundation": foundation_compliance(sensor.spec, dielectric_law=law, cover_law=cover)}
    return sensor


@pytest.fixture(scope="module")
def pressed(pad):
    """Both fast models pressed with a block, by name."""
    block = trimesh.creation.box((5.0, 4.0, 3.0))
    return {model: pad.press(block, force_n=FORCES, model=model, threads=1) for model in ("elastic", "foundation")}


def changed(tmp_path, **values):
    """The file of a sensor like the second one but for some values."""
    path = tmp_path / "mine.yaml"
    path.write_text(yaml.safe_dump(yaml.safe_load(sensor_file("pad").read_text()) | values))
    return str(path)


def test_its_study_says_but_its_sensor_and_the_forces_on_its_whole_width_and_takes_the_readouts_range_from_it():
    study = load_study(merged("second_sensor"))
    own, tiny = (yaml.safe_load((ROOT / f"config/{name}.yaml").read_text()) for name in ("second_sensor", "tiny"))
    own["ftir"].pop("forces_n"), tiny["ftir"].pop("forces_n")
    assert own.pop("section") == {"force_n": 40}
    assert own == tiny | {"study": "second_sensor", "sensor": "pad"}
    assert study.spec.frusta_counts == (18, 12) and study.values.ssim.data_range == study.spec.largest_counts == 3000


@pytest.mark.slow
@pytest.mark.parametrize("model", ["elastic", "foundation"])
def test_a_press_has_its_maps_and_taxels_and_is_deepest_under_the_object(pressed, model):
    result = pressed[model]
    assert result.deformation_map_mm.shape == (2, *MAP) and result.tactile_map.shape == (2, *TAXELS)
    assert (np.diff(result.indentation_mm) > 0).all() and result.converged.all()
    maps = result.deformation_map_mm[-1]
    assert maps == pytest.approx(maps[::-1], abs=2e-3 * maps.max()) and maps == pytest.approx(maps[:, ::-1], abs=2e-3 * maps.max())
    under = (np.abs(result.x_mm) < 2)[None] & (np.abs(result.y_mm) < 2)[:, None]
    assert maps[under].min() > 2 * maps[~under].mean()
    assert result.tactile_map[-1].argmax() == 7          # row 1, column 2: the middle one


def test_both_fast_models_displace_a_like_volume(pressed):
    elastic, foundation = (pressed[model].deformation_map_mm[-1].mean() for model in ("elastic", "foundation"))
    assert 0.5 < elastic / foundation < 2


def test_the_hyperelastic_body_has_its_frusta(pad):
    assert pad.body().support.count == 10 * 6


@pytest.mark.parametrize("architecture", ARCHITECTURES)
def test_a_networks_layers_follow_its_map_and_taxels(architecture, pressed):
    torch.manual_seed(0)
    small = {"filters": (2, 3, 4)} | ({"dense": 6} if architecture == "printed" else {})
    network = ARCHITECTURES[architecture](map_shape=MAP, taxels=TAXELS, **small)
    if architecture == "printed":
        assert network.hidden.in_features == 4 * (13 - 6) * (21 - 6)
    maps = torch.as_tensor(pressed["foundation"].deformation_map_mm, dtype=torch.float32)
    assert network(maps).shape == (2, *TAXELS)


def test_the_virtual_sensor_reads_its_taxels_up_to_its_own_largest_count(pad, pressed):
    maps = 2.0 * pressed["foundation"].deformation_map_mm
    read = read_virtual_sensor(pad.spec, maps, force_n=FORCES, trials=2, seed=1, item="square")
    assert read.shape == (2, 2, *TAXELS)
    deep = read_virtual_sensor(pad.spec, 0 * maps + 1.1, force_n=FORCES, trials=1, seed=1, item="deep")
    assert deep.max() == 3000 == ideal_counts(pad.spec, 0 * maps + 1.1).max()


def test_its_press_is_drawn_to_the_range_of_its_data_or_of_its_own_readout(pressed):
    result = pressed["elastic"]
    for full_scale, highest in ((True, 3000), (False, result.tactile_map.max())):
        figure = result.plot(full_scale=full_scale)
        assert [axes.get_images()[0].get_clim()[1] for axes in figure.axes[2:4]] == [highest, highest]
        written = [text.get_text() for text in figure.axes[2].texts]
        assert written == [f"{value:.0f}" for value in result.tactile_map[0].ravel()]


def test_each_point_of_a_drawn_map_lies_in_the_middle_of_its_cell(pressed):
    result = pressed["elastic"]
    axes = result.plot().axes[0]
    for (low, high), points in zip(np.reshape(axes.get_images()[0].get_extent(), (2, 2)), (result.x_mm, result.y_mm), strict=True):
        edges = np.linspace(low, high, len(points) + 1)
        assert 0.5 * (edges[1:] + edges[:-1]) == pytest.approx(points)
    assert axes.get_xlim() == pytest.approx((result.x_mm[0], result.x_mm[-1]))


@pytest.mark.parametrize(("values", "said"), [
    ({"map_shape": [30, 45]}, "has no middle row and column"),
    ({"footprint_mm": [30.0, 21.0]}, "18 x 13 frusta has a row in the middle"),
    ({"taxels": {"rows": 2, "columns": 5}}, "window is 3; it must fit on the 2 taxels"),
    ({"map_shape": [7, 9]}, "layers take up to 8 rows and columns, and the map has 7"),
])
def test_a_study_refuses_at_its_start_a_sensor_that_a_model_or_network_would_refuse_later(values, said, tmp_path):
    with pytest.raises(InputError, match=said):
        load_study(merged("second_sensor") | {"sensor": changed(tmp_path, **values)})
