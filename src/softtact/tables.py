"""Read users' tables: CSV in the dialects of common programs, and Excel sheets with openpyxl (extra `excel`).

A table whose dialect is ambiguous is refused; nothing is guessed.
  encoding    UTF-8, UTF-16 with a byte order mark, else that of Windows (cp1252)
  separator   the first of tab, semicolon and comma that the header contains; or the one of a first line `sep=;`
  fields      each row has as many as the header, so that a comma in a number, or a row's name, cannot shift columns
  numbers     with a decimal point, or a comma if the caller states so; no thousands separators, since 1,234 is ambiguous
  `#`         starts a line of notes
"""

import codecs
import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median

from softtact.errors import InputError
from softtact.inputs import check_input
from softtact.workbooks import WORKBOOKS, Cell, read_sheet

SEPARATORS = "\t;,"
DECIMALS = (".", ",")
_SEP_LINE = re.compile(r'"?sep=(\\t|[^\w\s".]|\t)"?\s*', flags=re.IGNORECASE)      # a first line for Excel
# What programs and fonts write for a minus: hyphens, dashes, the mathematical sign, a small and a wide one.
_MINUS = str.maketrans(dict.fromkeys("\u2010\u2011\u2012\u2013\u2014\u2212\u02d7\ufe58\ufe63\uff0d", "-"))
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", flags=re.ASCII)
_NOT_FINITE = re.compile(r"[+-]?(nan|inf|infinity)", flags=re.IGNORECASE)
_NOT_CP1252 = set(b"\0\x81\x8d\x8f\x90\x9d")     # bytes without a character in cp1252
_NAMES = {",": "commas", ";": "semicolons", "\t": "tabs"}
_STATE = "state the decimal comma (--decimal ,)"
_ROWS_TO_COMPARE = 5    # fewest rows from which the usual length of a number is known


@dataclass(frozen=True)
class Table:
    """A header and the rows below it.

    header: the columns' names;  rows: [(row number in the file from 1, cells)]; cells are text, in Excel also numbers
    notes: lines that begin with `#`;  decimal: `.` or `,`, or None: a point, and the caller has no option to change it
    remarks: sentences without a full stop on what was left out, such as hidden rows
    """

    path: Path
    header: list[str]
    rows: list[tuple[int, list[Cell]]]
    notes: list[str]
    decimal: str | None = None
    remarks: tuple[str, ...] = ()

    def positions(self, name: str) -> list[int]:
        """Positions of the columns of this name, also with the suffixes that programs add to a duplicate name."""
        name = on_one_line(name)
        repeated = re.compile(re.escape(name) + r"([._]\d+| \(\d+\))")
        return [at for at, text in enumerate(self.header) if text == name or (name in self.header and repeated.fullmatch(text))]

    def numbers(self, names: Sequence[str]) -> list[list[float]]:
        """Values (n,) of the column of each name. Raises InputError unless there is one such column and its cells are numbers."""
        at = []
        for name in names:
            found = self.positions(name)
            if len(found) != 1:
                problem = "several columns are" if found else "no column is"
                raise InputError(f"{self.path}: {problem} named {name!r} among {', '.join(self.header)}; name one so.")
            at += found
        return [[number(self.path, row, cells[k], decimal=self.decimal) for row, cells in self.rows] for k in at]


