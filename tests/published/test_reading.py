"""A good archive is read to its values; every oddity is named by file and row, and only its test is lost."""

import numpy as np
import pytest
from small_archive import Archive, counts_of, dent

from softtact.errors import InputError
from softtact.published.archive import ARRANGEMENTS, PRINTED, arrange, correlations, counts_sentence, counts_table, find_archive
from softtact.published.importing import files_table, found_counts, items_of, object_name, read_archive, sign_towards_pcb

BOTH = ["elastic", "hyperelastic"]
MAPS = ("Flat", "hyperelastic")
FLAT_MAPS, FLAT_REAL = "Flat_Simulation_Abaqus.csv", "Flat_Real_Abaqus.csv"


def read(folder, **options):
    return read_archive(find_archive(folder, **{"models": BOTH} | options))


def refusal(call, *arguments, **options):
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    return str(caught.value)


def test_maps_and_readings_of_a_test_are_paired_by_order(archive, tmp_path):
    tables = read(archive.write(tmp_path))
    assert tables.outliers.findings == []
    test = next(test for test in tables.tests["flat"] if test.path == "EchoH/test_1")
    frame = archive.maps[MAPS]
    expected = frame[frame.Path == "EchoH/test_1"].drop(columns="Path").to_numpy().reshape(5, 57, 33)
    assert np.array_equal(tables.maps_mm("hyperelastic", "flat", test), np.float32(expected))
    real = archive.real["Flat"]
    assert np.array_equal(tables.readings("flat", test), np.float32(real[real.Path == "EchoH/test_1"].iloc[:, 1:29]))


def test_each_object_has_its_own_tests_though_one_name_begins_another(archive, tmp_path):
    tables = read(archive.write(tmp_path))
    paths = {test.path for test in tables.tests["flat"] if test.object == "echo"}
    assert paths == {"Echo/test_0", "Echo/test_1"}


def test_an_object_is_named_by_the_text_before_the_first_slash():
    for path, name in [
        ("CircleG/a/b", "circle_g"), ("CircleXS/1", "circle_xs"), ("AForm", "a_form"), ("DiagonalInver/x", "diagonal_inver"),
        ("EchoH/x", "echo_h"), ("Echo/x", "echo"), ("Object5/x", "object_5"), ("Bordes V\\x", "bordes_v"), ("/x", "")]:
        assert object_name(path) == name, path


@pytest.mark.parametrize(("ending", "isaac"), [("", "Issac"), ("_V1", "Isaac"), ("_V1_Noise", "issac")])
def test_files_are_known_by_how_their_names_begin(archive, tmp_path, ending, isaac):
    found = find_archive(archive.write(tmp_path, ending=ending, isaac=isaac), models=BOTH)
    assert list(found.simulated) == BOTH
    assert {file.variant for file in found.files()} == {ending.removeprefix("_")}


def test_of_several_variants_one_must_be_named(archive, tmp_path):
    for ending in ("_V1", "_V1_Noise"):
        archive.write(tmp_path, ending=ending)
    assert "are files of one kind; name the one to read by its ending in 'data.variant'" in refusal(
        find_archive, tmp_path, models=BOTH)
    found = find_archive(tmp_path, models=BOTH, variant="V1")
    assert {file.path.stem.split("_", 3)[3] for file in found.files()} == {"V1"}
    assert "(it is 'V2')" in refusal(find_archive, tmp_path, models=BOTH, variant="V2")


def test_the_shares_folders_may_stay_and_an_ending_that_is_asked_for_must_be_there(archive, tmp_path):
    archive.write(tmp_path / "Simulations/all", ending="_V1")
    assert len(find_archive(tmp_path, models=BOTH).files()) == 6
    said = refusal(find_archive, tmp_path, models=BOTH, variant="V2")
    assert "Simulations/all/Curved_Real_Abaqus_V1.csv is the only file of its kind" in said


def test_a_missing_folder_and_a_missing_kind_are_refused_with_where_to_get_them(archive, tmp_path):
    assert "Lab-CORO/TactileDataset" in refusal(find_archive, tmp_path / "none", models=BOTH)
    archive.write(tmp_path)
    (tmp_path / "Curved_Real_Abaqus.csv").unlink()
    assert "there is no file Curved_Real_Abaqus*.csv" in refusal(find_archive, tmp_path, models=BOTH)


