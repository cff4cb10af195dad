"""Tables of a user's own files: what is read, and what is refused before a column can be taken for another."""

import openpyxl
import pytest

from softtact.errors import InputError, missing_extra
from softtact.materials.readers import read_curve
from softtact.tables import read_table

HEADER = "stretch,nominal_stress_mpa\n"


@pytest.fixture
def written(tmp_path):
    """Function: text or bytes -> path of a CSV file with them."""

    def write(content, name="uniaxial.csv"):
        path = tmp_path / name
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


@pytest.fixture
def workbook(tmp_path):
    """Function: {sheet: rows} -> path of a workbook; `change` is called with it before it is saved."""

    def write(sheets, change=lambda book: None):
        book = openpyxl.Workbook()
        book.remove(book.active)
        for name, rows in sheets.items():
            page = book.create_sheet(name)
            for row in rows:
                page.append(row)
        change(book)
        book.save(tmp_path / "uniaxial.xlsx")
        return tmp_path / "uniaxial.xlsx"

    return write


@pytest.mark.parametrize(("content", "options", "sentence"), [
    (HEADER + "1,00,0,000\n1,10,0,096\n", {}, "row 2: it has 4 fields where 2 are named, with commas .* are decimals"),
    (HEADER + '"1,00","0,000"\n', {}, "row 2: '1,00' is not a number; .*state the decimal comma"),
    ("stretch;nominal_stress_mpa\n1.0;0\n", {"decimal": ","}, "row 2: '1.0' is not a number; its decimal sign was stated to be"),
    (HEADER + '1.0,"1,234.5"\n', {}, "row 2: '1,234.5' is not a number; .* no separator of thousands"),
    ('"stretch","nominal_stress_mpa"\n"1",1.0,0.0\n"2",1.1,0.1\n', {}, "row 2: it has 3 fields .* names of the rows, as R"),
    ("stretch,nominal_stress_mpa,stretch,nominal_stress_mpa\n1,0,1,0\n1.1,1,1.1,2\n", {}, "several columns hold the stretch"),
    ("stretch,nominal_stress_mpa,stretch.1,nominal_stress_mpa.1\n1,0,1,0\n1.1,1,1.1,2\n", {}, "several columns hold the stretch"),
    (HEADER + "1.0,0,\n1.1,0.1,\n", {}, "row 2: it has 3 fields .* none at its end that the header does not name"),
    ("Test of 3 May\n" + HEADER + "1.0,0\n1.1,0.1\n", {}, "Pass over lines above the header .--skip-rows N"),
    ("stretch nominal_stress_mpa\n1.0 0\n1.1 0.1\n", {}, "names one column, .*put commas, semicolons or tabs between"),
    (b"PK\x03\x04" + bytes(20), {}, "it is no text, but a workbook of Excel"),
    (HEADER + "1.0,0\n1.1\n", {}, "row 3: it has 1 field where 2 are named"),
    (HEADER + '1.0,"0\n1.1,0.1\n', {}, "row 2: it has unbalanced quotes"),
    (HEADER + "1.0,0\n#N/A,0.1\n", {}, "row 3: '#N/A' is not a number"),
    (HEADER + "1.0,0_1\n1.1,1\n", {}, "row 2: '0_1' is not a number"),
    (HEADER.encode() + "1.0,0.1\n".encode("utf-16-le"), {}, "not text, or UTF-16 without a byte order mark|row 2"),
    (HEADER.encode("utf-16-le"), {}, "not text, or UTF-16 without a byte order mark"),
    (b"stretch,nominal_stress_mpa,\x81\n", {}, "text is neither UTF-8 .* nor cp1252"),
    (HEADER + "1,0\n1.1,0.1\n", {"skip_rows": 3}, "the file is empty below row 3"),
    (HEADER + "1,0\n1.1,0.1\n", {"skip_rows": -1}, "skip_rows is -1"),
    (HEADER + "1,0\n1.1,0.1\n", {"sheet": "a"}, "no sheet 'a', for it is no workbook"),
    (HEADER + "1,0\n1.1,0.1\n", {"columns": {"engineering_strain": "e"}}, "maps engineering_strain to 'e', which no file has"),
    ("# mode: planar\n# mode: uniaxial\n" + HEADER + "1,0\n1.1,0.1\n", {}, "notes state the mode twice, 'planar' and 'uniaxial'"),
    (HEADER + "1.00,0.00\n1.10,0.12\n1.20,0.2", {}, "row 4: the file ends with '0.2', without a line end and shorter than above"),
])
def test_a_table_whose_columns_may_be_others_is_refused(written, content, options, sentence):
    with pytest.raises(InputError, match=sentence):
        read_curve(written(content), **options)


