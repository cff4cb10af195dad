"""What a check of a recording finds, and words for its place."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from softtact.errors import InputError
from softtact.readout.recording import COLUMNS, ROWS, name_of, row_of, taxel_in_words

if TYPE_CHECKING:
    import xarray

CABLE = "check the cable"      # remedy of readings that get lost or changed on their way


@dataclass(frozen=True)
class Finding:
    """A fault of a recording.

    check: its name in the table of the documentation;  sentence: file, place, fault and remedy
    fingers: those whose readings it spoils;  safe: whether the rest can be used
    left_out: readings (time, finger, row, column) that cannot be used, or None
    zero_n: reading of the load cell at no force, to be taken off
    """

    check: str
    sentence: str
    fingers: tuple[int, ...]
    safe: bool = True
    left_out: np.ndarray | None = None
    zero_n: float = 0.0


def left_out(recording: "xarray.Dataset", found: Sequence[Finding]) -> np.ndarray:
    """Readings (time, finger, row, column) that some finding leaves out."""
    spoiled = np.zeros(recording.counts.shape, dtype=bool)
    for one in found:
        if one.left_out is not None:
            spoiled |= one.left_out
    return spoiled


def refuse_unsafe(found: Sequence[Finding]) -> None:
    """Raises InputError with the first finding that makes a calibration wrong."""
    for one in found:
        if not one.safe:
            raise InputError(one.sentence)


def zeroed(recording: "xarray.Dataset", found: Sequence[Finding]) -> "xarray.Dataset":
    """The recording with the forces of each finger over the load cell's reading at rest."""
    zeros = [sum(one.zero_n for one in found if finger in one.fingers) for finger in range(recording.sizes["finger"])]
    return recording.assign(force_n=recording.force_n - np.array(zeros)) if any(zeros) else recording


def taxels_of(recording: "xarray.Dataset", finger: int) -> np.ndarray:
    """Counts (time, taxel) of a finger."""
    return recording.counts.values[:, finger].reshape(len(recording.time), -1).astype(float)


def readings(recording: "xarray.Dataset", finger: int, rows: np.ndarray | slice,
             taxels: np.ndarray | slice | int = slice(None)) -> np.ndarray:
    """Mask (time, finger, row, column) of the rows of taxels of a finger."""
    mask = np.zeros((*recording.counts.shape[:2], ROWS * COLUMNS), dtype=bool)
    mask[rows, finger, taxels] = True
    return mask.reshape(recording.counts.shape)


def taxel(finger: int, number: int) -> str:
    """A taxel by its number in the finger, in words."""
    return taxel_in_words(finger, *divmod(int(number), COLUMNS))


def where(recording: "xarray.Dataset", first: int, last: int | None = None) -> str:
    """The file and its rows of the readings from first to last, in words."""
    begin = row_of(recording, int(first))
    rows = f"row {begin}" if last is None or last == first else f"rows {begin} to {row_of(recording, int(last))}"
    return f"{name_of(recording)}, {rows}"


def and_more(count: int, what: str) -> str:
    """Words for the others of `count` things."""
    return f", and {count - 1} more {what}{'s' * (count > 2)}" if count > 1 else ""
