"""Which curves of contact area the paper's words allow: the stated rule, on curves made to break one part of it each."""

import numpy as np
import pandas as pd
import pytest

from softtact.evaluation.curve_shape import LEAST_GROWTH_MM2, judge, measures, objections, summary_sentence, verdict

FORCES = np.array([0.0, 10.0, 40.0, 80.0, 140.0])
GROWING = np.array([0.0, 0.284, 0.30, 0.36, 0.48])


def found(area):
    return measures(FORCES, area, pitch_mm=1.2)


def against(area):
    return objections(found(area), pixel_mm=0.02)


def test_a_curve_that_grows_and_keeps_its_discs_apart_is_allowed():
    assert against(GROWING) == []
    assert verdict("mine", found(GROWING), pixel_mm=0.02).startswith("mine: compatible with the paper's curve: from 10 to 140 N")


def test_the_measures_are_those_of_the_curve_without_its_rest():
    values = found(GROWING)
    assert values["growth_mm2"] == pytest.approx(0.196) and values["growth_share"] == pytest.approx(0.196 / 0.284)
    assert values["disc_gap_mm"] == pytest.approx(1.2 - 2 * np.sqrt(0.48 / np.pi))
    assert values["largest_step_share"] == pytest.approx(0.12 / 0.196)
    assert values["largest_rate"] == pytest.approx(0.12 / 60 / (0.196 / 130))
    assert values["departure_from_line"] == pytest.approx((0.284 + 0.196 * 70 / 130 - 0.36) / 0.196)


def test_a_straight_line_departs_from_none():
    line = 0.28 + 0.001 * FORCES
    assert found(line)["departure_from_line"] == pytest.approx(0, abs=1e-12)
    assert found(line)["largest_rate"] == pytest.approx(1)


def test_a_curve_that_breaks_the_rule_is_refused_with_the_reason():
    for area, said in [
        (np.full(5, 0.3), "changes by 0.000 mm2, less than 0.04 mm2"),
        (np.linspace(0.3, 0.3 + 0.9 * LEAST_GROWTH_MM2, 5), "(five times the paper's RMSE)"),
        (np.array([0.3, 0.3, 0.4, 0.38, 0.5]), "falls between two forces"),
        (np.array([0.9, 0.9, 1.0, 1.05, 1.2]), "its discs leave 0.000 mm between them, less than 0.04 mm"),
        (np.array([0.3, 0.3, 0.301, 0.302, 0.303]) + [0, 0, 0.3, 0.3, 0.3], "it grows in a jump (99% of the growth in one step"),
    ]:
        assert any(said in sentence for sentence in against(area)), area


def test_orientations_are_judged_one_by_one_and_the_whole_follows_from_them():
    flat = np.full(5, 1.131)
    table = pd.concat([pd.DataFrame({"orientation": orientation, "law": "ogden2", "force_n": FORCES, "area_per_frustum_mm2": area})
                       for orientation, area in (("default", GROWING), ("as_printed", flat))])
    records = judge(table, pitch_mm=1.2, pixel_mm=0.02)
    assert [record["allowed"] for record in records] == [True, False]
    assert summary_sentence(records) == ("The paper's words allow default with ogden2. "
                                         "They hardly allow the orientation as_printed with any law.")
    assert summary_sentence(records[1:]).startswith("The paper's words allow none of the curves.")
