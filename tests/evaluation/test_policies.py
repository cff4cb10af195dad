"""Policies that choose a model, compared on presses whose errors are known."""

import numpy as np
import pandas as pd
import pytest
import xarray

from softtact.evaluation.policies import CHANCE, choices, expected_over_true, policy_table, press_table, with_chance
from softtact.press.choice import INTERVALS
from softtact.studies.hybrid.figures.fig8_policies import draw

FORCES = np.array([10.0, 20.0])
BUMP = np.exp(-np.linspace(-2, 2, 9)[:, None] ** 2 - np.linspace(-2, 2, 7) ** 2)
SIZE = np.sqrt((BUMP**2).mean())


def data_set(item, of_set, amplitude, *, time, compression=0.1):
    return xarray.Dataset({"deformation_map_mm": (("step", "y", "x"), amplitude * (FORCES / 20)[:, None, None] * BUMP),
                           "frustum_compression_mm": ("step", compression * FORCES / 20), "wall_time_s": ("step", [time, time]),
                           "within_validity": ("step", [1, 1]), "indentation_mm": ("step", [0.1, 0.2]),
                           "tactile_map": (("step", "row", "column"), np.outer(1000 * amplitude * FORCES / 20,
                                                                               np.ones(28)).reshape(2, 7, 4))},
                          attrs={"item": item, "set": of_set, "thickness_mm": 2.5})


def press(item, of_set, *, apart):
    """A press in which elastic and foundation maps are off by 100 % and by `apart`."""
    return {"elastic": data_set(item, of_set, 0.4, time=0.1), "foundation": data_set(item, of_set, 0.2 * (1 + apart), time=1.0),
            "hyperelastic": data_set(item, of_set, 0.2, time=100.0)}


@pytest.fixture(scope="module")
def table():
    presses = [press("ring", "indenters", apart=0.03), press("star", "indenters", apart=0.03), press("cup", "grasps", apart=0.03)]
    return press_table(presses, {"ring": "elastic", "star": "elastic", "cup": "hyperelastic"}, height_mm=0.5)[0]


def test_a_press_counts_with_its_worst_load_step_and_the_time_of_all(table):
    cup = table[table.item == "cup"].iloc[0]
    assert cup.foundation_error_mm == pytest.approx(0.2 * 0.03 * SIZE)
    assert cup.elastic_error_mm == pytest.approx(0.2 * SIZE)
    assert (cup.elastic_time_s, cup.hyperelastic_time_s) == (0.2, 200.0)
    assert (cup.elastic_error_counts, cup.hyperelastic_error_counts) == pytest.approx((28 * 200.0, 0.0))


def test_an_error_that_is_the_same_everywhere_is_found_exactly(table):
    assert expected_over_true(table, "foundation")["median"] == pytest.approx(1.0, rel=1e-6)


def test_the_error_to_expect_is_found_from_indenters_alone():
    indenters = [press("ring", "indenters", apart=0.03), press("star", "indenters", apart=0.03)]
    others = [press("cup", "grasps", apart=0.3), press("disc", "unseen", apart=0.6)]
    alone, beside = (press_table(presses, {"ring": "elastic", "star": "elastic", "cup": "elastic", "disc": "elastic"},
                                 height_mm=0.5)[1] for presses in (indenters, indenters + others))
    assert beside == alone and alone.at_rest == pytest.approx(0.03 / 1.03)


def test_the_calibration_goes_by_the_share_of_a_frustums_height():
    """Twice the height and twice the compression are the same shares; the same compression of twice the height is another."""
    def calibrated(height_mm, most):
        presses = []
        for name, apart, compression in (("ring", 0.03, 0.1 * most), ("star", 0.3, most)):
            one = press(name, "indenters", apart=apart)
            squeezed = one["foundation"].assign(frustum_compression_mm=("step", compression * np.array([0.9, 1.0])))
            presses.append(one | {"foundation": squeezed})
        return press_table(presses, {"ring": "elastic", "star": "elastic"}, height_mm=height_mm)[1]

    assert calibrated(1.0, 0.8) == calibrated(0.5, 0.4) != calibrated(1.0, 0.4)


