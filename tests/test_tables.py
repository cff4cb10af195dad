"""Tables of a user's own files: what is read, and what is refused before a column can be taken for another."""

import openpyxl
import pytest

from softtact.errors import InputError, missing_extra
from softtact.materials.readers import read_curve
from softtact.tables import read_table

HEADER = "stretch,nominal_stress_mpa\n"


TWO_LINES = {"columns": {"stretch": "Stretch [-]", "nominal_stress_mpa": "Stress (nominal, of the section) [MPa]"}}


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
    ('"Stretch\n[-]";"Stress\r\n(nominal, of the section)\n[MPa]"\n1.0;0.0\n1.5;0.25\n', TWO_LINES),
    ('Stretch [-],"Stress ""nominal""\n[MPa]"\n1.0,0.0\n1.5,0.25\n', {"columns": TWO_LINES["columns"] | {
        "nominal_stress_mpa": 'Stress "nominal" [MPa]'}}),
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
    ("stretch;nominal_stress", "-;N", "'N' below 'nominal_stress' .* MPa, kPa, .* or kgf/mm2; .*lengths and forces are no strain"),
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


def test_names_on_two_lines_are_read_from_a_workbook_too(workbook):
    path = workbook({"a": [["Stretch\n[-]", "Stress\n(nominal, of the section)\n[MPa]"], *ROWS[1:]]})
    assert read_curve(path, **TWO_LINES).stretch.tolist() == [1.0, 1.5]


@pytest.mark.parametrize("minus", "\u2010\u2011\u2012\u2013\u2014\u2212\ufe63\uff0d")
def test_every_sign_of_a_minus_is_read_in_the_first_row_and_in_exponents(written, minus):
    content = "engineering_strain;nominal_stress_mpa\n-0,25;-1,5E-1\n-0,5;-4E-1\n".replace("-", minus)
    curve = read_curve(written(content), decimal=",")
    assert curve.stretch.tolist() == [0.75, 0.5] and curve.nominal_stress.tolist() == [-0.15, -0.4]


def test_a_blank_after_the_minus_is_read(written):
    assert read_curve(written("stretch,nominal_stress_mpa\n0.5,- 0.2\n1,0\n")).nominal_stress.tolist() == [-0.2, 0.0]


def test_a_mapped_name_may_hold_the_line_break_of_the_file(written):
    columns = {"stretch": "Stretch\n[-]", "nominal_stress_mpa": "Stress\n[MPa]"}
    assert read_curve(written('"Stretch\n[-]";"Stress\n[MPa]"\n1;0\n1.5;0.25\n'), columns=columns).stretch.tolist() == [1.0, 1.5]


def test_a_dash_between_numbers_is_no_minus(written):
    with pytest.raises(InputError, match="row 2: '1–2' is not a number"):
        read_curve(written(HEADER + "1–2,0\n1.5,0.25\n"))


FORMULAS = [["stretch", "nominal_stress_mpa", "note"], [1, "=0.35*(A2-A2^-2)", "=B2"], [1.5, "=0.35*(A3-A3^-2)", None]]


def test_a_formula_without_a_stored_value_is_refused_by_its_text_and_only_where_it_is_needed(workbook):
    path = workbook({"a": FORMULAS})
    with pytest.raises(InputError, match=r"row 2: '=0.35\*\(A2-A2\^-2\)' is not a number; it is a formula without a stored"):
        read_curve(path)
    assert read_curve(workbook({"a": [*ROWS[:1], [1, 0, "=B2"], [1.5, 0.25, "=B3"]]})).stretch.tolist() == [1.0, 1.5]


def hide_rows(book):
    for row in (4, 5, 7):
        book["a"].row_dimensions[row].hidden = True


def hide_columns(book):
    book["a"].column_dimensions.group("C", "D", hidden=True)


def test_hidden_rows_are_left_out_with_a_remark(workbook):
    rows = [*ROWS, [1.55, 9], [1.6, 9], [1.7, 0.3], [1.8, 9]]
    curve = read_curve(workbook({"a": rows}, change=hide_rows))
    assert curve.stretch.tolist() == [1.0, 1.5, 1.7]
    assert "rows 4 to 5, 7 of the sheet 'a' are hidden and left out; show them in Excel" in curve.remarks[0]


def test_hidden_columns_are_left_out_with_a_remark(workbook):
    rows = [[*row, *row] for row in ROWS]
    curve = read_curve(workbook({"a": rows}, change=hide_columns))
    assert "columns C to D of the sheet 'a' are hidden and left out" in curve.remarks[0]
    with pytest.raises(InputError, match="no column holds the stress among x, stretch .columns C to D of the sheet 'a' are hidden"):
        read_curve(workbook({"a": [["x", "stretch", "nominal_stress_mpa", "y"], [1, 1, 0, 1], [1, 2, 1, 1]]}, change=hide_columns))


def hide_sheet(book):
    book["b"].sheet_state = "hidden"


def test_a_hidden_sheet_is_not_read_unless_it_is_named(workbook):
    sheets = {"a": ROWS, "b": [*ROWS[:2], [2, 0.6]]}
    assert read_curve(workbook(sheets, change=hide_sheet)).stretch.tolist() == [1.0, 1.5]
    assert read_curve(workbook(sheets, change=hide_sheet), sheet="b").stretch.tolist() == [1.0, 2.0]


def test_a_file_that_is_no_workbook_is_refused(written):
    with pytest.raises(InputError, match="uniaxial.xlsx: not a readable workbook"):
        read_curve(written(HEADER, "uniaxial.xlsx"))
    assert "pip install 'softtact[excel]'" in missing_extra(ModuleNotFoundError(name="openpyxl"))


@pytest.mark.parametrize("header", ["a,a", "a,a.1", "a,a_2", "a,a (2)"])
def test_a_column_of_a_table_is_found_by_its_one_name(written, header):
    with pytest.raises(InputError, match="several columns are named 'a' among a, a"):
        read_table(written(f"{header}\n1,2\n")).numbers(["a"])
    assert read_table(written("a,area\n1,2\n")).numbers(["a"]) == [[1.0]]
