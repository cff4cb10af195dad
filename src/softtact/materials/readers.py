"""Readers of test curves. Each refuses unreliable data in a sentence with file, row, value and remedy.

Layouts:
  plain          CSV (, ; or tab) or a sheet of Excel, with a header. The names of the columns declare quantity and unit: one of
                 `STRETCHES` and one of `STRESSES`, or of `VOLUMES` and `PRESSURES`; `columns` maps these names to those of the
                 file. A quantity without a unit, such as `nominal_stress`, takes it from a row of units below the header; where
                 both state a unit, they must agree. `# key: value` lines may come first (mode, kind, source, remark).
  soro_db        the Soft Robotics Materials Database: metadata lines, then `;`-separated columns. Uniaxial.
  stress_stretch two bare columns, nominal stress in MPa first, then stretch (digitised literature data)
  literature     a folder with UT, ET and PS (uniaxial, equibiaxial, planar), each with a stress_stretch.txt
A curve is one loading branch, in the file's order or sorted; loading and unloading are not mixed.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from softtact.errors import InputError
from softtact.materials.checks import checked, refuse_first
from softtact.materials.curves import MODES, VOLUMETRIC, Curve, VolumetricCurve
from softtact.tables import Cell, Table, number, read_bare, read_table

LAYOUTS = ("plain", "soro_db", "stress_stretch", "literature")
_MARKER = "Engineering Strain"      # in the header of the layout soro_db
_SORO = {"engineering_strain": _MARKER, "nominal_stress_mpa": "Engineering Stress (MPa)"}
_WHAT = "test curve"
_BARE = ("nominal_stress_mpa", "stretch")
_FOLDERS = {"UT": "uniaxial", "ET": "equibiaxial", "PS": "planar"}
_JITTER = 0.05      # share of the range by which a branch may turn back (noise of the strain)
_ROWS = 3           # of a branch, at least and on average; unordered rows rise or fall over one or two
_BACK = 2           # rows of the next branch within the range of the one before
# Name of a column -> its value as stretch, nominal stress in MPa at a stretch, volume ratio, pressure in MPa.
STRETCHES: dict[str, Callable[[float], float]] = {
    "stretch": lambda value: value,
    "engineering_strain": lambda value: 1 + value,
    "engineering_strain_percent": lambda value: 1 + value / 100,
    "true_strain": math.exp,
}
_PER_MPA = {"mpa": 1.0, "kpa": 1e-3, "pa": 1e-6}
STRESSES: dict[str, Callable[..., Any]] = {
    f"nominal_stress_{unit}": lambda value, stretch, factor=factor: factor * value for unit, factor in _PER_MPA.items()}


@dataclass(frozen=True)
class Reading:
    """How a file of a test curve is read.

    mode: test mode; else taken from the file's `# mode:` line or from a file name such as uniaxial.csv
    columns: {"engineering_strain_percent": "Dehnung [%]", ...} for a plain file with other names in its header
    sort: order the rows, for a file with unordered rows
    compression: a compression test whose strains and stresses are written without a minus; a volumetric test keeps its pressure
    decimal: `.` or `,`;  skip_rows: lines above the header that are passed over;  sheet: of a workbook that has several
    """

    mode: str | None = None
    layout: str = "plain"
    columns: Mapping[str, str] = field(default_factory=dict)
    sort: bool = False
    compression: bool = False
    decimal: str = "."
    skip_rows: int = 0
    sheet: str | None = None

    def __post_init__(self):
        if self.skip_rows < 0:
            raise InputError(f"skip_rows is {self.skip_rows}; give the number of lines above the header, 0 or more.")
        if self.columns and self.layout != "plain":
            raise InputError(f"`columns` has no effect on the layout {self.layout}, whose columns are known; leave it out.")


def read_curve(path: str | Path, **options: Any) -> Curve | VolumetricCurve:
    """Read one `Curve`, or `VolumetricCurve`; options are the fields of `Reading`."""
    reading = Reading(**options)
    if reading.layout not in LAYOUTS[:-1]:
        raise InputError(f"{path}: layout {reading.layout!r} is unknown; use one of {', '.join(LAYOUTS[:-1])} for a file.")
    curve, header = _read(path, reading)
    _refuse_unused(reading.columns, [header])
    return curve


def read_curves(paths: str | Path | Sequence[str | Path], *, mode: str | None = None, layout: str = "plain",
                **options: Any) -> list[Curve | VolumetricCurve]:
    """Read one or several files with the same options, fields of `Reading`; a path MODE=FILE states the mode of one file.

    In the layout `literature` each path is a folder with a file per mode.
    """
    found = stated_files(paths, mode=mode, layout=layout)
    bare = "stress_stretch" if layout == "literature" else layout
    read = [_read(path, Reading(mode=stated, layout=bare, **options)) for path, stated in found]
    _refuse_unused(options.get("columns") or {}, [header for _, header in read])
    return [curve for curve, _ in read]


def stated_files(paths: str | Path | Sequence[str | Path], *, mode: str | None = None,
                 layout: str = "plain") -> list[tuple[Path, str | None]]:
    """[(file, its mode or None)] of the arguments of `read_curves`; a mode without effect is refused."""
    paths = [paths] if isinstance(paths, (str, Path)) else paths
    found = [pair for path in paths for pair in (_in_folder(path) if layout == "literature" else [_stated_mode(path, mode)])]
    each_stated = layout == "literature" or not any(path == Path(given) for given, (path, _) in zip(paths, found, strict=False))
    if mode is not None and each_stated:
        raise InputError(f"the mode {mode} for all files has no effect, as each states one; leave it out.")
    return found


def _read(path, reading):
    """The curve of a file, and its header."""
    table = _table(path, reading)
    notes = _notes(table)
    mode = _mode(path, reading.mode or ("uniaxial" if reading.layout == "soro_db" else None), notes)
    rows, values, raw = _values(table, reading, mode)
    remarks = checked(path, rows, *values, mode=mode, raw=raw, compression=reading.compression)
    x, y = order(path, rows, *values, mode=mode, sort=reading.sort)
    # A file that names its source was written by softtact: remarks on its origin are noted in it.
    record = {"kind": notes.get("kind", "measured"), "source": notes.get("source", Path(path).name),
              "remarks": _remarks(table) if "source" in notes else remarks}
    return VolumetricCurve(x, y, **record) if mode == VOLUMETRIC else Curve(mode, x, y, **record), table.header


def _table(path, reading):
    """The file's `Table`."""
    if reading.layout == "stress_stretch":
        if reading.sheet is not None:
            raise InputError(f"{path}: it has no sheet {reading.sheet!r}, as it is a text file; leave `sheet` out.")
        return read_bare(path, what=_WHAT, header=_BARE, decimal=reading.decimal, skip_rows=reading.skip_rows)
    marked = {"marker": _MARKER, "layout": "soro_db"} if reading.layout == "soro_db" else {}
    return read_table(path, what=_WHAT, decimal=reading.decimal, skip_rows=reading.skip_rows, sheet=reading.sheet, **marked)


