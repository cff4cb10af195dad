"""The kernels of a bonded layer that is infinite in plan: closed forms, limits, and the operator on a grid."""

import numpy as np
import pytest

from softtact.models.elastic.wide_layer import WideLayer, surface_spectrum

SHEAR = 1.0


def elements_through_the_thickness(k, poisson, elements=60):
    """Surface displacement (u, w) of a wave exp(i k x) under tractions (i q, p): quadratic elements in z, thickness 1, fixed below.

    With u = i U exp(i k x), w = W exp(i k x), z up: strains exx = -k U, ezz = W', and i (U' + k W) in shear; all real.
    """
    lame, z = 2 * SHEAR * poisson / (1 - 2 * poisson), np.linspace(0, 1, 2 * elements + 1)
    stiffness = np.zeros((2 * len(z), 2 * len(z)))
    for element in range(elements):
        length = z[2 * element + 2] - z[2 * element]
        for s, weight in zip(*np.polynomial.legendre.leggauss(3), strict=True):
            shape = np.array([s * (s - 1) / 2, 1 - s * s, s * (s + 1) / 2])
            slope = np.array([s - 0.5, -2 * s, s + 0.5]) * 2 / length
            along, up, shear = np.zeros(6), np.zeros(6), np.zeros(6)
            along[0::2], up[1::2], shear[0::2], shear[1::2] = -k * shape, slope, slope, k * shape
            energy = ((lame + 2 * SHEAR) * (np.outer(along, along) + np.outer(up, up))
                      + lame * (np.outer(along, up) + np.outer(up, along)) + SHEAR * np.outer(shear, shear))
            place = slice(4 * element, 4 * element + 6)
            stiffness[place, place] += energy * weight * length / 2
    return np.linalg.inv(stiffness[2:, 2:])[-2:, -2:]


@pytest.mark.parametrize("poisson", [0.0, 0.25, 0.4, 0.49])
def test_the_closed_forms_are_those_of_elements_through_the_thickness(poisson):
    """60 quadratic elements: 1e-5. A wave up is one down with the other sign, so the coupling's sign is that of U by p."""
    for k in (0.1, 0.7, 2.0, 4.0):
        expected = elements_through_the_thickness(k, poisson)
        normal, along, _, coupling = surface_spectrum(np.array(k), thickness_mm=1.0, shear_mpa=SHEAR, poisson=poisson)
        np.testing.assert_allclose([along, normal], np.diag(expected), rtol=1e-5)
        np.testing.assert_allclose([coupling, coupling], [expected[0, 1], expected[1, 0]], rtol=1e-5, atol=1e-6)


def test_a_wave_of_traction_across_itself_shears_the_layer():
    """G v'' = G k^2 v with v(0) = 0 and G v' = q at the surface: v = q sinh(k z) / (G k cosh(k h))."""
    k = np.array([0.2, 1.0, 3.0])
    np.testing.assert_allclose(surface_spectrum(k, thickness_mm=2.0, shear_mpa=0.5, poisson=0.3)[2], np.tanh(2 * k) / (0.5 * k))


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.4995, 0.5])
def test_long_waves_find_a_confined_layer_and_short_ones_a_half_space(poisson):
    """k = 0: h / M, h / G, h / G, 0, and as good as that at k h = 2e-6.

    k h = 1e4, where cosh would overflow: (1 - nu)/(G k), 1/(G k), (1 - 2 nu)/(2 G k).
    """
    thickness, long, short = 2.0, np.array([0.0, 1e-6]), np.array(5e3)
    found = surface_spectrum(long, thickness_mm=thickness, shear_mpa=SHEAR, poisson=poisson)
    confined = thickness * (1 - 2 * poisson) / (2 * SHEAR * (1 - poisson))
    for values, expected in zip(found, (confined, thickness / SHEAR, thickness / SHEAR, 0.0), strict=True):
        np.testing.assert_allclose(values, expected, rtol=1e-8, atol=2e-6)
    scale = 1 / (SHEAR * short)
    found = surface_spectrum(short, thickness_mm=thickness, shear_mpa=SHEAR, poisson=poisson)
    expected = (1 - poisson, 1 - poisson, 1.0, -(0.5 - poisson))
    for values, factor in zip(found, expected, strict=True):
        np.testing.assert_allclose(values, factor * scale, rtol=1e-12)


