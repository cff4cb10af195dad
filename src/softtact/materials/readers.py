"""Readers of test curves. Each refuses what it cannot trust with a sentence naming file, row, value and remedy.

Layouts:
  plain          CSV (, ; or tab) with a header. The names of the columns declare quantity and unit: one of `STRETCHES` and one
                 of `STRESSES`, or of `VOLUMES` and `PRESSURES`; `columns` maps these names to the file's own.
                 `# key: value` lines may stand above (mode, kind, source, remark).
  soro_db        the Soft Robotics Materials Database: metadata lines, then `;`-separated columns. Uniaxial.
  stress_stretch two bare columns, nominal stress in MPa first, then stretch (digitised literature data)
  literature     a folder with UT, ET and PS (uniaxial, equibiaxial, planar), each with a stress_stretch.txt
"""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from softtact.errors import InputError
from softtact.materials.checks import checked, order
from softtact.materials.curves import MODES, VOLUMETRIC, Curve, VolumetricCurve

# Name of a column -> its value as stretch, nominal stress in MPa at a stretch, volume ratio, pressure in MPa.
STRETCHES = {
    "stretch": lambda value: value,
    "engineering_strain": lambda value: 1 + value,
    "engineering_strain_percent": lambda value: 1 + value / 100,
    "true_strain": math.exp,
}
_PER_MPA = {"mpa": 1.0, "kpa": 1e-3, "pa": 1e-6}
STRESSES = {f"nominal_stress_{unit}": lambda value, stretch, factor=factor: factor * value for unit, factor in _PER_MPA.items()}
# Constant volume: the loaded section of a bar, a strip or a sheet has shrunk by the stretch, in each of the three tests.
STRESSES |= {f"true_stress_{unit}": lambda value, stretch, factor=factor: factor * value / stretch
             for unit, factor in _PER_MPA.items()}
VOLUMES = {"volume_ratio": lambda value: value, "volumetric_strain": lambda value: 1 + value,
           "volumetric_strain_percent": lambda value: 1 + value / 100}
PRESSURES = {f"pressure_{unit}": lambda value, ratio, factor=factor: factor * value for unit, factor in _PER_MPA.items()}

LAYOUTS = ("plain", "soro_db", "stress_stretch", "literature")
_SORO = {"engineering_strain": "Engineering Strain", "nominal_stress_mpa": "Engineering Stress (MPa)"}
_FOLDERS = {"UT": "uniaxial", "ET": "equibiaxial", "PS": "planar"}


def read_curve(path: str | Path, *, mode: str | None = None, layout: str = "plain", columns: dict[str, str] | None = None,
               sort: bool = False, compression: bool = False) -> Curve | VolumetricCurve:
    """Read one `Curve`, or `VolumetricCurve`.

    mode: test mode; else taken from the file's `# mode:` line or from a file name such as uniaxial.csv
    columns: {"engineering_strain_percent": "Dehnung [%]", ...} for a plain file with other names in its header
    sort: order the rows, for a file with several loading branches
    compression: a compression test whose strains and stresses are written without a minus
    """
    if layout not in LAYOUTS[:-1]:
        raise InputError(f"{path}: layout {layout!r} is unknown; use one of {', '.join(LAYOUTS[:-1])} for a file.")
    rows = _read_rows(path)
    notes = _notes(rows)
    table = [row for row in rows if not row[1].startswith("#")]
    mode = _mode(path, mode or ("uniaxial" if layout == "soro_db" else None), notes)
    numbers, values, raw = _columns(path, table, layout, mode, columns or {}, compression=compression)
    remarks = checked(path, numbers, *values, mode=mode, raw=raw)
    x, y = order(path, numbers, *values, mode=mode, sort=sort)
    # A file that names its source is one of the project's own: what was odd in its origin is noted in it.
    record = {"kind": notes.get("kind", "measured"), "source": notes.get("source", Path(path).name),
              "remarks": _remarks(rows) if "source" in notes else remarks}
    return VolumetricCurve(x, y, **record) if mode == VOLUMETRIC else Curve(mode, x, y, **record)


def read_curves(paths: str | Path | Sequence[str | Path], *, mode: str | None = None, layout: str = "plain",
                **options: Any) -> list[Curve | VolumetricCurve]:
    """Read one or several files with the same options of `read_curve`; a path MODE=FILE states a file's own mode.

    In the layout `literature` each path is a folder with a file per mode.
    """
    paths = [paths] if isinstance(paths, (str, Path)) else paths
    found = [pair for path in paths for pair in (_in_folder(path) if layout == "literature" else [_stated_mode(path, mode)])]
    layout = "stress_stretch" if layout == "literature" else layout
    return [read_curve(path, mode=own, layout=layout, **options) for path, own in found]


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


def _read_rows(path):
    """(row number from 1, text) of each line that is not blank."""
    try:
        raw = Path(path).read_bytes()
    except (FileNotFoundError, IsADirectoryError):
        raise InputError(f"{path}: there is no such file; give the path of a test curve.") from None
    text = raw.decode("utf-8-sig", errors="replace")
    rows = [(number, line.strip()) for number, line in enumerate(text.splitlines(), 1)]
    rows = [(number, line) for number, line in rows if line.strip(";,")]
    if not rows:
        raise InputError(f"{path}: the file is empty; give a test curve with its columns.")
    return rows


