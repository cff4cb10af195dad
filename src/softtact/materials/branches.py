"""The order of a curve's rows: one loading branch, as the file has it or sorted; loading and unloading are not mixed."""

from pathlib import Path

import numpy as np

from softtact.errors import InputError
from softtact.materials.checks import refuse_first
from softtact.materials.curves import VOLUMETRIC

_JITTER = 0.05      # share of the range by which a branch may turn back, as noise of the strain does
_ROWS = 3           # of a branch, at least and on average; rows in disorder rise or fall over one or two
_BACK = 2           # rows of the next branch within the range of the one before


def order(path: str | Path, rows: np.ndarray, x: np.ndarray, y: np.ndarray, *, mode: str,
          sort: bool) -> tuple[np.ndarray, np.ndarray]:
    """x and y in rising or falling order: as they are, or sorted.

    A file with loading and unloading is refused either way, for a law has one stress at a stretch, and a sorted file would be
    fitted in the middle between both.
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
        f"the {name} turns back to {{value}}; keep one loading branch, or say `sort: true` if its rows are in disorder.",
    )  # fmt: skip
    return x, y


def _unloading(x):
    """Index of the row where the first branch turns back over the range that it came through; None where none does.

    Rows in disorder have no branches: they turn every second row.
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
    """Indices of the ends and of the extremes between them, of which each is further than jitter from the last."""
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