def _stated_mode(path, mode):
    """(path, mode) of MODE=FILE, or of a plain path with the mode stated for all."""
    head, equals, tail = str(path).partition("=")
    return (Path(tail), head) if equals and head in MODES else (Path(path), mode)


def _in_folder(folder):
    """(path, mode) of the files in a folder of the layout `literature`."""
    found = [(Path(folder) / name / "stress_stretch.txt", mode) for name, mode in _FOLDERS.items()]
    found = [pair for pair in found if pair[0].is_file()]
    if not found:
        raise InputError(f"{folder}: the folder holds no UT, ET or PS with a stress_stretch.txt; name a folder of that layout.")
    return found


def _notes(table):
    """The `# key: value` lines as a dict; only remarks may come more than once."""
    notes = {}
    for text in table.notes:
        key, colon, value = text[1:].partition(":")
        key, value = key.strip(), value.strip()
        if colon and key in ("mode", "kind", "source") and notes.get(key, value) != value:
            raise InputError(f"{table.path}: the notes state the {key} twice, {notes[key]!r} and {value!r}; keep one.")
        if colon:
            notes[key] = value
    return notes


def _remarks(table):
    """The texts of the `# remark: ` lines."""
    return tuple(text.removeprefix("# remark: ") for text in table.notes if text.startswith("# remark: "))


