"""Tests with loading and unloading: the rows of first loading, and the fit of the Mullins effect."""

import numpy as np
import pytest
from law_constants import PARAMETERS

from softtact.errors import InputError
from softtact.materials.curves import Curve, make_curve
from softtact.materials.cycles import CyclicTest, energy_of, fit_mullins
from softtact.materials.laws.registry import make_law
from softtact.materials.mullins import Mullins
from softtact.materials.readers import read_curve, read_cycles

LAW = make_law("yeoh", {"c10": 0.2, "c20": -0.005, "c30": 0.002})
TRUTH = Mullins(r=1.8, m_mpa=0.05, beta=0.2)
HEADER = "stretch,nominal_stress_mpa\n"


def cycles_to(*amplitudes, start=1.0, back=1.02, rows=31):
    """Stretches of a test that is unloaded to `back` after each amplitude."""
    parts = [np.array([start])]
    for amplitude in amplitudes:
        parts += [np.linspace(parts[-1][-1], amplitude, rows)[1:], np.linspace(amplitude, back, rows)[1:]]
    return np.concatenate(parts)


def softening_test(stretch, *, mode="uniaxial", law=LAW, effect=TRUTH, noise=0.0):
    energy = energy_of(law, mode, stretch)
    stress = effect.softening(energy, np.maximum.accumulate(energy)) * law.nominal_stress(mode, stretch)
    stress = stress + noise * np.abs(stress).max() * np.random.default_rng(4).standard_normal(len(stress))
    return CyclicTest(make_curve(mode, stretch, stress, source="cycles.csv"))


def written(write_file, test):
    curve = test.history
    return write_file(HEADER + "".join(f"{x:.8f},{y:.8f}\n" for x, y in zip(curve.stretch, curve.stress, strict=True)))


@pytest.mark.parametrize("mode", ["uniaxial", "equibiaxial", "planar", "simple_shear"])
@pytest.mark.parametrize("name", PARAMETERS)
def test_the_slope_of_the_energy_along_a_test_is_its_nominal_stress(name, mode):
    law, at, step = make_law(name, PARAMETERS[name]), np.linspace(0.7, 1.6, 7), 1e-5
    slope = (energy_of(law, mode, at + step) - energy_of(law, mode, at - step)) / (2 * step)
    weight = 2 if mode == "equibiaxial" else 1      # of two loaded directions
    assert slope == pytest.approx(weight * law.nominal_stress(mode, at), rel=1e-7, abs=1e-9)


@pytest.mark.parametrize(("mode", "expected"), [
    ("uniaxial", [0, 0.244, 0.4222222222, 0.1528455494, 0.0505927733, 0.2476678969, 0.5693877551, 0.7, 0.317496869, 0.1582758864,
                  0.0254174434]),
    ("planar", [0, 0.2952, 0.4814814815, 0.1752334732, 0.0632839157, 0.2795594111, 0.6253644315, 0.75, 0.3461519258, 0.1841755108,
                0.0330957862])])
def test_softened_stress_along_cycles_is_that_of_felupe(mode, expected):
    """Values of felupe 11.3.0: `ViewMaterialIncompressible` of `OgdenRoxburgh(NeoHooke(mu=0.4), r=1.8, m=0.05, beta=0.2)`."""
    stretch = np.array([1, 1.25, 1.5, 1.3, 1.1, 1.4, 1.75, 2.0, 1.8, 1.4, 1.05])
    test = softening_test(stretch, mode=mode, law=make_law("neo_hooke", {"c10": 0.2}))
    assert test.history.stress == pytest.approx(expected, abs=1e-10)


@pytest.mark.parametrize("mode", ["uniaxial", "planar", "simple_shear"])
def test_cycles_of_several_amplitudes_give_back_the_effect(mode):
    strain = cycles_to(1.5, 2.0, 2.5) - (mode == "simple_shear")
    found = fit_mullins(LAW, [softening_test(strain, mode=mode)])
    assert (found.effect.r, found.effect.m_mpa, found.effect.beta) == pytest.approx((1.8, 0.05, 0.2), rel=1e-5)
    assert found.not_identifiable == [] and found.relative_error < 1e-6 and list(found.warnings) == []


def test_noise_moves_the_constants_by_their_standard_errors():
    found = fit_mullins(LAW, [softening_test(cycles_to(1.5, 2.0, 2.5), noise=0.01)])
    for name, truth in (("r", 1.8), ("m_mpa", 0.05), ("beta", 0.2)):
        assert abs(getattr(found.effect, name) - truth) < 3 * found.standard_error[name], name


def test_one_amplitude_fixes_the_width_of_the_softening_and_not_its_two_constants():
    found = fit_mullins(LAW, [softening_test(cycles_to(2.5, 2.5))])
    greatest = float(energy_of(LAW, "uniaxial", np.array([2.5]))[0])
    assert found.effect.m_mpa == pytest.approx(0.05 + 0.2 * greatest, rel=1e-5) and found.effect.beta == 0
    assert found.not_identifiable == ["beta"]
    assert any("one amplitude, which does not tell m and beta apart" in text for text in found.warnings)


def test_jitter_at_the_start_is_no_second_amplitude():
    stretch = np.concatenate([[1.0, 1.004, 1.002], cycles_to(2.5, 2.5, start=1.005)])
    found = fit_mullins(LAW, [softening_test(stretch)])
    assert not found.several and found.effect.beta == 0 and found.not_identifiable == ["beta"]


@pytest.mark.parametrize("share", [1.0, 1e-3])
def test_a_width_that_cycles_do_not_determine_is_told_of_soft_and_stiff_materials_alike(share):
    """Under noise two large amplitudes determine m + beta W_max, not its small part m."""
    law = make_law("yeoh", {name: share * value for name, value in LAW.parameters.items()})
    test = softening_test(cycles_to(2.0, 2.5), law=law, effect=Mullins(1.8, share * 0.01, 0.2), noise=0.03)
    assert fit_mullins(law, [test]).not_identifiable == ["m_mpa"]


