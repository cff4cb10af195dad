"""The laws at special states, against each other and against closed forms; tests/verification has the rest."""

import numpy as np
import pytest
from law_constants import C_PER_E, COLUMN, PARAMETERS, ROW
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from softtact.errors import ExtrapolationWarning, InputError
from softtact.materials.laws.registry import LAWS, make_law
from softtact.materials.laws.stretches import stretch_range
from softtact.materials.laws.volumetric import VOLUMETRIC_FUNCTIONS


def law_of(name):
    return make_law(name, PARAMETERS[name])


def components(C):
    """The six components (n, 6) of symmetric tensors (n, 3, 3)."""
    return np.ascontiguousarray(C[:, ROW, COLUMN])


def tensors(C6):
    """Symmetric tensors (n, 3, 3) of six components (n, 6)."""
    C = np.empty((len(C6), 3, 3))
    C[:, ROW, COLUMN] = C6
    C[:, COLUMN, ROW] = C6
    return C


def random_states(n=20):
    """C6 of random deformations with stretches of about 0.6 to 1.6 and volume changes."""
    F = np.eye(3) + 0.15 * np.random.default_rng(7).standard_normal((n, 3, 3))
    return components(np.einsum("nki,nkj->nij", F, F))


def states_with_equal_stretches():
    """C6 with two or three equal principal stretches, along the axes and turned."""
    turn = Rotation.from_euler("xyz", [0.3, -0.7, 1.1]).as_matrix()
    principal = [np.diag(c) for c in ([1, 1, 1], [1.7, 1.7, 1.7], [0.5, 0.5, 2.0], [2.0, 0.6, 2.0])]
    return components(np.array(principal + [turn @ C @ turn.T for C in principal], dtype=float))


def derivative_by_E(function, C6, *, step=1e-3):
    """Derivative (..., 6) of function(C6) by E6: central differences of fourth order, so the error is about 1e-11."""
    columns = []
    for k in range(6):
        d = np.zeros(6)
        d[k] = step * C_PER_E[k]
        near, far = function(C6 + d) - function(C6 - d), function(C6 + 2 * d) - function(C6 - 2 * d)
        columns.append((8 * near - far) / (12 * step))
    return np.stack(columns, axis=-1)


def relative_error(value, expected):
    return np.abs(value - expected).max() / np.abs(expected).max()


def test_tangent_holds_at_equal_stretches():
    for name in PARAMETERS:
        law, C6 = law_of(name), states_with_equal_stretches()
        numeric = derivative_by_E(lambda C, law=law: law.isochoric(C, tangent=False).stress, C6)
        assert relative_error(law.isochoric(C6).tangent, numeric) < 1e-7, name


def test_ogden_tangent_does_not_jump_where_stretches_become_equal():
    for gap in [1e-15, 1e-12, 1e-9, 1e-7]:
        law, C6 = law_of("ogden2"), states_with_equal_stretches()
        near = C6 + gap * np.array([1.0, -0.5, 0.3, 0.2, -0.4, 0.7])
        # The tangent's own change over the gap is of the order of the gap; the rest is round-off.
        assert relative_error(law.isochoric(near).tangent, law.isochoric(C6).tangent) < 50 * gap + 1e-13, gap


def test_tangent_has_major_symmetry():
    for name in PARAMETERS:
        tangent = law_of(name).isochoric(random_states()).tangent
        assert np.array_equal(tangent, tangent.transpose(0, 2, 1)), name


def test_turning_the_material_turns_the_stress_only():
    for name in PARAMETERS:
        law, C6 = law_of(name), random_states()
        turn = Rotation.from_euler("xyz", [0.4, 1.2, -0.5]).as_matrix()
        here, turned = law.isochoric(C6), law.isochoric(components(turn @ tensors(C6) @ turn.T))
        assert relative_error(turned.energy, here.energy) < 1e-12, name
        assert relative_error(turned.stress, components(turn @ tensors(here.stress) @ turn.T)) < 1e-12, name


def test_a_volume_change_costs_no_isochoric_energy_and_stress_does_no_work_on_it():
    for name in PARAMETERS:
        law, C6 = law_of(name), random_states()
        response, swollen = law.isochoric(C6), law.isochoric(1.3 * C6)
        assert relative_error(swollen.energy, response.energy) < 1e-12, name
        work = np.einsum("nij,nij->n", tensors(response.stress), tensors(C6))
        assert np.abs(work).max() < 1e-13, name