def _mode(path, mode, notes):
    """The stated mode, else the file's note, else its name."""
    mode = mode or notes.get("mode") or Path(path).stem
    if mode not in MODES:
        raise InputError(
            f"{path}: the test mode is {mode!r}; state one of {', '.join(MODES)}"
            " with the file, in a line `# mode: uniaxial` at its top, or in its name."
        )
    return mode


def _values(table, reading, mode):
    """Rows' numbers (n,); stretch and stress, or volume ratio and pressure (2, n); and the numbers in the file (2, n)."""
    columns = _SORO if reading.layout == "soro_db" else reading.columns
    found, units = find_columns(table, mode=mode, columns=columns)
    raw = [(row, *(number(table.path, row, cells[column.at], decimal=table.decimal) for column in found))
           for row, cells in table.rows[units:]]
    if len(raw) < 2:
        raise InputError(f"{table.path}: {len(raw)} point(s) make no curve; give at least two.")
    rows, x, y = (np.array(column) for column in zip(*raw, strict=True))
    names = [column.name for column in found]
    if reading.compression:
        x, y = _with_minus(table.path, rows, x, y, names[0])
    to_x, to_y = (STRETCHES | VOLUMES)[names[0]], (STRESSES | PRESSURES)[names[1]]
    ratio = np.array([_value(table.path, row, value, to_x) for row, value in zip(rows, x, strict=True)])
    with np.errstate(divide="ignore"):
        return rows, np.stack([ratio, to_y(y, ratio)]), np.stack([x, y])


def _value(path, row, value, convert):
    try:
        return convert(value)
    except OverflowError:
        raise InputError(f"{path}, row {row}: the true strain {value:g} is beyond any elastomer; if the column holds percent,"
                         " name it engineering_strain_percent.") from None


def _with_minus(path, rows, x, y, name):
    """A compression test written with positive numbers, with signs. A compressing pressure is always positive."""
    strain = name not in ("stretch", "volume_ratio")
    if strain and x.min() < 0 < x.max():
        row = rows[np.argmax(x < 0)]
        raise InputError(f"{path}, row {row}: it has strains of both signs, so it is written with signs; leave `compression` out.")
    return (-np.abs(x) if strain else x), (y if name in VOLUMES else -np.abs(y))


def _refuse_unused(columns, headers):
    """Refuse a name that `columns` maps to and that no file's header holds."""
    for name, mapped in columns.items():
        if not any(mapped in header for header in headers):
            raise InputError(f"`columns` maps {name} to {mapped!r}, which no file has in its header ({', '.join(headers[0])}); "
                             "correct it, or leave it out.")


def order(path: str | Path, rows: np.ndarray, x: np.ndarray, y: np.ndarray, *, mode: str,
          sort: bool) -> tuple[np.ndarray, np.ndarray]:
    """x and y in rising or falling order: as they are, or sorted.

    A file with loading and unloading is refused in both cases: a law has one stress at a stretch, and the fit of a sorted file
    would lie between both branches.
    """
    name = "volume ratio" if mode == VOLUMETRIC else "stretch"
    if x.min() == x.max():
        raise InputError(f"{path}: every row has the {name} {x[0]:.6g}; give a curve over a range.")
    turn = _unloading(x)
    if turn is not None:
        raise InputError(f"{path}, row {rows[turn]}: the {name} turns back at {x[turn]:.6g} over the range before it, so loading "
                         "and unloading (or several cycles) follow each other; keep the rows of one branch.")
    if sort:
        by_x = np.argsort(x, kind="stable")
        return x[by_x], y[by_x]
    steps, forward = np.diff(x), np.sign(x[-1] - x[0])
    refuse_first(
        path, rows[1:], x[1:], steps * forward < 0 if forward else steps != 0,
        f"the {name} turns back to {{value}}; keep one loading branch, or write `sort: true` if its rows are unordered.",
    )  # fmt: skip
    return x, y


