"""Read and write files. A file is written completely or not at all, with labels and provenance inside."""

import contextlib
import hashlib
import io
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import yaml

import softtact
from softtact.checksums import SEALED, checked, seal
from softtact.errors import InputError
from softtact.inputs import check_input, check_limit, in_one_sentence
from softtact.outputs import NO_ROOM, not_written, target_of, temporary_file

if TYPE_CHECKING:
    import h5py
    import pandas as pd
    import xarray as xr

_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)     # libyaml's, a tenth of the time, where PyYAML was built with it
_DEEPEST = 100        # levels of a YAML file
_COUNTED = 10**12     # values of a YAML file; more are not told apart
_AGAIN = "take a copy of it, or make it again"
PROVENANCE = ("softtact_version", "config_digest", "seed")     # attributes of every data set that is written


@contextlib.contextmanager
def atomic_path(path: str | Path, *, durable: bool = False) -> Iterator[Path]:
    """Yield a temporary path beside `path`; rename it to `path` if the block succeeds, delete it otherwise.

    durable: wait until the file is on the disk, so that not even a power failure loses it

    A binary file gets its checksum. A link stays, and its target is written. A full disk, or a folder that cannot be written to,
    becomes an `OutputError`.
    """
    target, suffix = target_of(path), Path(path).suffix
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        temporary = temporary_file(target.parent, suffix)
    except OSError as error:
        raise not_written(path, error) from None
    try:
        try:
            yield temporary
            if suffix.lower() in SEALED:
                seal(temporary)
            if durable:
                wait_for_disk(temporary)
        except OSError as error:
            if error.errno in NO_ROOM:
                raise not_written(path, error) from None
            raise
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)  # a temporary file is private; results are to be shared
        os.replace(temporary, target)
        if durable:
            wait_for_disk(target.parent)
    finally:
        temporary.unlink(missing_ok=True)


def wait_for_disk(path: str | Path) -> None:
    """Wait until a file's content, or the names in a folder, are on the disk, which may be full only then."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


@contextlib.contextmanager
def new_hdf5(path: str | Path) -> Iterator["h5py.File"]:
    """A new HDF5 file. A write that fails raises an OSError at the end of the block.

    HDF5 itself is not told of it: it would try again when the file is closed and when the process ends, and then crash it.
    """
    import h5py

    with _Unfailing(path, "w+") as raw:
        try:
            with h5py.File(raw, "w") as file:
                yield file
        finally:
            if raw.error is not None:
                raise raw.error


class _Unfailing(io.FileIO):
    """A file that seems to take all that is written; `error` is that of the first write that failed."""

    error: OSError | None = None

    def write(self, data: Any) -> int:
        rest = memoryview(data).cast("B")
        size = len(rest)
        try:
            while len(rest) and self.error is None:
                rest = rest[super().write(rest):]
        except OSError as error:
            self.error = error
        return size

    def truncate(self, size: int | None = None) -> int:
        try:
            return super().truncate(size)
        except OSError as error:
            self.error = self.error or error
            return self.tell() if size is None else size


def read_yaml(path: str | Path, *, missing: str) -> Any:
    """The content of a YAML file. `missing`: what to do if the file does not exist, for the error message.

    Raises InputError if there is no such file, if it is not valid YAML, or if a mapping has a key twice.
    """
    check_input(path, "yaml", missing=missing)
    text = ""
    try:
        text = Path(path).read_text(encoding="utf-8")
        _refuse_deep(text)
        loader = _LOADER(text)
        node = loader.get_single_node()
        if node is None:
            return None
        check_limit(path, "values", _written_out(node, {}))
        _refuse_twice(node, loader)
        return loader.construct_document(node)
    except (UnicodeDecodeError, yaml.YAMLError, ValueError, RecursionError) as error:     # ValueError: 2001-99-99 is no date
        told = _clearer(text, error) if isinstance(error, yaml.YAMLError) else error
        raise InputError(f"{path}: not valid YAML ({' '.join(str(told).split())}); correct it.") from None


def _clearer(text, error):
    """What PyYAML's own parser says of a text: it names the character or the alias that libyaml leaves out, and shows the place."""
    try:
        yaml.compose(text, yaml.SafeLoader)
    except yaml.YAMLError as clearer:
        return clearer
    except RecursionError:
        pass
    return error


