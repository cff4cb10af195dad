"""Readings and maps of each test, matched by their order, and what speaks against using a test.

A test is one value of `Path`: one loading. Its k-th row among the real ones is the reading of its k-th map, 57 rows each, among the
simulated ones. That is inferred (nobody states it), so it is tested: every test must have 57 simulated rows for each real one.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softtact.published.table import Outliers, Table

MAP_ROWS, MAP_COLUMNS, TAXELS = 57, 33, 28
# Beyond these a test is left out. The layered sensor is 2.5 mm thick; counts run to 2400 in the paper's figures and the raw
# converter's from 10,067 to 37,865 in a file of the share, so 5000 parts them; a sensor without load may read below zero.
LARGEST_DEFORMATION_MM = 2.5
COUNTS = (-240.0, 5000.0)
PAPERS_COUNTS = 2400.0
FORCES_N = (-1.0, 75.0)     # the paper presses with 0 to 50 N


@dataclass(frozen=True)
class PairedTest:
    """One usable test: path, object (snake_case), readings (n,) rows of the real table, maps {model: (n * 57,) rows}."""

    path: str
    object: str
    readings: np.ndarray
    maps: dict


def object_name(path: str) -> str:
    """CircleG/... -> circle_g: the text before the first slash, in words that capitals and digits begin; '' if there is none."""
    text = re.split(r"[/\\]", path.strip(), maxsplit=1)[0]
    words = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])|(?<=[A-Za-z])(?=[0-9])", "_", text)
    return re.sub(r"[^a-z0-9]+", "_", words.lower()).strip("_")


def pair(reals: Sequence[Table], simulated: dict[str, Table], *, outliers: Outliers) -> list[PairedTest]:
    """The usable `PairedTest`s of one set.

    reals: tables of readings, of which the first serves and the others must agree;  simulated: {model: table}
    """
    real, *others = reals
    tables = [real, *others, *simulated.values()]
    rows = {id(table): table.rows_of_tests() for table in tables}
    tests = []
    for path in dict.fromkeys(path for table in tables for path in table.paths):
        rows_of: dict[int, Any] = {id(table): rows[id(table)].get(path) for table in tables}
        if _in_all(path, tables, rows_of, outliers):
            _check_readings(path, real, others, rows_of, outliers)
            for table in simulated.values():
                _check_maps(path, real, table, rows_of, outliers)
        if not outliers.leaves_out(path, files={table.file for table in tables}):
            of_models = {model: rows_of[id(table)] for model, table in simulated.items()}
            tests.append(PairedTest(path, object_name(path), rows_of[id(real)], of_models))
    return tests


def _in_all(path, tables, rows_of, outliers):
    """Whether each table has the test, and it names an object."""
    here = [table for table in tables if rows_of[id(table)] is not None]
    first = here[0].line[rows_of[id(here[0])][0]]
    for table in tables:
        if rows_of[id(table)] is None:
            outliers.leave_out(here[0].file, first, path, f"the test is not in {table.file}")
    if not object_name(path):
        outliers.leave_out(here[0].file, first, path, "the test names no object")
    return len(here) == len(tables)


def _check_readings(path, real, others, rows_of, outliers):
    rows = rows_of[id(real)]
    _check_common(path, real, rows, outliers)
    _check_range(path, real, rows, real.values, COUNTS, "counts", outliers)
    _check_range(path, real, rows, real.force_n[:, None], FORCES_N, "N", outliers)
    high = rows[(real.values[rows] > PAPERS_COUNTS).any(axis=1)]
    if len(high):
        outliers.keep(real.file, real.line[high[0]], path,
                      f"readings above {PAPERS_COUNTS:g} counts, where the paper's figures end",
                 count=len(high))
    for other in others:
        theirs = rows_of[id(other)]
        if not _alike(other.force_n[theirs], real.force_n[rows]) or not _alike(other.values[theirs], real.values[rows]):
            outliers.leave_out(other.file, other.line[theirs[0]], path, f"other readings than in {real.file}")


def _alike(ours, theirs):
    """Whether two columns or tables hold the same but for rounding."""
    return ours.shape == theirs.shape and np.allclose(ours, theirs, rtol=1e-3, atol=1e-2, equal_nan=True)


def _check_maps(path, real, table, rows_of, outliers):
    rows, readings = rows_of[id(table)], len(rows_of[id(real)])
    _check_common(path, table, rows, outliers)
    _check_range(path, table, rows, table.values, (-LARGEST_DEFORMATION_MM, LARGEST_DEFORMATION_MM), "mm", outliers)
    if len(rows) % MAP_ROWS:
        outliers.leave_out(table.file, table.line[rows[0]], path,
                           f"{len(rows)} rows are no whole number of maps of {MAP_ROWS} rows")
    elif len(rows) != readings * MAP_ROWS:
        outliers.leave_out(table.file, table.line[rows[0]], path,
                           f"{len(rows) // MAP_ROWS} maps and {readings} readings in {real.file}")


def _check_common(path, table, rows, outliers):
    """Numbers missing, too many fields, a test in several places."""
    bad = ~np.isfinite(table.values[rows])
    per_row = bad.any(axis=1)
    if per_row.any():
        line = table.line[rows[np.argmax(per_row)]]
        text = f"{table.texts[int(line)]!r} in place of a number" if int(line) in table.texts else "a value is missing or infinite"
        outliers.leave_out(table.file, line, path, text, count=bad.sum())
    surplus = rows[table.surplus[rows]]
    if len(surplus):
        outliers.leave_out(table.file, table.line[surplus[0]], path, "more fields than columns", count=len(surplus))
    gaps = [k for k in np.flatnonzero(np.diff(rows) > 1) if (table.test[rows[k] + 1:rows[k + 1]] >= 0).any()]
    if gaps:
        outliers.keep(table.file, table.line[rows[gaps[0] + 1]], path,
                      "the test goes on after rows of another; joined in their order",
                 count=len(gaps))


def _check_range(path, table, rows, values, limits, unit, outliers):
    checked = values[rows]
    outside = (checked < limits[0]) | (checked > limits[1])
    if unit == "N":
        outside |= ~np.isfinite(checked)
    per_row = outside.any(axis=1)
    if per_row.any():
        at = np.argmax(per_row)
        worst = checked[at][outside[at]][0]
        raw = "; raw values of the converter?" if unit == "counts" and worst > limits[1] else ""
        outliers.leave_out(table.file, table.line[rows[at]], path,
                      f"{worst:g} {unit} is not within {limits[0]:g} to {limits[1]:g}{raw}", count=outside.sum())