def read_table(path: str | Path, *, what: str = "table", marker: str | None = None, layout: str = "another",
               decimal: str | None = None, skip_rows: int = 0, sheet: str | None = None) -> Table:
    """The `Table` of a CSV file or of a sheet of Excel.

    what: what the table is, for an error message
    marker: a text by which the header is found below other lines, as in the `layout` of that name; by default the header is
    the first line
    decimal: `.` or `,` as the user stated it, or None: a point, and the caller has no option to change it
    skip_rows: number of lines to skip at the top;  sheet: the name of a workbook's sheet, required if several hold data
    Raises InputError with file, row and remedy.
    """
    path = Path(path)
    if decimal not in (None, *DECIMALS):
        raise InputError(f"{path}: the decimal sign is {decimal!r}; state '.' or ','.")
    if path.suffix.lower() in WORKBOOKS:
        records, remarks = read_sheet(path, sheet=sheet)
        records = [(row, cells) for row, cells in records if row > skip_rows]
        return replace(_of_sheet(path, records, what=what, marker=marker, layout=layout, decimal=decimal), remarks=remarks)
    if sheet is not None:
        raise InputError(f"{path}: it has no sheet {sheet!r}, for it is no workbook of Excel; leave `sheet` out.")
    text = read_text(path, what=what)
    separator, lines = _stated_separator(text)
    lines = [(row, line) for row, line in lines if row > skip_rows]
    notes, lines = _parted(lines)
    if not lines:
        raise InputError(f"{path}: the file is empty{f' below row {skip_rows}' * bool(skip_rows)}; give a {what} with its columns.")
    first = _header_at(path, [line for _, line in lines], marker, layout)
    separator = separator or _separator([line for _, line in lines[first:]])
    (_, header), *rows = _records(path, lines[first:], separator)
    table = Table(path, [on_one_line(name) for name in header], rows, notes, decimal)
    return _whole(table, text, _NAMES.get(separator, repr(separator)))


def read_bare(path: str | Path, *, header: Sequence[str], what: str = "table", decimal: str | None = None,
              skip_rows: int = 0) -> Table:
    """The `Table` of a file of numbers separated by blanks, without a header; `header` names its columns."""
    text = read_text(path, what=what)
    notes, lines = _parted([(row, line) for row, line in _numbered(text) if row > skip_rows])
    table = Table(Path(path), list(header), [(row, list(line.split())) for row, line in lines], notes, decimal)
    return _whole(table, text, "blanks")


def read_matrix(path: str | Path, *, what: str = "table") -> list[list[float]]:
    """The numbers (rows, columns) of a CSV file without a header."""
    path, text = Path(path), read_text(path, what=what)
    separator, lines = _stated_separator(text)
    _, lines = _parted(lines)
    if not lines:
        raise InputError(f"{path}: the file is empty; give a {what}.")
    separator = separator or _separator([line for _, line in lines])
    rows = _records(path, lines, separator)
    table = Table(path, [f"column {k}" for k in range(len(rows[0][1]))], rows, [])
    table = _whole(table, text, _NAMES.get(separator, repr(separator)))
    return [[number(path, row, cell) for cell in cells] for row, cells in table.rows]


def read_text(path: str | Path, *, what: str = "table") -> str:
    """The text of a file in UTF-8, UTF-16 or cp1252. Raises InputError if the file is not text."""
    check_input(path, "table", missing=f"there is no such file; give the path of a {what}.")
    raw = Path(path).read_bytes()
    if raw.startswith((b"PK\x03\x04", b"\xd0\xcf\x11\xe0")):
        raise InputError(f"{path}: it is no text, but a workbook of Excel or another archive; save it as .xlsx, or as CSV.")
    try:
        text = raw.decode(encoding_of(path))
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: it cannot be read as text ({error.reason} at byte {error.start}); save it as UTF-8.") from None
    if "\0" in text:
        raise InputError(f"{path}: it holds zero bytes, so it is not text, or UTF-16 without a byte order mark; save it as UTF-8.")
    return text


def encoding_of(path: str | Path) -> str:
    """The name of a text file's encoding: UTF-16 with a byte order mark, UTF-8 if all of it is valid, else cp1252."""
    decoder = codecs.getincrementaldecoder("utf-8")()
    with open(path, "rb") as file:
        if file.read(2) in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
            return "utf-16"
        file.seek(0)
        try:
            while piece := file.read(1 << 20):
                decoder.decode(piece)
            decoder.decode(b"", final=True)
        except UnicodeDecodeError as error:
            file.seek(0)
            if any(set(piece) & _NOT_CP1252 for piece in iter(lambda: file.read(1 << 20), b"")):
                raise InputError(f"{path}: its text is neither UTF-8 ({error.reason}) nor cp1252; save it as UTF-8.") from None
            return "cp1252"
    return "utf-8-sig"