def test_the_undeformed_state_is_free_and_has_the_modulus_mu0():
    for name in PARAMETERS:
        law = law_of(name)
        response = law.isochoric(np.array([[1.0, 1, 1, 0, 0, 0]]))
        deviatoric = np.diag([2.0, 2, 2, 1, 1, 1])
        deviatoric[:3, :3] -= 2 / 3
        assert response.energy == pytest.approx(0, abs=1e-15), name
        assert np.abs(response.stress).max() < 1e-15, name
        assert np.allclose(response.tangent[0], law.mu0 * deviatoric, rtol=0, atol=1e-14), name


def test_without_a_tangent_energy_and_stress_are_the_same():
    for name in PARAMETERS:
        law, C6 = law_of(name), random_states()
        with_tangent, without = law.isochoric(C6), law.isochoric(C6, tangent=False)
        assert without.tangent is None, name
        assert np.array_equal(with_tangent.energy, without.energy), name
        assert np.array_equal(with_tangent.stress, without.stress), name


def test_nominal_stress_agrees_with_the_stress_at_points():
    """P1 = l1 (S1 - S3 c3/c1): the pressure that frees direction 3 acts on C^-1."""
    for name in PARAMETERS:
        for mode, exponents in [("uniaxial", (1, -0.5)), ("equibiaxial", (1, 1)), ("planar", (1, 0))]:
            law, stretch = law_of(name), np.array([0.6, 0.9, 1.2, 1.9])
            c1, c2 = stretch ** (2 * exponents[0]), stretch ** (2 * exponents[1])
            c3 = 1 / (c1 * c2)
            S = law.isochoric(np.stack([c1, c2, c3, 0 * c1, 0 * c1, 0 * c1], axis=1)).stress
            expected = stretch * (S[:, 0] - S[:, 2] * c3 / c1)
            assert np.allclose(law.nominal_stress(mode, stretch), expected, rtol=1e-12), mode


def same_law(one, other, *, within=1e-12):
    C6 = np.concatenate([random_states(), states_with_equal_stretches()])
    a, b = one.isochoric(C6), other.isochoric(C6)
    pairs = [(a.energy, b.energy), (a.stress, b.stress), (a.tangent, b.tangent)]
    return one.mu0 == pytest.approx(other.mu0) and max(relative_error(x, y) for x, y in pairs) < within


def test_ogden_with_alpha_2_and_minus_2_is_mooney_rivlin():
    ogden = make_law("ogden2", {"mu1": 0.4, "alpha1": 2.0, "mu2": 0.06, "alpha2": -2.0})
    assert same_law(ogden, make_law("mooney_rivlin", {"c10": 0.2, "c01": 0.03}))


def test_yeoh_without_its_cubic_term_is_the_reduced_polynomial():
    yeoh = make_law("yeoh", {"c10": 0.2, "c20": 0.01, "c30": 0.0})
    assert same_law(yeoh, make_law("reduced_polynomial2", {"c10": 0.2, "c20": 0.01}))


def test_mooney_rivlin_follows_its_textbook_curves():
    for mode in ["uniaxial", "equibiaxial", "planar"]:
        c10, c01, L = 0.1706, 0.0040, np.linspace(0.4, 3.0, 27)
        textbook = {
            "uniaxial": 2 * (L - L**-2) * (c10 + c01 / L),
            "equibiaxial": 2 * (L - L**-5) * (c10 + c01 * L**2),
            "planar": 2 * (L - L**-3) * (c10 + c01),
        }
        law = make_law("mooney_rivlin", {"c10": c10, "c01": c01})
        assert np.allclose(law.nominal_stress(mode, L), textbook[mode], rtol=1e-12, atol=1e-15), mode


def test_arruda_boyce_is_eight_chains_of_langevins_function():
    """P = mu/3 lambda_m/c L^-1(c/lambda_m) (l - l^-2), c^2 = I1/3, Arruda and Boyce 1993: what the series of five terms leaves out.

    Its relative size is near (c/lambda_m)^10: 1e-6 at lambda_m = 5 and l = 1.6.
    """
    law = make_law("arruda_boyce", {"mu": 0.3, "lambda_m": 5.0})
    for stretch in (0.6, 1.3, 1.6):
        chain = np.sqrt((stretch**2 + 2 / stretch) / 3)
        inverse = brentq(lambda beta: 1 / np.tanh(beta) - 1 / beta - chain / 5, 1e-3, 50, xtol=1e-14)  # noqa: B023
        expected = 0.3 / 3 * 5 / chain * inverse * (stretch - stretch**-2)
        assert law.nominal_stress("uniaxial", stretch) == pytest.approx(expected, rel=2e-6), stretch


