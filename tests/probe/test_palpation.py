"""Sweeps of a palpation sensor: balance, symmetry, both scenarios, switches."""

import numpy as np
import pytest
from support.probes import small_design

from softtact.errors import InputError
from softtact.probe.sweep import palpate, slope
from softtact.readout.strip import line_weights


@pytest.fixture(scope="module")
def moved():
    return palpate(small_design(), "rubber", "displacement")


def test_films_that_cover_the_base_carry_the_jaws_force(moved):
    assert moved.film_force_n.sum(axis=1) == pytest.approx(moved.force_n, rel=1e-5)     # the residual's tolerance is 1e-6


def test_both_supports_carry_the_same(moved):
    assert moved.film_force_n[:, 1] == pytest.approx(moved.film_force_n[:, 2], rel=1e-6)


def test_the_load_that_a_moved_jaw_felt_moves_it_as_far(moved):
    loaded = palpate(small_design(), "rubber", "load", values=moved.force_n[:1])
    assert loaded.jaw_mm == pytest.approx(moved.jaw_mm[:1], rel=1e-5)
    assert loaded.beam_deflection_mm == pytest.approx(moved.beam_deflection_mm[:1], rel=1e-5)


def test_a_sliding_jaw_needs_less_force_than_a_bonded_one(moved):
    assert palpate(small_design(jaw="sliding"), "rubber", "displacement").force_n[-1] < 0.9 * moved.force_n[-1]


@pytest.mark.parametrize("loose", ["tissue_on_beam", "beam_on_base"])
def test_a_unilateral_interface_with_much_friction_is_nearly_a_bonded_one(moved, loose):
    own = palpate(small_design(**{loose: 1.0}), "rubber", "displacement", values=np.array([1.0]))
    # Edges may lift: of the beam's ends over the supports, and of the tissue's rims.
    assert own.force_n[-1] == pytest.approx(moved.force_n[0], rel=0.1)
    assert own.film_force_n[-1].sum() == pytest.approx(own.force_n[-1], rel=1e-4)


def test_a_lump_off_the_middle_loads_the_support_on_its_side():
    lump = {"x": 12.0, "depth": 7.5, "width": 10.0, "height": 5.0, "stiffness_ratio": 20.0}
    own = palpate(small_design(lump=lump), "rubber", "displacement", values=np.array([1.0]))
    assert own.film_force_n[0, 1] > 1.01 * own.film_force_n[0, 2]


def test_weights_of_a_line_integrate_a_linear_traction_over_any_part():
    x = np.array([0.0, 0.5, 1.0, 2.0, 3.0])
    q = line_weights(x, 0.4, 2.2)
    t = 1.0 + 2.0 * x     # MPa mm; its nodal forces are those that the shape functions give
    points, weights = np.polynomial.legendre.leggauss(3)
    force = np.zeros(5)
    for first in (0, 2):
        length = x[first + 2] - x[first]
        s = 0.5 * (points + 1)
        N = np.array([(1 - s) * (1 - 2 * s), 4 * s * (1 - s), s * (2 * s - 1)])
        force[first:first + 3] += N @ (0.5 * length * weights * (N.T @ t[first:first + 3]))
    assert q @ force == pytest.approx((2.2 - 0.4) + 2.2**2 - 0.4**2, rel=1e-12)


def test_the_slope_of_a_known_curve():
    d = np.linspace(0.1, 1, 10)
    own = slope(50 * d + 8 * d**2, d)
    assert own.initial_n_mm == pytest.approx(50, rel=1e-9) and own.secant_n_mm == pytest.approx((50.8, 58))
    assert own.line_n_mm == pytest.approx(np.polyfit(np.append(0, d), np.append(0, 50 * d + 8 * d**2), 1)[0])


def test_a_slope_needs_a_growing_deflection():
    with pytest.raises(InputError, match="deflection grows"):
        slope(np.array([1.0, 2.0]), np.array([0.2, 0.1]))
