"""Read one CSV of the archive as arrays, in pieces, with numbers as float32 and a code for each test, to save memory.

Encoding, separator, decimal sign and the order of the columns follow from the file. The numbers in the columns' names (`tax1` to
`tax28`, `x0` to `x32`, or bare numbers) give the order of the values; the force has a name such as `force`. A file whose names do
not order its columns is refused, because a wrong order would shift every taxel without notice. Outliers are counted by file and
row, with the action taken for each.
"""

import csv
import os
import re
import warnings
from collections.abc import Collection, Iterator
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np
import pandas as pd

from softtact.errors import InputError
from softtact.inputs import check_input
from softtact.tables import encoding_of

PIECE = 57 * 200    # rows read at a time: about 4 MB
MOST_SURPLUS = 0.5      # share of rows with surplus fields above which the header does not describe the file
TEXTS_KEPT = 1000   # most texts in place of numbers that are kept for messages, one for each of the first rows with one
_PATH = "path"
_ROW_NUMBERS = re.compile(r"(Unnamed: \d+)?")      # a column without a name, and pandas' name for it
_UNIT = r"\s*(?:_(?P<suffix>n|kn|mn)|[\[(](?P<unit>.*)[\])])?"
_FORCE = re.compile(r"((normal|contact|measured)?[ _]?(force|load)([ _]?z|[ _]normal)?|f[ _]?z?)" + _UNIT, flags=re.IGNORECASE)
_NUMBERED = re.compile(r"(.*?)(\d+)")
_NUMBER = re.compile(r"[+-]?\d+([.,]\d+)?([eE][+-]?\d+)?")
# 1,234 may have a decimal comma or a thousands separator; 0,123 and 12,3456 have a decimal comma.
_MAYBE_THOUSANDS = re.compile(r"[+-]?[1-9]\d{0,2}(,\d{3})+")


@dataclass(frozen=True)
class Finding:
    """One outlier. row: the line of its first occurrence, 1 being the header;  path: the test, '' for a file;  count: occurrences
    done: "left out" (the test) or "kept"."""

    file: str
    row: int
    path: str
    what: str
    count: int
    done: str

    def __str__(self):
        return f"{self.file}, row {self.row}{f', {self.path}' if self.path else ''}: {self.what}"


class Outliers:
    """The outliers of an archive, in the order found."""

    def __init__(self) -> None:
        self.findings: list[Finding] = []

    def leave_out(self, file: str | Path, row: int, path: str, what: str, *, count: int = 1) -> None:
        """Add an outlier whose test is not used."""
        self.findings.append(Finding(str(file), int(row), path, what, int(count), "left out"))

    def keep(self, file: str | Path, row: int, path: str, what: str, *, count: int = 1) -> None:
        """Add an outlier that is only reported."""
        self.findings.append(Finding(str(file), int(row), path, what, int(count), "kept"))

    def left_out(self) -> list[str]:
        """The tests that are not used, in the order of their first outlier."""
        return list(dict.fromkeys(f.path for f in self.findings if f.done == "left out"))

    def leaves_out(self, path: str, *, files: Collection[str]) -> bool:
        """Whether a test is not used because of an outlier in one of the files."""
        return any(f.path == path and f.file in files and f.done == "left out" for f in self.findings)

    def table(self) -> pd.DataFrame:
        """A row per outlier."""
        return pd.DataFrame([asdict(f) for f in self.findings], columns=[field.name for field in fields(Finding)])

    def refuse(self, tests: int, *, outliers: str, largest_share: float) -> None:
        """Refuse an archive with more outliers than the user allows.

        tests: their number;  outliers: leave_out or refuse;  largest_share: of tests that may be left out
        """
        left = len(self.left_out())
        if left and (outliers == "refuse" or left > largest_share * tests):
            first = [str(f) for f in self.findings if f.done == "left out"][:3]
            allowed = "none may be" if outliers == "refuse" else f"at most {largest_share:.0%} may be"
            remedy = "set 'data.outliers' to leave_out" if outliers == "refuse" else "raise 'data.largest_outlier_share'"
            raise InputError(f"{left} of {tests} tests of the archive are outliers, and {allowed} ({'; '.join(first)}); "
                             f"correct the files or {remedy}.")


