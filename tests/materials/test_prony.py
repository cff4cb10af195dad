"""Prony series: relaxation in time and the moduli in frequency, and the constants of a card."""

import math

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.materials.prony import PronySeries

SERIES = PronySeries((0.3, 0.2), (0.1, 10.0))


def test_the_modulus_relaxes_from_one_to_the_relaxed_share():
    assert SERIES.relaxation(np.array([0.0, 1e9])) == pytest.approx([1.0, 0.5], rel=1e-14)
    assert SERIES.relaxation(0.1) == pytest.approx(0.5 + 0.3 * math.exp(-1) + 0.2 * math.exp(-0.01), rel=1e-14)


def test_the_loss_of_one_term_is_greatest_where_omega_tau_is_one():
    storage, loss = PronySeries((0.4,), (2.0,)).storage_loss(np.array([0.25, 0.5, 1.0]))
    assert loss == pytest.approx([0.16, 0.2, 0.16], rel=1e-14)
    assert storage[1] == pytest.approx(0.8, rel=1e-14)


def test_the_moduli_in_frequency_are_the_transform_of_the_relaxation():
    """G*(w) = G_inf + i w int (G(t) - G_inf) exp(-i w t) dt, by Simpson's rule over forty of the longest times."""
    from scipy.integrate import simpson

    omega, time = 3.0, np.linspace(0, 400, 400_001)
    part = SERIES.relaxation(time) - SERIES.relaxed_share
    modulus = SERIES.relaxed_share + 1j * omega * simpson(part * np.exp(-1j * omega * time), x=time)
    assert SERIES.storage_loss(omega) == (pytest.approx(modulus.real, rel=1e-8), pytest.approx(modulus.imag, rel=1e-8))


def test_creep_is_the_inverse_of_relaxation():
    """int G(t - s) dc(s) = g_inf for all t, by parts and Simpson's rule; one term: g late by tau / g_inf (Zener's solid)."""
    from scipy.integrate import simpson

    for end in (0.05, 1.0, 30.0):
        time = np.linspace(0, end, 20_001)
        fading = sum(g / tau * np.exp(-(end - time) / tau) for g, tau in zip(SERIES.g, SERIES.tau_s, strict=True))
        assert SERIES.creep(end) - simpson(fading * SERIES.creep(time), x=time) == pytest.approx(0.5, rel=1e-7)
    shares, times = PronySeries((0.2,), (3.0,)).retardation()
    assert shares == pytest.approx([0.2], rel=1e-12) and times == pytest.approx([3.0 / 0.8], rel=1e-12)


def test_relaxed_moduli_are_scaled_to_the_instantaneous_ones():
    assert SERIES.instantaneous_factor == 1
    assert PronySeries(SERIES.g, SERIES.tau_s, "relaxed").instantaneous_factor == pytest.approx(2)


@pytest.mark.parametrize(("g", "times", "moduli", "sentence"), [
    ((0.5, 0.5), (1.0, 2.0), "relaxed", "the sum of g is 1; give shares"),
    ((0.5,), (1.0, 2.0), "relaxed", "g has 1 values and tau_s 2"),
    ((), (), "relaxed", "g is empty"),
    ((-0.1,), (1.0,), "relaxed", "g has the value -0.1"),
    ((0.1,), (0.0,), "relaxed", "tau_s has the value 0; give finite numbers above 0"),
    ((0.1,), (math.nan,), "relaxed", "tau_s has the value nan"),
    ((0.1,), (1.0,), "long_term", "moduli is 'long_term'; write instantaneous or relaxed")])
def test_a_series_without_a_meaning_is_refused(g, times, moduli, sentence):
    with pytest.raises(InputError, match=f"prony: {sentence}"):
        PronySeries(g, times, moduli)