def test_only_models_with_simulations_are_read(tmp_path):
    folder = Archive(models=("hyperelastic",)).write(tmp_path)
    assert list(find_archive(folder, models=BOTH).simulated) == ["hyperelastic"]
    assert "Flat_Simulation_Isaac*.csv" in refusal(find_archive, folder, models=["elastic"])


def test_path_may_stand_anywhere_and_an_index_column_is_passed_over(archive, tmp_path):
    frame = archive.maps[MAPS]
    archive.maps[MAPS] = frame[["Path", *frame.columns[:-1]]]
    folder = archive.write(tmp_path)
    archive.real["Flat"].to_csv(folder / FLAT_REAL)
    tables = read(folder)
    assert len(tables.tests["flat"]) == 12
    assert [(f.file, f.row, f.done) for f in tables.outliers.findings] == [(FLAT_REAL, 1, "kept")]


def test_commas_for_decimals_are_read_and_reported(archive, tmp_path):
    plain, comma = read(archive.write(tmp_path / "a")), read(archive.write(tmp_path / "b", sep=";", decimal=","))
    assert np.array_equal(plain.real["flat"][0].values, comma.real["flat"][0].values)
    assert all("decimals are written with ','" in f.what for f in comma.outliers.findings) and len(comma.outliers.findings) == 6


def test_a_text_amid_decimal_commas_costs_its_own_test_alone(archive, tmp_path):
    real = archive.real["Flat"].copy()
    archive.real["Flat"].tax9 = real.tax9.map(lambda value: str(value).replace(".", ","))
    set_value(archive, FLAT_REAL, 2, "tax9", "n/d")
    set_value(archive, FLAT_REAL, 7, "tax9", "1.234,5")
    tables = read(archive.write(tmp_path, sep=";", decimal=","))
    left_out = [f for f in tables.outliers.findings if f.done == "left out"]
    assert [(f.row, f.path, f.what) for f in left_out] == [
        (FIRST[FLAT_REAL] + 2, "EchoH/test_0", "'n/d' in place of a number"),
        (FIRST[FLAT_REAL] + 7, "EchoH/test_1", "'1.234,5' in place of a number")]
    test = tables.tests["flat"][0]
    assert np.array_equal(tables.readings("flat", test), np.float32(real[real.Path == test.path].iloc[:, 1:29]))


# Where the test EchoH/test_0 begins: four tests of five frames go before.
FIRST = {FLAT_REAL: 4 * 5 + 2, FLAT_MAPS: 4 * 5 * 57 + 2}


def of(archive, kind):
    return archive.real["Flat"] if kind == FLAT_REAL else archive.maps[MAPS]


def put(archive, kind, frame):
    if kind == FLAT_REAL:
        archive.real["Flat"] = frame
    else:
        archive.maps[MAPS] = frame


def set_value(archive, kind, row, column, value):
    frame = of(archive, kind).astype({column: object})
    frame.loc[FIRST[kind] - 2 + row, column] = value
    put(archive, kind, frame)


def drop(archive, kind, rows):
    put(archive, kind, of(archive, kind).drop(index=[FIRST[kind] - 2 + row for row in rows]))


ODDITIES = [
    (lambda a: drop(a, FLAT_MAPS, [3]), FLAT_MAPS, 0, "284 rows are no whole number of maps of 57 rows"),
    (lambda a: drop(a, FLAT_MAPS, range(57)), FLAT_MAPS, 0, "4 maps and 5 readings in Flat_Real_Abaqus.csv"),
    (lambda a: drop(a, FLAT_REAL, range(5)), "Flat_Simulation_Isaac.csv", 0, "the test is not in Flat_Real_Abaqus.csv"),
    (lambda a: set_value(a, FLAT_MAPS, 60, "x5", "0,12"), FLAT_MAPS, 60, "'0,12' in place of a number"),
    (lambda a: set_value(a, FLAT_MAPS, 60, "x5", "inf"), FLAT_MAPS, 60, "a value is missing or infinite"),
    (lambda a: set_value(a, FLAT_MAPS, 60, "x5", 7.0), FLAT_MAPS, 60, "7 mm is not within -2.5 to 2.5"),
    (lambda a: set_value(a, FLAT_REAL, 2, "tax9", 20117.0), FLAT_REAL, 2,
     "20117 counts is not within -240 to 5000; raw values of the converter?"),
]


