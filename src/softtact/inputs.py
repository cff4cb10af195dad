"""Checks of a file before it is read: that it is a file which can be read, and not larger than the limit of its kind.

All limits are in `LIMITS`. The environment variable `SOFTTACT_LIMITS` raises them: `SOFTTACT_LIMITS=4` makes each four times as
large.
"""

import contextlib
import errno
import math
import os
import stat
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePath

from softtact.errors import InputError, SofttactError, UnreadableError

VARIABLE = "SOFTTACT_LIMITS"
_POINTER = b"version https://git-lfs.github.com/spec/"


@dataclass(frozen=True)
class Limit:
    """The largest input of a kind."""

    most: float
    unit: str
    of: str
    """What it limits, in the words of a message."""


LIMITS = {
    "yaml": Limit(0.5e6, "bytes", "a YAML file"),
    "values": Limit(200_000, "values", "a YAML file with its aliases and merges written out"),
    "json": Limit(20e6, "bytes", "a JSON file"),
    "table": Limit(100e6, "bytes", "a table or recording of text"),
    "archive": Limit(4e9, "bytes", "a table of the published archive"),
    "workbook": Limit(50e6, "bytes", "a workbook (unpacked)"),
    "cells": Limit(2e6, "cells", "a sheet, with its empty ones"),
    "mesh": Limit(300e6, "bytes", "a mesh file (unpacked)"),
    "facets": Limit(4e6, "facets", "a mesh"),
    "arrays": Limit(4e9, "bytes", "a file of arrays (unpacked)"),
    "picture": Limit(1e9, "bytes", "a picture file"),
    "pixels": Limit(100e6, "pixels", "a picture"),
    "bag": Limit(4e9, "bytes", "a file of a ROS 2 bag"),
    "movie": Limit(20e9, "bytes", "a movie, or images in one file"),
}


def limit(kind: str) -> float:
    """The limit of a kind, raised by the environment variable."""
    return LIMITS[kind].most * _factor()


def check_limit(path: str | Path, kind: str, count: float) -> None:
    """Refuse a file with more than the limit of bytes, values or facets, in a sentence that says how to raise it."""
    if count > limit(kind):
        one = LIMITS[kind]
        most = _shown(limit(kind), one.unit)
        raise InputError(f"{path}: it has {_shown(count, one.unit)}, and the limit of {one.of} is {most}; give a smaller one, or "
                         f"raise all limits: set {VARIABLE}={math.ceil(count / one.most)}.")


def check_input(path: str | Path, kind: str, *, missing: str = "there is no such file.") -> None:
    """Refuse what is no readable file, or is larger than the limit of its kind; nothing of it is read.

    missing: what a message says of a file that does not exist
    """
    try:
        found = os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(f"{path}: {missing}") from None
    except PermissionError as error:
        raise unreadable(path, error) from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: {no_name(error)}.") from None
    if stat.S_ISDIR(found.st_mode):
        raise InputError(f"{path}: it is a folder; give a file.")
    if not stat.S_ISREG(found.st_mode):
        raise InputError(f"{path}: it is a device or a pipe; save what it gives to a file, and give that.")
    if not os.access(path, os.R_OK):
        raise unreadable(path, PermissionError(errno.EACCES, os.strerror(errno.EACCES)))
    check_limit(path, kind, found.st_size)
    with open(path, "rb") as file:
        refuse_pointer(path, file.read(len(_POINTER)))


def refuse_pointer(path: str | Path, beginning: bytes) -> None:
    """Refuse what a clone without Git LFS leaves in place of a file, by the file's first bytes."""
    if beginning.startswith(_POINTER):
        raise InputError(f"{path}: it is a pointer of Git LFS, the file itself was not fetched; run git lfs pull.")


def is_hidden(path: PurePath) -> bool:
    """Whether a file is one that systems hide and put beside others, such as ._part.stl and .DS_Store of macOS."""
    return path.name.startswith(".")


def refuse_twice(paths: Iterable[str | Path]) -> None:
    """Refuse a file that is given twice, under whatever name: it would weigh twice."""
    seen: dict[str, str | Path] = {}
    for path in paths:
        place = os.path.realpath(path)
        if place in seen:
            also = "" if str(seen[place]) == str(path) else f", also as {seen[place]}"
            raise InputError(f"{path}: the file is given twice{also}, and would weigh twice; give it once.")
        seen[place] = path


def no_name(error: OSError | ValueError) -> str:
    """What is wrong with a name that the system refuses, and what to do."""
    if isinstance(error, UnicodeError):
        return "its name has characters that this system's names cannot hold; take plain letters, or set LC_ALL=C.UTF-8"
    if isinstance(error, ValueError):
        return "its name holds a zero byte; give another name"
    reasons = {errno.ELOOP: "its links lead in a circle; correct them",
               errno.ENOTDIR: "a part of its path is a file, not a folder; give another place",
               errno.ENAMETOOLONG: "its name is too long; give a shorter one"}
    return reasons.get(error.errno or 0, f"it cannot be reached ({error.strerror or error}); give another place")


def unreadable(path: str | Path, error: OSError) -> UnreadableError:
    """The refusal of a file that exists but that the system does not let us read."""
    return UnreadableError(f"{path}: cannot be read ({error.strerror or error}); change its permissions, or copy it elsewhere.")


@contextlib.contextmanager
def in_one_sentence(path: str | Path, what: str, remedy: str) -> Iterator[None]:
    """A block that reads a file: whatever its reader raises becomes an `InputError` of one sentence with the file's name.

    Readers of other packages raise errors of many kinds for a damaged file, some of which advise what is not meant for users. A
    lack of memory is none of the file's.
    """
    try:
        yield
    except (SofttactError, ModuleNotFoundError, MemoryError):
        raise
    except Exception as error:
        if isinstance(error, OSError) and error.errno in (errno.EACCES, errno.EPERM, errno.EIO):
            raise unreadable(path, error) from None
        reason = " ".join(str(error).split())[:120] or type(error).__name__
        raise InputError(f"{path}: {what} ({reason}); {remedy}.") from None


def _factor() -> float:
    text = os.environ.get(VARIABLE, "1")
    try:
        factor = float(text)
    except ValueError:
        factor = math.nan
    if not 0 < factor < math.inf:
        raise InputError(f"{VARIABLE}={text}: it is no number above 0; set the factor by which all limits are raised, such as 4.")
    return factor


def _shown(count, unit):
    if unit == "bytes":
        return f"{count / 1e9:.3g} GB" if count >= 1e9 else f"{count / 1e6:.3g} MB"
    return f"{count:,.0f} {unit}"