@dataclass(frozen=True)
class Table:
    """The rows of one file.

    values (row, column) float32, nan where there is no number;  force_n (row,), nan in a simulation
    test (row,): index into `paths`, -1 where the row names none;  line (row,): of the file, the header being 1
    paths: the tests' names in the order of their appearance;  surplus (row,): True where there are more fields than columns
    texts {row: text}: what stood in place of a number
    """

    file: str
    values: np.ndarray
    force_n: np.ndarray
    test: np.ndarray
    line: np.ndarray
    paths: list
    surplus: np.ndarray
    texts: dict

    def rows_of_tests(self) -> dict[str, np.ndarray]:
        """{path: rows (n,) in the file's order}."""
        order = np.argsort(self.test, kind="stable")
        ends = np.searchsorted(self.test[order], np.arange(len(self.paths) + 1))
        return {path: order[start:end] for path, start, end in zip(self.paths, ends[:-1], ends[1:], strict=True)}


def read_table(path: Path, *, columns: int, force: bool, outliers: Outliers) -> Table:
    """The `Table` of a file with `columns` values a row, and a force column if `force`; irregularities are added to `outliers`."""
    codes: dict[str, int] = {}
    texts: dict[int, str] = {}
    pieces = []
    check_input(path, "archive")
    try:
        layout = read_layout(path, columns=columns, force=force, outliers=outliers)
        with warnings.catch_warnings(action="ignore", category=pd.errors.ParserWarning):     # about more than one surplus field
            for piece in _pieces(path, layout):
                pieces.append(_arrays(piece, layout, codes, texts))
    except pd.errors.ParserError as error:
        raise InputError(f"{path}: not readable as a table ({_where_it_breaks(error)}); correct that line.") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: not readable as a table ({error}); fetch it again.") from None
    if not pieces:
        raise InputError(f"{path}: it holds a header and no row; fetch it again.")
    values, force_n, test, line, surplus = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    if surplus.mean() > MOST_SURPLUS:
        raise InputError(f"{path}, row {line[surplus][0]}: it has more fields than row 1 has columns, as {surplus.sum()} of "
                         f"{len(line)} rows have; write decimals with points, if they are written with {layout.separator!r}, or "
                         "fetch it again.")
    if (test < 0).any():
        outliers.keep(path.name, line[test < 0][0], "", "the row names no test; it is not used", count=(test < 0).sum())
    if layout.path < len(layout.columns) - 1 and test[-1] >= 0 and not _ends_with_a_line(path):
        outliers.leave_out(path.name, line[-1], list(codes)[test[-1]], "the file ends in this row, without a line end; cut off?")
    return Table(path.name, values, force_n, test, line, list(codes), surplus, texts)


def _ends_with_a_line(path):
    """Whether a file's last line is terminated, so that its last number is complete."""
    with open(path, "rb") as file:
        file.seek(-min(4, path.stat().st_size), os.SEEK_END)
        return b"\n" in (end := file.read()) or b"\r" in end


def _pieces(path, layout):
    # One column more than the header has, so that a surplus field is detected and shifts nothing. Blank lines count as lines.
    width = len(layout.columns)
    return pd.read_csv(path, sep=layout.separator, decimal=layout.decimal, header=None, skiprows=1, names=range(width + 1),
                       index_col=False, dtype={layout.path: str}, chunksize=PIECE, skip_blank_lines=False, low_memory=False,
                       encoding=layout.encoding)


def _arrays(piece, layout, codes, texts):
    """(values, force_n, test, line, surplus) of one piece; adds to `codes` {path: test} and `texts`."""
    surplus = piece[len(layout.columns)].notna().to_numpy()
    start = piece.index[0]
    piece = piece.drop(columns=len(layout.columns))
    blank = piece.isna().all(axis=1).to_numpy()
    values = np.column_stack([_numbers(piece[k], layout.decimal, texts) for k in layout.numbers])
    force_n = _numbers(piece[layout.force], layout.decimal, texts) if layout.force is not None else np.full(len(piece), np.nan)
    test = _codes(piece[layout.path].str.strip(), codes)
    line = start + 2 + np.arange(len(piece))
    return tuple(array[~blank] for array in (values.astype(np.float32), force_n, test, line, surplus))


def _numbers(column, decimal, texts):
    """A column as float64, nan for cells without a number, whose texts are kept by line.

    One text in a column is enough for pandas to leave all its cells as texts, with their decimal sign.
    """
    if pd.api.types.is_numeric_dtype(column) and column.dtype != bool:
        return column.to_numpy(dtype=float)
    cells = column.astype(object)
    if decimal == ",":
        cells = cells.astype(str).str.replace(",", ".").where(column.notna())
    numbers = pd.to_numeric(cells, errors="coerce").to_numpy(dtype=float)
    for at in np.flatnonzero(np.isnan(numbers) & column.notna().to_numpy())[: max(0, TEXTS_KEPT - len(texts))]:
        texts.setdefault(int(column.index[at]) + 2, str(column.iloc[at]))
    return numbers