@pytest.mark.parametrize(("inject", "file", "row", "said"), ODDITIES, ids=[said[:30] for *_, said in ODDITIES])
def test_an_outlier_is_named_by_file_and_row_and_only_its_test_is_left_out(archive, tmp_path, inject, file, row, said):
    inject(archive)
    tables = read(archive.write(tmp_path))
    left_out = [f for f in tables.outliers.findings if f.done == "left out"]
    assert (left_out[0].file, left_out[0].path, left_out[0].what) == (file, "EchoH/test_0", said)
    assert left_out[0].row == FIRST.get(file, FIRST[FLAT_MAPS]) + row
    assert {test.path for test in tables.tests["flat"]} == set(archive.real["Flat"].Path) - {"EchoH/test_0"}
    assert len(tables.tests["curved"]) == 4


def test_a_surplus_field_is_named_and_shifts_nothing(archive, tmp_path):
    folder = archive.write(tmp_path)
    lines = (folder / FLAT_MAPS).read_text().split("\n")
    lines[FIRST[FLAT_MAPS] + 7 - 1] += ",1.0"
    (folder / FLAT_MAPS).write_text("\n".join(lines))
    (finding,) = read(folder).outliers.findings
    assert (finding.row, finding.path, finding.what) == (FIRST[FLAT_MAPS] + 7, "EchoH/test_0", "more fields than columns")


def test_a_cut_off_row_is_named(archive, tmp_path):
    folder = archive.write(tmp_path)
    lines = (folder / FLAT_MAPS).read_text().split("\n")
    lines[FIRST[FLAT_MAPS] + 7 - 1] = "0.1,0.2"
    (folder / FLAT_MAPS).write_text("\n".join(lines))
    orphan, short = read(folder).outliers.findings
    assert (orphan.row, orphan.done) == (FIRST[FLAT_MAPS] + 7, "kept") and "names no test" in orphan.what
    assert short.path == "EchoH/test_0" and "284 rows" in short.what


def test_blank_lines_count_as_lines_and_are_no_rows(archive, tmp_path):
    set_value(archive, FLAT_MAPS, 60, "x5", 7.0)
    folder = archive.write(tmp_path)
    header, rest = (folder / FLAT_MAPS).read_text().split("\n", 1)
    (folder / FLAT_MAPS).write_text(f"{header}\n\n\n{rest}\n\n")
    (finding,) = read(folder).outliers.findings
    assert finding.row == FIRST[FLAT_MAPS] + 60 + 2


def test_a_test_in_two_places_is_joined_and_reported(archive, tmp_path):
    real = archive.real["Flat"]
    archive.real["Flat"] = real.iloc[[*range(3), *range(5, len(real)), 3, 4]]
    tables = read(archive.write(tmp_path))
    (finding,) = tables.outliers.findings
    assert (finding.row, finding.path, finding.done) == (len(real), "CircleG/test_0", "kept")
    assert len(tables.tests["flat"]) == 12


def test_readings_above_the_papers_scale_are_kept_and_reported(archive, tmp_path):
    set_value(archive, FLAT_REAL, 2, "tax9", 2600.0)
    tables = read(archive.write(tmp_path))
    assert [(f.row, f.done) for f in tables.outliers.findings] == [(FIRST[FLAT_REAL] + 2, "kept")]
    assert len(tables.tests["flat"]) == 12


@pytest.mark.parametrize("column", ["force", "tax11"])
def test_readings_beside_isaacs_maps_must_be_the_same(archive, tmp_path, column):
    folder = archive.write(tmp_path)
    other = archive.real["Flat"].copy()
    other.loc[7, column] += 3.0
    other.to_csv(folder / "Flat_Real_Issac.csv", index=False)
    (finding,) = read(folder).outliers.findings
    assert (finding.path, finding.done) == ("CircleG/test_1", "left out") and "other readings" in finding.what


def test_readings_in_another_order_than_the_maps_are_reported(archive, tmp_path):
    rows = np.arange(len(archive.real["Flat"]))
    rows[20:25] = rows[20:25][::-1]
    archive.real["Flat"] = archive.real["Flat"].iloc[rows]
    findings = read(archive.write(tmp_path)).outliers.findings
    assert [(f.path, f.done) for f in findings] == [("EchoH/test_0", "kept")] * 2
    assert "do not rise with the maps of Isaac (correlation -1.00)" in findings[0].what


