"""Sideways motion of a bonded layer's surface against the half-space's closed forms, a long wave and another derivation."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.models.elastic.ball_on_layer import BallOnLayer, layer_over_half_space
from softtact.models.elastic.layer_shear import ShearedContact, _surface_response, outward


def test_the_kernels_of_short_waves_are_those_of_a_half_space():
    along, push = _surface_response(18.0, 0.3)
    assert along == pytest.approx(1 - 0.3, abs=1e-10)
    assert push == pytest.approx(-0.5 * (1 - 2 * 0.3), abs=1e-10)


def test_a_long_wave_shears_the_layer_without_bending_it():
    along, _ = _surface_response(1e-2, 0.3)
    assert along == pytest.approx(1e-2, rel=1e-3)       # u = tau h / G


@pytest.mark.parametrize("x", [0.3, 1.0, 3.0])
def test_the_layer_stores_energy_under_every_pair_of_traction_and_pressure(x):
    """The symmetric (Betti) matrix of the responses along and down is positive definite."""
    nu = 0.4
    compliance = np.array([[_surface_response(x, nu)[0], _surface_response(x, nu)[1]],
                          [_surface_response(x, nu)[1], (1 - nu) * layer_over_half_space(np.array([x]), nu)[0]]])
    assert np.linalg.eigvalsh(compliance).min() > 0


def test_a_ball_draws_the_surface_of_a_compressible_half_space_inwards_by_the_closed_form():
    """Johnson (3.43b): outside the contact u_r = -(1 - 2 nu) F / (4 pi G r)."""
    nu, ball = 0.3, BallOnLayer(1.0, 50.0, 60.0, 0.3)
    found = outward(ball, np.array([2.0, 4.0]))
    expected = -(1 - 2 * nu) * ball.force_over_shear_modulus / (4 * np.pi * np.array([2.0, 4.0]))
    assert found == pytest.approx(expected, rel=0.05)       # the tail of the waves and the layer's bottom


def test_a_nearly_incompressible_layer_is_pushed_outwards_by_a_ball():
    assert outward(BallOnLayer(1.0, 5.0, 1.5, 0.49), np.array([1.5]))[0] > 0


def test_a_stuck_contact_moves_as_one_piece_on_a_deep_layer():
    contact = ShearedContact(1.0, 1.0, 60.0, 0.3)
    inside = contact.motion(np.array([0.0, 0.5, 0.0]), np.array([0.0, 0.0, 0.8]))
    assert inside[:, 0] == pytest.approx(1.0, abs=0.03)      # Johnson (7.35): uniform under 1 / sqrt(1 - r^2/a^2)
    assert inside[:, 1] == pytest.approx(0.0, abs=0.03)


def test_slip_at_the_edge_lets_the_surface_there_lag_behind():
    stuck, slipped = (ShearedContact(1.0, share, 2.0, 0.49).motion(np.array([0.9]), np.array([0.0]))[0, 0] for share in (1.0, 0.2))
    assert slipped < stuck - 0.1


def test_the_motion_decays_within_a_few_thicknesses():
    contact = ShearedContact(1.0, 0.8, 1.0, 0.49)
    assert np.abs(contact.motion(np.array([8.0]), np.array([3.0]))).max() < 0.01


def test_a_share_above_one_is_refused():
    with pytest.raises(InputError, match="share that sticks, 1.2, is not between 0 and 1"):
        ShearedContact(1.0, 1.2, 2.0)