@pytest.mark.parametrize(("content", "options"), [
    ("sep=;\nstretch;nominal_stress_mpa\n1.0;0.0\n1.5;0.25\n", {}),
    ('stretch;nominal_stress_mpa\n1,0;0,0\n"1,5";0,25\n', {"decimal": ","}),
    ("stretch\tnominal_stress_mpa\n1.0\t0.0\n1.5\t0.25".encode("utf-16"), {}),
    ('Machine; 7\nTest\n"stretch","nominal_stress_mpa"\n1.0,0.0\n# slower from here\n1.5,2.5E-1\n', {"skip_rows": 2}),
    (HEADER.replace("\n", ",Größe\n").encode("cp1252") + b"1.0,0.0,\xe4\n1.5,0.25,\n", {}),
    (HEADER + "1.0,\N{MINUS SIGN}0.0\n\n,\n1.5,0.25\n", {}),
])
def test_the_dialects_of_other_programs_are_read(written, content, options):
    curve = read_curve(written(content), **options)
    assert curve.stretch.tolist() == [1.0, 1.5] and curve.nominal_stress.tolist() == [0.0, 0.25]


@pytest.mark.parametrize(("header", "units", "row"), [
    ("engineering_strain;nominal_stress", "%;kPa", "50;250"),
    ("engineering_strain;nominal_stress", "[-];(N/mm²)", "0.5;0.25"),
    ("stretch;nominal_stress_mpa", ";MPa", "1.5;0.25"),
    ("stretch;true_stress", "-;MPa", "1.5;0.375"),
])
def test_a_row_of_units_below_the_header_is_taken_at_its_word(written, header, units, row):
    zero = "1;0" if header.startswith("stretch") else "0;0"
    curve = read_curve(written(f"{header}\n{units}\n{zero}\n{row}\n"))
    assert (curve.stretch[1], curve.nominal_stress[1]) == pytest.approx((1.5, 0.25))


@pytest.mark.parametrize(("header", "units", "sentence"), [
    ("stretch;nominal_stress", "mm;N", "row 2: 'mm' below 'stretch' is neither a number nor the unit that belongs there"),
    ("stretch;nominal_stress", "-;N", "'N' below 'nominal_stress' .* MPa, kPa or Pa; .*lengths and forces are no strain"),
    ("stretch;nominal_stress", "-;mPa", "'mPa' below 'nominal_stress'"),
    ("stretch;nominal_stress_mpa", "-;kPa", "'kPa' below 'nominal_stress_mpa' .* mpa, as its name says"),
    ("engineering_strain_percent;nominal_stress_mpa", "-;MPa", "'-' below 'engineering_strain_percent' .* %, as its name says"),
    ("stretch;nominal_stress", "1;0", "'nominal_stress' states no unit; name the column nominal_stress_mpa"),
])
def test_a_unit_that_cannot_be_right_is_refused_by_name(written, header, units, sentence):
    with pytest.raises(InputError, match=sentence):
        read_curve(written(f"{header}\n{units}\n1;0\n1.5;0.25\n"))


ROWS = [["stretch", "nominal_stress_mpa"], [1, 0], [1.5, 0.25]]


def test_a_sheet_of_excel_is_read_with_its_lines_above_and_its_units(workbook):
    rows = [["Machine 7"], ["stretch", "note", "nominal_stress"], ["-", None, "kPa"], [1, "a", 0], [1.5, None, 250.0]]
    curve = read_curve(workbook({"Test": rows, "Sheet2": []}), skip_rows=1)
    assert curve.stretch.tolist() == [1.0, 1.5] and curve.nominal_stress.tolist() == [0.0, 0.25]
    assert read_curve(workbook({"a": [["x"]], "b": ROWS}), sheet="b").stretch.tolist() == [1.0, 1.5]


def as_percent(book):
    book["a"]["A3"].number_format = "0.0%"


@pytest.mark.parametrize(("sheets", "options", "sentence"), [
    ({"a": ROWS, "b": ROWS}, {}, "several sheets hold data, a, b; name the one to read"),
    ({"a": ROWS}, {"sheet": "c"}, "there is no sheet 'c'; name one of a"),
    ({"a": []}, {}, "all sheets are empty"),
    ({"a": ROWS}, {"change": as_percent}, "cell A3: it is shown as percent"),
    ({"a": [*ROWS, [1.6, None]]}, {}, "row 4: '' is not a number"),
    ({"a": [*ROWS, ["#N/A", 0.3]]}, {}, "row 4: '#N/A' is not a number"),
    ({"a": [*ROWS, [1.6, True]]}, {}, "row 4: 'True' is not a number"),
])
def test_a_workbook_that_may_be_read_wrong_is_refused(workbook, sheets, options, sentence):
    path = workbook(sheets, change=options.pop("change", lambda book: None))
    with pytest.raises(InputError, match=sentence):
        read_curve(path, **options)


def test_a_file_that_is_no_workbook_is_refused(written):
    with pytest.raises(InputError, match="uniaxial.xlsx: not a readable workbook"):
        read_curve(written(HEADER, "uniaxial.xlsx"))
    assert "pip install 'softtact[excel]'" in missing_extra(ModuleNotFoundError(name="openpyxl"))


@pytest.mark.parametrize("header", ["a,a", "a,a.1", "a,a_2", "a,a (2)"])
def test_a_column_of_a_table_is_found_by_its_one_name(written, header):
    with pytest.raises(InputError, match="several columns are named 'a' among a, a"):
        read_table(written(f"{header}\n1,2\n")).numbers(["a"])
    assert read_table(written("a,area\n1,2\n")).numbers(["a"]) == [[1.0]]
