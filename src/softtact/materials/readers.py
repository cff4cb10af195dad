"""Readers of test curves. Each refuses what it cannot trust with a sentence naming file, row, value and remedy.

Layouts:
  plain          CSV (, ; or tab) with a header. The names of the columns declare quantity and unit: one of
                 STRETCH_COLUMNS and one of STRESS_COLUMNS; `columns` maps these names to the file's own.
                 `# key: value` lines may stand above (mode, kind, source).
  soro_db        the Soft Robotics Materials Database: metadata lines, then `;`-separated columns. Uniaxial.
  stress_stretch two bare columns, nominal stress in MPa first, then stretch (digitised literature data)
"""

import math
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.materials.curves import Curve
from softtact.materials.laws.base import TEST_PATHS

# Name of a column -> (factor, offset) to the stretch, or factor to the nominal stress in MPa.
STRETCH_COLUMNS = {
    "stretch": (1.0, 0.0),
    "engineering_strain": (1.0, 1.0),
    "engineering_strain_percent": (0.01, 1.0),
}
STRESS_COLUMNS = {"nominal_stress_mpa": 1.0, "nominal_stress_kpa": 1e-3, "nominal_stress_pa": 1e-6}
LAYOUTS = ("plain", "soro_db", "stress_stretch")
SORO_COLUMNS = {"engineering_strain": "Engineering Strain", "nominal_stress_mpa": "Engineering Stress (MPa)"}

# No elastomer goes beyond these; values beyond are percent or another unit.
LARGEST_STRETCH = 25.0
LARGEST_STRESS_MPA = 200.0
# Stress may have the wrong sign by this share of the largest one (zero drift of a load cell) before it is refused.
SIGN_TOLERANCE = 0.05


def read_curve(path, *, mode=None, layout="plain", columns=None, sort=False):
    """Read one `Curve`.

    mode: test mode; else taken from the file's `# mode:` line or from a file name such as uniaxial.csv
    columns: {"engineering_strain_percent": "Dehnung [%]", ...} for a plain file with other names in its header
    sort: order the rows by stretch, for a file with several loading branches
    """
    if layout not in LAYOUTS:
        raise InputError(f"{path}: layout {layout!r} is unknown; use one of {', '.join(LAYOUTS)}.")
    rows = _read_rows(path)
    notes = _notes(rows)
    table = [row for row in rows if not row[1].startswith("#")]
    if layout == "soro_db":
        header, table = _after_header(path, table, "Engineering Strain")
        points = _points_by_name(path, header, table, SORO_COLUMNS)
        mode = mode or "uniaxial"
    elif layout == "plain":
        header, table = _after_header(path, table, None)
        points = _points_by_name(path, header, table, columns or {})
    else:
        points = [(row, *_numbers(path, row, text.split(), (1, 0))) for row, text in table]
    return _checked_curve(path, _mode(path, mode, notes), points, notes, sort=sort)


def read_curves(paths, **options):
    """Read one or several files with the same options of `read_curve`."""
    paths = [paths] if isinstance(paths, (str, Path)) else paths
    return [read_curve(path, **options) for path in paths]


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


def _points_by_name(path, header, table, columns):
    """[(row, stretch, stress in MPa)] from the columns whose names declare quantity and unit."""
    separator = _separator(header)
    header = _cells(header, separator)
    strain_name, strain_at = _find_column(path, header, STRETCH_COLUMNS, columns, "stretch")
    stress_name, stress_at = _find_column(path, header, STRESS_COLUMNS, columns, "nominal stress")
    factor, offset = STRETCH_COLUMNS[strain_name]
    points = []
    for row, text in table:
        strain, stress = _numbers(path, row, _cells(text, separator), (strain_at, stress_at))
        points.append((row, factor * strain + offset, STRESS_COLUMNS[stress_name] * stress))
    return points


def _find_column(path, header, known, columns, quantity):
    """Name (a key of `known`) and position of the one column that holds the quantity."""
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


def _mode(path, mode, notes):
    """The stated mode, else the file's note, else its name."""
    mode = mode or notes.get("mode") or Path(path).stem
    if mode not in TEST_PATHS:
        raise InputError(
            f"{path}: the test mode is {mode!r}; state one of {', '.join(TEST_PATHS)}"
            " with the file, in a line `# mode: uniaxial` at its top, or in its name."
        )
    return mode


def _checked_curve(path, mode, points, notes, *, sort):
    if len(points) < 2:
        raise InputError(f"{path}: {len(points)} point(s) make no curve; give at least two.")
    rows, stretch, stress = (np.array(column) for column in zip(*points, strict=True))
    _check_magnitude(path, rows, stretch, stress)
    _check_sign(path, rows, stretch, stress)
    if sort:
        order = np.argsort(stretch, kind="stable")
        stretch, stress = stretch[order], stress[order]
    else:
        _check_order(path, rows, stretch)
    return Curve(mode, stretch, stress, notes.get("kind", "measured"), notes.get("source", Path(path).name))


def _refuse_first(path, rows, values, bad, sentence):
    """Raise for the first bad value, if there is one; `sentence` takes {value}."""
    if bad.any():
        first = int(np.argmax(bad))
        raise InputError(f"{path}, row {rows[first]}: " + sentence.format(value=f"{values[first]:.6g}"))


def _check_magnitude(path, rows, stretch, stress):
    _refuse_first(
        path, rows, stretch, stretch <= 0,
        "the stretch {value} is not positive; if the column holds strain, name it engineering_strain"
        " or engineering_strain_percent.",
    )  # fmt: skip
    _refuse_first(
        path, rows, stretch, stretch > LARGEST_STRETCH,
        f"the stretch {{value}} is above {LARGEST_STRETCH:g}, which no elastomer reaches;"
        " if the column holds percent, name it engineering_strain_percent.",
    )  # fmt: skip
    _refuse_first(
        path, rows, stress, np.abs(stress) > LARGEST_STRESS_MPA,
        f"the stress {{value}} MPa is beyond {LARGEST_STRESS_MPA:g} MPa, which no elastomer bears;"
        " if the column holds kPa or Pa, name it nominal_stress_kpa or nominal_stress_pa.",
    )  # fmt: skip


def _check_sign(path, rows, stretch, stress):
    wrong = stress * np.sign(stretch - 1) < -SIGN_TOLERANCE * np.abs(stress).max()
    _refuse_first(
        path, rows, stress, wrong,
        "the stress {value} MPa has the wrong sign for its stretch;"
        " tension is positive and compression negative, in strain and in stress.",
    )  # fmt: skip


def _check_order(path, rows, stretch):
    """A stretch that turns back is unloading or a second branch: a fit of both at once means nothing."""
    steps = np.diff(stretch)
    forward = np.sign(stretch[-1] - stretch[0])
    _refuse_first(
        path, rows[1:], stretch[1:], steps * forward < 0 if forward else steps != 0,
        "the stretch turns back to {value}; keep one loading branch, or say `sort: true` if its rows are in disorder.",
    )  # fmt: skip
