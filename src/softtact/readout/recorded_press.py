"""Readings of a real sensor at given forces, from a recording of one press: during loading, and during unloading where recorded.

Isotonic regression (least squares, `scipy.optimize`) makes the force rise: readings during which the force stands, or falls by the
load cell's noise, share their mean, so that a hold is averaged. Between these levels readings are linear in the force. Creep and
hysteresis of the press are left in them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import isotonic_regression

from softtact.errors import InputError
from softtact.readout.recording import clipped, row_of, taxel_in_words

if TYPE_CHECKING:
    import xarray

SOURCE = "recording of a TSF-85"
_SLACK = 0.02     # of the largest force: by which the force may turn back (load cell's noise) or end short of a hold; assumed


@dataclass(frozen=True)
class RecordedPress:
    """Readings of one press at given forces."""

    loading: np.ndarray
    """(force, row, column) counts over the baseline during loading."""
    unloading: np.ndarray | None
    """The same during unloading; None where the recording ends above the least of the forces."""


def readings_at(recording: "xarray.Dataset", forces_n: Sequence[float], *, finger: int = 0,
                largest_counts: float | None = None) -> RecordedPress:
    """The `RecordedPress` of a recording with `force_n` (`recording.with_force`) at rising forces in N.

    largest_counts: upper end of the readout's range
    Raises InputError where the force does not reach one of `forces_n`, turns back by more than 2 % of its largest value during
    loading or unloading, or where a taxel is clipped in the readings that are used. Dead taxels: `recording.dead`.
    """
    if finger not in range(recording.sizes["finger"]):
        raise InputError(f"{_name(recording)}: it has no finger {finger}; give one of 0 to {recording.sizes['finger'] - 1}.")
    force = recording.force_n.values[:, finger]
    top = len(force) - 1 - int(np.argmax(force[::-1]))       # the last of equal ones: a hold belongs to loading
    up, down = np.arange(top + 1), np.arange(top, len(force))[::-1]
    loading, used = _branch(recording, up, forces_n, finger, turned="falls back", branch="loading")
    unloading = None
    if force[down].min() <= forces_n[0]:
        unloading, more = _branch(recording, down, forces_n, finger, turned="rises again", branch="unloading")
        used = np.union1d(used, more)
    _refuse_clipped(recording, used, finger, largest_counts)
    return RecordedPress(loading, unloading)


def _name(recording):
    return recording.attrs["file"] or "the recording"


def _branch(recording, order, forces_n, finger, *, turned, branch):
    """Counts (force, row, column) at the forces over the readings `order`, whose force rises; and the readings used for them."""
    force = recording.force_n.values[order, finger]
    slack = _SLACK * force.max()
    _refuse_turning(recording, order, force, slack, turned=turned, branch=branch)
    levels, first, count = np.unique(isotonic_regression(force).x, return_index=True, return_counts=True)
    if not (levels[0] <= forces_n[0] and levels[-1] >= forces_n[-1] - slack):
        missed = forces_n[0] if levels[0] > forces_n[0] else forces_n[-1]
        raise InputError(f"{_name(recording)}: its force goes from {levels[0]:.3g} to {levels[-1]:.3g} N and does not reach "
                         f"{missed:g} N; record the press from touch to {forces_n[-1]:g} N, or change the forces that are read.")
    counts = recording.counts.values[order, finger].astype(float)
    means = np.add.reduceat(counts, first, axis=0) / count[:, None, None]
    last = min(int(np.searchsorted(levels, forces_n[-1])), len(levels) - 1)
    return (np.apply_along_axis(lambda taxel: np.interp(forces_n, levels, taxel), 0, means),
            order[:first[last] + count[last]])


def _refuse_turning(recording, order, force, slack, *, turned, branch):
    """Refuse a force that turns back by more than the slack; the message names the row."""
    back = np.maximum.accumulate(force) - force > slack
    if back.any():
        at = int(np.argmax(back))
        raise InputError(f"{_name(recording)}, row {row_of(recording, order[at])}: the force {turned} during {branch} "
                         f"({force[:at].max():.3g} and {force[at]:.3g} N); give a recording of one press, loaded once and let go "
                         "once.")


def _refuse_clipped(recording, used, finger, largest_counts):
    at_end = clipped(recording, largest=largest_counts)[np.sort(used), finger]
    if at_end.any():
        reading, *taxel = np.argwhere(at_end)[0]
        raise InputError(f"{_name(recording)}, row {row_of(recording, np.sort(used)[reading])}: {taxel_in_words(finger, *taxel)} "
                         "reads the end of its range, so its true value may be larger; read at smaller forces.")