def ascii_minus(text: str) -> str:
    """The text of a number without blanks at its ends and after its sign, with `-` for the other signs of a minus."""
    return re.sub(r"^-\s+(?=[\d.,])", "-", text.strip().translate(_MINUS))


def number(path: Path, row: int, cell: Cell, *, decimal: str | None = None) -> float:
    """The finite number in a cell. Raises InputError, with the row and a remedy, for other content."""
    if isinstance(cell, float):
        value, text = cell, f"{cell:g}"
    else:
        text = ascii_minus(cell)
        if _NOT_FINITE.fullmatch(text):
            value = math.nan
        elif not is_number(cell, decimal=decimal):
            raise InputError(f"{path}, row {row}: {cell!r} is not a number; {_remedy(text, decimal)}.")
        else:
            value = float(text.replace(decimal or ".", "."))
    if not math.isfinite(value):
        raise InputError(f"{path}, row {row}: the value {text!r} is not finite; correct it or remove the row.")
    return value


def is_number(cell: Cell, *, decimal: str | None = None) -> bool:
    """Whether a cell holds a number and nothing else."""
    if isinstance(cell, float):
        return True
    text = ascii_minus(cell)
    if decimal == ",":
        text = text.replace(".", "?").replace(",", ".")
    return _NUMBER.fullmatch(text) is not None


def _remedy(text, decimal):
    if text.startswith("="):
        return "it is a formula without a stored value: open the file in Excel or LibreOffice and save it again"
    if decimal != "," and "," in text:
        return "write it with a decimal point and no separator of thousands" + f", or {_STATE}" * (decimal is not None)
    if decimal == "," and "." in text:
        return "its decimal sign was stated to be the comma: write it so, without separators of thousands, or leave --decimal out"
    return "correct it or remove the row"


def _stated_separator(text):
    """The separator that a first line `sep=;` states, or None; and [(number, line)] of the others."""
    lines = _numbered(text)
    found = _SEP_LINE.fullmatch(lines[0][1])
    if found is None:
        return None, lines
    return found[1].replace("\\t", "\t"), lines[1:]


def _numbered(text):
    """[(number from 1, line)] of all lines."""
    return list(enumerate(re.split(r"\r\n|\r|\n", text), 1))


def _parted(lines):
    """The notes, and the other lines that are not blank; a line of only separators counts as blank.

    Below the header a note starts with `#` and a blank, since a row may start with an Excel error such as #N/A.
    """
    notes: list[str] = []
    others: list[tuple[int, str]] = []
    for row, line in lines:
        if line.lstrip().startswith("# " if others else "#"):
            notes.append(line.strip())
        elif line.strip("\t;, "):
            others.append((row, line))
    return notes, others


def _header_at(path, lines, marker, layout):
    """Index of the header: the first line, or the first that has the marker."""
    for index, line in enumerate(lines):
        if marker is None or marker in line:
            return index
    raise InputError(f"{path}: no header with {marker!r} was found; is its layout {layout}?")


def _separator(lines):
    """The first of tab, semicolon and comma in the header outside quotes; in the rows a comma may be a decimal sign.

    lines: the header's and all below; a quoted name may go over several
    """
    end = next((k for k in range(1, len(lines)) if "".join(lines[:k]).count('"') % 2 == 0), len(lines))
    bare = re.sub(r'"[^"]*"', "", "\n".join(lines[:end]).strip())
    return next((separator for separator in SEPARATORS if separator in bare), ",")


