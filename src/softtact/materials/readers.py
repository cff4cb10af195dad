"""Readers of test curves. Each refuses unreliable data in a sentence with file, row, value and remedy.

Layouts:
  plain          CSV (, ; or tab) or a sheet of Excel, with a header. The names of the columns declare quantity and unit
                 (`columns.py`); `columns` maps these names to those of the file. `# key: value` lines may come first (mode, kind,
                 source, remark).
  soro_db        the Soft Robotics Materials Database: metadata lines, then `;`-separated columns. Uniaxial.
  stress_stretch two bare columns, nominal stress in MPa first, then stretch (digitised literature data)
  literature     a folder with UT, ET and PS (uniaxial, equibiaxial, planar), each with a stress_stretch.txt
A curve is one loading branch, in the file's order or sorted; loading and unloading are not mixed.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from softtact.errors import InputError
from softtact.inputs import refuse_twice
from softtact.materials.checks import checked, refuse_impossible
from softtact.materials.columns import Specimen, find_columns, refuse_lacking
from softtact.materials.curves import MODES, VOLUMETRIC, AnyCurve, make_curve
from softtact.materials.cycles import CyclicTest
from softtact.materials.history import HOLDS, order, refuse_cycles, without_holds
from softtact.tables import number, on_one_line, read_bare, read_table

LAYOUTS = ("plain", "soro_db", "stress_stretch", "literature")
_MARKER = "Engineering Strain"      # in the header of the layout soro_db
_SORO = {"engineering_strain": _MARKER, "nominal_stress_mpa": "Engineering Stress (MPa)"}
_WHAT = "test curve"
_BARE = ("nominal_stress_mpa", "stretch")
_FOLDERS = {"UT": "uniaxial", "ET": "equibiaxial", "PS": "planar"}


@dataclass(frozen=True)
class Reading:
    """How a file of a test curve is read.

    mode: test mode; else taken from the file's `# mode:` line or from a file name such as uniaxial.csv
    columns: {"engineering_strain_percent": "Dehnung [%]", ...} for a plain file with other names in its header
    sort: order the rows, for a file with unordered rows
    compression: a compression test whose strains and stresses are written without a minus; a volumetric test keeps its pressure
    decimal: `.` or `,`;  skip_rows: lines above the header that are passed over;  sheet: of a workbook that has several
    area_mm2, length_mm: of the undeformed specimen, for columns of force and extension
    holds: `instantaneous` or `relaxed`, of a test with steps at which the stress relaxes
    window: {mode: [min, max]} of the rows that will be used: remarks are on these; the curve is read as a whole
    """

    mode: str | None = None
    layout: str = "plain"
    columns: Mapping[str, str] = field(default_factory=dict)
    sort: bool = False
    compression: bool = False
    decimal: str = "."
    skip_rows: int = 0
    sheet: str | None = None
    area_mm2: float | None = None
    length_mm: float | None = None
    holds: str | None = None
    window: Mapping[str, Sequence[float]] = field(default_factory=dict)

    def __post_init__(self):
        if self.holds not in (None, *HOLDS):
            raise InputError(f"holds is {self.holds!r}; write {' or '.join(HOLDS)}.")
        if self.skip_rows < 0:
            raise InputError(f"skip_rows is {self.skip_rows}; give the number of lines above the header, 0 or more.")
        if self.columns and self.layout != "plain":
            raise InputError(f"`columns` has no effect on the layout {self.layout}, whose columns are known; leave it out.")


def read_curve(path: str | Path, **options: Any) -> AnyCurve:
    """Read one curve; options are the fields of `Reading`."""
    reading = Reading(**options)
    if reading.layout not in LAYOUTS[:-1]:
        raise InputError(f"{path}: layout {reading.layout!r} is unknown; use one of {', '.join(LAYOUTS[:-1])} for a file.")
    curve, header = _read(path, reading)
    _refuse_unused(reading.columns, [header])
    return curve


def read_curves(paths: str | Path | Sequence[str | Path], *, mode: str | None = None, layout: str = "plain",
                **options: Any) -> list[AnyCurve]:
    """Read one or several files with the same options, fields of `Reading`; a path MODE=FILE states the mode of one file.

    In the layout `literature` each path is a folder with a file per mode.
    """
    found = stated_files(paths, mode=mode, layout=layout)
    bare = "stress_stretch" if layout == "literature" else layout
    read = [_read(path, Reading(mode=stated, layout=bare, **options)) for path, stated in found]
    _refuse_unused(options.get("columns") or {}, [header for _, header in read])
    return [curve for curve, _ in read]


def read_cycles(paths: Sequence[str | Path], *, cycles: str, mode: str | None = None,
                **options: Any) -> tuple[list[AnyCurve], list[CyclicTest]]:
    """The curves of tests with loading and unloading that laws are fitted to, and the tests of shape, in the order of time.

    cycles: `first` or `mullins`, the curves are those of first loading, or `steady`, those of the last loading
    Other arguments are those of `read_curves`, and so are the checks.
    """
    found = [_read_history(path, Reading(mode=stated, **options), cycles) for path, stated in stated_files(paths, mode=mode)]
    _refuse_unused(options.get("columns") or {}, [header for _, _, header in found])
    tests = [test for _, test, _ in found if test is not None]
    if all(test.first.all() for test in tests):
        raise InputError(f"{', '.join(test.history.source for test in tests) or paths[0]}: the strain only grows, so --cycles has "
                         "no effect; leave it out.")
    return [curve for curve, _, _ in found], tests


def _read_history(path, reading, cycles):
    """The curve of a file for a law; the test itself, None for a volumetric one; and the header."""
    table = _table(path, reading)
    notes = _notes(table)
    mode = _mode(path, reading.mode, notes)
    if mode == VOLUMETRIC:
        curve, header = _read(path, reading)
        return curve, None, header
    if reading.sort or reading.holds is not None:
        raise InputError(f"{path}: the rows of cycles are in the order of time, and none is a hold; leave "
                         f"{'--sort' if reading.sort else '--holds'} out, or --cycles.")
    rows, values, raw = _values(table, reading, mode)
    refuse_impossible(path, rows, *values, mode=mode, raw=raw)      # all rows: a wrong one hides which are of first loading
    test = CyclicTest(make_curve(mode, *values, kind=notes.get("kind", "measured"), source=Path(path).name))
    used = test.rows(cycles)
    remarks = checked(path, rows[used], *values[:, used], mode=mode, raw=raw[:, used], compression=reading.compression,
                      window=reading.window.get(mode))
    return replace(test.curve(cycles), remarks=(*_of_table(table), *remarks)), test, table.header


def stated_files(paths: str | Path | Sequence[str | Path], *, mode: str | None = None,
                 layout: str = "plain") -> list[tuple[Path, str | None]]:
    """[(file, its mode or None)] of the arguments of `read_curves`; a mode without effect is refused."""
    paths = [paths] if isinstance(paths, (str, Path)) else paths
    found = [pair for path in paths for pair in (_in_folder(path) if layout == "literature" else [_stated_mode(path, mode)])]
    each_stated = layout == "literature" or not any(path == Path(given) for given, (path, _) in zip(paths, found, strict=False))
    if mode is not None and each_stated:
        raise InputError(f"the mode {mode} for all files has no effect, as each states one; leave it out.")
    refuse_twice([path for path, _ in found])
    return found


def _read(path, reading):
    """The curve of a file, and its header."""
    table = _table(path, reading)
    notes = _notes(table)
    mode = _mode(path, reading.mode or ("uniaxial" if reading.layout == "soro_db" else None), notes)
    rows, values, raw = _values(table, reading, mode)
    refuse_impossible(path, rows, *values, mode=mode, raw=raw)
    refuse_cycles(path, rows, values[0], mode=mode)     # first, as the stress of a turn is that of a short hold
    used = without_holds(path, rows, *values, mode=mode, holds=reading.holds)
    _check_count(path, used)
    rows, values, raw = rows[used], values[:, used], raw[:, used]
    remarks = checked(path, rows, *values, mode=mode, raw=raw, compression=reading.compression, window=reading.window.get(mode))
    x, y = order(path, rows, *values, mode=mode, sort=reading.sort)
    # A file that names its source was written by softtact: remarks on its origin are noted in it.
    record = {"kind": notes.get("kind", "measured"), "source": notes.get("source", Path(path).name),
              "remarks": _remarks(table) if "source" in notes else (*_of_table(table), *remarks)}
    return make_curve(mode, x, y, **record), table.header


def _of_table(table):
    """The remarks on the table itself."""
    return (f"{table.path}: {remark}" for remark in table.remarks)


def _check_count(path, points):
    if len(points) < 2:
        raise InputError(f"{path}: {len(points)} point(s) make no curve; give at least two.")


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
    _check_count(table.path, raw)
    rows, x, y = (np.array(column) for column in zip(*raw, strict=True))
    specimen = Specimen(reading.area_mm2, reading.length_mm)
    refuse_lacking(table.path, [column.name for column in found], specimen)
    if reading.compression:
        x, y = _with_minus(table.path, rows, x, y, found[0].name)
    deformation = np.array([_value(table.path, row, value, found[0], specimen) for row, value in zip(rows, x, strict=True)])
    with np.errstate(divide="ignore"):
        return rows, np.stack([deformation, found[1].convert(y, deformation, specimen)]), np.stack([x, y])


def _value(path, row, value, column, specimen):
    try:
        return column.convert(value, specimen)
    except OverflowError:
        raise InputError(f"{path}, row {row}: the true strain {value:g} is beyond any elastomer; if the column holds percent,"
                         " name it engineering_strain_percent.") from None


def _with_minus(path, rows, x, y, name):
    """A compression test written with positive numbers, with signs. A compressing pressure is always positive."""
    strain = name not in ("stretch", "volume_ratio")
    if strain and x.min() < 0 < x.max():
        row = rows[np.argmax(x < 0)]
        raise InputError(f"{path}, row {row}: it has strains of both signs, so it is written with signs; leave `compression` out.")
    return (-np.abs(x) if strain else x), (y if name.startswith("volum") else -np.abs(y))


def _refuse_unused(columns, headers):
    """Refuse a name that `columns` maps to and that no file's header holds."""
    for name, mapped in columns.items():
        if not any(on_one_line(mapped) in header for header in headers):
            raise InputError(f"`columns` maps {name} to {mapped!r}, which no file has in its header ({', '.join(headers[0])}); "
                             "correct it, or leave it out.")
