"""Pseudo-elasticity of Ogden and Roxburgh: its softening, and the constants of a card."""

import math

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.materials.mullins import Mullins

SOFT = Mullins(r=2.0, m_mpa=0.05, beta=0.1)


def test_the_softening_is_that_of_the_error_function():
    expected = 1 - math.erf((0.4 - 0.1) / (0.05 + 0.1 * 0.4)) / 2
    assert SOFT.softening(0.1, 0.4) == pytest.approx(expected, rel=1e-14)


def test_first_loading_is_not_softened():
    assert SOFT.softening(np.array([0.4, 0.5]), 0.4) == pytest.approx([1, 1], abs=0)
    assert SOFT.softening_derivative(np.array([0.4, 0.5]), 0.4) == pytest.approx([0, 0], abs=0)


def test_a_body_that_was_never_loaded_is_not_softened_without_m():
    assert Mullins(2.0, 0.0, 0.1).softening(0.0, 0.0) == 1


def test_the_derivative_of_the_softening_is_that_of_finite_differences():
    energy, step = np.linspace(0.05, 0.35, 7), 1e-6
    difference = (SOFT.softening(energy + step, 0.4) - SOFT.softening(energy - step, 0.4)) / (2 * step)
    assert SOFT.softening_derivative(energy, 0.4) == pytest.approx(difference, rel=1e-8, abs=1e-9)   # round-off


@pytest.mark.parametrize("constants", [(1.0, 0.1, 0.1), (math.nan, 0.1, 0.1), (2.0, -0.1, 0.1), (2.0, 0.1, math.inf),
                                       (2.0, 0.0, 0.0)])
def test_constants_without_a_meaning_are_refused(constants):
    with pytest.raises(InputError, match="mullins: .*(give a finite number|make one of them positive)"):
        Mullins(*constants)


def test_the_energy_is_the_integral_of_the_softening_and_continues_first_loading():
    from scipy.integrate import quad

    lost, _ = quad(lambda energy: float(SOFT.softening(energy, 0.4)), 0.1, 0.4, epsabs=1e-13)
    assert SOFT.energy(0.4, 0.4) - SOFT.energy(0.1, 0.4) == pytest.approx(lost, rel=1e-10)
    assert SOFT.energy(0.4, 0.4) == pytest.approx(0.4, rel=1e-14)
