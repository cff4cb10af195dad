"""Reading test curves: what is understood, and what is refused in which words."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.materials.checks import refuse_mixed_units
from softtact.materials.curves import Curve, VolumetricCurve, join_by_mode, refuse_idle, write_curve
from softtact.materials.linear import bulk_modulus
from softtact.materials.readers import read_curve, read_curves

PLAIN = "stretch,nominal_stress_mpa\n0.8,-0.3\n1.0,0.0\n1.2,0.2\n"


def test_a_plain_file_is_read_with_the_mode_of_its_name(write_file):
    curve = read_curve(write_file(PLAIN, "planar.csv"))
    assert (curve.mode, curve.kind, curve.source) == ("planar", "measured", "planar.csv")
    assert curve.stretch.tolist() == [0.8, 1.0, 1.2]
    assert curve.nominal_stress.tolist() == [-0.3, 0.0, 0.2]


def test_notes_above_the_header_tell_mode_kind_and_source(write_file):
    path = write_file("# mode: equibiaxial\n# kind: synthetic\n# source: made: by hand\n" + PLAIN, "x.csv")
    curve = read_curve(path)
    assert (curve.mode, curve.kind, curve.source) == ("equibiaxial", "synthetic", "made: by hand")


def test_a_stated_mode_comes_before_the_files_own(write_file):
    assert read_curve(write_file("# mode: planar\n" + PLAIN), mode="uniaxial").mode == "uniaxial"


def test_percent_and_kilopascal_become_stretch_and_megapascal_with_any_separator(write_file):
    rows = [["engineering_strain_percent", "time", "nominal_stress_kpa"], ["-20", "0", "-300"], ["50", "1", "200"]]
    for separator in (",", ";", "\t"):
        curve = read_curve(write_file("\n".join(separator.join(row) for row in rows)))
        assert curve.stretch == pytest.approx([0.8, 1.5])
        assert curve.nominal_stress == pytest.approx([-0.3, 0.2])


def test_a_users_own_column_names_are_mapped(write_file):
    path = write_file("Dehnung [%];Spannung [kPa]\n10;50\n20;90\n")
    columns = {"engineering_strain_percent": "Dehnung [%]", "nominal_stress_kpa": "Spannung [kPa]"}
    assert read_curve(path, columns=columns).nominal_stress == pytest.approx([0.05, 0.09])


def test_a_falling_stretch_is_one_loading_branch(write_file):
    curve = read_curve(write_file("stretch,nominal_stress_mpa\n1.0,0\n0.9,-0.1\n0.7,-0.4\n"))
    assert curve.stretch.tolist() == [1.0, 0.9, 0.7]


def test_rows_in_disorder_are_sorted_when_told(write_file):
    path = write_file("stretch,nominal_stress_mpa\n1.0,0\n0.8,-0.3\n1.2,0.2\n")
    assert read_curve(path, sort=True).stretch.tolist() == [0.8, 1.0, 1.2]


def test_a_written_curve_reads_back(tmp_path):
    curve = Curve("planar", np.array([1.0, 1.25]), np.array([0.0, 0.125]), "synthetic", "a law, seed 1")
    write_curve(tmp_path / "any.csv", curve)
    again = read_curve(tmp_path / "any.csv")
    assert (again.mode, again.kind, again.source) == ("planar", "synthetic", "a law, seed 1")
    assert np.array_equal(again.stretch, curve.stretch) and np.array_equal(again.nominal_stress, curve.nominal_stress)


def test_curves_of_one_mode_are_joined_and_sorted(write_file):
    tension = write_file("stretch,nominal_stress_mpa\n1.0,0\n1.2,0.2\n", "tension.csv")
    compression = write_file("stretch,nominal_stress_mpa\n0.9,-0.1\n0.8,-0.3\n", "compression.csv")
    (joined,) = join_by_mode(read_curves([tension, compression], mode="uniaxial"))
    assert joined.stretch.tolist() == [0.8, 0.9, 1.0, 1.2]
    assert joined.window == (0.8, 1.2)


def test_one_synthetic_part_makes_the_whole_synthetic(write_file):
    measured, made = write_file(PLAIN, "a.csv"), write_file("# kind: synthetic\n" + PLAIN, "b.csv")
    assert join_by_mode(read_curves([measured, made], mode="uniaxial"))[0].kind == "synthetic"


HEADER = "stretch,nominal_stress_mpa\n"


def test_an_unreadable_or_implausible_curve_is_refused_by_file_row_value_and_remedy(write_file):
    for text, sentence in [
        ("", "the file is empty; give a test curve"),
        (HEADER, r"0 point\(s\) make no curve; give at least two"),
        (HEADER + "1.0,0\n1.1,nan\n", "row 3: the value 'nan' is not finite; correct it or remove the row"),
        (HEADER + "1.0,0\n1.1,\n", "row 3: '' is not a number; correct it or remove the row"),
        (
            "stretch;nominal_stress_mpa\n1,0;0,1\n1,1;0,2\n",
            "row 2: '1,0' is not a number; write it with a decimal point",
        ),
        (HEADER + "0,0\n0.1,0.1\n", "row 2: the stretch 0 is not positive; .* name it engineering_strain"),
        (HEADER + "0,1\n-0.3,1.2\n", "row 2: the stretch 0 is not positive; .* engineering_strain_percent.$"),  # nor swapped
        (HEADER + "1,0\n50,0.1\n", "row 3: the stretch 50 is above 25, .* name it engineering_strain_percent"),
        (HEADER + "1,0\n1.5,350\n", "row 3: the stress 350 MPa is beyond 200 MPa, .* nominal_stress_kpa"),
        (HEADER + "1,0\n1.1,0\n1.2,0\n", "every stress is 0, as of a channel that was not recorded; name the right column"),
        ("# mode: volumetric\nvolume_ratio,pressure_mpa\n1,0\n0.9,0\n", "every pressure is 0, as of a channel"),
        (HEADER + "0.7,0.47\n1,0\n", "row 2: the stress 0.47 MPa has the wrong sign .* compression negative"),
        (HEADER + "1,0\n1.2,0.2\n1.1,0.1\n", "row 4: the stretch turns back to 1.1; keep one loading branch"),
        (HEADER + "1,0\n0.9,-0.1\n1.1,0.1\n1.3,0.2\n", "row 3: the stretch turns back to 0.9; keep one loading branch"),
        ("lambda,nominal_stress_mpa\n1,0\n", "no column holds the stretch among lambda, nominal_stress_mpa; name one"),
        ("stretch,engineering_strain,nominal_stress_mpa\n1,0,0\n", "several columns hold the stretch"),
    ]:
        path = write_file(text)
        with pytest.raises(InputError, match=sentence) as refusal:
            read_curve(path)
        assert str(refusal.value).startswith(str(path)), text
        assert str(refusal.value).endswith("."), text


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="uniaxial.csv: there is no such file"):
        read_curve(tmp_path / "uniaxial.csv")


def test_a_mode_for_all_files_that_changes_nothing_is_refused_and_one_that_does_is_not(write_file, published):
    path = write_file(PLAIN, "planar.csv")
    assert read_curves([path], mode="uniaxial")[0].mode == "uniaxial"
    with pytest.raises(InputError, match="the mode uniaxial for all files has no effect, as each states one"):
        read_curves([f"equibiaxial={path}"], mode="uniaxial")
    with pytest.raises(InputError, match="has no effect"):
        read_curves(published / "literature" / "Treloar_1944", layout="literature", mode="uniaxial")


def test_a_mapped_header_that_no_file_has_is_refused(write_file):
    columns = {"engineering_strain": "Dehnung"}
    with pytest.raises(InputError, match="`columns` maps engineering_strain to 'Dehnung', which no file has in its header"):
        read_curves([write_file(PLAIN, "planar.csv")], columns=columns)


def test_a_window_or_a_weight_that_changes_nothing_is_refused():
    for window, weights, modes, sentence in (
        ({"planr": (1, 2)}, {}, ["planar"], "The window of 'planr': .*planar"),
        ({}, {"planar": 2.0}, ["uniaxial", "equibiaxial"], "The weight of planar has no effect, as there is no planar curve"),
        ({}, {"uniaxial": 2.0}, ["uniaxial"], "The weight of the only mode has no effect"),
        ({}, {"uniaxial": 2.0}, ["uniaxial", "volumetric"], "The weight of the only mode has no effect"),
        ({}, {"volumetric": 2.0}, ["uniaxial", "planar", "volumetric"], "as K is fitted to that curve alone"),
    ):
        with pytest.raises(InputError, match=sentence):
            refuse_idle(window, weights, modes=modes)
    refuse_idle({"uniaxial": (0.5, 2)}, {"uniaxial": 2.0}, modes=["uniaxial", "planar"])


def test_a_file_without_a_mode_is_refused(write_file):
    with pytest.raises(InputError, match="the test mode is 'batch7'; state one of uniaxial, equibiaxial, planar"):
        read_curve(write_file(PLAIN, "batch7.csv"))


def test_an_unknown_layout_is_refused(write_file):
    with pytest.raises(InputError, match="layout 'excel' is unknown; use one of plain, soro_db, stress_stretch"):
        read_curve(write_file(PLAIN), layout="excel")


def test_a_plain_file_is_not_taken_for_the_databases_layout(write_file):
    with pytest.raises(InputError, match="no header with 'Engineering Strain' was found; is its layout soro_db"):
        read_curve(write_file(PLAIN), layout="soro_db")


def test_the_databases_files_are_read(published):
    curve = read_curve(published / "soro_db" / "Dragon Skin 30.csv", layout="soro_db")
    assert curve.mode == "uniaxial"
    assert (curve.stretch[0], curve.nominal_stress[0]) == pytest.approx((1.0446, 0.01736))
    assert (curve.stretch[-1], curve.nominal_stress[-1]) == pytest.approx((8.09091, 4.14551))


def test_every_file_of_the_database_is_read(published):
    files = sorted((published / "soro_db").glob("*.csv"))
    assert len(files) == 6
    assert all(len(curve.stretch) > 50 for curve in read_curves(files, layout="soro_db"))


def test_two_bare_columns_are_stress_then_stretch(published):
    folder = published / "literature" / "Treloar_1944" / "UT"
    curve = read_curve(folder / "stress_stretch.txt", layout="stress_stretch", mode="uniaxial")
    assert (curve.stretch[-1], curve.nominal_stress[-1], len(curve.stretch)) == (7.6, 6.3176, 24)


def test_true_stress_and_true_strain_become_nominal_stress_and_stretch(write_file):
    """Constant volume: the section shrinks by the stretch. ln 2 = 0.693147; 3 MPa over a stretch of 2 is 1.5 MPa."""
    for unit, stress in {"mpa": "3", "kpa": "3000", "pa": "3000000"}.items():
        curve = read_curve(write_file(f"true_strain,true_stress_{unit}\n0,0\n{np.log(2)},{stress}\n"))
        assert curve.stretch == pytest.approx([1, 2])
        assert curve.nominal_stress == pytest.approx([0, 1.5])


def test_a_volumetric_test_is_pressure_against_volume(write_file):
    curve = read_curve(write_file("volumetric_strain_percent,pressure_kpa\n0,0\n-2,140\n", "volumetric.csv"))
    assert curve.mode == "volumetric"
    assert curve.volume_ratio == pytest.approx([1, 0.98]) and curve.pressure == pytest.approx([0, 0.14])


def test_a_volumetric_curve_reads_back(tmp_path):
    curve = VolumetricCurve(np.array([0.9, 1.0]), np.array([0.7, 0.0]), "synthetic", "a law, seed 1")
    write_curve(tmp_path / "any.csv", curve)
    again = read_curve(tmp_path / "any.csv")
    assert (again.mode, again.kind, again.source) == ("volumetric", "synthetic", "a law, seed 1")
    assert np.array_equal(again.volume_ratio, curve.volume_ratio) and np.array_equal(again.pressure, curve.pressure)


def test_a_written_volumetric_curve_keeps_the_bulk_modulus_of_a_hardly_compressed_rubber(tmp_path):
    pressure = np.linspace(0, 0.01, 14)
    write_curve(tmp_path / "any.csv", VolumetricCurve(1 - pressure / 2000, pressure))
    assert bulk_modulus(read_curve(tmp_path / "any.csv"), bulk_over_shear=20).modulus_mpa == pytest.approx(2000, rel=1e-5)


def test_a_path_can_state_its_own_mode(write_file):
    paths = write_file(PLAIN, "specimen_7.csv"), write_file(PLAIN, "specimen_8.csv")
    assert [curve.mode for curve in read_curves([f"planar={paths[0]}", f"uniaxial={paths[1]}"])] == ["planar", "uniaxial"]


def test_a_compression_test_without_a_minus_is_read_when_told(write_file):
    for text in ["engineering_strain,nominal_stress_mpa\n0.1,0.1\n0.3,0.5\n",
                 "stretch,nominal_stress_mpa\n0.9,0.1\n0.7,0.5\n"]:
        curve = read_curve(write_file(text), compression=True)
        assert curve.stretch == pytest.approx([0.9, 0.7]) and curve.nominal_stress == pytest.approx([-0.1, -0.5]), text


def test_a_curve_that_no_rubber_gives_is_refused(write_file):
    for name, text, sentence in [
        ("volumetric", "volume_ratio,pressure_mpa\n1,0\n0.98,-0.1\n", "row 3: the pressure -0.1 MPa has the wrong sign"),
        ("volumetric", "volume_ratio,pressure_mpa\n1,0\n0.02,0.1\n", "row 3: the volume ratio 0.02 .* volumetric_strain"),
        ("uniaxial", HEADER + "1.1,0.05\n1.2,0.09\n1.3,130\n1.4,160\n", "row 4: the stress jumps to 130 MPa.*are units mixed"),
        ("uniaxial", HEADER + "0.02,1.1\n0.1,1.3\n0.2,2\n", "row 2: the stress 1.1 MPa has the wrong sign.*are they swapped"),
        ("uniaxial", HEADER + "0.9,0.1\n0.8,0.3\n", "write `compression: true` for a compression test written without a minus"),
        ("uniaxial", HEADER + "1.2,0.1\n1.2,0.3\n", "every row has the stretch 1.2; give a curve over a range"),
        ("uniaxial", "true_strain,nominal_stress_mpa\n0,0\n900,1\n", "row 3: the true strain 900 is beyond any elastomer"),
    ]:
        with pytest.raises(InputError, match=sentence):
            read_curve(write_file(text, f"{name}.csv"))


def test_a_mapped_name_that_is_no_quantity_is_refused(write_file):
    with pytest.raises(InputError, match="`columns` maps 'mass', which is no quantity with a unit"):
        read_curve(write_file("F,e\n1,0\n"), columns={"mass": "F"})


def test_curves_in_different_units_are_refused_with_both_names(write_file):
    mpa = write_file(HEADER + "1.1,0.1\n1.3,0.3\n", "uniaxial.csv")
    kpa = write_file(HEADER + "1.1,130\n1.3,180\n", "planar.csv")
    with pytest.raises(InputError, match=r"planar.csv \(planar\) is .* times as stiff as uniaxial.csv .* another unit"):
        refuse_mixed_units(read_curves([mpa, kpa]))


def neo_hooke_rows(stretches, *, minus=True):
    """CSV of a neo-Hookean uniaxial test, with or without its minus signs."""
    stress = 0.35 * (stretches - stretches**-2)
    strain = stretches - 1
    rows = zip(strain, stress, strict=True) if minus else zip(np.abs(strain), np.abs(stress), strict=True)
    return "engineering_strain,nominal_stress_mpa\n" + "".join(f"{e:.6f},{s:.6f}\n" for e, s in rows)


def test_a_compression_test_that_may_be_tension_gets_a_remark(write_file):
    (remark,) = read_curve(write_file(neo_hooke_rows(np.linspace(1, 0.5, 11), minus=False))).remarks
    assert "steepens from the start" in remark and "`compression: true`" in remark


def test_a_test_with_its_signs_is_not_remarked_upon(write_file):
    for end in [0.5, 1.9]:
        assert read_curve(write_file(neo_hooke_rows(np.linspace(1, end, 11)))).remarks == (), end


def test_strains_that_may_be_in_another_unit_are_remarked_upon(write_file):
    for header, rows, remark in [
        ("engineering_strain", "1,0.01\n5,0.05\n10,0.09\n", "if the column holds percent"),
        ("engineering_strain_percent", "0.1,0.03\n0.3,0.09\n0.5,0.14\n", "if the column holds a ratio"),
    ]:
        (said,) = read_curve(write_file(f"{header},nominal_stress_mpa\n{rows}")).remarks
        assert remark in said, header


def test_a_remark_stays_with_the_curve_in_the_projects_own_file(write_file, tmp_path):
    curve = read_curve(write_file(neo_hooke_rows(np.linspace(1, 0.5, 11), minus=False)))
    write_curve(tmp_path / "copy.csv", curve)
    assert read_curve(tmp_path / "copy.csv").remarks == curve.remarks


def test_no_published_test_is_remarked_upon_or_refused(published):
    curves = read_curves(sorted((published / "soro_db").glob("*.csv")), layout="soro_db")
    for name in ("Treloar_1944", "Kawabata_1981"):
        curves += read_curves(published / "literature" / name, layout="literature")
    assert [curve.remarks for curve in curves] == [()] * 12


def test_a_literature_folder_is_read_with_its_three_modes(published):
    curves = read_curves(published / "literature" / "Treloar_1944", layout="literature")
    assert [(curve.mode, len(curve.stretch)) for curve in curves] == [("uniaxial", 24), ("equibiaxial", 16), ("planar", 13)]


def test_a_folder_without_that_layout_is_refused(tmp_path):
    with pytest.raises(InputError, match="holds no UT, ET or PS with a stress_stretch.txt"):
        read_curves(tmp_path, layout="literature")