def test_an_unloading_that_hardly_begins_does_not_fix_r():
    stretch = np.concatenate([np.linspace(*ends, 20) for ends in ((1, 1.5), (1.5, 1.49), (1.5, 2.5), (2.5, 2.49))])
    found = fit_mullins(LAW, [softening_test(stretch, noise=0.002)])
    assert "r" in found.not_identifiable and any("do not determine r" in text for text in found.warnings)


def test_cycles_that_the_effect_does_not_describe_are_told():
    curve = softening_test(cycles_to(1.5, 2.0)).history
    set_in = Curve("uniaxial", curve.stretch, np.where(np.gradient(curve.stretch) < 0, 0.3 * curve.stress, curve.stress))
    warnings = fit_mullins(LAW, [CyclicTest(set_in)]).warnings
    assert any("it misses the stress of unloading and reloading by" in text for text in warnings)


def test_only_rows_inside_the_window_fit_the_effect_but_those_beyond_it_soften():
    test = softening_test(cycles_to(1.5, 2.0, 2.5))
    found = fit_mullins(LAW, [test], window={"uniaxial": (1.0, 1.8)})
    assert (found.effect.r, found.effect.m_mpa, found.effect.beta) == pytest.approx((1.8, 0.05, 0.2), rel=1e-4)
    assert found.points < fit_mullins(LAW, [test]).points
    with pytest.raises(InputError, match=r"0 row\(s\) of unloading with a stress are too few"):
        fit_mullins(LAW, [test], window={"uniaxial": (3.0, 4.0)})


def test_a_law_that_ends_before_the_strains_of_the_test_is_refused():
    gent = make_law("gent", {"mu": 0.4, "jm": 2.0})
    test = softening_test(cycles_to(1.5, 2.8))
    with pytest.raises(InputError, match="cycles.csv: the law gent does not exist at the stretch 2.* that the test reaches before"):
        fit_mullins(gent, [test], window={"uniaxial": (1.0, 1.4)})


def test_an_impossible_row_outside_of_first_loading_is_refused_too(write_file):
    """A strain of -1.2 in the first unloading had ended first loading there."""
    test = softening_test(cycles_to(1.5, 2.0, 2.8))
    stretch, text = test.history.stretch.copy(), "engineering_strain,nominal_stress_mpa\n"
    stretch[40] = -0.2
    path = write_file(text + "".join(f"{x - 1:.8f},{y:.8f}\n" for x, y in zip(stretch, test.history.stress, strict=True)))
    with pytest.raises(InputError, match="row 42: the stretch -0.2 is not positive"):
        read_cycles([path], cycles="first")


def test_first_loading_is_the_envelope_and_the_steady_curve_the_last_loading(write_file):
    test = softening_test(cycles_to(1.5, 2.0, 2.0))
    (first,), tests = read_cycles([written(write_file, test)], cycles="first")
    assert first.stress == pytest.approx(LAW.nominal_stress("uniaxial", first.stretch), abs=1e-7)
    assert first.window == (1.0, 2.0) and len(tests) == 1
    (steady,), _ = read_cycles([written(write_file, test)], cycles="steady")
    assert (len(steady.stretch), steady.window) == (31, (1.02, 2.0))
    assert (steady.stress[1:-1] < 0.9 * LAW.nominal_stress("uniaxial", steady.stretch[1:-1])).all()


def test_compression_after_less_tension_is_first_loading_again(write_file):
    stretch = np.concatenate([np.linspace(1, 1.5, 20), np.linspace(1.5, 0.5, 60)[1:], np.linspace(0.5, 1, 20)[1:]])
    (first,), _ = read_cycles([written(write_file, softening_test(stretch))], cycles="first")
    assert first.window == (0.5, 1.5)
    assert first.stress == pytest.approx(LAW.nominal_stress("uniaxial", first.stretch), abs=1e-7)


def test_a_file_of_cycles_is_refused_with_the_options_that_read_it(write_file):
    with pytest.raises(InputError, match="row 32: the stretch turns back at 1.5 .* .--cycles first, steady or mullins"):
        read_curve(written(write_file, softening_test(cycles_to(1.5, 2.0))))


def test_the_turn_from_unloading_to_loading_is_no_hold(write_file):
    """Where the stress falls and rises again within a few rows of nearly the same stretch."""
    back = 1.26 + 0.24 * np.cos(np.linspace(0, 2 * np.pi, 60))
    stretch = np.concatenate([np.linspace(1, 1.5, 40), back, np.linspace(1.5, 2.5, 40)])
    with pytest.raises(InputError, match="turns back at 1.5 over the range before"):
        read_curve(written(write_file, softening_test(stretch)))


@pytest.mark.parametrize(("stretch", "options", "sentence"), [
    (np.linspace(1, 2, 20), {"cycles": "first"}, "uniaxial.csv: the strain only grows, so --cycles has no effect"),
    (cycles_to(2.0), {"cycles": "steady"}, "uniaxial.csv: it is loaded once, so there is no steady cycle; take --cycles first"),
    (cycles_to(2.0), {"cycles": "first", "sort": True}, "in the order of time, .*; leave --sort out, or --cycles"),
    (cycles_to(2.0, start=2.0), {"cycles": "mullins"}, r"1 row\(s\) of loading make no curve; give the test from its start")])
def test_a_test_without_the_cycles_that_are_asked_for_is_refused(write_file, stretch, options, sentence):
    with pytest.raises(InputError, match=sentence):
        read_cycles([written(write_file, softening_test(stretch))], **options)
