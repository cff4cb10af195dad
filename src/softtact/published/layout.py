"""How a CSV of the archive is written: encoding, separator, decimal sign, and which column holds what, by the columns' names.

Names that end in rising numbers (`tax1` to `tax28`, `x0` to `x32`), or that are numbers themselves, order the values, wherever
their columns stand. A force's name says so. A file whose names do not tell is refused, for a column in the place of another would
shift every taxel in silence.
"""

import csv
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from softtact.errors import InputError
from softtact.published.outliers import Outliers
from softtact.tables import encoding_of

_PATH = "path"
_ROW_NUMBERS = re.compile(r"(Unnamed: \d+)?")      # a nameless column, and pandas' name of one
_UNIT = r"\s*(?:_(?P<suffix>n|kn|mn)|[\[(](?P<unit>.*)[\])])?"
_FORCE = re.compile(r"((normal|contact|measured)?[ _]?(force|load)([ _]?z|[ _]normal)?|f[ _]?z?)" + _UNIT, flags=re.IGNORECASE)
_NUMBERED = re.compile(r"(.*?)(\d+)")
_NUMBER = re.compile(r"[+-]?\d+([.,]\d+)?([eE][+-]?\d+)?")
# 1,234 is a number with a decimal comma, or twelve hundred and thirty-four; 0,123 and 12,3456 are only the one.
_MAYBE_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")


@dataclass(frozen=True)
class Layout:
    """How a CSV is written.

    encoding, separator, decimal;  columns: their names;  path, force: which is `Path`, and the force (or None)
    numbers: which are values, in their order
    """

    encoding: str
    separator: str
    decimal: str
    columns: list
    path: int
    numbers: list
    force: int | None


def read_layout(path: Path, *, columns: int, force: bool, outliers: Outliers) -> Layout:
    """The `Layout` of a file with `columns` values a row, and a force where `force`; other columns are refused."""
    encoding = encoding_of(path)
    with open(path, encoding=encoding, newline="") as lines:
        header = lines.readline().rstrip("\r\n")
    separator = max(",;\t", key=re.sub(r'"[^"]*"', "", header).count)
    names = [name.strip() for name in next(csv.reader([header], delimiter=separator), [])]
    found = [k for k, name in enumerate(names) if name.lower() == _PATH]
    if len(found) != 1:
        raise InputError(f"{path}: {len(found)} columns are named 'Path' where one is needed (row 1 is {header[:60]!r}); "
                         "fetch it again.")
    numbers = [k for k in range(len(names)) if k != found[0] and not _ROW_NUMBERS.fullmatch(names[k])]
    if len(numbers) < len(names) - 1:
        outliers.keep(path.name, 1, "", "a column without a name is passed over: row numbers of a former table")
    if len(numbers) != columns + force:
        raise InputError(f"{path}: row 1 names {len(numbers)} columns of numbers beside 'Path' where {columns + force} are needed"
                         f"{' (force and the taxels)' if force else ''}; fetch it again.")
    force_at = _force_column(path, names, numbers) if force else None
    values = _in_order(path, names, [k for k in numbers if k != force_at], outliers)
    decimal = _decimal(path, encoding, separator, found[0])
    if (separator, decimal) != (",", "."):
        outliers.keep(path.name, 1, "", f"fields end with {separator!r} and decimals are written with {decimal!r}; read so")
    return Layout(encoding, separator, decimal, names, found[0], values, force_at)


def _force_column(path, names, numbers):
    """Which column holds the force in N: the one whose name says so."""
    told = {k: _FORCE.fullmatch(names[k]) for k in numbers}
    named = [k for k, match in told.items() if match]
    if len(named) != 1:
        raise InputError(f"{path}: {len(named)} columns are named as a force where one is needed (row 1 names "
                         f"{', '.join(names[k] for k in numbers)[:100]} ...); name the one of the normal force 'force'.")
    match = told[named[0]]
    unit = (match["suffix"] or match["unit"] or "N").strip()
    if unit not in ("N", "n"):
        raise InputError(f"{path}: the column {names[named[0]]!r} is in {unit}; convert it to N, and name it 'force'.")
    return named[0]


def _in_order(path, names, numbers, outliers):
    """The columns of values by the numbers in their names; another order in the file is reported."""
    order = _numbers_of([names[k] for k in numbers])
    if order is None:
        raise InputError(f"{path}: the names {names[numbers[0]]!r} to {names[numbers[-1]]!r} do not tell the order of the columns; "
                         "name them with one word and numbers without a gap, such as tax1 to tax28 or x0 to x32.")
    ordered = [numbers[k] for k in sorted(range(len(numbers)), key=lambda k: order[k])]
    if ordered != numbers:
        outliers.keep(path.name, 1, "", f"the columns are not in the order of their names (the first is {names[numbers[0]]!r}); "
                      "they are taken in this order")
    return ordered


def _numbers_of(names):
    """A number for each name, by which they are ordered; None where the names do not tell one."""
    if all(_NUMBER.fullmatch(name) for name in names):     # positions, or numbers without a word
        values = [float(name.replace(",", ".")) for name in names]
        return values if len(set(values)) == len(names) else None
    parts = [_NUMBERED.fullmatch(name) for name in names]
    if None in parts or len({part[1].lower() for part in parts}) != 1:
        return None
    values = [int(part[2]) for part in parts]
    return values if sorted(values) == list(range(min(values), min(values) + len(values))) else None


def _decimal(path, encoding, separator, path_at):
    """The decimal sign: that of the first number which has one, be it thousands of rows below."""
    maybe = None
    for row, cell in _signs(path, encoding, separator, path_at):
        if "." in cell:
            return "."
        if not _MAYBE_THOUSANDS.fullmatch(cell):
            return ","
        maybe = maybe or (row, cell)
    if maybe is None:
        return "."
    raise InputError(f"{path}, row {maybe[0]}: whether the comma of {maybe[1]!r} is a decimal one or of thousands is told by no "
                     "number of the file; write the numbers with decimal points.")


def _signs(path, encoding, separator, path_at) -> Iterator[tuple[int, str]]:
    """(row, text) of the numbers with a point or a comma in them. A row with other fields than the header tells nothing."""
    with open(path, encoding=encoding, newline="") as lines:
        width = None
        for row, cells in enumerate(csv.reader(lines, delimiter=separator), 1):
            width = width or len(cells)
            if row == 1 or len(cells) != width:
                continue
            yield from ((row, cell.strip()) for k, cell in enumerate(cells) if k != path_at and re.search(r"\d*[.,]\d", cell))
