"""Elastomers, the papers' criteria and claims on them, and the thickness that meets all needs."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from softtact.errors import ExtrapolationWarning, InputError
from softtact.skin.analysis import CONVERTERS, Converter
from softtact.skin.choice import (
    Needs,
    front_confidence,
    main_effects,
    pareto,
    printed_criteria,
    thickness_table,
    thinnest,
    with_scatter,
)
from softtact.skin.elastomers import find_elastomer, fingertip_area_mm2, read_elastomers
from softtact.skin.layout import module_layout
from softtact.studies.skin.claims import PRINTED_FRONT

PAPER = CONVERTERS["paper"]


@pytest.fixture(scope="module")
def known():
    return read_elastomers()


def test_the_secant_modulus_is_the_one_of_the_authors_case(known):
    assert known["Ecoflex 00-30"].young_mpa(0.01) == pytest.approx(0.126153, rel=1e-5)


def test_the_printed_choice_at_10_kpa_is_reproduced(known):
    table = printed_criteria(list(known.values()), stress_mpa=0.01, area_mm2=module_layout().area_mm2).set_index("elastomer")
    assert sorted(table.index[table.on_front]) == PRINTED_FRONT
    assert table.weight_g_module.idxmin() == table.sensitivity_per_kpa.idxmin() == "SomaFoama + SrTiO3"
    assert table.t_min_mm["SomaFoama + SrTiO3"] == pytest.approx(0.2467, abs=5e-5)
    assert table.weight_g_module.idxmax() == table.sensitivity_per_kpa.idxmax() == "Polytek polyurethane"


def test_the_front_has_no_point_that_another_one_beats_in_both():
    sensitivity, weight = np.array([1.0, 2.0, 2.0, 3.0, 0.5]), np.array([1.0, 2.0, 3.0, 3.0, 1.0])
    assert pareto(sensitivity, weight).tolist() == [True, True, False, True, False]


def test_the_front_is_rarely_the_same_when_strains_scatter_by_a_tenth(known):
    table, same = front_confidence(
        list(known.values()), stress_mpa=0.01, draws=4000, strain_scatter=0.1, batch_scatter=0.33, ageing_stiffening=0.2, seed=0
    )
    assert same["strain_scatter"] == pytest.approx(0.2, abs=0.03)  # 20 % by other draws
    assert table.set_index("elastomer")["all"]["SomaFoama"] > 0.95


def test_extrapolation_is_said_and_refused_beyond_twice_the_tested_stress(known):
    foam = known["SomaFoama"]
    with pytest.warns(ExtrapolationWarning, match="50 kPa is outside of its test from 2.73 to 42.2 kPa"):
        foam.strain(0.05)
    with pytest.raises(InputError, match="tested up to 42.2 kPa, and 90 kPa is beyond twice that"):
        foam.strain(0.09)


def test_below_the_lowest_tested_stress_the_strain_falls_in_proportion_to_it(known):
    for elastomer in known.values():
        low = elastomer.tested_mpa[0]
        with pytest.warns(ExtrapolationWarning, match="its modulus is held as at the lowest tested stress"):
            assert elastomer.strain(1e-3 * low) == pytest.approx(5e-5)     # 5 % at the lowest tested stress
        assert elastomer.tested_young_mpa(1e-6 * low) == pytest.approx(elastomer.young_mpa(1.0001 * low), rel=1e-3)


def test_a_curve_that_is_strained_without_stress_by_more_than_the_test_begins_with_is_refused(tmp_path):
    (tmp_path / "mine.yaml").write_text("elastomers: [{name: gel, strain_percent: [6, 500, 0, 0], density_g_cm3: 1, poisson: 0.45, "
                                        "permittivity: 3, permittivity_fe: 3}]")
    with pytest.raises(InputError, match="gel: its curve has a strain of 6.50% at 1 kPa and 6.00% without stress"):
        read_elastomers(tmp_path / "mine.yaml")["gel"].strain(0.001)


@pytest.mark.parametrize(("poisson", "limit"), [(0.5, "less than 0.5"), (-1.0, "greater than -1")])
def test_an_elastomer_without_a_stable_poissons_ratio_is_refused(poisson, limit, tmp_path):
    (tmp_path / "mine.yaml").write_text(f"elastomers: [{{name: gel, strain_percent: [0, 500, 0, 0], density_g_cm3: 1, "
                                        f"poisson: {poisson}, permittivity: 3, permittivity_fe: 3}}]")
    with pytest.raises(InputError, match=rf"mine.yaml, elastomer 1, at 'poisson' \(it is {poisson}\): .* {limit}; correct it"):
        read_elastomers(tmp_path / "mine.yaml")


def test_an_own_elastomer_joins_those_that_ship(tmp_path):
    (tmp_path / "mine.yaml").write_text(
        "elastomers: [{name: gel, strain_percent: [0, 500, 0, 0], density_g_cm3: 1, poisson: 0.45, "
        "permittivity: 3, permittivity_fe: 3}]"
    )
    known = read_elastomers(tmp_path / "mine.yaml")
    assert len(known) == 9 and known["gel"].young_mpa(0.02) == pytest.approx(0.2)
    with pytest.raises(InputError, match="there is no elastomer 'gell' .did you mean 'gel'"):
        find_elastomer("gell", known, where="design")
    (tmp_path / "mine.yaml").write_text("elastomers: [{name: gel, strain_percent: [0, 500, 0], density_g_cm3: 1}]")
    with pytest.raises(InputError, match="mine.yaml, elastomer 1, at"):
        read_elastomers(tmp_path / "mine.yaml")


def test_the_thinnest_layer_meets_force_strain_range_and_weight_together(known):
    needs = Needs((0.01, 0.05), 6.0, 0.05, 3.0, 0.3)
    table = thickness_table(
        [known["Ecoflex 00-30"]], module_layout(), needs=needs, thicknesses_mm=(1.0, 4.0), converter=PAPER, weight_budget_g=0.6
    )
    thin, thick = table.iloc[0], table.iloc[1]
    assert thin.meets_all and not thick.force_met and not thick.in_budget
    assert thin.at_rest_ff / thick.at_rest_ff == pytest.approx(4, rel=0.02)  # plates, but for the guard gap
    assert thin.weight_g_module == pytest.approx(1.28e-3 * module_layout().area_mm2)
    worst = with_scatter(table, needs=needs, batch_scatter=0.33, ageing_stiffening=0.2)
    assert worst.counts_of_worst.iloc[0] == pytest.approx(thin.counts_at_smallest_force * 0.67 / 1.2)
    assert worst.meets_all_at_worst.tolist() == [True, False]
    chosen = thinnest(table)
    assert chosen.thickness_mm.tolist() == [1.0]


def test_a_converter_counts_changes_in_its_steps():
    capacitance = np.array([[200.0, 200.0], [203.2, 200.3]])
    paper = Converter(step_ff=0.32, range_pf=(4, 30), offset_step_pf=0.0, stray_pf=10.0)
    assert paper.counts(capacitance).tolist() == [[10, 0]] or paper.counts(capacitance).tolist() == [[10, 1]]
    maker = CONVERTERS["adi"]
    assert maker.counts(capacitance)[0, 0] == pytest.approx(3.2 / 0.244, abs=1)


def test_a_taxel_without_enough_stray_is_out_of_the_printed_range():
    with pytest.raises(InputError, match="taxel 1 with its stray has 0.2 pF, and the range is 4 to 30 pF"):
        dataclasses.replace(CONVERTERS["paper"], stray_pf=0.0).counts(np.array([[200.0], [210.0]]))


def test_fingertips_have_the_printed_areas():
    assert fingertip_area_mm2("keyboard") == 108.80
    with pytest.raises(InputError, match="no fingertip task 'piano'"):
        fingertip_area_mm2("piano")


def test_main_effects_of_an_additive_output_add_up_to_one():
    grid = pd.MultiIndex.from_product(
        [["a", "b"], [1.0, 2.0], [1.5, 2.0], [5.0, 6.0]], names=["elastomer", "thickness_mm", "radius_mm", "pitch_mm"]
    ).to_frame(index=False)
    table = grid.assign(
        counts_at_smallest_force=np.exp(grid.thickness_mm + 2 * grid.radius_mm),
        strain=grid.thickness_mm,
        crosstalk=grid.pitch_mm,
        weight_g_module=grid.thickness_mm * grid.radius_mm,
    )
    effects = main_effects(table).set_index("factor")
    assert effects.counts_at_smallest_force.sum() == pytest.approx(1) and effects.crosstalk["pitch_mm"] == pytest.approx(1)
    assert effects.counts_at_smallest_force["thickness_mm"] == pytest.approx(0.5) and effects.weight_g_module.sum() < 1