def test_compressible_uniaxial_stress_agrees_with_calculix():
    """Gold numbers of one CalculiX 2.20 element at stretch 0.7 and 1.5, K = 20 mu0, printed to six digits."""
    for name, compressed, stretched in [("mooney_rivlin", -0.466273, 0.356118), ("ogden2", -0.847201, 0.281311)]:
        assert law_of(name).uniaxial_compressible([0.7, 1.5]) == pytest.approx([compressed, stretched], abs=6e-7), name


def test_compressible_stress_tends_to_the_incompressible_one():
    stretch = np.array([0.5, 0.8, 1.3, 2.5])
    law = make_law("ogden2", PARAMETERS["ogden2"], bulk_over_shear=1e6)
    assert law.uniaxial_compressible(stretch) == pytest.approx(law.nominal_stress("uniaxial", stretch), rel=1e-4)


def test_the_plane_modulus_is_youngs_over_1_minus_the_square_of_poissons():
    """mu = 0.5 MPa, K = 2 MPa: E = 9 K mu/(3 K + mu) = 18/13, nu = (3 K - 2 mu)/(6 K + 2 mu) = 5/13, E/(1 - nu^2) = 1.625 MPa."""
    law = make_law("neo_hooke", {"c10": 0.25}, bulk_modulus=2.0)
    assert law.plane_modulus == pytest.approx(18 / 13 / (1 - (5 / 13) ** 2)) == pytest.approx(1.625)


def test_a_law_warns_beyond_either_end_of_its_window_and_not_at_the_ends(recwarn):
    law = make_law("neo_hooke", {"c10": 0.25})
    law.stretch_window = (0.45, 4.0)      # of principal stretches: in tension l and l**-0.5
    law.nominal_stress("uniaxial", np.array([0.46, 3.99]))
    assert not recwarn.list
    for stretch in (0.44, 4.01):
        with pytest.warns(ExtrapolationWarning, match="is based on data from 0.45 to 4"):
            law.nominal_stress("uniaxial", stretch)


def test_bulk_modulus_is_the_stated_multiple_of_mu0_or_the_stated_value():
    for name in PARAMETERS:
        assert law_of(name).bulk_modulus == pytest.approx(20 * law_of(name).mu0), name
        assert make_law(name, PARAMETERS[name], bulk_modulus=3.0).bulk_modulus == 3.0, name


def test_volumetric_energy_is_a_parabola_in_J():
    energy, first, second = make_law("neo_hooke", {"c10": 1.0}, bulk_modulus=8.0).volumetric.at(np.array([0.5, 1.0]))
    assert (energy.tolist(), first.tolist(), second.tolist()) == ([1.0, 0.0], [-4.0, 0.0], [8.0, 8.0])


def test_a_volumetric_function_has_its_derivatives_and_the_bulk_modulus_at_rest():
    """Central differences of step 1e-5: within 1e-8 of K, and 1e-5 for the energy's, which has few digits near J = 1."""
    for name in VOLUMETRIC_FUNCTIONS:
        function, J, step = VOLUMETRIC_FUNCTIONS[name](7.0), np.array([0.4, 0.9, 1.0, 1.3, 2.0]), 1e-5
        ahead, behind = function.at(J + step), function.at(J - step)
        energy, pressure, stiffness = function.at(J)
        assert (ahead[0] - behind[0]) / (2 * step) == pytest.approx(pressure, abs=1e-8 * 7.0), name
        assert (ahead[1] - behind[1]) / (2 * step) == pytest.approx(stiffness, rel=1e-7), name
        assert (energy[2], pressure[2], stiffness[2]) == (0.0, 0.0, 7.0), name
        assert function.linear == (len(set(stiffness)) == 1), name
        assert function.with_modulus(3.0).at(J)[0] == pytest.approx(3.0 / 7.0 * energy), name


def test_the_logarithmic_function_is_as_its_formula_says():
    J = np.array([0.3, 0.8, 1.7])
    energy, pressure, _ = VOLUMETRIC_FUNCTIONS["logarithmic"](4.0).at(J)
    assert energy == pytest.approx(J**2 - 1 - 2 * np.log(J)) and pressure == pytest.approx(2 * (J - 1 / J))


