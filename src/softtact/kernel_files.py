"""Numba's files of compiled kernels, with a checksum; what cannot be read or written is compiled again and stops no work.

Numba itself runs what a damaged file holds, and passes on the errors of a full disk.
"""

import contextlib
import hashlib
import os
from functools import cache
from typing import Any

from numba.core.caching import IndexDataCacheFile

from softtact.progress import announce

_MARK = b"softtact sha256"     # before the length and the digest of what was written
_LENGTH, _DIGEST = 8, 32       # bytes


class KernelFiles(IndexDataCacheFile):
    """The files of one kernel: an index, and one for each signature. Files without a checksum, of Numba alone, are taken."""

    def load(self, key: Any) -> Any:
        """The kernel of a signature; None where there is none, or its files are damaged."""
        try:
            return super().load(key)
        except Exception as error:     # of unpickling: of any kind
            reason = " ".join(str(error).split())[:120]
            _warn(f"{self._index_path}: compiled kernels cannot be read ({reason}); they are compiled again.")
            with contextlib.suppress(OSError):
                self.flush()
            return None

    def save(self, key: Any, data: Any) -> None:
        """Keep a kernel, where that is possible."""
        try:
            super().save(key, data)
        except OSError as error:
            _warn(f"{self._cache_path}: compiled kernels cannot be kept ({error.strerror or error}), so the next run compiles them "
                  "again; make room there, or set NUMBA_CACHE_DIR to another folder.")

    def _dump(self, obj):
        content = super()._dump(obj)
        return content + _MARK + len(content).to_bytes(_LENGTH, "big") + hashlib.sha256(content).digest()

    def _load_index(self):
        with contextlib.suppress(FileNotFoundError):
            _check(self._index_path)
        return super()._load_index()

    def _load_data(self, name):
        _check(os.path.join(self._cache_path, name))
        return super()._load_data(name)


def _check(path):
    """Raise ValueError for a file whose contents do not fit its checksum."""
    with open(path, "rb") as file:
        content = file.read()
    end = len(content) - len(_MARK) - _LENGTH - _DIGEST
    if end >= 0 and content[end:].startswith(_MARK):
        length = int.from_bytes(content[-_LENGTH - _DIGEST:-_DIGEST], "big")
        if hashlib.sha256(content[max(0, end - length):end]).digest() != content[-_DIGEST:]:
            raise ValueError(f"{os.path.basename(path)} does not fit its checksum")


@cache
def _warn(sentence):
    """Say a sentence on stderr, once."""
    announce(f"WARNING: {sentence}")