def _records(path, lines, separator):
    """[(number of its first line, cells)] of each record. Raises InputError for unbalanced quotes."""
    started: list[int] = []

    def fed():
        for row, line in lines:
            started.append(row)
            yield f"{line}\n"

    reader, records, taken = csv.reader(fed(), delimiter=separator, skipinitialspace=True, strict=True), [], 0
    try:
        for cells in reader:
            records.append((started[taken], [cell.strip() for cell in cells]))
            taken = len(started)
    except csv.Error as error:
        raise InputError(f"{path}, row {started[taken]}: it has unbalanced quotes ({error}); put each field in a pair of quotes, "
                         "or in none.") from None
    return records


def _whole(table, text, separator):
    """The table, after the check that its rows are complete; `separator` in words."""
    _check_widths(table, separator)
    if not text.endswith(("\n", "\r")):
        _check_end(table)
    return table


def _check_widths(table, separator):
    """Refuse a row with more or fewer fields than the header, because its columns may be shifted."""
    width = len(table.header)
    wrong = [(row, cells) for row, cells in table.rows if len(cells) != width]
    if not wrong:
        return
    row, fields, last = wrong[0][0], len(wrong[0][1]), wrong[0][1][-1]
    remedy = "write as many in each row, and none at its end that the header does not name"
    if width == 1:
        remedy = "is this the header, or a line above it? Pass over lines above the header" + " (--skip-rows N)" * (
            table.decimal is not None)
    elif len(wrong) == len(table.rows) and fields == width + 1 and any(cells[-1] for _, cells in wrong):
        remedy = ("are the first the names of the rows, as R writes them? Give these a name in the header, or write the file "
                  "without (row.names = FALSE)")
    elif separator == "commas" and fields > width and last:
        remedy = "are decimals written with commas? Write points" + f", or put semicolons between the fields and {_STATE}" * (
            table.decimal is not None)
    raise InputError(f"{table.path}, row {row}: it has {fields} field{'s' * (fields != 1)} where {width} are named, with "
                     f"{separator} between them; {remedy}.")


def _check_end(table):
    """Refuse a last number without a line end that is shorter than those above: the file may be truncated within it."""
    if len(table.rows) < 2:
        return
    *above, last = [_lengths(cells[-1]) for _, cells in table.rows]
    digits, decimals = (list(values) for values in zip(*above, strict=True))
    even = len(set(decimals)) == 1 and last[1] < decimals[0]
    if even or (len(above) >= _ROWS_TO_COMPARE and (last[0] < median(digits) or last[1] < median(decimals))):
        row, cells = table.rows[-1]
        raise InputError(f"{table.path}, row {row}: the file ends with {cells[-1]!r}, without a line end and shorter than above, "
                         "so it may be cut off; write it again, or end its last line if it is whole.")


def _lengths(cell):
    """Number of digits, and of digits after the decimal sign, in a text."""
    return sum(map(str.isdigit, cell)), sum(map(str.isdigit, "".join(re.split("[.,]", cell)[1:])))


def _of_sheet(path, records, *, what, marker, layout, decimal):
    """The `Table` of the records [(row, cells)] of a sheet."""
    begins = {row: next((str(cell) for cell in cells if cell != ""), "") for row, cells in records}
    notes, others = _parted(list(begins.items()))
    kept = {row for row, _ in others}
    records = [(row, cells) for row, cells in records if row in kept]
    if not records:
        raise InputError(f"{path}: the sheet is empty; give a {what} with its columns.")
    first = _header_at(path, ["\t".join(map(str, cells)) for _, cells in records], marker, layout)
    (_, header), *rows = records[first:]
    return Table(path, [on_one_line(str(name)) for name in header], rows, notes, decimal)


def on_one_line(name: str) -> str:
    """The name of a column, as a header has it: with a blank for a line break within it."""
    return re.sub(r"\s*[\r\n]\s*", " ", name.strip())
