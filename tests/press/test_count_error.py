"""The expected error of a fast model in counts: what the hyperelastic model would read."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.sensors import CORO

from softtact.commands.press_summary import _table_on_layers
from softtact.press.count_error import ELASTIC, FOUNDATION, hyperelastic_counts, mean_depth
from softtact.press.result import PressResult, read_press
from softtact.readout.capacitance import ideal_counts
from softtact.readout.registry import labelled


def press(depth_mm, model="elastic", read=None):
    """A result of level maps of these depths (l,), with the counts that they read."""
    maps = np.asarray(depth_mm)[:, None, None] * np.ones((1, *CORO.map_shape))
    counts = ideal_counts(CORO, maps) if read is None else read
    number = np.zeros(len(maps))
    names = ("indentation_mm", "contact_area_mm2", "penetration_mm", "frustum_compression_mm", "residual_n",
             "extrapolated_volume_fraction", "iterations", "converged", "within_validity", "wall_time_s")
    return PressResult(deformation_map_mm=maps, readings={"taxels": labelled(counts, ("step", "row", "column"), units="counts")},
                       normal_force_n=np.arange(1.0, len(maps) + 1), x_mm=CORO.map_x_mm, y_mm=CORO.map_y_mm,
                       model=model, sensor="coro", solver="", **dict.fromkeys(names, number))


def read_at(depth, share):
    return ideal_counts(CORO, np.full(CORO.map_shape, (1 - share) * depth)).sum()


def test_what_the_hyperelastic_model_reads_is_the_reading_of_a_map_that_is_so_much_less_deep():
    """A level map's mean depth is its depth, and coro's dielectric is 1 mm thick: at 0.4 mm the share is a + 0.4 b."""
    expected = [[read_at(depth, ELASTIC.at_rest + depth * ELASTIC.per_thickness + left)
                 for left in (ELASTIC.above, 0.0, ELASTIC.below)] for depth in (0.05, 0.4)]
    assert hyperelastic_counts(CORO, press([0.05, 0.4])) == pytest.approx(np.array(expected), rel=1e-9)


def test_the_foundation_models_counts_have_its_own_shares_and_none_where_its_error_is_not_known():
    found = hyperelastic_counts(CORO, press([0.2, 0.2], "foundation"), FOUNDATION, np.array([True, False]))
    middle = FOUNDATION.at_rest + 0.2 * FOUNDATION.per_thickness
    shares = (middle + FOUNDATION.above, middle, middle + FOUNDATION.below)
    assert found[0] == pytest.approx([read_at(0.2, share) for share in shares], rel=1e-9)
    assert np.isnan(found[1]).all()


@pytest.mark.parametrize(("model", "error"), [("elastic", ELASTIC), ("foundation", FOUNDATION)])
def test_one_in_twenty_of_the_recorded_presses_is_below_the_interval_and_the_middle_is_theirs(model, error):
    rows = json.loads((Path(__file__).parents[2] / "benchmarks/results/count_errors.json").read_text())["rows"]
    left = np.array([row["gain_error"] - error.at_rest - error.per_thickness * row["mean_depth_mm"] for row in rows
                     if row["valid"] and row["model"] == model])
    assert 0.02 < np.mean(left < error.below) < 0.1 and np.mean(left > error.above) < 0.1
    assert abs(np.median(left)) < 0.004


def test_the_mean_depth_of_a_flat_punch_is_its_depth_whatever_its_area():
    one = np.zeros((2, 9, 9))
    one[0, 2:4], one[1, 2:8] = 0.3, 0.3
    assert mean_depth(one) == pytest.approx([0.3, 0.3]) and mean_depth(0 * one) == pytest.approx([0.0, 0.0])


def test_the_same_share_of_the_deformation_is_a_larger_share_of_the_counts_where_the_gap_closes():
    result = press([0.05, 0.4])
    result = replace(result, hyperelastic_counts=hyperelastic_counts(CORO, result))
    shallow, deep = result.expected_error_counts / result.tactile_map.sum(axis=(1, 2))
    assert deep > 1.2 * shallow > 0


def test_a_result_without_taxels_has_no_error_in_counts_nor_has_a_press_of_the_hyperelastic_model():
    bare = replace(press([0.1]), readings={})
    assert np.isnan(hyperelastic_counts(CORO, bare)).all() and np.isnan(bare.expected_error_counts).all()
    assert np.isnan(press([0.1], "hyperelastic").expected_error_counts).all()


def test_a_thin_walls_counts_change_in_proportion_to_those_of_the_maps_points():
    result = press([0.2])
    twice = press([0.2], read=2 * result.tactile_map)
    assert hyperelastic_counts(CORO, twice) == pytest.approx(2 * hyperelastic_counts(CORO, result))


def test_a_file_of_an_earlier_version_is_read_without_it(tmp_path):
    result = replace(press([0.1]), hyperelastic_counts=np.array([[1.0, 2.0, 3.0]]))
    result.write(tmp_path / "press.nc")
    assert (read_press(tmp_path / "press.nc").hyperelastic_counts == [[1.0, 2.0, 3.0]]).all()
    result.to_dataset().drop_vars("hyperelastic_counts").to_netcdf(tmp_path / "old.nc", engine="h5netcdf")
    assert np.isnan(read_press(tmp_path / "old.nc").hyperelastic_counts).all()


def test_the_command_states_the_counts_that_the_hyperelastic_model_would_give():
    summary = {"normal_force_n": [20.0], "indentation_mm": [0.1], "contact_area_mm2": [4.0], "largest_deformation_mm": [0.1],
               "within_validity": [1], "iterations": [3], "tactile_map": [[[1000.0, 1000.0], [900.0, 100.0]]],
               "hyperelastic_counts": [[1600.0, 1800.0, 2000.0]]}
    head, line = _table_on_layers(summary)
    assert "counts if hyperelastic" in head
    assert " ".join(line.split()) == "20 0.100 4.0 0.100 3000 1800 (1600 to 2000) yes"
    unknown = summary | {"hyperelastic_counts": [[None, None, None]]}
    assert "hyperelastic" not in next(_table_on_layers(unknown))
