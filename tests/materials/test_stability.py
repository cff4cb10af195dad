"""Drucker stability against hand calculation."""

import numpy as np
import pytest
from scipy.optimize import brentq

from softtact.materials.config import law_from_printed
from softtact.materials.consistency import is_stable, log_tangent, plane_tangent, stable_range, stable_ranges
from softtact.materials.laws.base import TEST_PATHS
from softtact.materials.laws.registry import LAWS, make_law


def test_at_rest_the_tangent_is_that_of_an_incompressible_plane():
    """D = mu [[4, 2], [2, 4]]: uniaxial stress gives 3 mu, equibiaxial 6 mu."""
    D = plane_tangent(make_law("neo_hooke", {"c10": 0.5}), "uniaxial", np.array([1.0]))
    assert np.allclose(D[0], [[4, 2], [2, 4]])


def test_the_complex_step_agrees_with_finite_differences():
    law = make_law("ogden2", {"mu1": 0.1351, "alpha1": 1.4538, "mu2": 0.2223, "alpha2": -4.9910})
    stretches, h = np.array([[1.3, 0.9, 0.8]]), 1e-6
    numeric = [
        (law.principal_stress(stretches * np.exp(d)) - law.principal_stress(stretches * np.exp(-d))) / (2 * h)
        for d in h * np.eye(3)
    ]
    assert np.allclose(log_tangent(law, stretches), np.stack(numeric, axis=-1), rtol=1e-8)


def test_a_negative_c01_limits_equibiaxial_stretch_where_theory_says():
    """With t_a = 2 c10 (l_a^2 + r l_a^-2), r = -c01/c10, the determinant of D falls to zero where T1 + 2 T3 does."""

    def determinant(L, ratio):
        T1, T3 = L**2 - ratio * L**-2, L**-4 - ratio * L**4
        return T1 + 2 * T3

    for ratio in (0.05, 0.2):
        expected = brentq(determinant, 1.0, 10.0, args=(ratio,))
        law = make_law("mooney_rivlin", {"c10": 0.2, "c01": -0.2 * ratio})
        # The scan walks in steps of 1 %, and the last stable one counts.
        assert expected / 1.011 < stable_range(law, "equibiaxial")[1] <= expected, ratio


def test_laws_with_nonnegative_constants_are_stable_everywhere():
    for mode in TEST_PATHS:
        values = {"MPa": 0.2, "1": 3.0}
        for name, kind in LAWS.items():
            if name == "gent":
                continue   # has an end of its own
            law = make_law(name, {constant.name: values[constant.unit] for constant in kind.constants})
            assert stable_range(law, mode) == pytest.approx([0.1, 10.0]), name


def test_a_law_without_stiffness_is_stable_nowhere():
    law = LAWS["mooney_rivlin"]({"c10": 0.1, "c01": -0.2}, bulk_modulus=1.0)
    assert stable_ranges(law) == {mode: [1.0, 1.0] for mode in TEST_PATHS}


def test_a_softening_yeoh_is_unstable_beyond_the_peak_of_its_curve():
    """Past the maximum of the Kirchhoff stress in planar tension, psi1 has fallen too far."""
    law = make_law("yeoh", {"c10": 0.2, "c20": -0.02, "c30": 0.0})
    low, high = stable_range(law, "planar")
    assert low > 0.1 and high < 10
    assert is_stable(law, "planar", np.array([high]))[0] and not is_stable(law, "planar", np.array([high * 1.001]))[0]


def test_the_printed_ogden_constants_are_stable_over_the_sensors_range(material_yaml):
    for material in ["neoprene", "polyurethane"]:
        low, high = stable_range(law_from_printed(material_yaml(material), "ogden2"), "uniaxial")
        assert low <= 0.2 and high >= 4, material


def test_gent_is_stable_up_to_where_its_chains_are_taut():
    """l^2 + 2/l - 3 = jm at both ends of the uniaxial path."""
    low, high = stable_range(make_law("gent", {"mu": 0.3, "jm": 3.0}), "uniaxial")
    assert low**2 + 2 / low - 3 == pytest.approx(3.0, rel=1e-4)
    assert high**2 + 2 / high - 3 == pytest.approx(3.0, rel=1e-4)


def test_the_end_of_the_stable_range_is_found_to_its_last_digits():
    """Yeoh with c20 < 0: the uniaxial tangent vanishes first; the scan's own steps are 1 %."""
    law = make_law("yeoh", {"c10": 0.2, "c20": -0.01, "c30": 0.0})
    high = stable_range(law, "uniaxial")[1]
    assert is_stable(law, "uniaxial", np.array([high]))[0]
    assert not is_stable(law, "uniaxial", np.array([high * 1.00001]))[0]