def _codes(paths, codes):
    """Test (row,) of each row's path, numbered in the order of appearance; -1 where there is none."""
    code_in_piece, names = pd.factorize(paths)
    # A path of blanks is "" here and counts as none.
    numbers = np.array([codes.setdefault(name, len(codes)) if name else -1 for name in names] + [-1], dtype=np.int32)
    return numbers[code_in_piece]


def _where_it_breaks(error):
    """The parser's message, e.g. `Expected 35 fields in line 9, saw 40`."""
    return str(error).rsplit("C error: ", 1)[-1].strip()


@dataclass(frozen=True)
class Layout:
    """The format of a CSV.

    encoding, separator, decimal;  columns: their names;  path, force: indices of `Path` and of the force (or None)
    numbers: indices of the values in their order
    """

    encoding: str
    separator: str
    decimal: str
    columns: list
    path: int
    numbers: list
    force: int | None


def read_layout(path: Path, *, columns: int, force: bool, outliers: Outliers) -> Layout:
    """The `Layout` of a file with `columns` values a row, and a force where `force`; raises InputError for other columns."""
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
    """Index of the column of the force in N, by its name."""
    forces = {k: _FORCE.fullmatch(names[k]) for k in numbers}
    named = [k for k, match in forces.items() if match]
    if len(named) != 1:
        raise InputError(f"{path}: {len(named)} columns are named as a force where one is needed (row 1 names "
                         f"{', '.join(names[k] for k in numbers)[:100]} ...); name the column of the normal force 'force'.")
    match = forces[named[0]]
    unit = (match["suffix"] or match["unit"] or "N").strip()
    if unit not in ("N", "n"):
        raise InputError(f"{path}: the column {names[named[0]]!r} is in {unit}; convert it to N, and name it 'force'.")
    return named[0]


def _in_order(path, names, numbers, outliers):
    """The columns of values, ordered by the numbers in their names; another order in the file is reported."""
    order = _numbers_of([names[k] for k in numbers])
    if order is None:
        raise InputError(f"{path}: the names {names[numbers[0]]!r} to {names[numbers[-1]]!r} do not give the order of the columns; "
                         "name them with one word and numbers without a gap, such as tax1 to tax28 or x0 to x32.")
    ordered = [numbers[k] for k in sorted(range(len(numbers)), key=lambda k: order[k])]
    if ordered != numbers:
        outliers.keep(path.name, 1, "", f"the columns are not in the order of their names (the first is {names[numbers[0]]!r}); "
                      "they are taken in this order")
    return ordered


def _numbers_of(names):
    """A number for each name, by which they are ordered; None if the names have none."""
    if all(_NUMBER.fullmatch(name) for name in names):     # positions, or numbers without a word
        values = [float(name.replace(",", ".")) for name in names]
        return values if len(set(values)) == len(names) else None
    parts = [_NUMBERED.fullmatch(name) for name in names]
    if None in parts or len({part[1].lower() for part in parts}) != 1:
        return None
    values = [int(part[2]) for part in parts]
    return values if sorted(values) == list(range(min(values), min(values) + len(values))) else None


def _decimal(path, encoding, separator, path_at):
    """The decimal sign: that of the first number which shows it, even thousands of rows below."""
    maybe = None
    for row, cell in _signs(path, encoding, separator, path_at):
        if "." in cell:
            return "."
        if not _MAYBE_THOUSANDS.fullmatch(cell):
            return ","
        maybe = maybe or (row, cell)
    if maybe is None:
        return "."
    raise InputError(f"{path}, row {maybe[0]}: the comma of {maybe[1]!r} may be a decimal sign or a thousands separator, and no "
                     "other number shows which; write the numbers with decimal points.")


def _signs(path, encoding, separator, path_at) -> Iterator[tuple[int, str]]:
    """(row, text) of the numbers that contain a point or a comma, without rows that have more or fewer fields than the header."""
    with open(path, encoding=encoding, newline="") as lines:
        width = None
        for row, cells in enumerate(csv.reader(lines, delimiter=separator), 1):
            width = width or len(cells)
            if row == 1 or len(cells) != width:
                continue
            yield from ((row, cell.strip()) for k, cell in enumerate(cells) if k != path_at and re.search(r"\d*[.,]\d", cell))
