"""The card: what is in it, what it warns of, and the laws made from it."""

import json

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.files import write_json
from softtact.materials.cards import law_from_card, linear_from_card, load_card, make_card
from softtact.materials.consistency import disagreements
from softtact.materials.laws.registry import make_law
from softtact.materials.linear import LinearConstants, young_modulus
from softtact.materials.readers import read_curve

TRUTH = {"c10": 0.1706, "c01": 0.0040}


@pytest.fixture
def card(curves_of):
    curves = curves_of("mooney_rivlin", TRUTH)
    laws = ["neo_hooke", "mooney_rivlin", "yeoh"]
    return make_card(curves, material="foam", laws=laws, choose="mooney_rivlin", poisson=0.1729)


def test_a_card_survives_its_file(card, tmp_path):
    write_json(tmp_path / "foam.json", card)
    again = load_card(tmp_path / "foam.json")
    assert again == json.loads(json.dumps(card))
    assert law_from_card(again).parameters == pytest.approx(TRUTH, rel=1e-6)


def test_a_card_says_what_it_was_fitted_to(card):
    assert (card["material"], card["kind"]) == ("foam", "synthetic")
    assert card["strain_window"] == {"uniaxial": [0.6, 1.6], "equibiaxial": [1.0, 1.4], "planar": [1.0, 1.6]}
    assert [entry["points"] for entry in card["curves"]] == [25, 25, 25]


def test_the_volume_follows_from_the_stated_ratio_of_moduli(card):
    entry = card["laws"]["mooney_rivlin"]
    assert entry["mu0_mpa"] == pytest.approx(2 * 0.1746, rel=1e-6)
    assert entry["bulk_modulus_mpa"] == pytest.approx(20 * entry["mu0_mpa"])
    assert entry["d_per_mpa"] == pytest.approx([2 / entry["bulk_modulus_mpa"]])
    assert law_from_card(card).bulk_modulus == pytest.approx(entry["bulk_modulus_mpa"])


def test_another_law_than_the_chosen_one_can_be_taken(card):
    assert law_from_card(card).name == "mooney_rivlin"
    assert law_from_card(card, "yeoh").name == "yeoh"


def test_a_law_that_the_card_lacks_is_refused_with_those_it_has(card):
    with pytest.raises(InputError, match="material foam has no hyperelastic law 'ogden2'; it has .*neo_hooke"):
        law_from_card(card, "ogden2")
    with pytest.raises(InputError, match="no hyperelastic law 'linear'"):
        law_from_card(card, "linear")


def test_the_linear_constants_are_the_small_strain_slope_and_the_stated_ratio(card):
    """The cubic term of the curve, 4/3 e^2 of the slope, leaves about 1 % at a strain of 0.1."""
    linear = linear_from_card(card)
    assert linear.young_mpa == pytest.approx(3 * 2 * 0.1746, rel=0.015)
    assert linear.poisson == 0.1729
    assert "not fitted" in card["laws"]["linear"]["poisson_source"]


def test_without_a_stated_poissons_ratio_there_are_no_linear_constants(curves_of):
    card = make_card(curves_of("neo_hooke", {"c10": 0.2}), laws=["neo_hooke"])
    assert "linear" not in card["laws"]
    assert any("none was stated (`poisson`)" in sentence for sentence in card["warnings"])
    with pytest.raises(InputError, match="has no linear constants"):
        linear_from_card(card)


def test_without_a_uniaxial_curve_the_card_says_why_it_has_no_modulus(curves_of):
    curves = curves_of("neo_hooke", {"c10": 0.2}, modes={"planar": (1.0, 1.5)})
    card = make_card(curves, laws=["neo_hooke"], poisson=0.3)
    assert any("too few for Young's modulus; give a uniaxial curve" in sentence for sentence in card["warnings"])


def test_the_best_law_is_the_one_that_explains_most_with_fewest_constants(curves_of):
    card = make_card(curves_of("mooney_rivlin", {"c10": 0.15, "c01": 0.03}, noise=0.01), choose="best")
    assert card["chosen"] == card["ranking"][0]
    assert card["ranking"].index("mooney_rivlin") < card["ranking"].index("ogden3")


