"""A ball on a bonded layer against Hertz, the layer squeezed thin, and its own profile."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.models.elastic.ball_on_layer import BallOnLayer, layer_over_half_space


def test_on_a_half_space_force_depth_and_profile_are_those_of_hertz():
    ball, nu = 40.0, 0.3
    found = BallOnLayer(1.0, ball, np.inf, nu)
    # relative: the cap of the ball against Hertz's parabola, (a / R)^2 / 3
    assert found.depth == pytest.approx(1 / ball, rel=5e-4)
    assert found.force_over_shear_modulus == pytest.approx(8 / (3 * (1 - nu) * ball), rel=5e-4)
    rho = np.array([1.2, 1.5, 3.0])
    slope = 2 / (np.pi * ball) * (-rho * np.arcsin(1 / rho) + np.sqrt(1 - 1 / rho**2))
    lowering = 1 / (np.pi * ball) * ((2 - rho**2) * np.arcsin(1 / rho) + np.sqrt(rho**2 - 1))
    assert found.slope(rho) == pytest.approx(slope, rel=2e-3)
    assert found.lowering(rho) == pytest.approx(lowering, rel=2e-3)


def test_a_thin_compressible_layer_is_squeezed_like_a_bed_of_springs():
    thickness, nu, ball = 0.1, 0.0, 100.0
    found = BallOnLayer(1.0, ball, thickness, nu)
    confined_over_shear = 2 * (1 - nu) / (1 - 2 * nu)
    # depth a^2 / 2R and force pi M a^4 / (4 R h); relative: the edge of the layer, where it shears, some h / a
    assert found.depth == pytest.approx(0.5 / ball, rel=0.5 * thickness)
    assert found.force_over_shear_modulus == pytest.approx(np.pi * confined_over_shear / (4 * ball * thickness), rel=thickness)


def test_a_nearly_incompressible_layer_bulges_beside_the_ball():
    thin, thick = (BallOnLayer(1.0, 10.0, thickness, 0.49).lowering(np.array([1.5])) for thickness in (1.0, 30.0))
    assert thin < 0 < thick


def test_the_surface_is_smooth_at_the_edge_of_the_contact():
    found, edge = BallOnLayer(1.0, 50.0, 1.5, 0.49), np.array([1 - 1e-9, 1 + 1e-9])
    assert np.diff(found.lowering(edge)) == pytest.approx(0, abs=1e-6 * found.depth)
    assert np.diff(found.slope(edge)) == pytest.approx(0, abs=2e-4 / 50)     # the cap against the parabola, (a / R)^2 / 2


def test_the_slope_outside_is_the_derivative_of_the_profile():
    found, radius, step = BallOnLayer(1.0, 5.0, 1.5, 0.49), np.array([1.3, 2.0, 4.0]), 1e-4
    derivative = (found.lowering(radius + step) - found.lowering(radius - step)) / (2 * step)
    assert found.slope(radius) == pytest.approx(derivative, abs=1e-7)


def test_the_layer_is_as_soft_as_a_half_space_for_short_waves_and_stiff_for_long_ones():
    assert layer_over_half_space(np.array([30.0]), 0.4) == pytest.approx(1, abs=1e-12)
    # u = p h / M for long waves, over the half-space's (1 - nu) / (G k)
    assert layer_over_half_space(np.array([1e-3]), 0.25) == pytest.approx(1e-3 * (1 - 0.5) / (2 * 0.75**2), rel=1e-3)


def test_a_contact_as_large_as_the_ball_is_refused():
    with pytest.raises(InputError, match="contact radius 5 is not between 0 and the ball's radius 5"):
        BallOnLayer(5.0, 5.0, 1.0)