def _unloading(x):
    """Index of the row at which the first branch turns back over its range; None where none does.

    Unordered rows have no branches: they turn at every second row.
    """
    turns = _turns(x)
    if len(x) / (len(turns) - 1) < _ROWS:
        return None
    for start, turn, end in zip(turns, turns[1:], turns[2:], strict=False):
        before, after = x[start:turn + 1], x[turn + 1:end + 1]
        back = (after > before.min()) & (after < before.max())
        if len(before) >= _ROWS and back.sum() >= _BACK:
            return turn
    return None


def _turns(x):
    """Indices of the ends and of the extremes between them, each farther from the last than the jitter."""
    least = _JITTER * (x.max() - x.min())
    turns, extreme, direction = [0], 0, 0
    for k in range(1, len(x)):
        if direction == 0:
            direction = int(np.sign(x[k] - x[0])) if abs(x[k] - x[0]) > least else 0
            extreme = k if direction else 0
        elif direction * (x[k] - x[extreme]) >= 0:
            extreme = k
        elif direction * (x[extreme] - x[k]) > least:
            turns.append(extreme)
            extreme, direction = k, -direction
    return [*turns, len(x) - 1]


# Constant volume: the loaded section of a bar, a strip or a sheet has shrunk by the stretch, in each of the three tests.
STRESSES |= {f"true_stress_{unit}": lambda value, stretch, factor=factor: factor * value / stretch
             for unit, factor in _PER_MPA.items()}
VOLUMES: dict[str, Callable[[float], float]] = {
    "volume_ratio": lambda value: value, "volumetric_strain": lambda value: 1 + value,
    "volumetric_strain_percent": lambda value: 1 + value / 100}
PRESSURES: dict[str, Callable[..., Any]] = {
    f"pressure_{unit}": lambda value, ratio, factor=factor: factor * value for unit, factor in _PER_MPA.items()}
NAMES = (*STRETCHES, *STRESSES, *VOLUMES, *PRESSURES)

_BASES = ("nominal_stress", "true_stress", "pressure")      # quantities whose name has no unit
_PERCENT = {"engineering_strain": "engineering_strain_percent", "volumetric_strain": "volumetric_strain_percent"}
# Case matters: mPa is not MPa.
_UNITS = {"MPa": "mpa", "MPA": "mpa", "mpa": "mpa", "N/mm2": "mpa", "N/mm^2": "mpa", "N/mm\N{SUPERSCRIPT TWO}": "mpa",
          "kPa": "kpa", "KPa": "kpa", "kpa": "kpa", "kN/m2": "kpa", "kN/m^2": "kpa", "kN/m\N{SUPERSCRIPT TWO}": "kpa",
          "Pa": "pa", "pa": "pa", "N/m2": "pa", "N/m^2": "pa", "N/m\N{SUPERSCRIPT TWO}": "pa",
          "%": "percent", "percent": "percent", "": "1", "-": "1", "\N{EN DASH}": "1", "mm/mm": "1", "m/m": "1", "in/in": "1"}

@dataclass(frozen=True)
class Declared:
    """A column: its position, and the name, a key of `NAMES`, that declares its quantity and unit."""

    name: str
    at: int


