"""What a law remembers at points: stress and tangent are derivatives of the potential, and its limits are those of its parts."""

from dataclasses import replace

import numpy as np
import pytest

from softtact.materials.inelastic import Inelastic
from softtact.materials.laws.registry import make_law
from softtact.materials.mullins import Mullins
from softtact.materials.prony import PronySeries

RUBBER = make_law("mooney_rivlin", {"c10": 0.2, "c01": 0.05}, bulk_over_shear=20)
SERIES = PronySeries((0.3, 0.2), (0.1, 5.0))
BOTH = Inelastic(Mullins(1.6, 0.01, 0.1), SERIES)


def strained(seed, size=0.3, count=5):
    """C6 (n, 6) of random gradients."""
    F = np.eye(3) + size * np.random.default_rng(seed).uniform(-1, 1, (count, 3, 3))
    C = np.einsum("nki,nkj->nij", F, F)
    return C[:, [0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]]


def elastic(C6, tangent=False):
    return RUBBER.isochoric(C6, tangent=tangent)


def remembered(memory, *, seconds, largest=0.4):
    """The history of points after two increments, in which another one of `seconds` has begun."""
    history = memory.at_rest(5)
    for seed, size, then in ((1, largest, 0.2), (2, 0.2, seconds)):
        history = memory.after(history, elastic(strained(seed, size)), then)
    return history


@pytest.mark.parametrize("size", [0.15, 0.6], ids=["below the greatest energy", "beyond it"])
def test_stress_and_tangent_are_the_derivatives_of_the_potential_of_an_increment(size):
    history, C6, step = remembered(BOTH, seconds=0.3), strained(7, size), 1e-6
    found = BOTH.response(history, elastic(C6, tangent=True), C6)
    for k in range(6):
        change = np.zeros(6)
        change[k] = 2 * step if k < 3 else step     # E = (C - 1)/2, its shears doubled
        up, down = (BOTH.response(history, elastic(C6 + sign * change), C6 + sign * change) for sign in (1, -1))
        np.testing.assert_allclose(found.stress[:, k], (up.energy - down.energy) / (2 * step), rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(found.tangent[:, k], (up.stress - down.stress) / (2 * step), rtol=1e-5, atol=1e-7)


def test_an_increment_of_no_time_is_instantaneous_and_one_without_end_relaxed():
    memory, C6 = Inelastic(prony=SERIES), strained(3)
    rest = memory.at_rest(5)
    at_once = memory.after(rest, elastic(strained(1, 0.0)), 0.0)
    np.testing.assert_allclose(memory.response(at_once, elastic(C6), C6).stress, elastic(C6).stress, rtol=1e-13)
    np.testing.assert_allclose(memory.response(rest, elastic(C6), C6).stress, 0.5 * elastic(C6).stress, rtol=1e-13)
    slow = Inelastic(prony=replace(SERIES, moduli="relaxed"))
    np.testing.assert_allclose(slow.response(rest, elastic(C6), C6).stress, elastic(C6).stress, rtol=1e-13)


def test_increments_add_up_to_the_hereditary_integral_with_an_error_of_second_order():
    """Against the integral of the relaxation over the path, by Simpson's rule on 20,001 points."""
    from scipy.integrate import simpson

    memory, end = Inelastic(prony=SERIES), 1.0
    def stretched(time):
        stretch = 1 + 0.5 * np.sin(2 * np.asarray(time)) ** 2
        zero = np.zeros_like(stretch)
        return np.stack([stretch**2, 1 / stretch, 1 / stretch, zero, zero, zero], axis=-1)

    time = np.linspace(0, end, 20_001)
    stress = elastic(stretched(time)).stress[:, 0]
    # the integral by parts: G(0) S(t) - int dG/ds(t - s) S(s) ds
    fading = sum(g / tau * np.exp(-(end - time) / tau) for g, tau in zip(SERIES.g, SERIES.tau_s, strict=True))
    expected = stress[-1] - simpson(fading * stress, x=time)

    def error(count):
        history, steps = memory.at_rest(1), np.linspace(0, end, count + 1)
        history = memory.after(history, elastic(stretched(steps[:1])), end / count)
        for at in steps[1:-1]:
            history = memory.after(history, elastic(stretched([at])), end / count)
        C6 = stretched(steps[-1:])
        return abs(memory.response(history, elastic(C6), C6).stress[0, 0] - expected)

    errors = [error(count) for count in (20, 40, 80)]
    assert errors[-1] < 1e-4 * abs(expected)
    assert np.log2(np.array(errors[:-1]) / errors[1:]) == pytest.approx(2, abs=0.15)


def test_a_law_of_other_units_softens_and_relaxes_alike():
    stiffer = make_law("mooney_rivlin", {"c10": 2.0, "c01": 0.5}, bulk_over_shear=20)
    scaled, C6 = BOTH.scaled(10.0), strained(7, 0.15)
    history = scaled.at_rest(5)
    for seed, size, then in ((1, 0.4, 0.2), (2, 0.2, 0.3)):
        history = scaled.after(history, stiffer.isochoric(strained(seed, size), tangent=False), then)
    found = scaled.response(history, stiffer.isochoric(C6, tangent=False), C6).stress
    np.testing.assert_allclose(found, 10 * BOTH.response(remembered(BOTH, seconds=0.3), elastic(C6), C6).stress, rtol=1e-12)