def test_a_grasped_object_that_is_an_indenter_too_is_left_out(tmp_path):
    tables = read(Archive(curved=("Mug", "EchoH")).write(tmp_path))
    assert {test.object for test in tables.tests["curved"]} == {"mug"}
    assert tables.outliers.left_out() == ["EchoH/test_0", "EchoH/test_1"]


@pytest.mark.parametrize(("file", "columns", "said"), [
    (FLAT_MAPS, slice(1, None), "row 1 names 32 columns of numbers beside 'Path' where 33 are needed"),
    (FLAT_REAL, slice(1, None), "row 1 names 28 columns of numbers beside 'Path' where 29 are needed (force and the taxels)"),
    (FLAT_REAL, slice(None, -1), "0 columns are named 'Path'")])
def test_a_file_with_other_columns_is_refused(archive, tmp_path, file, columns, said):
    folder = archive.write(tmp_path)
    frame = archive.real["Flat"] if file == FLAT_REAL else archive.maps[MAPS]
    frame.iloc[:, columns].to_csv(folder / file, index=False)
    assert said in refusal(read, folder)


@pytest.mark.parametrize(("options", "refused"), [
    ({"outliers": "leave_out", "largest_share": 0.1}, False), ({"outliers": "leave_out", "largest_share": 0.01}, True),
    ({"outliers": "refuse", "largest_share": 1.0}, True)])
def test_an_archive_with_more_outliers_than_allowed_is_refused(archive, tmp_path, options, refused):
    drop(archive, FLAT_MAPS, [3])
    outliers = read(archive.write(tmp_path)).outliers
    if refused:
        assert "1 of 16 tests of the archive are outliers" in refusal(outliers.refuse, 16, **options)
    else:
        outliers.refuse(16, **options)


def test_maps_that_are_negative_towards_the_pcb_are_turned_and_metres_refused(archive, tmp_path):
    archive.maps[MAPS].iloc[:, :33] *= -1
    archive.maps["Curved", "hyperelastic"].iloc[:, :33] *= -1
    tables = read(archive.write(tmp_path / "a"))
    assert (sign_towards_pcb(tables, "hyperelastic"), sign_towards_pcb(tables, "elastic")) == (-1, 1)
    for key in archive.maps:
        archive.maps[key].iloc[:, :33] *= 1e-3
    assert "may be in metres" in refusal(read, archive.write(tmp_path / "b"))


def test_the_taxels_arrangement_is_found_from_maps_and_readings():
    for arrangement in ARRANGEMENTS:
        rng = np.random.default_rng(1)
        maps = np.array([dent(*rng.uniform([-12, -7, 4], [12, 7, 10])) for _ in range(40)])
        truth = np.array([counts_of(one) for one in maps]).reshape(-1, 7, 4)
        grids = arrange(np.tile(np.arange(28), (1, 1)), arrangement, shape=(7, 4))[0]      # taxel at each place
        counts = np.empty((len(maps), 28))
        counts[:, grids.ravel()] = truth.reshape(len(maps), 28)
        found = correlations(maps, counts, shape=(7, 4))
        assert max(found, key=found.get) == arrangement and found[arrangement] > 0.95, arrangement
        assert sorted(found.values())[-2] < 0.8, arrangement


def test_the_counts_found_are_compared_with_those_printed(archive, tmp_path):
    tables = read(archive.write(tmp_path))
    found = found_counts(tables, items_of(tables, unseen=["donut_m"]))
    assert found == {"real maps": 80, "maps of elastic": 80, "maps of hyperelastic": 80, "real maps of indenters to train on": 50,
                     "real maps of unseen indenters": 10, "real maps of objects": 20}
    assert {row["file"]: (row["rows"], row["tests"], row["objects"]) for row in files_table(tables)}[FLAT_MAPS] == (60 * 57, 12, 6)
    assert counts_sentence(counts_table(found)).count("not met") == 3
    text = counts_table({what: number for what, where, number in PRINTED if where in ("text", "repository")})
    assert counts_sentence(text) == (
        "The count of the abstract is not met (real maps: 53400 printed, 15400 found); the count of the repository is met; "
        "the count of the text is met.")


def test_an_unknown_unseen_indenter_is_refused_with_the_known_ones(archive, tmp_path):
    said = refusal(items_of, read(archive.write(tmp_path)), unseen=["donut_x"])
    assert "no usable test of the archive is of an indenter 'donut_x'; name some of bordes_h, circle_g" in said
