"""Checksums in the binary files that softtact writes, checked before a file is read, so that damage is noticed.

The SHA-256 of a file's bytes is its last line. NumPy, PyTorch, HDF5 and VTK pass over what stands there; as a comment of XML it
may also end a VTU file. A program that changes such a file writes its end anew, without the line: the file is then one without a
checksum, and is read with a word on stderr. Text for people (CSV, JSON, YAML) has none, since it is meant to be edited.
"""

import contextlib
import hashlib
import os
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import BinaryIO

from softtact.errors import InputError
from softtact.progress import announce

SEALED = (".nc", ".h5", ".hdf5", ".npz", ".pt", ".vtu")     # endings of the files that have a checksum
_LINE = b"\n<!-- softtact sha256 %s -->\n"
_LENGTH = len(_LINE % bytes(64))
_SEAL = re.compile((_LINE % b"([0-9a-f]{64})").replace(b"\n", rb"\n"))
_PIECE = 1 << 20     # bytes that are read at once


def seal(path: str | Path) -> None:
    """Add to a finished file the checksum of its bytes."""
    with open(path, "r+b") as file:
        file.write(_LINE % _digest(file, file.seek(0, os.SEEK_END)).encode())


@contextlib.contextmanager
def checked(path: str | Path) -> Iterator[None]:
    """A block that reads a file, after `check`; then says on stderr, once for each file, where it has no checksum."""
    has_checksum = check(path)
    yield
    if not has_checksum:
        _say(str(path))


def check(path: str | Path) -> bool:
    """Refuse a file whose bytes do not fit its checksum; return whether it has one."""
    with open(path, "rb") as file:
        size = file.seek(0, os.SEEK_END) - _LENGTH
        file.seek(max(0, size))
        found = _SEAL.fullmatch(file.read())
        if found and found[1].decode() != _digest(file, size):
            raise InputError(f"{path}: its contents do not fit its checksum, so it was damaged after it was written; take a copy "
                             "of it, or make it again.")
    return found is not None


@cache
def _say(path):
    announce(f"{path}: it has no checksum, as files of other programs and older ones of softtact have none; damage to it would not "
             "be noticed.")


def _digest(file: BinaryIO, size: int) -> str:
    """SHA-256 of the first bytes of an open file, which is left behind them."""
    found = hashlib.sha256()
    file.seek(0)
    while size > 0:
        piece = file.read(min(size, _PIECE))
        found.update(piece)
        size -= len(piece) or size     # a file that shrinks meanwhile has another digest
    return found.hexdigest()
