"""Columns of a test's table: which quantity and unit a name declares, and how its numbers become stretch, stress, and so on.

The names of the columns declare quantity and unit. A quantity without a unit, such as `nominal_stress`, takes it from brackets in
the file's header, or from a row of units below the header; where several state a unit, they must agree.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from softtact.errors import InputError
from softtact.materials.curves import VOLUMETRIC
from softtact.materials.laws.base import SIMPLE_SHEAR
from softtact.tables import Cell, Table, ascii_minus

_POUND_N, _INCH_MM, _KGF_N = 4.4482216152605, 25.4, 9.80665
_PSI_MPA = _POUND_N / _INCH_MM**2
MEGAPASCALS = {"mpa": 1.0, "kpa": 1e-3, "pa": 1e-6, "gpa": 1e3, "bar": 0.1, "psi": _PSI_MPA, "ksi": 1e3 * _PSI_MPA, "n_cm2": 0.01,
               "kgf_cm2": _KGF_N / 100, "kgf_mm2": _KGF_N}
NEWTONS = {"n": 1.0, "mn": 1e-3, "kn": 1e3, "gf": 1e-3 * _KGF_N, "kgf": _KGF_N, "lbf": _POUND_N}
MILLIMETRES = {"mm": 1.0, "um": 1e-3, "cm": 10.0, "m": 1e3, "in": _INCH_MM}
SECONDS = {"s": 1.0, "ms": 1e-3, "min": 60.0, "h": 3600.0}
HERTZ = {"hz": 1.0, "khz": 1e3, "rad_s": 1 / (2 * math.pi)}
# Quantity whose name has no unit -> its units, factors to MPa, N, mm, s or Hz.
BASES = dict.fromkeys((
    "nominal_stress", "true_stress", "shear_stress", "pressure", "relaxation_modulus", "shear_modulus", "young_modulus",
    "storage_modulus", "loss_modulus", "shear_storage_modulus", "shear_loss_modulus"), MEGAPASCALS) | {
    "force": NEWTONS, "extension": MILLIMETRES, "time": SECONDS, "frequency": HERTZ}
_PERCENT = {name: f"{name}_percent" for name in ("engineering_strain", "volumetric_strain", "shear_strain")}
# A unit as it is written -> its name above. Case matters: mPa is not MPa.
_WRITTEN = {
    "mpa": "MPa MPA Mpa mpa N/mm2 MN/m2", "kpa": "kPa KPa kpa kN/m2", "pa": "Pa pa N/m2", "gpa": "GPa GPA kN/mm2", "bar": "bar Bar",
    "psi": "psi PSI Psi lbf/in2 lb/in2 lbs/in2", "ksi": "ksi KSI", "n_cm2": "N/cm2",
    "kgf_cm2": "kgf/cm2 Kgf/cm2 KGF/CM2 kg/cm2 kp/cm2",
    "kgf_mm2": "kgf/mm2 kg/mm2 kp/mm2", "n": "N", "mn": "mN", "kn": "kN", "gf": "gf g", "kgf": "kgf kp kg", "lbf": "lbf lb lbs",
    "mm": "mm", "um": "um \N{MICRO SIGN}m \N{GREEK SMALL LETTER MU}m", "cm": "cm", "m": "m", "in": 'in inch inches "',
    "s": "s sec", "ms": "ms", "min": "min", "h": "h", "hz": "Hz hz", "khz": "kHz", "rad_s": "rad/s",
    "percent": "% percent", "1": "1 - \N{EN DASH} mm/mm m/m in/in"}
_UNITS = {text: unit for unit, texts in _WRITTEN.items() for text in texts.split()} | {"": "1"}
_IN_HEADER = re.compile(r"(?:[\[(]|\s/|,\s|\sin\s)\s*([^\[\]()]+?)\s*[\])]?$")


@dataclass(frozen=True)
class Specimen:
    """What makes strain of an extension and stress of a force: area_mm2, the undeformed section; length_mm, the undeformed length.

    In simple shear they are the sheared area and the thickness. None where the table needs them not.
    """

    area_mm2: float | None = None
    length_mm: float | None = None

    def __post_init__(self):
        for name, value in (("area_mm2", self.area_mm2), ("length_mm", self.length_mm)):
            if value is not None and not 0 < value < math.inf:
                raise InputError(f"{name} is {value:g}; give a positive number.")


def _with_units(base: str, convert: Callable[..., Any]) -> dict[str, Callable[..., Any]]:
    """{name with unit: function of the values} where convert(values times the unit's factor, *others) is that of the base."""
    return {f"{base}_{unit}": lambda value, *others, factor=factor: convert(factor * value, *others)
            for unit, factor in BASES[base].items()}


# Name of a column -> its value as stretch (shear strain, volume ratio), given the specimen.
STRETCHES: dict[str, Callable[..., Any]] = {
    "stretch": lambda value, specimen: value,
    "engineering_strain": lambda value, specimen: 1 + value,
    "engineering_strain_percent": lambda value, specimen: 1 + value / 100,
    "true_strain": lambda value, specimen: math.exp(value),
} | _with_units("extension", lambda value, specimen: 1 + value / specimen.length_mm)
SHEARS: dict[str, Callable[..., Any]] = {
    "shear_strain": lambda value, specimen: value,
    "shear_strain_percent": lambda value, specimen: value / 100,
    "engineering_strain": lambda value, specimen: value,
    "engineering_strain_percent": lambda value, specimen: value / 100,
} | _with_units("extension", lambda value, specimen: value / specimen.length_mm)
VOLUMES: dict[str, Callable[..., Any]] = {
    "volume_ratio": lambda value, specimen: value,
    "volumetric_strain": lambda value, specimen: 1 + value,
    "volumetric_strain_percent": lambda value, specimen: 1 + value / 100}
# Name of a column -> its values in MPa as nominal stress (pressure), given the stretches and the specimen.
_NOMINAL = _with_units("nominal_stress", lambda value, x, specimen: value)
_FORCES = _with_units("force", lambda value, x, specimen: value / specimen.area_mm2)
# Constant volume: the loaded section of a bar, a strip or a sheet has shrunk by the stretch, in each of the three tests.
STRESSES = _NOMINAL | _FORCES | _with_units("true_stress", lambda value, x, specimen: value / x)
# In simple shear the true stress is the nominal one.
SHEAR_STRESSES = (_with_units("shear_stress", lambda value, x, specimen: value) | _NOMINAL | _FORCES
                  | _with_units("true_stress", lambda value, x, specimen: value))
PRESSURES = _with_units("pressure", lambda value, x, specimen: value)
# Over time: the stress after a step of strain, in any measure that is proportional to the modulus; and the moduli in frequency.
TIMES = _with_units("time", lambda value: value)
_OVER_TIME = ("relaxation_modulus", "shear_modulus", "young_modulus", "nominal_stress", "true_stress", "shear_stress", "force")
RELAXING = {name: convert for base in _OVER_TIME for name, convert in _with_units(base, lambda value: value).items()} | {
    "normalised_modulus": lambda value: value}
FREQUENCIES = _with_units("frequency", lambda value: value)
STORAGE, LOSS = (_with_units(f"{kind}_modulus", lambda value: value) | _with_units(f"shear_{kind}_modulus", lambda value: value)
                 for kind in ("storage", "loss"))
# Beginning of a name of these -> the shear modulus of an incompressible material over the modulus; of the others it is not known.
SHEAR_OVER = {"shear_modulus": 1.0, "young_modulus": 1 / 3, "shear_storage_modulus": 1.0}
_OF_MODE = {VOLUMETRIC: ((VOLUMES, "volume"), (PRESSURES, "pressure")),
            SIMPLE_SHEAR: ((SHEARS, "shear strain"), (SHEAR_STRESSES, "stress"))}
_OF_SHAPE = ((STRETCHES, "stretch"), (STRESSES, "stress"))
NAMES = (*STRETCHES, *STRESSES, *SHEARS, *SHEAR_STRESSES, *VOLUMES, *PRESSURES, *TIMES, *RELAXING, *FREQUENCIES, *STORAGE, *LOSS)


@dataclass(frozen=True)
class Column:
    """A column: its position, the name that declares its quantity and unit, and the function of its numbers."""

    name: str
    at: int
    convert: Callable[..., Any]


@dataclass(frozen=True)
class _Declared:
    """A column: its position, and the name, with or without a unit, that declares its quantity."""

    name: str
    at: int


def find_columns(table: Table, *, mode: str, columns: Mapping[str, str]) -> tuple[list[Column], int]:
    """The two columns of a curve's table, stretch and stress, or volume and pressure; and the number of rows of units below.

    columns: {name: that in the file}
    """
    return find_quantities(table, _OF_MODE.get(mode, _OF_SHAPE), columns)


def find_quantities(table: Table, wanted: Sequence[tuple[Mapping[str, Callable[..., Any]], str]],
                    columns: Mapping[str, str]) -> tuple[list[Column], int]:
    """A column for each of the wanted ({accepted name: function}, quantity in words), and how many rows of units follow."""
    unknown = sorted(set(columns) - {*NAMES, *BASES})
    if unknown:
        raise InputError(f"{table.path}: `columns` maps {unknown[0]!r}, which is no quantity with a unit; map one of "
                         f"{', '.join(_examples(NAMES))}.")
    found = [_find(table, list(known), columns, quantity) for known, quantity in wanted]
    found = [_as_in_header(table, column) for column in found]
    units = _units_below(table, found)
    if units is not None:
        row, texts = units
        found = [_with_unit(table, row, column, text) for column, text in zip(found, texts, strict=True)]
    for column in found:
        if column.name in BASES:
            raise InputError(f"{table.path}: {table.header[column.at]!r} states no unit; name the column "
                             f"{_listed([f'{column.name}_{unit}' for unit in BASES[column.name]])}, or write a row of units below "
                             "the header.")
    named = [Column(column.name, column.at, known[column.name]) for column, (known, _) in zip(found, wanted, strict=True)]
    return named, int(units is not None)


def refuse_lacking(path: Any, names: Sequence[str], specimen: Specimen) -> None:
    """Refuse a force without a section, an extension without a length, and either where no column needs it."""
    for base, name, what in (("force", "area_mm2", "the undeformed section in mm2"),
                             ("extension", "length_mm", "the undeformed length in mm")):
        value, needed = getattr(specimen, name), [column for column in names if column.startswith(f"{base}_")]
        option = f"--{name.replace('_', '-')}"
        if needed and value is None:
            raise InputError(f"{path}: the column {needed[0]} needs {what}; state it ({option}, `{name}`).")
        if value is not None and not needed:
            raise InputError(f"{path}: {name} {value:g} has no effect, as no column is called {base}_{next(iter(BASES[base]))} or "
                             f"the like; leave {option} out, or name the column so.")


def _find(table, known, columns, quantity):
    """The one column that holds the quantity."""
    accepted = [*known, *(base for base in BASES if any(name.startswith(f"{base}_") for name in known))]
    found = [_Declared(name, at) for name in accepted for at in table.positions(columns.get(name, name))]
    if len(found) == 1:
        return found[0]
    unmet = next((f"; none is called {columns[name]!r}, to which {name} is mapped" for name in accepted if name in columns
                  and not table.positions(columns[name])), "")
    if len(table.header) == 1:
        raise InputError(f"{table.path}: the header names one column, {table.header[0]!r}; put commas, semicolons or tabs between "
                         "the columns, or pass over the lines above the header (--skip-rows N).")
    problem = "several columns hold" if found else "no column holds"
    hidden = f" ({'; '.join(table.remarks)})" if table.remarks else ""
    raise InputError(f"{table.path}: {problem} the {quantity} among {', '.join(table.header)}{unmet}{hidden}; name one of them "
                     f"{_listed(_examples(known))}, map it under `columns`, or pass over the lines above the header "
                     "(--skip-rows N).")


def _examples(names):
    """The names, each quantity with three of its units at most."""
    units = {f"{base}_{unit}" for base in BASES for unit in list(BASES[base])[3:]}
    return [name for name in dict.fromkeys(names) if name not in units]


def _listed(names):
    return f"{', '.join(names[:-1])} or {names[-1]}" if len(names) > 1 else names[0]


def _known_unit(text):
    """The name of a unit as it is written, in brackets or without; None if it is no unit."""
    bare = re.sub(r"^[\[(]\s*|\s*[\])]$", "", text.strip())
    return _UNITS.get(bare.replace("^", "").replace("\N{SUPERSCRIPT TWO}", "2").replace("\N{MIDDLE DOT}", ""))


def _as_in_header(table, column):
    """The column with the unit at the end of its header, if this is such as `Stress [kPa]`, `Force (N)` or `Strain / %`."""
    found = _IN_HEADER.search(table.header[column.at])
    return column if found is None or _known_unit(found[1]) in (None, "1") else _with_unit(table, 1, column, found[1])


def _units_below(table, found):
    """(row number, texts) of the first row, if none of the columns has a number there; else None."""
    if not table.rows:
        return None
    row, cells = table.rows[0]
    texts = [cells[column.at] for column in found]
    return (row, texts) if any(texts) and not any(_like_a_number(cell) for cell in texts) else None


def _like_a_number(cell: Cell) -> bool:
    """Whether a cell is a number, even one that cannot be read, such as `1,5`, nan or a formula."""
    return isinstance(cell, float) or re.match(r"=|[+-]?[.,]?\d|[+-]?(nan|inf)", ascii_minus(cell), flags=re.IGNORECASE) is not None


def _with_unit(table, row, column, text):
    """The column with the unit that a text states, which must be that of its name if this has one."""
    unit, header = _known_unit(text), table.header[column.at]
    base = next((base for base in BASES if column.name.startswith(f"{base}_") or column.name == base), None)
    if base is not None:
        stated = column.name.removeprefix(base).removeprefix("_")
        if unit in BASES[base] and stated in ("", unit):
            return _Declared(f"{base}_{unit}", column.at)
        if stated and text.strip() == "":
            return column
        wanted = f"{stated}, as its name says" if stated else _listed([_WRITTEN[one].split()[0] for one in BASES[base]])
    elif column.name in _PERCENT and unit == "percent":
        return _Declared(_PERCENT[column.name], column.at)
    else:
        percent = column.name.endswith("_percent")
        if text.strip() == "" or unit == ("percent" if percent else "1"):
            return column
        wanted = "%, as its name says" if percent else "-"
    if row == 1:
        raise InputError(f"{table.path}: the header {header!r} states the unit {text!r}, and the one that belongs there is "
                         f"{wanted}; map another name than {column.name} to it.")
    raise InputError(f"{table.path}, row {row}: {text!r} below {header!r} is neither a number nor the unit that belongs there, "
                     f"{wanted}; correct the row, or convert the column (lengths and forces are no strain and no stress, but may "
                     "be named extension and force).")
