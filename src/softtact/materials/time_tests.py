"""Tests over time: relaxation after a step of strain, and storage and loss modulus over frequency (DMA).

Both are read like other test curves (`readers.py`), and only their form matters for a Prony series: each may be in any measure
that is proportional to the shear modulus. Of an incompressible material these are Young's modulus and the stress at a fixed strain.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from softtact.errors import InputError
from softtact.materials.checks import refuse_first
from softtact.materials.columns import FREQUENCIES, LOSS, RELAXING, SHEAR_OVER, STORAGE, TIMES, find_quantities
from softtact.materials.prony import PronySeries
from softtact.tables import number, read_table

RELAXATION, FREQUENCY = TIME_MODES = ("relaxation", "frequency")
_RISE = 0.02        # share by which the stress may exceed its first value: of noise, not of a ramp


@dataclass(frozen=True)
class TimeTest:
    """One test over time, made for a fit.

    mode: "relaxation" or "frequency";  at: (n,) times in s, or frequencies in Hz, rising
    values: (k, n) the modulus over time, or storage and loss modulus; in one unit, all positive
    shear_over: the shear modulus in MPa over these values, None where their measure does not tell
    """

    mode: str
    at: np.ndarray
    values: np.ndarray
    source: str = ""
    shear_over: float | None = None
    remarks: tuple = ()

    @property
    def times_s(self) -> tuple[float, float]:
        """Shortest and longest time that the test resolves, s: 1/(2 pi f) in frequency."""
        times = self.at[self.at > 0] if self.mode == RELAXATION else 1 / (2 * np.pi * self.at)
        return float(times.min()), float(times.max())

    def of(self, series: PronySeries) -> np.ndarray:
        """What the test gives (k, n) of a series, over the instantaneous modulus."""
        if self.mode == RELAXATION:
            return series.relaxation(self.at)[None]
        return np.stack(series.storage_loss(2 * np.pi * self.at))

    def terms(self, tau_s: np.ndarray) -> np.ndarray:
        """What it gives (k, n, 1 + m) of a unit of the relaxed modulus, and of the moduli that relax with the times tau_s (m,)."""
        if self.mode == RELAXATION:
            return np.concatenate([np.ones((1, len(self.at), 1)), np.exp(-self.at[:, None] / tau_s)[None]], axis=2)
        phase = 2 * np.pi * self.at[:, None] * tau_s
        constant = np.stack([np.ones(len(self.at)), np.zeros(len(self.at))])[..., None]
        return np.concatenate([constant, np.stack([phase**2, phase]) / (1 + phase**2)], axis=2)


def read_time_tests(paths: Sequence[tuple[str | Path, str]], *, columns: Mapping[str, str] | None = None,
                    **reading: Any) -> list[TimeTest]:
    """The tests of [(file, mode)]; reading: decimal, skip_rows and sheet, as of a `Reading`."""
    return [_read(Path(path), mode, columns or {}, reading) for path, mode in paths]


def _read(path, mode, columns, reading):
    table = read_table(path, what=f"test of {mode}", **reading)
    wanted = ([(TIMES, "time"), (RELAXING, "modulus or stress")] if mode == RELAXATION
              else [(FREQUENCIES, "frequency"), (STORAGE, "storage modulus"), (LOSS, "loss modulus")])
    found, units = find_quantities(table, wanted, columns)
    rows = np.array([row for row, _ in table.rows[units:]])
    values = np.array([[column.convert(number(path, row, cells[column.at], decimal=table.decimal)) for column in found]
                       for row, cells in table.rows[units:]]).reshape(-1, len(found)).T
    if len(rows) < 4:
        raise InputError(f"{path}: {len(rows)} row(s) are too few for a test of {mode}; give at least four.")
    _refuse_mixed(path, [column.name for column in found[1:]])
    remarks = tuple(f"{path}: {remark}" for remark in table.remarks)
    shear_over = next((factor for base, factor in SHEAR_OVER.items() if found[1].name.startswith(base)), None)
    return _checked(path, rows, TimeTest(mode, values[0], values[1:], Path(path).name, shear_over, remarks))


def _refuse_mixed(path, names):
    """Refuse the storage modulus of shear beside the loss modulus of tension, or the other way round."""
    if len({name.startswith("shear_") for name in names}) > 1:
        raise InputError(f"{path}: {names[0]} and {names[1]} are of two tests, one of shear and one of tension; give both moduli "
                         "of one.")


def _checked(path, rows, test):
    """The test in rising order of positive values. Raises InputError for data that no such test gives."""
    at, values = test.at, test.values
    if test.mode == RELAXATION:
        values = -values if (values < 0).all() else values      # of a compressed specimen
        refuse_first(path, rows, at, at < 0, "the time {value} s is negative; let it count from the step of strain.")
        refuse_first(path, rows[1:], at[1:], np.diff(at) <= 0, "the time {value} s does not rise; give one relaxation.")
    else:
        order = np.argsort(at, kind="stable")
        rows, at, values = rows[order], at[order], values[:, order]
        refuse_first(path, rows, at, at <= 0, "the frequency {value} Hz is not positive; correct it.")
        refuse_first(path, rows[1:], at[1:], np.diff(at) == 0, "the frequency {value} Hz comes twice; give one sweep.")
    for column in values:
        refuse_first(path, rows, column, column <= 0, "the value {value} is not positive; correct it or leave the row out.")
    peak = int(np.argmax(values[0]))
    if test.mode == RELAXATION and values[0, peak] > (1 + _RISE) * values[0, 0]:
        raise InputError(f"{path}, row {rows[peak]}: the stress rises up to here, as in the ramp before the strain is held; leave "
                         "the rows before it out, and let the time count from this row.")
    return replace(test, at=at, values=values)