def test_a_law_that_was_not_fitted_cannot_be_chosen(curves_of):
    with pytest.raises(InputError, match="'yeoh' is to be chosen but is not fitted; choose one of neo_hooke"):
        make_card(curves_of("neo_hooke", {"c10": 0.2}), laws=["neo_hooke"], choose="yeoh")


def test_a_window_cuts_the_curves(curves_of):
    card = make_card(curves_of("neo_hooke", {"c10": 0.2}), laws=["neo_hooke"], window={"uniaxial": (0.8, 1.2)})
    low, high = card["strain_window"]["uniaxial"]
    assert 0.8 <= low < 0.85 and 1.15 < high <= 1.2
    assert card["strain_window"]["planar"] == [1.0, 1.6]


def test_an_empty_window_is_refused(curves_of):
    with pytest.raises(InputError, match="leaves no uniaxial curve; widen it"):
        make_card(curves_of("neo_hooke", {"c10": 0.2}), laws=["neo_hooke"], window={"uniaxial": (2.0, 3.0)})


def test_a_law_unstable_within_its_data_is_ranked_last_and_warned_of(curves_of):
    """The curve goes past the point where a negative c01 makes the material unstable."""
    curves = curves_of("mooney_rivlin", {"c10": 0.2, "c01": -0.02}, modes={"equibiaxial": (1.0, 2.5)})
    card = make_card(curves, laws=["mooney_rivlin", "neo_hooke"])
    assert card["ranking"] == ["neo_hooke", "mooney_rivlin"]
    assert not card["laws"]["mooney_rivlin"]["stable_over_data"]
    assert any(s.startswith("mooney_rivlin: not stable over the whole range") for s in card["warnings"])


def test_constants_that_the_curves_do_not_hold_are_named(curves_of):
    card = make_card(curves_of("neo_hooke", {"c10": 0.2}, noise=0.01), laws=["ogden2"])
    assert any(s.startswith("ogden2: these curves do not determine") for s in card["warnings"])


def test_a_file_that_is_no_card_is_refused(tmp_path):
    write_json(tmp_path / "x.json", {"material": "foam"})
    with pytest.raises(InputError, match="not a material card, it lacks kind, chosen, laws"):
        load_card(tmp_path / "x.json")


def test_laws_that_agree_raise_no_sentence():
    law = make_law("neo_hooke", {"c10": 0.2})
    same = make_law("ogden1", {"mu1": 0.4, "alpha1": 2.0})
    assert disagreements({"neo_hooke": law, "ogden1": same}) == []


def test_linear_constants_that_a_law_shares_raise_no_sentence():
    law = make_law("neo_hooke", {"c10": 0.2}, bulk_modulus=2.0)
    young = 9 * 2.0 * 0.4 / (3 * 2.0 + 0.4)
    poisson = (3 * 2.0 - 2 * 0.4) / (2 * (3 * 2.0 + 0.4))
    linear = LinearConstants(young, poisson)
    assert (linear.mu_mpa, linear.bulk_modulus_mpa) == pytest.approx((0.4, 2.0))
    assert disagreements({"neo_hooke": law}, linear=linear) == []


@pytest.mark.parametrize(("young", "poisson"), [(-1.0, 0.3), (1.0, 0.5)])
def test_impossible_linear_constants_are_refused(young, poisson):
    with pytest.raises(InputError, match="give"):
        LinearConstants(young, poisson)


def test_youngs_modulus_has_an_honest_error(curves_of):
    young, error, _ = young_modulus(curves_of("neo_hooke", {"c10": 0.2}, noise=0.01), small_strain=0.1)
    assert 0 < error < 0.2
    assert abs(young - 1.2) < 3 * error


def test_a_silicone_to_failure_is_fitted_within_its_window(published):
    """At 100 % strain, well inside the window, Yeoh's law must be within 5 % of the specimen."""
    curve = read_curve(published / "soro_db" / "Dragon Skin 30.csv", layout="soro_db")
    card = make_card([curve], window={"uniaxial": (1.0, 3.0)}, laws=["yeoh"], poisson=0.49, small_strain=0.2)
    law = law_from_card(card)
    assert card["kind"] == "measured"
    assert float(law.nominal_stress("uniaxial", 2.0)) == pytest.approx(
        float(np.interp(2.0, curve.stretch, curve.nominal_stress)), rel=0.05
    )
