"""One CSV of the archive as arrays: read in pieces, numbers as float32, a code for each test, never an object per cell."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from softtact.errors import InputError
from softtact.published.outliers import Outliers

PIECE = 57 * 200    # rows read at a time: some 4 MB
TEXTS_KEPT = 1000   # words in place of numbers, for naming; one for each of the first rows that have them


@dataclass(frozen=True)
class Layout:
    """How a CSV is written. columns: names;  path, force: which is `Path`, and the force (or None);  numbers: which are values."""

    separator: str
    decimal: str
    columns: list
    path: int
    numbers: list
    force: int | None


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
    """The `Table` of a file with `columns` values a row, and a force column where `force`; oddities of the file go to `odd`."""
    layout = read_layout(path, columns=columns, force=force, outliers=outliers)
    codes: dict[str, int] = {}
    texts: dict[int, str] = {}
    pieces = []
    try:
        for piece in _pieces(path, layout):
            pieces.append(_arrays(piece, layout, codes, texts))
    except pd.errors.ParserError as error:
        raise InputError(f"{path}: not readable as a table ({_where_it_breaks(error)}); correct that line.") from None
    if not pieces:
        raise InputError(f"{path}: it holds a header and no row; fetch it again.")
    values, force_n, test, line, surplus = (np.concatenate(parts) for parts in zip(*pieces, strict=True))
    if (test < 0).any():
        outliers.keep(path.name, line[test < 0][0], "", "the row names no test; it is not used", count=(test < 0).sum())
    return Table(path.name, values, force_n, test, line, list(codes), surplus, texts)


def read_layout(path: Path, *, columns: int, force: bool, outliers: Outliers) -> Layout:
    """The `Layout` that the first two lines tell; another number of columns than expected is refused."""
    with open(path, encoding="utf-8-sig", errors="replace") as lines:
        header, first = lines.readline().rstrip("\r\n"), lines.readline().rstrip("\r\n")
    separator = max(",;\t", key=header.count)
    decimal = "," if separator != "," and "," in first else "."
    names = [name.strip().strip('"') for name in header.split(separator)]
    if (separator, decimal) != (",", "."):
        outliers.keep(path.name, 1, "", f"fields end with {separator!r} and decimals are written with {decimal!r}; read so")
    found = [k for k, name in enumerate(names) if name.lower() == "path"]
    if len(found) != 1:
        raise InputError(f"{path}: {len(found)} columns are named 'Path' where one is needed (row 1 is {header[:60]!r}); "
                         "fetch it again.")
    numbers = [k for k in range(len(names)) if k != found[0] and not re.fullmatch(r"(Unnamed: \d+)?", names[k])]
    if len(numbers) < len(names) - 1:
        outliers.keep(path.name, 1, "", "a column without a name is passed over: row numbers of a former table")
    wanted = columns + force
    if len(numbers) != wanted:
        raise InputError(f"{path}: row 1 names {len(numbers)} columns of numbers beside 'Path' where {wanted} are needed"
                         f"{' (force and the taxels)' if force else ''}; fetch it again.")
    force_at = _force_column(path, names, numbers, outliers) if force else None
    return Layout(separator, decimal, names, found[0], [k for k in numbers if k != force_at], force_at)


def _force_column(path, names, numbers, outliers):
    """Which column holds the force: the one of that name, else the first."""
    named = [k for k in numbers if "force" in names[k].lower()]
    if len(named) != 1:
        outliers.keep(path.name, 1, "", f"no column is named force; the first, {names[numbers[0]]!r}, is taken for it")
    return named[0] if len(named) == 1 else numbers[0]


def _pieces(path, layout):
    # One column more than the header has: a surplus field is then seen, and shifts nothing. Blank lines count as lines.
    width = len(layout.columns)
    return pd.read_csv(path, sep=layout.separator, decimal=layout.decimal, header=None, skiprows=1, names=range(width + 1),
                       dtype={layout.path: str}, chunksize=PIECE, skip_blank_lines=False, low_memory=False,
                       encoding="utf-8-sig", encoding_errors="replace")


def _arrays(piece, layout, codes, texts):
    """(values, force_n, test, line, surplus) of one piece; `codes` {path: test} and `texts` grow."""
    surplus = piece[len(layout.columns)].notna().to_numpy()
    start = piece.index[0]
    piece = piece.drop(columns=len(layout.columns))
    blank = piece.isna().all(axis=1).to_numpy()
    values = np.column_stack([_numbers(piece[k], texts) for k in layout.numbers])
    force_n = _numbers(piece[layout.force], texts) if layout.force is not None else np.full(len(piece), np.nan)
    test = _codes(piece[layout.path].str.strip(), codes)
    line = start + 2 + np.arange(len(piece))
    return tuple(array[~blank] for array in (values.astype(np.float32), force_n, test, line, surplus))


def _numbers(column, texts):
    """A column as float64, nan where it holds no number; what stands there instead is remembered by its line."""
    if pd.api.types.is_numeric_dtype(column) and column.dtype != bool:
        return column.to_numpy(dtype=float)
    numbers = pd.to_numeric(column.astype(object), errors="coerce").to_numpy(dtype=float)
    for at in np.flatnonzero(np.isnan(numbers) & column.notna().to_numpy())[: max(0, TEXTS_KEPT - len(texts))]:
        texts.setdefault(int(column.index[at]) + 2, str(column.iloc[at]))
    return numbers


def _codes(paths, codes):
    """Test (row,) of each row's path, numbered in the order of appearance; -1 where there is none."""
    own, names = pd.factorize(paths)     # a path of blanks is none
    numbers = np.array([codes.setdefault(name, len(codes)) if name else -1 for name in names] + [-1], dtype=np.int32)
    return numbers[own]


def _where_it_breaks(error):
    """The parser's complaint, e.g. `Expected 35 fields in line 9, saw 40`."""
    return str(error).rsplit("C error: ", 1)[-1].strip()
