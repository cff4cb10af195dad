"""Sideways motion of a bonded layer's surface against the half-space's closed forms, a long wave and another derivation."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.models.elastic.ball_on_layer import BallOnLayer
from softtact.models.elastic.layer_shear import ShearedContact, outward
from softtact.models.elastic.wide_layer import surface_spectrum


def surface_response(x, nu):
    """A and B of one wave: sideways motion of the surface, times G k, under unit traction sin(k s) and unit pressure cos(k s).

    u = U sin(k s), w = W cos(k s); the four solutions at the bottom (u = w = 0) and at the top (sigma_z, tau given).
    """
    c = 3 - 4 * nu

    def solutions(z):
        up, down = np.exp(z), np.exp(-(z + x))      # z in 1/k: -x at the bottom, 0 at the top; down is 1 at the bottom
        u, w = np.array([up, down, z * up, z * down]), np.array([-up, down, (c - z) * up, (c + z) * down])
        du = np.array([up, -down, (1 + z) * up, (1 - z) * down])
        dw = np.array([-up, -down, (c - z - 1) * up, (1 - c - z) * down])
        return u, w, 2 * (dw + nu / (1 - 2 * nu) * (u + dw)), du - w

    bottom, top = solutions(-x), solutions(0.0)
    system = np.array([bottom[0], bottom[1], top[2], top[3]])
    loads = np.array([[0, 0, 0, 1.0], [0, 0, -1.0, 0]]).T
    return top[0] @ np.linalg.solve(system, loads)


@pytest.mark.parametrize("x", [0.02, 0.3, 1.0, 3.0, 18.0])
@pytest.mark.parametrize("nu", [0.2, 0.4, 0.49])
def test_the_closed_forms_are_the_solutions_of_naviers_equations(x, nu):
    """Agreement to the round-off of a 4 x 4 system, whose condition grows with exp(2 x) and 1 / (1 - 2 nu)."""
    _, along, _, push = surface_spectrum(np.array([x]), thickness_mm=1.0, shear_mpa=1.0, poisson=nu)
    assert surface_response(x, nu) == pytest.approx(np.array([x * along[0], x * push[0]]), rel=1e-8, abs=1e-10)


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


@pytest.mark.parametrize(("sizes", "sentence"), [
    ((0.0, 1.0, 1.0), "contact_radius=0 is not possible; give a finite length above 0"),
    ((-1.0, 1.0, 1.0), "contact_radius=-1 is not possible"),
    ((1.0, 1.0, float("inf")), "thickness=inf is not possible; give a finite length above 0"),
    ((1.0, 1.0, 1.0, 0.7), "poisson=0.7 is not possible; give a number above -1 and up to 0.5")])
def test_what_is_no_contact_on_a_layer_is_refused_in_a_sentence(sizes, sentence):
    with pytest.raises(InputError, match=sentence):
        ShearedContact(*sizes)


def test_far_from_a_small_contact_a_thick_layer_moves_as_a_half_space_under_a_point_force():
    """Johnson (3.76): F / (2 pi G r) along the force, (1 - nu) F / (2 pi G r) across; (7.35): centre (2 - nu) F / (8 G a)."""
    nu, ratio = 0.3, np.array([10.0, 30.0, 60.0])
    contact = ShearedContact(1e-4, 1.0, 1.0, nu)
    centre = 8 / (2 * np.pi * (2 - nu) * ratio)
    assert contact.motion(1e-4 * ratio, 0 * ratio)[:, 0] == pytest.approx(centre, rel=0.03)       # the bottom takes 1 % at 60
    assert contact.motion(0 * ratio, 1e-4 * ratio)[:, 0] == pytest.approx((1 - nu) * centre, rel=0.03)


@pytest.mark.parametrize("poisson", [0.3, 0.49])
def test_the_motion_of_a_small_contact_falls_without_a_jump_to_nothing(poisson):
    contact, away = ShearedContact(0.02, 1.0, 2.0, poisson), np.geomspace(0.08, 60.0, 400)
    along, across = contact.motion(away, 0 * away)[:, 0], contact.motion(0 * away, away)[:, 0]
    assert (np.diff(along) < 1e-6).all(), "it falls"
    assert np.abs(np.diff(across)).max() < 0.004 and np.abs(np.array([along, across])[:, -1]).max() < 1e-6