def test_a_law_of_an_unknown_volumetric_function_is_refused():
    with pytest.raises(InputError, match="Volumetric function 'cubic' is unknown; use one of quadratic, logarithmic"):
        make_law("neo_hooke", {"c10": 0.1}, volumetric="cubic")


def test_gent_with_long_chains_is_neo_hooke():
    """They differ by (i1 - 3)/(2 jm), of energies that are differences of numbers near 1: 1e-7 and rounding over it."""
    assert same_law(make_law("gent", {"mu": 0.36, "jm": 1e7}), make_law("neo_hooke", {"c10": 0.18}), within=1e-6)


def test_gent_beyond_its_chains_length_gives_nan_and_not_a_number_to_be_trusted():
    law = make_law("gent", {"mu": 0.3, "jm": 2.0})
    assert np.isfinite(law.nominal_stress("uniaxial", 1.9)) and np.isnan(law.nominal_stress("uniaxial", 2.2))


def test_an_inverted_point_gives_nan_and_not_a_number_to_be_trusted():
    inverted = np.array([[1.0, 1, -1, 0, 0, 0]])
    assert np.isnan(law_of("mooney_rivlin").isochoric(inverted).energy).all()
    assert np.isnan(law_of("ogden2").isochoric(inverted).energy).all()


def test_every_law_is_tested():
    assert set(PARAMETERS) == set(LAWS)


def test_wrong_constants_are_refused_with_a_sentence():
    for name, parameters, sentence in [
        ("moony_rivlin", {}, "Law 'moony_rivlin' is unknown; use one of neo_hooke, mooney_rivlin,"),
        ("neo_hooke", {"c1": 1.0}, "Law neo_hooke takes the constants c10, not c1=1.0."),
        ("neo_hooke", {"c10": float("nan")}, "constant c10 is nan; give a finite number"),
        ("neo_hooke", {"c10": "soft"}, "constant c10 is 'soft'; give a finite number"),
        ("ogden1", {"mu1": 1.0, "alpha1": 0.0}, "constant alpha1 is 0.0, where the energy is undefined"),
        ("mooney_rivlin", {"c10": 0.1, "c01": -0.2}, "initial shear modulus -0.2 MPa"),
    ]:
        with pytest.raises(InputError, match=sentence.replace("(", r"\(")):
            make_law(name, parameters)


def test_constants_may_be_numbers_of_numpy():
    assert make_law("neo_hooke", {"c10": np.float32(0.25)}).parameters == {"c10": 0.25}
    assert make_law("gent", {"mu": 0.3, "jm": np.int64(20)}).parameters == {"mu": 0.3, "jm": 20.0}


def test_a_negative_bulk_modulus_is_refused():
    with pytest.raises(InputError, match="bulk modulus -1 MPa; give a positive one"):
        make_law("neo_hooke", {"c10": 0.1}, bulk_modulus=-1.0)


def test_an_unknown_test_mode_is_refused():
    with pytest.raises(InputError, match="Test mode 'shear' is unknown; use one of uniaxial, equibiaxial, planar"):
        law_of("neo_hooke").nominal_stress("shear", 1.1)


@pytest.mark.parametrize("isochoric", [True, False])
def test_the_extreme_stretches_of_a_point_are_the_roots_of_its_eigenvalues(isochoric):
    """Against NumPy, at random states and at equal stretches; of the isochoric ones det C is taken out."""
    gradients = np.eye(3) + 0.4 * np.random.default_rng(3).standard_normal((200, 3, 3))
    C = np.concatenate([np.swapaxes(gradients, 1, 2) @ gradients, [np.eye(3), np.diag([4.0, 4, 1]), np.diag([9.0, 1, 1])]])
    values = np.linalg.eigvalsh(C)
    if isochoric:
        values = values / np.linalg.det(C)[:, None] ** (1 / 3)
    low, high = stretch_range(np.stack([C[:, i, j] for i, j in zip(ROW, COLUMN, strict=True)], axis=1), isochoric=isochoric)
    assert low == pytest.approx(np.sqrt(values[:, 0]), rel=1e-6, abs=1e-7)
    assert high == pytest.approx(np.sqrt(values[:, 2]), rel=1e-9)
