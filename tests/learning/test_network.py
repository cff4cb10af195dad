"""The printed network, the compact one, and what their files may hold."""

import pickle

import numpy as np
import pytest
import torch
from formula_study import TINY

from softtact.errors import InputError
from softtact.learning.network import (
    CompactNetwork,
    TactileNetwork,
    load_network,
    predict,
    save,
    save_network,
    summed_l1,
    taxel_weights,
)

SENSOR = {"map_shape": (57, 33), "taxels": (7, 4)}


@pytest.fixture
def printed():
    with torch.device("meta"):  # shapes without 377 MB of weights
        return TactileNetwork(**SENSOR)


@pytest.fixture
def tiny():
    torch.manual_seed(0)
    return TactileNetwork(**SENSOR, **TINY, map_scale_mm=0.4, count_scale=1200)


def test_the_printed_layers_have_the_printed_shapes(printed):
    shapes, x = [], torch.empty(2, 1, 57, 33, device="meta")
    for layer in printed.features:
        x = layer(x)
        shapes.append(tuple(x.shape[1:]))
    assert shapes == [(80, 56, 32), (80, 56, 32), (80, 55, 31), (95, 54, 30), (95, 54, 30), (95, 53, 29),
                      (120, 52, 28), (120, 52, 28), (120, 51, 27)]
    assert [type(layer).__name__ for layer in printed.features] == ["Conv2d", "ReLU", "MaxPool2d"] * 3
    assert (printed.hidden.in_features, printed.hidden.out_features) == (120 * 51 * 27, 570)
    assert (printed.output.in_features, printed.output.out_features) == (570, 28)
    assert printed(torch.empty(2, 57, 33, device="meta")).shape == (2, 7, 4)


def test_the_printed_network_has_94_3_million_weights(printed):
    by_hand = (4 + 1) * 80 + (4 * 80 + 1) * 95 + (4 * 95 + 1) * 120 + (120 * 51 * 27 + 1) * 570 + (570 + 1) * 28
    assert sum(weight.numel() for weight in printed.parameters()) == by_hand == 94_279_973


def test_the_loss_is_summed_over_taxels_and_averaged_over_maps():
    measured = torch.zeros(2, 7, 4)
    predicted = torch.zeros(2, 7, 4)
    predicted[0, 0, 0], predicted[0, 6, 3], predicted[1, 3, 2] = 10.0, -4.0, 6.0
    assert summed_l1(predicted, measured).item() == (10 + 4 + 6) / 2


def test_the_output_is_linear_so_a_count_may_be_negative(tiny):
    with torch.no_grad():
        tiny.output.weight.zero_()
        tiny.output.bias.fill_(-0.5)
    assert predict(tiny, np.zeros((1, 57, 33))) == pytest.approx(np.full((1, 7, 4), -600))


def test_scales_are_units_inside_and_do_not_show_outside(tiny):
    twice = TactileNetwork(**SENSOR, **TINY, map_scale_mm=0.8, count_scale=2400)
    twice.load_state_dict({**tiny.state_dict(), "map_scale_mm": torch.tensor(0.8), "count_scale": torch.tensor(2400.0)})
    maps = np.random.default_rng(0).random((3, 57, 33))
    assert predict(twice, 2 * maps) == pytest.approx(2 * predict(tiny, maps), rel=1e-5)


def test_a_linear_activation_is_a_choice():
    network = TactileNetwork(**SENSOR, **{**TINY, "activation": "linear"})
    assert not any(isinstance(layer, torch.nn.ReLU) for layer in network.features)


@pytest.fixture
def compact():
    torch.manual_seed(0)
    return CompactNetwork(**SENSOR, map_scale_mm=0.4, count_scale=1200)


def test_the_compact_layers_have_the_documented_shapes(compact):
    shapes, x = [], torch.zeros(2, 1, 57, 33)
    for layer in compact.features[::2]:
        x = layer(x)
        shapes.append(tuple(x.shape[1:]))
    assert shapes == [(16, 57, 33), (32, 29, 17), (64, 29, 17)]
    assert (compact.rows @ x @ compact.columns.T).shape == (2, 64, 7, 4)
    assert compact(torch.zeros(2, 57, 33)).shape == (2, 7, 4)


def test_the_compact_network_has_60_thousand_weights(compact):
    by_hand = (9 + 1) * 16 + (9 * 16 + 1) * 32 + (9 * 32 + 1) * 64 + (9 * 64 + 1) * 64 + (64 + 1) + 2 * 28
    assert sum(weight.numel() for weight in compact.parameters()) == by_hand == 60_345


