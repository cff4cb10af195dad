"""ZIP archives that hold meshes: their files, hidden ones left out, not larger unpacked than the limit of a mesh."""

import io
import zipfile
from pathlib import Path, PurePosixPath

from softtact.errors import InputError
from softtact.inputs import check_limit, in_one_sentence, is_hidden

ZIP = b"PK\x03\x04"
"""First bytes of an archive."""
_AGAIN = "pack it again"


class Archive:
    """The files of an archive by their names; each is unpacked when it is read."""

    def __init__(self, path: Path, data: bytes) -> None:
        self.path = path
        with in_one_sentence(path, "not a readable ZIP archive", _AGAIN):
            self._zip = zipfile.ZipFile(io.BytesIO(data))
        found = [one for one in self._zip.infolist() if not one.is_dir()]
        self.names = [one.filename for one in found if not _is_hidden(one.filename)]
        check_limit(path, "mesh", sum(one.file_size for one in found if one.filename in self.names))

    def read(self, name: str) -> bytes:
        """The bytes of a file; InputError where it is missing, damaged or locked."""
        if name not in self.names:
            raise InputError(f"{self.path}: it holds no file {name}; export it again.")
        with in_one_sentence(self.path, f"its file {name} cannot be unpacked", _AGAIN):
            return self._zip.read(name)


def _is_hidden(name):
    return name.startswith("__MACOSX/") or is_hidden(PurePosixPath(name))