def test_the_expected_error_sends_a_press_to_the_cheapest_model_that_will_do(table):
    of_cup = table.index[table.item == "cup"][0]
    taken = [choices(table, tolerance)[f"error, {1e3 * tolerance:g} um"][of_cup] for tolerance in (0.5, 0.01, 1e-5)]
    assert taken == ["elastic", "foundation", "hyperelastic"]


def test_a_model_is_taken_where_nine_of_ten_presses_are_within_the_tolerance_as_by_default(table):
    row, cup = table[table.item == "cup"].iloc[0], table.index[table.item == "cup"][0]
    mostly = INTERVALS["foundation"][1] * row.foundation_expected_mm
    assert mostly > 1.2 * row.foundation_expected_mm
    for tolerance, model in ((1.01 * mostly, "foundation"), (0.99 * mostly, "hyperelastic")):
        assert choices(table, tolerance)[f"error, {1e3 * tolerance:g} um"][cup] == model


def test_a_random_choice_of_the_papers_share_has_the_means_of_the_models_by_that_share():
    """Two of three presses elastic: 2/3 of 0.09 mm and of 1 s, and 1/3 of 30 s."""
    def row(policy, elastic, error, time):
        return {"policy": policy, "presses": 3, "share_elastic": elastic, "share_foundation": 0.0,
                "share_hyperelastic": 1 - elastic, "mean_error_mm": error, "time_per_press_s": time, "time_in_all_s": 3 * time}

    policies = pd.DataFrame([row("always elastic", 1, 0.09, 1.0), row("always foundation", 0, 0.01, 2.0),
                             row("always hyperelastic", 0, 0.0, 30.0), row("paper", 2 / 3, 0.05, 10.0),
                             row("error, 5 um", 0, 0.0, 33.0)])
    with_it = with_chance(policies)
    assert list(with_it.policy)[3:5] == ["paper", CHANCE] and len(with_it) == 6
    chance = with_it.set_index("policy").loc[CHANCE]
    assert (chance.mean_error_mm, chance.time_per_press_s) == pytest.approx((0.06, 2 / 3 + 10))
    pd.testing.assert_frame_equal(with_chance(with_it), with_it)
    assert len(with_chance(policies[policies.policy != "paper"])) == 4


def test_the_error_policy_pays_for_both_cheap_models_and_others_for_their_own(table):
    rows = policy_table(table, [0.01], sets=["grasps"]).set_index("policy")
    assert rows.loc["always elastic", "time_in_all_s"] == pytest.approx(0.2)
    assert rows.loc["paper", "time_in_all_s"] == pytest.approx(200.0)
    assert rows.loc["error, 10 um", "time_in_all_s"] == pytest.approx(2.2)
    assert rows.loc["error, 10 um", "share_foundation"] == 1.0 and rows.loc["error, 10 um", "over_tolerance"] == 0.0


def test_only_the_sets_asked_for_are_counted(table):
    assert set(policy_table(table, [0.01], sets=["grasps"]).presses) == {1}


def test_errors_in_counts_stand_beside_those_of_the_maps_and_are_unknown_of_presses_without_taxels(table):
    rows = policy_table(table, [0.01], sets=["grasps"]).set_index("policy")
    assert rows.mean_error_counts[["always elastic", "always foundation", "paper"]].tolist() == pytest.approx([5600.0, 168.0, 0.0])
    bare = {model: one.drop_vars("tactile_map") for model, one in press("ring", "indenters", apart=0.03).items()}
    assert press_table([bare], {"ring": "elastic"}, height_mm=0.5)[0].elastic_error_counts.isna().all()


def test_figure_8_marks_the_random_choice_of_the_rules_share(table):
    rows = policy_table(table, [0.01], sets=["grasps", "indenters"])
    axes = draw(rows, table).axes[0]
    assert "a random choice of the rule's share" in [text.get_text() for text in axes.get_legend().get_texts()]
    assert "random" in [text.get_text() for text in axes.texts]
