"""Tests as machines write them: specimens that break, steps that relax, forces and lengths, units of all kinds."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.materials.readers import read_curve

MU = 0.35
HEADER = "stretch,nominal_stress_mpa\n"
STRETCH = np.linspace(1, 3, 201)


def rubber(stretch):
    """Nominal stress (n,) of a neo-Hookean rubber in uniaxial tension."""
    return MU * (stretch - stretch**-2)


def lines(x, y):
    return "".join(f"{a:.5f},{b:.6f}\n" for a, b in zip(x, y, strict=True))


def noise(count, share):
    return 1 + share * np.random.default_rng(5).standard_normal(count)


@pytest.mark.parametrize("share", [0.0, 0.01])
@pytest.mark.parametrize("last", [[0.6, 0.4, 0.3], [0.0], np.linspace(0.95, 0.4, 12), [*np.full(50, 0.8), 1.0]],
                         ids=["in steps", "at once", "slowly", "in part, and it holds on"])
def test_a_stress_that_falls_is_told_with_the_window_before_it(write_file, last, share):
    stress = rubber(STRETCH) * noise(201, share)
    stress[201 - len(last):] *= last
    (remark,) = read_curve(write_file(HEADER + lines(STRETCH, stress))).remarks
    row, end = int(remark.split("from row ")[1].split()[0]), float(remark.split("=1:")[1].rstrip(")"))
    assert "its stress falls" in remark and abs(row - (203 - len(last))) <= (2 if share else 0) + (len(last) == 12)
    assert read_curve(write_file(HEADER + lines(STRETCH, stress)), window={"uniaxial": (1, end)}).remarks == ()


def test_a_compressed_specimen_that_breaks_is_told(write_file):
    stretch = np.linspace(1, 0.4, 61)
    stress = rubber(stretch)
    stress[-5:] *= 0.5
    (remark,) = read_curve(write_file(HEADER + lines(stretch, stress))).remarks
    assert "from row 58 on its stress falls" in remark and "--window uniaxial=0.45:1)" in remark


def held(x, y, *, rows=20, ramp=0, jitter=0.0, share=0.0):
    """A test with holds at the stretches x, whose stress falls from 1.3 y to y, with rows of a ramp before each."""
    rng, found, before = np.random.default_rng(2), [], (1.0, 0.0)
    for at, relaxed in zip(x, y, strict=True):
        up = np.linspace(0, 1, ramp, endpoint=False)    # its first row still has the stretch of the hold before
        found += [(before[0] + k * (at - before[0]), 1.05 * before[1] + k * (1.3 * relaxed - 1.05 * before[1])) for k in up]
        found += [(at, relaxed * (1 + 0.3 * np.exp(-4 * k / (rows - 1)))) for k in range(rows)]
        before = (at, found[-1][1])
    stretch, stress = np.array(found).T
    return stretch + jitter * rng.standard_normal(len(stretch)), stress * (1 + share * rng.standard_normal(len(stress)))


STEPS = np.array([1.2, 1.4, 1.6, 1.8, 2.0])


@pytest.mark.parametrize("shape", [{}, {"rows": 5}, {"ramp": 10}, {"ramp": 50, "rows": 100}, {"jitter": 0.001},
                                   {"rows": 200, "jitter": 0.001, "share": 0.005}])
def test_holds_in_which_the_stress_relaxes_are_refused_unless_the_user_says_which_stress_to_take(write_file, shape):
    path = write_file(HEADER + lines(*held(STEPS, rubber(STEPS), **shape)))
    with pytest.raises(InputError, match="the stress relaxes in 5 holds, by .* neither the instantaneous nor the relaxed"):
        read_curve(path)
    relaxed, instantaneous = read_curve(path, holds="relaxed"), read_curve(path, holds="instantaneous")
    assert relaxed.nominal_stress[-5:] == pytest.approx(rubber(relaxed.stretch[-5:]), rel=0.025)
    assert instantaneous.nominal_stress[-4:] == pytest.approx(1.3 * rubber(instantaneous.stretch[-4:]), rel=0.025)


def test_stress_to_take_of_a_test_without_holds_has_no_effect(write_file):
    with pytest.raises(InputError, match="the stress relaxes at no stretch that is held, so `holds` has no effect"):
        read_curve(write_file(HEADER + lines(STRETCH, rubber(STRETCH) * noise(201, 0.02))), holds="relaxed")


@pytest.mark.parametrize("largest", [0.6, 2.0])
@pytest.mark.parametrize("name", ["planar", "simple_shear"])
def test_simple_shear_is_told_from_planar_tension(write_file, name, largest):
    gamma = np.linspace(0, largest, 41)
    stress = MU * gamma if name == "planar" else MU * (1 + gamma - (1 + gamma) ** -3)
    (remark,) = read_curve(write_file("engineering_strain,nominal_stress_mpa\n" + lines(gamma, stress), f"{name}.csv")).remarks
    other = {"planar": "simple_shear", "simple_shear": "planar"}[name]
    assert remark.endswith(f"if it is one, give it as {other}") and "percent" not in remark


@pytest.mark.parametrize(("unit", "factor"), [
    ("MPa", 1), ("N/mm2", 1), ("N/mm^2", 1), ("MN/m²", 1), ("kPa", 1e3), ("Pa", 1e6), ("bar", 10), ("psi", 145.0377),
    ("lbf/in²", 145.0377), ("ksi", 0.1450377), ("kgf/cm2", 10.19716), ("kgf/cm²", 10.19716), ("kp/cm2", 10.19716),
    ("kgf/mm^2", 0.1019716), ("N/cm2", 100)])
def test_a_stress_in_any_unit_is_read_from_a_row_of_units_and_from_brackets(write_file, unit, factor):
    below = write_file(f"stretch;nominal_stress\n-;{unit}\n1;0\n1.5;{0.25 * factor}\n")
    assert read_curve(below).nominal_stress[1] == pytest.approx(0.25, rel=1e-6)
    beside = write_file(f"stretch;Stress [{unit}]\n1;0\n1.5;{0.25 * factor}\n")
    assert read_curve(beside, columns={"nominal_stress": f"Stress [{unit}]"}).nominal_stress[1] == pytest.approx(0.25, rel=1e-6)


def test_a_name_with_a_unit_declares_it(write_file):
    path = write_file("engineering_strain_percent,nominal_stress_psi\n0,0\n50,36.2594\n")
    assert read_curve(path).nominal_stress[1] == pytest.approx(0.25, rel=1e-5)


def test_a_header_whose_unit_contradicts_the_name_is_refused(write_file):
    path = write_file("stretch,Stress (kPa)\n1,0\n1.5,0.25\n")
    with pytest.raises(InputError, match=r"'Stress \(kPa\)' states the unit 'kPa', and the one that belongs there is mpa"):
        read_curve(path, columns={"nominal_stress_mpa": "Stress (kPa)"})


@pytest.mark.parametrize(("header", "rows"), [
    ("extension_mm,force_n", "0,0\n12.5,5"), ("extension,force\nmm,N", "0,0\n12.5,5"),
    ("extension,force\nin,lbf", "0,0\n0.492126,1.124045"), ("extension,force\ncm,kgf", "0,0\n1.25,0.5098581"),
    ("engineering_strain,force_kn", "0,0\n0.5,0.005")])
def test_force_and_extension_become_stress_and_stretch_with_the_specimens_section_and_length(write_file, header, rows):
    length = None if "strain" in header else 25.0
    curve = read_curve(write_file(f"{header}\n{rows}\n"), area_mm2=20.0, length_mm=length)
    assert (curve.stretch[1], curve.nominal_stress[1]) == pytest.approx((1.5, 0.25), rel=1e-5)


def test_in_simple_shear_the_extension_is_over_the_thickness(write_file):
    curve = read_curve(write_file("extension_mm,force_n\n0,0\n3,5\n", "simple_shear.csv"), area_mm2=20.0, length_mm=6.0)
    assert (curve.shear_strain[1], curve.shear_stress[1]) == pytest.approx((0.5, 0.25))


@pytest.mark.parametrize(("header", "options", "sentence"), [
    ("extension_mm,force_n", {"length_mm": 25.0}, "the column force_n needs the undeformed section in mm2; state it"),
    ("extension_mm,force_n", {"area_mm2": 25.0}, "the column extension_mm needs the undeformed length in mm; state it"),
    ("stretch,nominal_stress_mpa", {"area_mm2": 25.0}, "area_mm2 25 has no effect, as no column is called force_n"),
    ("extension_mm,force_n", {"area_mm2": -1.0, "length_mm": 25.0}, "area_mm2 is -1; give a positive number")])
def test_a_specimen_that_is_not_known_or_not_needed_is_refused(write_file, header, options, sentence):
    with pytest.raises(InputError, match=sentence):
        read_curve(write_file(f"{header}\n1,0\n1.5,5\n"), **options)