def _refuse_deep(text):
    """Refuse nesting for which libyaml, which calls itself for each level, would run out of stack and end the process."""
    depth = 0
    for event in yaml.parse(text, _LOADER):
        depth += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        if depth > _DEEPEST:
            raise ValueError(f"line {event.start_mark.line + 1} is nested more than {_DEEPEST} deep")


def _refuse_twice(root, loader):
    """Refuse a mapping with a key twice, of which PyYAML would keep the last one. Merges (`<<`) may be overridden."""
    waiting, seen = [root], set()
    while waiting:
        node = waiting.pop()
        if id(node) in seen or not isinstance(node, yaml.CollectionNode):
            continue
        seen.add(id(node))
        waiting += [part for one in node.value for part in (one if isinstance(one, tuple) else (one,))]
        lines: dict[Any, int] = {}
        for key, _ in node.value if isinstance(node, yaml.MappingNode) else ():
            if not isinstance(key, yaml.ScalarNode) or key.tag == "tag:yaml.org,2002:merge":
                continue
            name = loader.construct_object(key)
            if name in lines:
                raise ValueError(f"the key {key.value!r} stands in line {lines[name]} and again in line {key.start_mark.line + 1}; "
                                 "keep one")
            lines[name] = key.start_mark.line + 1


def _written_out(node, known):
    """Number of values below a YAML node if its aliases and merges are written out; `known` holds those of nodes.

    Raises ValueError for a node that contains itself.
    """
    if id(node) not in known:
        known[id(node)] = None
        below = node.value if isinstance(node, yaml.CollectionNode) else ()
        parts = [part for one in below for part in (one if isinstance(one, tuple) else (one,))]
        known[id(node)] = min(1 + sum(_written_out(part, known) for part in parts), _COUNTED)
    if known[id(node)] is None:
        raise ValueError(f"line {node.start_mark.line + 1} contains itself")
    return known[id(node)]


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
    check_input(path, "json")
    try:
        return parse_json(Path(path).read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not valid JSON ({error}); write the file again.") from None


def write_csv(path: str | Path, frame: "pd.DataFrame", *, float_format: str = "%.6g") -> None:
    """Write a pandas data frame as CSV without its index."""
    with atomic_path(path) as temporary:
        frame.to_csv(temporary, index=False, float_format=float_format, lineterminator="\n")


def read_csv(path: str | Path, **options: Any) -> "pd.DataFrame":
    """The table that `write_csv` wrote; options: of pandas.read_csv."""
    import pandas

    check_input(path, "archive")
    with in_one_sentence(path, "not a readable table", _AGAIN):
        return pandas.read_csv(path, **options)


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
    import h5py
    import xarray

    check_input(path, "arrays")
    with checked(path), in_one_sentence(path, "not a readable NetCDF file", _AGAIN):
        with h5py.File(path, "r") as file:
            check_limit(path, "arrays", _unpacked(file))
        return xarray.load_dataset(path, engine="h5netcdf")


def _unpacked(file):
    """Bytes of all arrays of an open HDF5 file as its headers state them; a compressed or empty one takes less on the disk."""
    sizes: list[int] = []
    file.visititems(lambda _, one: sizes.append(getattr(one, "nbytes", 0)))
    return sum(sizes)


@contextlib.contextmanager
def read_arrays(path: str | Path) -> Iterator[np.lib.npyio.NpzFile]:
    """The arrays of an .npz file, open while a block reads them; a damaged file raises `InputError`."""
    check_input(path, "arrays")
    with checked(path), in_one_sentence(path, "not a readable file of arrays", _AGAIN), np.load(path, allow_pickle=False) as data:
        check_limit(path, "arrays", sum(one.file_size for one in data.zip.infolist()))
        yield data