def find_columns(table: Table, *, mode: str, columns: Mapping[str, str]) -> tuple[list[Declared], int]:
    """The two columns of a curve's table, stretch and stress, or volume and pressure; and the number of rows of units below.

    columns: {name: that in the file}
    """
    unknown = sorted(set(columns) - {*NAMES, *_BASES})
    if unknown:
        raise InputError(f"{table.path}: `columns` maps {unknown[0]!r}, which is no quantity with a unit; map one of "
                         f"{', '.join(STRETCHES | STRESSES | VOLUMES | PRESSURES)}.")
    wanted = (((VOLUMES, "volume"), (PRESSURES, "pressure")) if mode == VOLUMETRIC
              else ((STRETCHES, "stretch"), (STRESSES, "stress")))
    found = [_find(table, list(known), columns, quantity) for known, quantity in wanted]
    units = _units_below(table, found)
    if units is None:
        for column in found:
            if column.name in _BASES:
                raise InputError(f"{table.path}: {table.header[column.at]!r} states no unit; name the column {column.name}_mpa, "
                                 f"{column.name}_kpa or {column.name}_pa, or write a row of units below the header.")
        return found, 0
    row, texts = units
    return [_with_unit(table, row, column, text) for column, text in zip(found, texts, strict=True)], 1


def _find(table, known, columns, quantity):
    """The one column that holds the quantity."""
    accepted = [*known, *(base for base in _BASES if any(name.startswith(base) for name in known))]
    found = [Declared(name, at) for name in accepted for at in table.positions(columns.get(name, name))]
    if len(found) == 1:
        return found[0]
    unmet = next((f"; none is called {columns[name]!r}, to which {name} is mapped" for name in accepted if name in columns
                  and columns[name] not in table.header), "")
    if len(table.header) == 1:
        raise InputError(f"{table.path}: the header names one column, {table.header[0]!r}; put commas, semicolons or tabs between "
                         "the columns, or pass over the lines above the header (--skip-rows N).")
    problem = "several columns hold" if found else "no column holds"
    raise InputError(f"{table.path}: {problem} the {quantity} among {', '.join(table.header)}{unmet}; name one of them "
                     f"{' or '.join(known)}, map it under `columns`, or pass over the lines above the header (--skip-rows N).")


def _units_below(table, found):
    """(row number, texts) of the first row, if none of the columns has a number there; else None."""
    if not table.rows:
        return None
    row, cells = table.rows[0]
    texts = [cells[column.at] for column in found]
    return (row, texts) if any(texts) and not any(_like_a_number(cell) for cell in texts) else None


def _like_a_number(cell: Cell) -> bool:
    """Whether a cell is a number, even one that cannot be read, such as `1,5` or nan."""
    return isinstance(cell, float) or re.match(r"[+-]?[.,]?\d|[+-]?(nan|inf)", cell.strip(), flags=re.IGNORECASE) is not None


def _with_unit(table, row, column, text):
    """The column with the unit that the row of units states."""
    written = re.sub(r"^[\[(]\s*|\s*[\])]$", "", text.strip())
    unit, header = _UNITS.get(written), table.header[column.at]
    if column.name in _BASES:
        if unit in _PER_MPA:
            return Declared(f"{column.name}_{unit}", column.at)
        wanted = "MPa, kPa or Pa"
    elif column.name in STRESSES | PRESSURES:
        if written == "" or unit == column.name.rsplit("_", 1)[1]:
            return column
        wanted = f"{column.name.rsplit('_', 1)[1]}, as its name says"
    elif column.name in _PERCENT and unit == "percent":
        return Declared(_PERCENT[column.name], column.at)
    else:
        percent = column.name.endswith("_percent")
        if written == "" or unit == ("percent" if percent else "1"):
            return column
        wanted = "%, as its name says" if percent else "-"
    raise InputError(f"{table.path}, row {row}: {text!r} below {header!r} is neither a number nor the unit that belongs there, "
                     f"{wanted}; correct the row, or convert the column (lengths and forces are no strain and no stress).")