def test_taxel_means_are_exact_for_what_is_linear_over_the_sensor():
    for points, parts in [(29, 7), (17, 4), (12, 5)]:
        weights, x = taxel_weights(points, parts), np.linspace(0, 1, points)
        assert weights.sum(axis=1) == pytest.approx(np.ones(parts)), points
        assert weights @ x == pytest.approx((np.arange(parts) + 0.5) / parts), points
        assert (weights >= 0).all()
        assert weights.sum(axis=0) * (points - 1) / parts == pytest.approx([0.5, *np.ones(points - 2), 0.5]), points


def test_away_from_the_borders_only_the_compact_networks_affine_map_knows_where_a_taxel_lies(compact):
    level = predict(compact, np.full((1, 57, 33), 0.2))[0]
    assert level[2:5, 1] == pytest.approx(np.full(3, level[3, 1]), rel=1e-4)    # equally far from the zero padding
    with torch.no_grad():
        compact.gain[3, 1], compact.offset[3, 1] = 2.0, 0.01
    changed = predict(compact, np.full((1, 57, 33), 0.2))[0]
    assert changed[3, 1] == pytest.approx(2 * level[3, 1] + 12, rel=1e-4)
    assert np.array_equal(np.delete(changed, 13), np.delete(level, 13))


def test_a_map_that_cannot_be_halved_with_its_borders_is_refused():
    with pytest.raises(InputError, match="a map of 56 x 33 points cannot be halved .* give odd sides"):
        CompactNetwork(map_shape=(56, 33), taxels=(7, 4))


def test_either_architecture_is_loaded_from_its_own_file(compact, tiny, tmp_path):
    for network in (compact, tiny):
        path = tmp_path / f"{network.architecture}.pt"
        save_network(path, network, facts={"model": "elastic"})
        loaded, _ = load_network(path)
        maps = np.random.default_rng(0).random((3, 57, 33))
        assert type(loaded) is type(network) and np.array_equal(predict(loaded, maps), predict(network, maps))


def test_a_file_from_before_there_were_two_architectures_holds_the_printed_one(tiny, tmp_path):
    save(tmp_path / "model.pt", {"options": tiny.options, "weights": tiny.state_dict(), "facts": {}})
    assert isinstance(load_network(tmp_path / "model.pt")[0], TactileNetwork)


def test_a_file_of_something_else_is_refused(tmp_path):
    for stored in [{"owner": "a checkpoint"}, [1, 2],
                   {"architecture": "drawn", "options": {}, "weights": {}, "facts": {}},
                   {"options": {"layers": 3}, "weights": {}, "facts": {}},
                   {"options": {"map_shape": [57, 33], "taxels": [7, 4], **TINY}, "weights": {}, "facts": {}}]:
        save(tmp_path / "model.pt", stored)
        with pytest.raises(InputError, match="it holds no network of printed, compact .* give a model.pt"):
            load_network(tmp_path / "model.pt")


def test_a_saved_network_predicts_the_same_and_keeps_its_facts(tiny, tmp_path):
    save_network(tmp_path / "model.pt", tiny, facts={"model": "elastic", "epoch": 4})
    network, facts = load_network(tmp_path / "model.pt")
    maps = np.random.default_rng(0).random((3, 57, 33))
    assert np.array_equal(predict(network, maps), predict(tiny, maps))
    assert facts["model"] == "elastic" and facts["epoch"] == 4


def test_the_same_network_gives_the_same_bytes_under_any_name(tiny, tmp_path):
    for name in ("a.pt", "other/b.pt"):
        save_network(tmp_path / name, tiny, facts={})
    assert (tmp_path / "a.pt").read_bytes() == (tmp_path / "other/b.pt").read_bytes()


class Opens:
    """A pickle that would run code on loading."""

    def __reduce__(self):
        return open, ("stolen", "w")


def test_a_file_that_is_no_network_is_refused_and_runs_nothing(tmp_path, monkeypatch):
    for content in [pickle.dumps(Opens(), protocol=2), b"", b"not a network"]:
        monkeypatch.chdir(tmp_path)
        (tmp_path / "model.pt").write_bytes(content)
        with pytest.raises(InputError, match="not a network's file"):
            load_network(tmp_path / "model.pt")
        assert not (tmp_path / "stolen").exists(), content


def test_a_missing_file_is_refused_with_the_remedy(tmp_path):
    with pytest.raises(InputError, match=r"model.pt: there is no such file; train"):
        load_network(tmp_path / "model.pt")


def test_equal_maps_are_predicted_once_and_returned_each_time(tiny, monkeypatch):
    maps = np.random.default_rng(3).uniform(0, 0.3, (3, 57, 33))
    expected, seen, forward = predict(tiny, maps), [], type(tiny).forward
    monkeypatch.setattr(type(tiny), "forward", lambda self, part: seen.append(len(part)) or forward(self, part))
    assert (predict(tiny, maps[[0, 2, 2, 1, 0]]) == expected[[0, 2, 2, 1, 0]]).all()
    assert sum(seen) == 3