def test_the_operator_is_the_sum_over_all_points():
    layer = WideLayer.with_constants(1.0, SHEAR, 0.3, (0.25, 0.2), (7, 9))
    kernels, force = layer.kernels, np.random.default_rng(1).standard_normal((3, 7, 9))

    def kernel(name, j, i):
        odd = {"xy": np.sign(j) * np.sign(i), "xn": np.sign(i), "yn": np.sign(j)}
        return kernels[name][abs(j), abs(i)] * odd.get(name, 1)

    expected = np.zeros_like(force)
    for j, i, b, a in np.ndindex(7, 9, 7, 9):
        xx, yy, xy, xn, yn, nn = (kernel(name, j - b, i - a) for name in ("xx", "yy", "xy", "xn", "yn", "nn"))
        expected[:, j, i] += np.array([[xx, xy, xn], [xy, yy, yn], [-xn, -yn, nn]]) @ force[:, b, a]
    operator = layer.operator((7, 9))
    np.testing.assert_allclose(operator(force), expected, atol=1e-13)
    np.testing.assert_allclose(operator.down_of_down(force[2]) + operator.down_of_aside(force[:2]), expected[2], atol=1e-13)
    np.testing.assert_allclose(operator.aside_of_down(force[2]) + operator.aside_of_aside(force[:2]), expected[:2], atol=1e-13)
    np.testing.assert_allclose(layer.operator((7, 9), single=True)(force), expected, atol=1e-5)


def test_the_operator_is_symmetric_and_positive():
    operator = WideLayer.with_constants(1.0, SHEAR, 0.5, (0.2, 0.2), (6, 5)).operator((6, 5))
    matrix = np.array([operator(one.reshape(3, 6, 5)).ravel() for one in np.eye(90)])
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-13)
    assert np.linalg.eigvalsh(matrix)[0] > 0


def test_even_tractions_on_a_wide_field_move_its_middle_as_a_confined_layer():
    """14 thicknesses wide: pressure h p / M, shear h q / G; the sums lack what is beyond, which falls as exp(-1.4 r / h)."""
    thickness, step, count, poisson = 1.0, 0.2, 71, 0.3
    layer = WideLayer.with_constants(thickness, SHEAR, poisson, (step, step), (count, count))
    moved = layer.operator((count, count))(np.full((3, count, count), step**2))[:, count // 2, count // 2]
    confined = 2 * SHEAR * (1 - poisson) / (1 - 2 * poisson)
    np.testing.assert_allclose(moved, [thickness / SHEAR, thickness / SHEAR, thickness / confined], rtol=2e-3)


def test_a_point_force_on_a_thick_layer_is_boussinesqs():
    """At 8 and 16 steps from the force, where hats look like points, on a layer 5 times as thick: (1 - nu)/(2 pi G r), Cerruti's.

    The base takes kappa / (G h) away, all alike, so differences between two distances are compared: 1 %.
    """
    step, nu, near, far = 0.1, 0.3, 8, 16
    kernels = WideLayer.with_constants(8.0, SHEAR, nu, (step, step), (3, far + 1)).kernels
    r = step * np.array([near, far])
    for name, factor in (("nn", 1 - nu), ("xx", 1.0), ("yy", 1 - nu)):
        expected = factor / (2 * np.pi * SHEAR * r)
        found = kernels[name][0, [near, far]]
        assert found[0] - found[1] == pytest.approx(expected[0] - expected[1], rel=0.01)
    # pressure draws points inwards, towards the force: -(1 - 2 nu) / (4 pi G r), near to it
    assert kernels["xn"][0, near] == pytest.approx(-(1 - 2 * nu) / (4 * np.pi * SHEAR * r[0]), rel=0.02)
