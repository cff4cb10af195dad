"""Which columns of a table hold a test curve: the names that declare quantity and unit, and a row of units below them.

A name is a quantity with its unit, such as `nominal_stress_kpa`. A quantity without one, such as `nominal_stress`, takes it from a
row of units below the header. Where both tell a unit, they must agree.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from softtact.errors import InputError
from softtact.materials.curves import VOLUMETRIC
from softtact.tables import Cell, Table

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
# Constant volume: the loaded section of a bar, a strip or a sheet has shrunk by the stretch, in each of the three tests.
STRESSES |= {f"true_stress_{unit}": lambda value, stretch, factor=factor: factor * value / stretch
             for unit, factor in _PER_MPA.items()}
VOLUMES: dict[str, Callable[[float], float]] = {
    "volume_ratio": lambda value: value, "volumetric_strain": lambda value: 1 + value,
    "volumetric_strain_percent": lambda value: 1 + value / 100}
PRESSURES: dict[str, Callable[..., Any]] = {
    f"pressure_{unit}": lambda value, ratio, factor=factor: factor * value for unit, factor in _PER_MPA.items()}
NAMES = (*STRETCHES, *STRESSES, *VOLUMES, *PRESSURES)

_BASES = ("nominal_stress", "true_stress", "pressure")      # quantities that have no unit of their own
_PERCENT = {"engineering_strain": "engineering_strain_percent", "volumetric_strain": "volumetric_strain_percent"}
# As they are written: a unit's letters are not folded, for mPa is no MPa.
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
    """The two columns of a curve's table, stretch and stress, or volume and pressure; and how many rows of units stand below.

    columns: {name: the file's own name of it}
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
    own = [cells[column.at] for column in found]
    return (row, own) if any(own) and not any(_like_a_number(cell) for cell in own) else None


def _like_a_number(cell: Cell) -> bool:
    """Whether a cell is a number, be it one that is not understood, such as `1,5` or nan."""
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
