"""What stands beside the counts: taxels at the end of the converter's range, rounded edges, why load steps are flagged, and the
sensor that an expected error is known of."""

from types import SimpleNamespace

import numpy as np
import pandas as pd

from softtact.commands.press_summary import edge_line, error_line, range_line, validity_lines
from softtact.press.result import PressResult
from softtact.studies.hybrid.page import range_end_sentence


def test_taxels_at_the_end_of_the_range_are_counted_at_each_load_step():
    maps = np.array([[[100.0, 2399.9]], [[2400.0, 2400.0]]])
    result = SimpleNamespace(tactile_map=maps, largest_counts=2400.0)
    assert PressResult.taxels_at_range_end.fget(result).tolist() == [0, 2]


def test_the_summary_names_the_load_steps_at_which_taxels_are_at_the_end():
    summary = {"taxels_at_range_end": [0, 2], "normal_force_n": [5.0, 50.0], "largest_counts": 2400.0}
    (line,) = range_line(summary)
    assert line == "taxels at the end of the converter's range (2400 counts), which read too little: 2 at 50 N"
    assert not list(range_line(summary | {"taxels_at_range_end": [0, 0]})) and not list(range_line({}))


def test_the_summary_names_the_load_steps_at_which_edges_were_rounded():
    (line,) = edge_line({"edge_radius_mm": [0.0, 0.05, 0.05], "normal_force_n": [5.0, 10.0, 20.0]})
    assert line.startswith("edges of the object rounded by 0.05 mm at 10, 20 N") and "several balances" in line
    assert not list(edge_line({"edge_radius_mm": [0.0], "normal_force_n": [5.0]})) and not list(edge_line({}))


def test_an_expected_error_of_another_sensor_says_which_sensor_it_is_known_of():
    summary = {"expected_error_interval": [0.8, 1.6], "expected_error_mm": [0.001, 0.002], "expected_error_calibrated_on": "coro",
               "sensor": "pad"}
    (line,) = error_line(summary)
    assert line == ("error to expect against the hyperelastic model: 0.002 mm (0.0016 to 0.0032), root mean square over the map; "
                    "calibrated on the sensor coro, not on pad")
    assert "calibrated" not in next(error_line(summary | {"sensor": "coro"}))
    assert not list(error_line(summary | {"expected_error_interval": None}))


def test_the_study_s_page_says_how_many_readings_are_at_the_end_at_its_own_gain():
    gains = pd.DataFrame({"gain": [1300.0, 2600.0], "full_share": [0.0, 0.0067]})
    config = {"virtual_sensor": {"counts_per_relative_change": 2600}}
    assert "0.7% of the taxels' readings" in range_end_sentence(gains, config)
    low = {"virtual_sensor": {"counts_per_relative_change": 1300}}
    assert range_end_sentence(gains, low) == range_end_sentence(gains, {}) == ""


def test_the_summary_names_each_reason_with_the_forces_at_which_it_flags():
    summary = {"normal_force_n": [5.0, 20.0, 50.0], "within_validity": [1, 0, 0], "validity_reason": ["", "narrow", "deep; narrow"]}
    said = "beyond what the model is valid for: "
    assert list(validity_lines(summary)) == [f"{said}20, 50 N: narrow", f"{said}50 N: deep"]
