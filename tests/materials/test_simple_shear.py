"""Simple shear: the stress of each law, and fits to such tests."""

import numpy as np
import pytest
from law_constants import PARAMETERS

from softtact.errors import ExtrapolationWarning, InputError
from softtact.materials.card_making import make_card
from softtact.materials.cards import law_from_card, load_card, write_card
from softtact.materials.config import load_material
from softtact.materials.curves import ShearCurve, synthetic_curve
from softtact.materials.fitting import fit_law
from softtact.materials.laws.registry import FOAM_LAWS, make_law
from softtact.materials.readers import read_curve

GAMMA = np.array([-1.5, -0.2, 0.1, 0.7, 1.2, 2.0])
FOAMS = {"hyperfoam1": {"mu1": 0.01, "alpha1": 6.0, "nu1": 0.1}, "blatz_ko": {"mu": 0.03, "f": 0.4, "nu": 0.2},
         "hyperfoam2": {"mu1": 0.01, "alpha1": 6.0, "nu1": 0.1, "mu2": 0.004, "alpha2": -2.0, "nu2": 0.3}}


def energy(law, gamma):
    """psi (n,) at F = I + gamma e1 x e2, of which C has the components xx, yy, zz, xy, yz, zx."""
    zero, one = np.zeros_like(gamma), np.ones_like(gamma)
    return law.isochoric(np.stack([one, 1 + gamma**2, one, gamma, zero, zero], axis=1), tangent=False).energy


@pytest.mark.parametrize("name", [*PARAMETERS, *FOAMS])
def test_the_shear_stress_of_every_law_is_the_slope_of_its_energy(name):
    law, step = make_law(name, (PARAMETERS | FOAMS)[name]), 1e-3
    near, far = (energy(law, GAMMA + k * step) - energy(law, GAMMA - k * step) for k in (1, 2))
    assert law.nominal_stress("simple_shear", GAMMA) == pytest.approx((8 * near - far) / (12 * step), rel=1e-7)


def test_every_foam_is_sheared():
    assert set(FOAMS) == set(FOAM_LAWS)


@pytest.mark.parametrize(("name", "constants", "stress"), [
    ("neo_hooke", {"c10": 0.2}, lambda g: 0.4 * g),
    ("mooney_rivlin", {"c10": 0.2, "c01": 0.05}, lambda g: 0.5 * g),
    ("yeoh", {"c10": 0.2, "c20": -0.01, "c30": 0.003}, lambda g: 2 * g * (0.2 - 0.02 * g**2 + 0.009 * g**4)),
    ("gent", {"mu": 0.3, "jm": 30.0}, lambda g: 0.3 * g * 30 / (30 - g**2)),
    ("ogden1", {"mu1": 0.4, "alpha1": 1.0}, lambda g: 0.8 * g / np.sqrt(4 + g**2))])
def test_the_shear_stress_is_that_of_the_closed_form(name, constants, stress):
    assert make_law(name, constants).nominal_stress("simple_shear", GAMMA) == pytest.approx(stress(GAMMA), rel=1e-12)


@pytest.mark.parametrize(("name", "constants"), [
    ("yeoh", {"c10": 0.2, "c20": -0.01, "c30": 0.003}), ("gent", {"mu": 0.3, "jm": 30.0})])
def test_a_shear_curve_gives_back_its_law(name, constants):
    curve = synthetic_curve(make_law(name, constants), "simple_shear", (0.0, 2.0), points=41, noise=0.0, seed=1)
    assert fit_law(name, [curve]).parameters == pytest.approx(constants, rel=1e-4)


def test_shear_does_not_tell_the_two_constants_of_mooney_and_rivlin_apart_and_says_so():
    curve = synthetic_curve(make_law("mooney_rivlin", {"c10": 0.2, "c01": 0.05}), "simple_shear", (-1.0, 1.0), points=41,
                            noise=0.01, seed=1)
    assert fit_law("mooney_rivlin", [curve]).not_identifiable == ["c10", "c01"]


def test_a_card_of_a_shear_test_knows_the_stretches_of_its_data(tmp_path):
    curve = ShearCurve(np.linspace(0, 1.5, 31), 0.4 * np.linspace(0, 1.5, 31))
    card = make_card([curve], laws=["neo_hooke", "yeoh"], choose="neo_hooke")
    write_card(tmp_path / "card.json", card)
    law = law_from_card(load_card(tmp_path / "card.json"))
    assert card["strain_window"] == {"simple_shear": [0.0, 1.5]} and law.mu0 == pytest.approx(0.4)
    assert law.stretch_window == pytest.approx((0.5, 2.0))      # l - 1/l = 1.5
    with pytest.warns(ExtrapolationWarning, match="0.5 to 2"):
        law.nominal_stress("uniaxial", 2.1)


def test_a_material_may_have_shear_curves_from_no_strain_on(tmp_path):
    (tmp_path / "m.yaml").write_text("material: m\ncurves: {kind: synthetic, law: neo_hooke, parameters: {c10: 0.2}, noise: 0.0, "
                                     "points: 5, seed: 0, modes: {simple_shear: [0, 1.5]}}\n")
    assert load_material(tmp_path / "m.yaml").curves.modes == {"simple_shear": (0.0, 1.5)}
    (tmp_path / "m.yaml").write_text((tmp_path / "m.yaml").read_text().replace("simple_shear", "planar"))
    with pytest.raises(InputError, match="a window of planar is of stretches or volume ratios, above 0"):
        load_material(tmp_path / "m.yaml")


@pytest.mark.parametrize(("content", "sentence"), [
    ("shear_strain,shear_stress_mpa\n0,0\n40,3\n", "row 3: the shear strain 40 is beyond 10, .* name it shear_strain_percent"),
    ("shear_strain,shear_stress_mpa\n0.1,0.1\n0.5,-0.3\n", "row 3: the stress -0.3 MPa has the wrong sign"),
    ("shear_strain,shear_stress_mpa\n0,0\n0.5,0.3\n0.4,0.2\n", "row 4: the shear strain turns back to 0.4"),
    ("stretch,shear_stress_mpa\n1,0\n1.5,0.3\n", "no column holds the shear strain among stretch, shear_stress_mpa")])
def test_a_shear_test_that_cannot_be_is_refused(write_file, content, sentence):
    with pytest.raises(InputError, match=sentence):
        read_curve(write_file(content, "simple_shear.csv"))
