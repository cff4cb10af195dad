"""Tests over time: how they are read, and the Prony series that is fitted to them."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.materials.prony import PronySeries
from softtact.materials.prony_fitting import fit_prony
from softtact.materials.time_tests import TimeTest, read_time_tests

SWEEP = "frequency_hz,storage_modulus_mpa,loss_modulus_mpa\n"
TRUTH = PronySeries((0.15, 0.2, 0.1), (0.03, 1.0, 40.0))
TIMES, HERTZ = np.geomspace(0.01, 300, 60), np.geomspace(0.001, 30, 30)


def relaxation(times=TIMES, *, scale=0.7, noise=0.0, series=TRUTH):
    return measured(TimeTest("relaxation", times, scale * series.relaxation(times)[None], "relaxation.csv"), noise)


def frequency(hz=HERTZ, *, scale=1.3, noise=0.0, series=TRUTH):
    return measured(TimeTest("frequency", hz, scale * np.stack(series.storage_loss(2 * np.pi * hz)), "dma.csv"), noise)


def measured(test, noise):
    factor = 1 + noise * np.random.default_rng(7).standard_normal(test.values.shape)
    return TimeTest(test.mode, test.at, test.values * factor, test.source)


@pytest.mark.parametrize("tests", [[relaxation()], [frequency()], [relaxation(), frequency()]], ids=["time", "frequency", "both"])
def test_clean_data_give_back_the_series_its_number_of_terms_and_the_instantaneous_modulus(tests):
    found = fit_prony(tests)
    assert found.series.g == pytest.approx(TRUTH.g, rel=1e-6) and found.series.tau_s == pytest.approx(TRUTH.tau_s, rel=1e-6)
    assert found.scales == pytest.approx([test.values[0, 0] / test.of(TRUTH)[0, 0] for test in tests], rel=1e-6)
    assert found.not_identifiable == [] and list(found.warnings) == []


@pytest.mark.parametrize(("test", "noise"), [(relaxation(noise=0.003), 0.003), (frequency(noise=0.01), 0.01)],
                         ids=["time", "frequency"])
def test_noise_moves_the_constants_by_their_standard_errors(test, noise):
    found = fit_prony([test], terms=3)
    assert found.relative_error == pytest.approx(noise, rel=0.25)       # of large and small moduli alike
    for name in ("g", "tau_s"):
        miss = np.abs(np.array(getattr(found.series, name)) - getattr(TRUTH, name))
        assert (miss < 3 * np.array(found.standard_error[name])).all(), name


def test_the_stated_error_is_the_scatter_of_repeated_tests():
    rng, clean = np.random.default_rng(1), relaxation(series=PronySeries((0.3,), (2.0,)))
    noisy = [clean.values * (1 + 0.01 * rng.standard_normal(clean.values.shape)) for _ in range(60)]
    fits = [fit_prony([TimeTest("relaxation", clean.at, values)], terms=1) for values in noisy]
    scatter = np.std([fit.series.g[0] for fit in fits])
    assert np.mean([fit.standard_error["g"][0] for fit in fits]) == pytest.approx(scatter, rel=0.3)


def test_a_time_beyond_the_test_is_told():
    short = relaxation(np.geomspace(0.01, 3, 40), noise=0.002)
    found = fit_prony([short], terms=3)
    assert any("lies outside of the tested 0.01 to 3 s" in text for text in found.warnings)
    assert found.not_identifiable and any("do not determine" in text for text in found.warnings)
    assert len(fit_prony([short]).series.g) == 2      # without a number, no more terms than the data hold


def test_moduli_that_contradict_each_other_are_told():
    good = frequency(noise=0.01)
    bad = TimeTest("frequency", good.at, good.values * [[1.0], [3.0]], "dma.csv")
    assert any("storage and loss modulus of dma.csv contradict each other" in text for text in fit_prony([bad]).warnings)
    assert list(fit_prony([good]).warnings) == []


def test_shear_moduli_of_two_tests_that_differ_are_told_and_those_in_another_unit_are_refused():
    tension = TimeTest("relaxation", TIMES, 3 * TRUTH.relaxation(TIMES)[None], "relaxation.csv", 1 / 3)

    def both(factor):
        return fit_prony([tension, TimeTest("frequency", HERTZ, factor * frequency(scale=1.0).values, "dma.csv", 1.0)], terms=3)

    assert both(1.2).shear_modulus_mpa == pytest.approx(1.1, rel=1e-3) and list(both(1.2).warnings) == []
    told, = both(2.0).warnings
    assert "modulus of dma.csv (frequency), 2 MPa, is 2 times that of relaxation.csv (relaxation), 1 MPa; check" in told
    with pytest.raises(InputError, match=r"of relaxation.csv \(relaxation\), 1 MPa, is 200 times that of dma.csv .* another unit"):
        both(0.005)


def test_a_modulus_that_relaxes_to_nothing_is_told():
    times = np.geomspace(0.01, 30, 60)
    fluid = TimeTest("relaxation", times, np.exp(-times / 2)[None], "gel.csv")
    assert any("relaxes to nothing within the tests" in text for text in fit_prony([fluid], terms=1).warnings)


def test_more_terms_than_the_data_can_have_are_refused():
    with pytest.raises(InputError, match="30 terms of a Prony series have 61 constants, and the tests 60 values"):
        fit_prony([relaxation()], terms=30)


@pytest.mark.parametrize(("header", "factor"), [
    ("time_s,relaxation_modulus_mpa", 1.0), ("time_ms,force_n", 1e3), ("time,nominal_stress\nmin,kPa", 1 / 60),
    ("time_h,normalised_modulus", 1 / 3600)])
def test_a_relaxation_is_read_in_any_measure(write_file, header, factor):
    path = write_file(f"{header}\n" + "".join(f"{factor * t:.12g},{-5 + t / 10}\n" for t in range(1, 6)), "relaxation.csv")
    (test,) = read_time_tests([(path, "relaxation")])
    assert test.at == pytest.approx([1, 2, 3, 4, 5])
    assert test.values[0] / test.values[0, 0] == pytest.approx((5 - np.arange(1, 6) / 10) / 4.9)      # of a compressed specimen


@pytest.mark.parametrize(("header", "factor"), [("frequency_hz,storage_modulus_mpa,loss_modulus_mpa", 1.0),
                                                ("frequency,storage_modulus,loss_modulus\nrad/s,kPa,kPa", 2 * np.pi)])
def test_a_sweep_is_read_in_any_order_of_frequencies(write_file, header, factor):
    path = write_file(f"{header}\n" + "".join(f"{factor * f:.12g},{100 + f},{10 - f}\n" for f in (3, 1, 4, 2)), "frequency.csv")
    (test,) = read_time_tests([(path, "frequency")])
    assert test.at == pytest.approx([1, 2, 3, 4])
    assert test.values[1] / test.values[0] == pytest.approx([9 / 101, 8 / 102, 7 / 103, 6 / 104])


@pytest.mark.parametrize(("mode", "content", "sentence"), [
    ("relaxation", "time_s,force_n\n0,1\n1,2\n2,3\n3,2\n4,1\n", "row 4: the stress rises up to here, as in the ramp"),
    ("relaxation", "time_s,force_n\n0,4\n1,3\n1,3\n2,2\n", "row 4: the time 1 s does not rise; give one relaxation"),
    ("relaxation", "time_s,force_n\n-1,4\n1,3\n2,3\n3,2\n", "row 2: the time -1 s is negative; let it count from the step"),
    ("relaxation", "time_s,force_n\n0,4\n1,3\n2,3\n3,-2\n", "row 5: the value -2 is not positive"),
    ("relaxation", "time_s,force_n\n0,4\n1,3\n", r"2 row\(s\) are too few for a test of relaxation"),
    ("relaxation", "t,force_n\n0,4\n1,3\n2,3\n3,2\n", "no column holds the time among t, force_n; name one of them time_s"),
    ("frequency", "frequency_hz,storage_modulus_mpa\n1,1\n2,2\n3,3\n4,4\n", "no column holds the loss modulus"),
    ("frequency", f"{SWEEP}1,1,1\n2,2,1\n3,3,1\n3,4,1\n", "row 5: the frequency 3 Hz comes twice"),
    ("frequency", f"{SWEEP.replace(',s', ',shear_s')}1,1,1\n2,2,1\n3,3,1\n4,4,1\n",
     "shear_storage_modulus_mpa and loss_modulus_mpa are of two tests"),
    ("frequency", f"{SWEEP}0,1,1\n2,2,1\n3,3,1\n4,4,1\n", "row 2: the frequency 0 Hz is not positive")])
def test_a_test_over_time_that_cannot_be_is_refused(write_file, mode, content, sentence):
    with pytest.raises(InputError, match=sentence):
        read_time_tests([(write_file(content, f"{mode}.csv"), mode)])