def _notes(rows):
    """The `# key: value` lines as a dict."""
    pairs = [text[1:].split(":", 1) for _, text in rows if text.startswith("#") and ":" in text]
    return {key.strip(): value.strip() for key, value in pairs}


def _remarks(rows):
    """The texts of the `# remark: ` lines."""
    return tuple(text.removeprefix("# remark: ") for _, text in rows if text.startswith("# remark: "))


def _mode(path, mode, notes):
    """The stated mode, else the file's note, else its name."""
    mode = mode or notes.get("mode") or Path(path).stem
    if mode not in MODES:
        raise InputError(
            f"{path}: the test mode is {mode!r}; state one of {', '.join(MODES)}"
            " with the file, in a line `# mode: uniaxial` at its top, or in its name."
        )
    return mode


def _columns(path, table, layout, mode, columns, *, compression):
    """Rows' numbers (n,); stretch and stress, or volume ratio and pressure (2, n); and the file's own numbers (2, n)."""
    if layout == "stress_stretch":
        raw = [(row, *_numbers(path, row, text.split(), (1, 0))) for row, text in table]
        declared = ("stretch", "nominal_stress_mpa")
    else:
        header, below = _after_header(path, table, "Engineering Strain" if layout == "soro_db" else None)
        declared, raw = _named(path, header, below, _SORO if layout == "soro_db" else columns, mode)
    if len(raw) < 2:
        raise InputError(f"{path}: {len(raw)} point(s) make no curve; give at least two.")
    rows, x, y = (np.array(column) for column in zip(*raw, strict=True))
    if compression:
        x, y = _with_minus(x, y, declared[0])
    to_x, to_y = (STRETCHES | VOLUMES)[declared[0]], (STRESSES | PRESSURES)[declared[1]]
    ratio = np.array([_value(path, row, value, to_x) for row, value in zip(rows, x, strict=True)])
    with np.errstate(divide="ignore"):
        return rows, np.stack([ratio, to_y(y, ratio)]), np.stack([x, y])


def _value(path, row, value, convert):
    try:
        return convert(value)
    except OverflowError:
        raise InputError(f"{path}, row {row}: the true strain {value:g} is beyond any elastomer; if the column holds percent,"
                         " name it engineering_strain_percent.") from None


def _with_minus(x, y, name):
    """A compression test written with positive numbers, with its signs."""
    return (x if name == "stretch" else -np.abs(x)), -np.abs(y)


def _separator(header):
    """The header decides: below it a comma may be a decimal comma, which is then refused as such."""
    return max(";\t,", key=header.count)


def _cells(text, separator):
    return [cell.strip().strip('"') for cell in text.split(separator)]


def _after_header(path, table, marker):
    """The header, and the (row, text) below it. The header is the first line, or the one that has `marker`."""
    for index, (_, text) in enumerate(table):
        if marker is None or marker in text:
            return text, table[index + 1 :]
    raise InputError(f"{path}: no header with {marker!r} was found; is its layout soro_db?")


def _named(path, header, table, columns, mode):
    """The two declared names, and [(row, x, y)] as the file has them."""
    separator = _separator(header)
    header = _cells(header, separator)
    wanted = ((VOLUMES, "volume"), (PRESSURES, "pressure")) if mode == VOLUMETRIC else (
        (STRETCHES, "stretch"), (STRESSES, "stress"))
    found = [_find_column(path, header, known, columns, quantity) for known, quantity in wanted]
    places = [place for _, place in found]
    raw = [(row, *_numbers(path, row, _cells(text, separator), places)) for row, text in table]
    return [name for name, _ in found], raw


def _find_column(path, header, known, columns, quantity):
    """Name (a key of `known`) and position of the one column that holds the quantity."""
    unknown = sorted(set(columns) - set(STRETCHES | STRESSES | VOLUMES | PRESSURES))
    if unknown:
        raise InputError(f"{path}: `columns` maps {unknown[0]!r}, which is no quantity with a unit; map one of"
                         f" {', '.join(known)}.")
    found = [name for name in known if columns.get(name, name) in header]
    if len(found) != 1:
        problem = "several columns hold" if found else "no column holds"
        raise InputError(
            f"{path}: {problem} the {quantity} among {', '.join(header)};"
            f" name one of them {' or '.join(known)}, or map it under `columns`."
        )
    return found[0], header.index(columns.get(found[0], found[0]))


def _numbers(path, row, cells, positions):
    """The finite numbers at two positions of a row."""
    values = []
    for position in positions:
        cell = cells[position] if position < len(cells) else ""
        try:
            value = float(cell)
        except ValueError:
            remedy = "write it with a decimal point" if "," in cell else "correct it or remove the row"
            raise InputError(f"{path}, row {row}: {cell!r} is not a number; {remedy}.") from None
        if not math.isfinite(value):
            raise InputError(f"{path}, row {row}: the value {cell!r} is not finite; correct it or remove the row.")
        values.append(value)
    return values
