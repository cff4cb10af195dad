"""What the order of a test's rows tells: branches, holds, and the break of a specimen.

A law has one stress at a stretch. So a curve is one loading branch, and each step of a relaxing test gives one point.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.materials.checks import normal_noise, refuse_first
from softtact.materials.curves import DEFORMATION
from softtact.materials.laws.base import principal_stretches, rest_of

HOLDS = INSTANTANEOUS, RELAXED = ("instantaneous", "relaxed")
_JITTER = 0.05      # share of the range by which a branch may turn back (noise of the strain)
_ROWS = 3           # of a branch, at least and on average; unordered rows rise or fall over one or two
_BACK = 2           # rows of the next branch within the range of the one before
_HELD_ROWS = 4      # of a hold, at least
_HELD = 0.02        # share of the range by which the stretch of a hold may vary, at most
# The stress of a hold falls from its first half to its second by these shares of itself and of the greatest, at least; and from its
# first row to its last by less than the third, as it would where the specimen breaks.
_FALLS = (0.01, 0.005, 0.8)


@dataclass(frozen=True)
class Hold:
    """Rows start to end - 1, at which the stretch is held while the stress relaxes by the share `fall`."""

    start: int
    end: int
    fall: float


def without_holds(path: str | Path, rows: np.ndarray, x: np.ndarray, y: np.ndarray, *, mode: str, holds: str | None) -> np.ndarray:
    """Indices of the rows that make one curve of a test with steps at which the stress relaxes; all rows of one without.

    holds: "instantaneous" takes the first loading up to the greatest stress of the first hold, and the greatest of each later one;
    "relaxed" takes the last row of each, and rows without load before them. Raises InputError for a test with holds where it is
    None, and the reverse.
    """
    found = find_holds(x, y)
    if not found and holds is not None:
        raise InputError(f"{path}: the stress relaxes at no {DEFORMATION.get(mode, 'stretch')} that is held, so `holds` has no "
                         "effect; leave it out (--holds).")
    if not found:
        return np.arange(len(x))
    if holds is None:
        low, high = min(hold.fall for hold in found), max(hold.fall for hold in found)
        raise InputError(
            f"{path}, rows {rows[found[0].start]} to {rows[found[-1].end - 1]}: the stress relaxes in {len(found)} hold"
            f"{'s' * (len(found) > 1)}, by {f'{low:.0%} to ' * (high - low > 0.01)}{high:.0%}, so the curve is neither "
            "the instantaneous nor the relaxed one; state which to take (--holds instantaneous or --holds relaxed).")
    if holds == RELAXED:
        unloaded = np.flatnonzero(np.abs(x[:found[0].start] - rest_of(mode)) <= 0.5 * _HELD * np.ptp(x))
        return np.concatenate([unloaded[:1], [hold.end - 1 for hold in found]])
    peaks = [hold.start + int(np.argmax(np.abs(y[hold.start:hold.end]))) for hold in found]
    return np.concatenate([np.arange(peaks[0]), peaks])


def find_holds(x: np.ndarray, y: np.ndarray) -> list[Hold]:
    """The holds of a test: stretch x (n,) and stress y (n,) in the order of the rows.

    Rows are of one hold whose stretches do not differ but by noise: rows that are spread over the range progress farther.
    """
    extent, stress = np.ptp(x), np.abs(y)
    noise = normal_noise(stress, np.maximum(stress, 0.1 * stress.max()))
    spread = min(_HELD * extent, max(extent / (len(x) - 1), 4 * np.median(np.abs(np.diff(x))))) if len(x) > 1 else 0.0
    found, start = [], 0
    while start < len(x):
        end, total = start + 1, x[start]
        while end < len(x) and abs(x[end] - total / (end - start)) < spread * (1 - 1e-9):
            end, total = end + 1, total + x[end]
        if end - start < _HELD_ROWS or _progress(x[start:end]) >= extent / (len(x) - 1):
            start += 1
            continue
        last = end      # without first rows of the next ramp
        while last - start > _HELD_ROWS and stress[last - 1] > (1 + _FALLS[0] + 4 * noise) * stress[last - 2]:
            last -= 1
        if (fall := _relaxation(stress[start:last], least=_FALLS[1] * stress.max(), noise=noise * stress[start:last].max())) > 0:
            found.append(Hold(start, last, fall))
        start = end
    return found


def _progress(values):
    """Difference of the means of a first and a second half."""
    half = len(values) // 2
    return abs(values[:half].mean() - values[-half:].mean())


def _relaxation(stress: np.ndarray, *, least: float, noise: float) -> float:
    """The share by which the stress (n,) of one hold falls; 0 where it does not, or not by `least` MPa, or as at a break.

    A fall from each row to the next is certain with less noise (MPa) than one of the means of a first and a second half.
    """
    half = len(stress) // 2
    first, last = stress[:half].mean(), stress[-half:].mean()
    least = max(_FALLS[0] * first, least, (1 if (np.diff(stress) <= 0).all() else 4) * noise)
    fall = 1 - np.median(stress[-max(half // 2, 1):]) / stress.max() if first - last > least else 0.0
    return float(fall) if fall < _FALLS[2] else 0.0


def refuse_cycles(path: str | Path, rows: np.ndarray, x: np.ndarray, *, mode: str) -> None:
    """Refuse rows that turn back over the range before: a law has one stress at a stretch."""
    turn = _unloading(x)
    if turn is not None:
        raise InputError(
            f"{path}, row {rows[turn]}: the {DEFORMATION.get(mode, 'stretch')} turns back at {x[turn]:.6g} over the range before, "
            "so loading and unloading (or several cycles) follow each other; keep the rows of one branch, or state which to take "
            "(--cycles first, steady or mullins).")


def order(path: str | Path, rows: np.ndarray, x: np.ndarray, y: np.ndarray, *, mode: str,
          sort: bool) -> tuple[np.ndarray, np.ndarray]:
    """x and y in rising or falling order: as they are, or sorted.

    A file with loading and unloading is refused in both cases: a law has one stress at a stretch, and the fit of a sorted file
    would lie between both branches.
    """
    name = DEFORMATION.get(mode, "stretch")
    if x.min() == x.max():
        raise InputError(f"{path}: every row has the {name} {x[0]:.6g}; give a curve over a range.")
    refuse_cycles(path, rows, x, mode=mode)
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


def first_loading(x: np.ndarray, *, mode: str) -> np.ndarray:
    """Booleans (n,): whether a row, in the order of time, is of first loading: I1 - 3 exceeds that of all rows before."""
    excess = loading(x, mode=mode)
    return np.concatenate([[True], excess[1:] > np.maximum.accumulate(excess)[:-1]])


def loading(x: np.ndarray, *, mode: str) -> np.ndarray:
    """I1 - 3 (n,) of the incompressible material: neo-Hooke's energy but for a factor, which orders the rows of a test of shape."""
    return (principal_stretches(mode, x) ** 2).sum(axis=1) - 3


def steady_loading(x: np.ndarray, *, mode: str) -> np.ndarray | None:
    """Indices of the rows of the last loading branch; None where there is no unloading before it."""
    excess = loading(x, mode=mode)
    turns = _turns(excess)
    branches = [(start, end) for start, end in zip(turns, turns[1:], strict=False) if excess[end] > excess[start]]
    if len(branches) < 2:
        return None
    start, end = branches[-1]
    return np.arange(start, end + 1)
