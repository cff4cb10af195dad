"""The finished blocks of a data set that is being written: a folder beside it, with one file for each block of presses.

A block's file has its name only when it is whole and on the disk, so that a run which is killed, or stopped by a full disk, loses
no finished block. One process at a time writes into the folder (`softtact.outputs.held`).
"""

import io
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from softtact.errors import InputError
from softtact.files import atomic_path, read_arrays
from softtact.progress import announce

BLOCK = 32     # presses written together


class PressBlocks:
    """The blocks in `folder` of a data set of `presses`; `settings`: hash of all that determines its numbers.

    Each has arrays by name whose first dimension is the press.
    """

    def __init__(self, folder: Path, settings: str, presses: int) -> None:
        self._folder, self._settings = folder, settings
        self._all = [np.arange(first, min(first + BLOCK, presses)) for first in range(0, presses, BLOCK)]

    def missing(self) -> list[np.ndarray]:
        """Numbers (n,) of the presses of each block that is not there. A damaged one is named on stderr and counts as missing.

        Raises InputError if a block is one of other settings.
        """
        return [numbers for numbers in self._all if not (self._path(numbers).exists() and self._is_good(numbers))]

    def write(self, numbers: np.ndarray, arrays: Mapping[str, Any]) -> None:
        """Write the block of the presses `numbers` and wait until it is on the disk. Raises OutputError if there is no room."""
        content = io.BytesIO()
        np.savez(content, settings=np.array(self._settings), **arrays)
        with atomic_path(self._path(numbers), durable=True) as temporary:
            temporary.write_bytes(content.getbuffer())

    def __iter__(self) -> Iterator[tuple[np.ndarray, dict[str, np.ndarray]]]:
        """(numbers of its presses, its arrays by name) of each block. Raises InputError for one that is damaged or missing."""
        return ((numbers, self._read(numbers)) for numbers in self._all)

    def _path(self, numbers):
        return self._folder / f"{numbers[0]:08d}.npz"

    def _read(self, numbers):
        with read_arrays(self._path(numbers)) as kept:
            arrays = dict(kept)
            found = str(arrays.pop("settings"))
        if found != self._settings:
            raise _OtherSettings(f"{self._folder}: there is an unfinished data set of other objects or settings; finish it "
                                 "with those, move it away, or give another name.")
        return arrays

    def _is_good(self, numbers):
        try:
            self._read(numbers)
        except _OtherSettings:
            raise
        except InputError:
            announce(f"{self._path(numbers)}: this block is damaged; presses {numbers[0]} to {numbers[-1]} are pressed again.")
            return False
        return True


class _OtherSettings(InputError):
    pass
