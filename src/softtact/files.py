"""Read and write files. A file is written completely or not at all, with labels and provenance inside."""

import contextlib
import errno
import hashlib
import io
import json
import os
import tempfile
import zipfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

import softtact
from softtact.errors import InputError, OutputError

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

PROVENANCE = ("softtact_version", "config_digest", "seed")     # attributes of every data set that is written


@contextlib.contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`; rename it to `path` if the block succeeds, delete it otherwise.

    A full disk, or a folder that cannot be written to, becomes an `OutputError`.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.stem}-", suffix=path.suffix, dir=path.parent)
    except OSError as error:
        raise _not_written(path, error) from None
    os.close(handle)
    temporary = Path(name)
    try:
        try:
            yield temporary
        except OSError as error:
            if error.errno in _NO_ROOM:
                raise _not_written(path, error) from None
            raise
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)  # mkstemp makes private files; results are to be shared
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def refuse_overwriting(inputs: Iterable[Path | str | None], outputs: Mapping[str, Path | None]) -> None:
    """Refuse an output {option: file or None} that is the same file as an input or another output, also through links."""
    read = [Path(path) for path in inputs if path]
    written: dict[str, Path] = {}
    for option, path in ((option, path) for option, path in outputs.items() if path):
        for other in read:
            if _same_file(path, other):
                raise InputError(f"{option} {path}: it is the input {other}, which would be lost; choose another name.")
        for name, other in written.items():
            if _same_file(path, other):
                raise InputError(f"{option} {path}: {name} writes the same file; choose another name for one of them.")
        written[option] = path


def _same_file(one, other):
    """Whether two paths lead to the same file, existing or not."""
    if one.exists() and other.exists():
        return one.samefile(other)
    return one.resolve() == other.resolve()


_NO_ROOM = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EROFS)


def _not_written(path, error):
    return OutputError(f"{path}: cannot be written ({error.strerror or error}); make room on the disk, or its folder writable, "
                       "and run again.")


class _OnceLoader(yaml.SafeLoader):
    """PyYAML's safe loader, made to refuse a duplicate key in a mapping; PyYAML silently keeps the last."""

    def compose_mapping_node(self, anchor: Any) -> yaml.MappingNode:
        """The node of a mapping before merges (`<<`), since a mapping may override a merged key."""
        node = super().compose_mapping_node(anchor)
        lines: dict[Any, int] = {}
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode) or key.tag == "tag:yaml.org,2002:merge":
                continue
            name = self.construct_object(key)
            if name in lines:
                raise yaml.constructor.ConstructorError(
                    None, None, f"the key {key.value!r} stands in line {lines[name]} and again in line {key.start_mark.line + 1}; "
                    "keep one")
            lines[name] = key.start_mark.line + 1
        return node


def read_yaml(path: str | Path, *, missing: str) -> Any:
    """The content of a YAML file. `missing`: what to do if the file does not exist, for the error message.

    Raises InputError if there is no such file, if it is not valid YAML, or if a mapping has a key twice.
    """
    try:
        loader = _OnceLoader(Path(path).read_text(encoding="utf-8"))
        return loader.get_single_data()
    except FileNotFoundError:
        raise InputError(f"{path}: {missing}") from None
    except (UnicodeDecodeError, yaml.YAMLError, ValueError, RecursionError) as error:     # ValueError: 2001-99-99 is no date
        raise InputError(f"{path}: not valid YAML ({' '.join(str(error).split())}); correct it.") from None


def files_below(paths: str | Path | list[Path], *, suffix: str) -> list[Path]:
    """The files of a list, or of a folder and all below it, sorted."""
    return paths if isinstance(paths, list) else sorted(Path(paths).rglob(f"*{suffix}"))


def digest(obj: Any) -> str:
    """Short, stable digest (16 hex digits) of a JSON-like object."""
    text = json.dumps(obj, sort_keys=True, separators=(",", ":"), default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def write_json(path: str | Path, obj: Any) -> None:
    """Write `obj` as indented JSON with sorted keys."""
    with atomic_path(path) as temporary:
        temporary.write_text(json.dumps(obj, indent=2, sort_keys=True) + "\n", encoding="utf-8")


def parse_json(text: str) -> Any:
    """The object of a JSON text. Raises ValueError for invalid JSON and for a duplicate key, which Python would accept."""
    def once(pairs):
        names = [name for name, _ in pairs]
        twice = next((name for name in names if names.count(name) > 1), None) if len(set(names)) < len(names) else None
        if twice is not None:
            raise ValueError(f"the key {twice!r} stands twice in one object")
        return dict(pairs)

    return json.loads(text, object_pairs_hook=once)


def read_json(path: str | Path) -> Any:
    """Read a JSON file; an unreadable one raises `InputError` naming the file and the line."""
    try:
        return parse_json(Path(path).read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file.") from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not valid JSON ({error}); write the file again.") from None


def write_csv(path: str | Path, frame: "pd.DataFrame", *, float_format: str = "%.6g") -> None:
    """Write a pandas data frame as CSV without its index."""
    with atomic_path(path) as temporary:
        frame.to_csv(temporary, index=False, float_format=float_format, lineterminator="\n")


def write_dataset(path: str | Path, dataset: "xr.Dataset", *, seed: int | None, settings: Any) -> None:
    """Write an xarray dataset as NetCDF with version, settings digest and seed among its attributes.

    The same data set gives the same bytes: no time stamp or path is stored.
    """
    provenance = dict(zip(PROVENANCE, (softtact.__version__, digest(settings), -1 if seed is None else int(seed)), strict=True))
    content = io.BytesIO()    # HDF5 can crash the process if it writes to a full disk
    dataset.assign_attrs(provenance).to_netcdf(content, engine="h5netcdf")
    with atomic_path(path) as temporary:
        temporary.write_bytes(content.getbuffer())


def read_dataset(path: str | Path) -> "xr.Dataset":
    """Read a NetCDF file whole into memory."""
    import xarray

    try:
        return xarray.load_dataset(path, engine="h5netcdf")
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file.") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not a readable NetCDF file ({error}); delete it and make it again.") from None


@contextlib.contextmanager
def read_arrays(path: str | Path) -> Iterator[np.lib.npyio.NpzFile]:
    """The arrays of an .npz file, open while a block reads them; a damaged file raises `InputError`."""
    try:
        with np.load(path, allow_pickle=False) as data:
            yield data
    except FileNotFoundError:
        raise InputError(f"{path}: there is no such file.") from None
    except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: not a readable file of arrays ({error}); delete it and make it again.") from None
