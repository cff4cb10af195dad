"""The archive's files in any dialect read back as they were; with a fault a test reads back as it was, or is left out."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from small_archive import Archive
from support.table_files import faults

from softtact.errors import InputError
from softtact.published.archive import find_archive
from softtact.published.importing import read_archive

quick = settings(max_examples=12, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
REAL, MAPS = "Flat_Real_Abaqus.csv", "Flat_Simulation_Abaqus.csv"


@pytest.fixture(scope="module")
def small():
    """A small archive of one model, in tests of two frames."""
    return Archive(flat=("CircleG", "Echo"), curved=("Mug",), tests=2, frames=2, models=("hyperelastic",))


@pytest.fixture(scope="module")
def folder(small, tmp_path_factory):
    return small.write(tmp_path_factory.mktemp("archive"))


def read(folder):
    return read_archive(find_archive(folder, models=["hyperelastic"]))


def assert_tests_are_those_of(small, tables):
    """Each usable test has the forces, the readings and the maps that were written."""
    real, maps = small.real["Flat"].set_index("Path"), small.maps["Flat", "hyperelastic"].set_index("Path")
    for test in tables.tests["flat"]:
        own = real.loc[test.path].to_numpy(dtype=float)
        assert tables.real["flat"][0].force_n[test.readings] == pytest.approx(own[:, 0]), test.path
        assert np.allclose(tables.readings("flat", test), own[:, 1:], rtol=1e-6), test.path
        assert np.allclose(tables.maps_mm("hyperelastic", "flat", test).reshape(-1, 33), maps.loc[test.path], atol=1e-6), test.path


@quick
@given(st.data())
def test_columns_are_found_by_name_in_any_order_and_dialect(small, folder, data):
    separator, decimal = data.draw(st.sampled_from([(",", "."), (";", ","), (";", "."), ("\t", ","), (",", ",")]))
    encoding = data.draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16"]))
    force = data.draw(st.sampled_from(["force", "Fz", "F_z", "Force (N)", "force_n", "Load [N]", "normal force"]))
    word = data.draw(st.sampled_from(["tax{}", "Taxel {}", "t{:02d}", "{}"]))
    names = {"force": force} | {f"tax{k}": word.format(k) for k in range(1, 29)}
    for name, frame in ((REAL, small.real["Flat"].rename(columns=names)), (MAPS, small.maps["Flat", "hyperelastic"])):
        frame = frame[data.draw(st.permutations(list(frame.columns)))]
        frame.to_csv(folder / name, index=data.draw(st.booleans()), sep=separator, decimal=decimal, encoding=encoding)
    tables = read(folder)
    assert len(tables.tests["flat"]) == 4 and len(tables.tests["curved"]) == 2
    assert_tests_are_those_of(small, tables)


@settings(quick, max_examples=25)
@given(st.data())
def test_a_faulty_file_is_refused_or_gives_only_tests_that_read_back(small, folder, data):
    small.write(folder)
    name = data.draw(st.sampled_from([REAL, MAPS]))
    text = (folder / name).read_text()
    (folder / name).write_text(data.draw(faults(text, ",", "\n")))
    try:
        tables = read(folder)
    except InputError as error:
        assert name in str(error) or "archive" in str(error)
        return
    assert_tests_are_those_of(small, tables)


def refused(small, folder, names, said):
    small.write(folder)
    small.real["Flat"].rename(columns=names).to_csv(folder / REAL, index=False)
    with pytest.raises(InputError, match=said):
        read(folder)


@pytest.mark.parametrize(("names", "said"), [
    ({"force": "time"}, "0 columns are named as a force where one is needed .* name the column of the normal force 'force'"),
    ({"force": "Fx"}, "0 columns are named as a force"),
    ({"tax3": "load"}, "2 columns are named as a force"),
    ({"force": "Force (kN)"}, "the column 'Force \\(kN\\)' is in kN; convert it to N"),
    ({"tax3": "tax30"}, "'tax1' to 'tax28' do not give the order of the columns"),
    ({"tax3": "left"}, "do not give the order of the columns"),
    ({"tax3": "tax4"}, "do not give the order of the columns")])
def test_names_that_do_not_tell_which_column_is_which_are_refused(small, folder, names, said):
    refused(small, folder, names, said)


def rewrite(folder, name, change):
    (folder / name).write_text(change((folder / name).read_text()))


def test_decimal_commas_between_commas_are_refused(small, folder):
    small.write(folder)
    rewrite(folder, REAL, lambda text: text.replace(".", ","))
    with pytest.raises(InputError, match="row 2: it has more fields than row 1 has columns, as 8 of 8 rows have; write decimals"):
        read(folder)


def test_a_map_of_zeros_at_the_top_hides_no_decimal_commas(small, folder):
    small.write(folder, sep=";", decimal=",")
    lines = (folder / MAPS).read_text().splitlines()
    lines[1:58] = [";".join(["0"] * 33 + [line.rsplit(";", 1)[1]]) for line in lines[1:58]]
    (folder / MAPS).write_text("\n".join(lines) + "\n")
    tables = read(folder)
    assert len(tables.tests["flat"]) == 4 and tables.simulated["hyperelastic"]["flat"].values[:57].max() == 0


def test_a_comma_that_may_be_one_of_thousands_is_refused(small, folder):
    small.write(folder)
    rows = ["force;" + ";".join(f"tax{k}" for k in range(1, 29)) + ";Path"]
    rows += [";".join(["5"] + ["1,234"] * 28 + [path]) for path in small.real["Flat"].Path]
    (folder / REAL).write_text("\n".join(rows) + "\n")
    with pytest.raises(InputError, match="row 2: the comma of '1,234' may be a decimal sign or a thousands separator"):
        read(folder)


def test_a_file_cut_off_within_its_last_number_loses_that_test(small, folder):
    small.write(folder)
    frame = small.real["Flat"]
    frame[["Path", *frame.columns[:-1]]].to_csv(folder / REAL, index=False)
    rewrite(folder, REAL, lambda text: text[:-3])
    tables = read(folder)
    assert {test.path for test in tables.tests["flat"]} == {"CircleG/test_0", "CircleG/test_1", "Echo/test_0"}
