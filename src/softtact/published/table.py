"""One CSV of the archive as arrays: read in pieces, numbers as float32, a code for each test, never an object per cell."""

import csv
import os
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from softtact.errors import InputError
from softtact.published.layout import read_layout
from softtact.published.outliers import Outliers

PIECE = 57 * 200    # rows read at a time: some 4 MB
MOST_SURPLUS = 0.5      # share of rows with too many fields from which the file is not written as its header says
TEXTS_KEPT = 1000   # words in place of numbers, for naming; one for each of the first rows that have them


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
    codes: dict[str, int] = {}
    texts: dict[int, str] = {}
    pieces = []
    try:
        layout = read_layout(path, columns=columns, force=force, outliers=outliers)
        with warnings.catch_warnings(action="ignore", category=pd.errors.ParserWarning):     # of fields beyond a surplus one
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
    """Whether a file's last line has an end, so that its last number is whole."""
    with open(path, "rb") as file:
        file.seek(-min(4, path.stat().st_size), os.SEEK_END)
        return b"\n" in (end := file.read()) or b"\r" in end


def _pieces(path, layout):
    # One column more than the header has: a surplus field is then seen, and shifts nothing. Blank lines count as lines.
    width = len(layout.columns)
    return pd.read_csv(path, sep=layout.separator, decimal=layout.decimal, header=None, skiprows=1, names=range(width + 1),
                       index_col=False, dtype={layout.path: str}, chunksize=PIECE, skip_blank_lines=False, low_memory=False,
                       encoding=layout.encoding)


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
