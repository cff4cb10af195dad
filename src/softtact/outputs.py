"""Checks of where a file is to be written, temporary files and folders, and what killed runs left of these.

A temporary file or folder has the process in its name. The next one in the same place deletes those whose process has ended.
"""

import contextlib
import errno
import hashlib
import os
import platform
import re
import shutil
import stat
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

from softtact.errors import InputError, OutputError
from softtact.inputs import no_name
from softtact.progress import announce

_OURS = re.compile(r"\.?softtact-([0-9a-f]{8})-(\d+)-.*")     # machine, process
_LONGEST_NAME = 255      # bytes, on the file systems in use
_LONGEST_ENDING = 20     # characters; longer ones are no file's kind, and would make a temporary name too long
_NUMBA = "NUMBA_CACHE_DIR"
NO_ROOM = (errno.ENOSPC, errno.EFBIG, errno.EDQUOT, errno.EROFS)     # errors of a file that is being written


def target_of(path: str | Path) -> Path:
    """The file to which an output leads, through links.

    Raises InputError for what cannot become a file: a folder, a device, links in a circle, a name that is too long or cannot be
    encoded.
    """
    _check_names(path)
    try:
        mode = os.stat(path).st_mode
        if not stat.S_ISREG(mode):
            raise InputError(f"{path}: it is a {'folder' if stat.S_ISDIR(mode) else 'device or a pipe'}; give the name of a file.")
        if not os.access(path, os.W_OK):
            raise OutputError(f"{path}: it is there and read-only; make it writable, or give another name.")
    except FileNotFoundError:
        pass
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: {no_name(error)}.") from None
    return Path(os.path.realpath(path))


def check_outputs(*paths: str | Path | None) -> None:
    """Refuse output files that cannot be written, before any work: each place is tried with an empty file."""
    for path in (Path(path) for path in paths if path):
        folder = target_of(path).parent
        if not folder.is_dir():
            raise InputError(f"{path}: there is no folder {folder if path.is_symlink() else path.parent}; create it first.")
        _try(path, folder)


def check_output_folder(path: str | Path) -> None:
    """Refuse a folder for results that cannot be made, or in which no file can be written, before any work."""
    _check_names(path)
    try:
        os.stat(path)
    except (FileNotFoundError, NotADirectoryError):
        pass
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: {no_name(error)}.") from None
    whole = Path(os.path.realpath(path))
    there = next(one for one in (whole, *whole.parents) if one.exists())
    if not there.is_dir():
        raise InputError(f"{path}: {there} is a file; give another name for the folder.")
    _try(path, there)


def _check_names(path):
    """Refuse a path with a name that is too long, whether or not the folders before it exist."""
    try:
        longest = max((len(os.fsencode(part)) for part in Path(path).parts), default=0)
    except UnicodeError as error:
        raise InputError(f"{path}: {no_name(error)}.") from None
    if longest > _LONGEST_NAME:
        raise InputError(f"{path}: {no_name(OSError(errno.ENAMETOOLONG, ''))}.")


def _try(path, folder):
    try:
        os.unlink(temporary_file(folder, ""))
    except OSError as error:
        raise not_written(path, error) from None


def not_written(path: str | Path, error: OSError) -> OutputError:
    """The refusal of an output that the system refuses."""
    return OutputError(f"{path}: cannot be written ({error.strerror or error}); make room on the disk, or its folder writable, "
                       "and run again.")


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
    try:
        return os.path.samefile(one, other)
    except (OSError, ValueError):
        return os.path.realpath(one) == os.path.realpath(other)


def cache_folder() -> Path:
    """The user's folder for what can be made or fetched again; OutputError where there is no home folder."""
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "softtact"
    except RuntimeError:
        raise OutputError("There is no home folder; set XDG_CACHE_HOME to a folder in which files can be written.") from None


def temporary_file(folder: Path, suffix: str) -> Path:
    """A new empty file in a folder, under a name of this process; what killed processes left there is deleted."""
    _delete_left(folder)
    handle, name = tempfile.mkstemp(prefix=f".{_prefix()}", suffix=suffix if len(suffix) <= _LONGEST_ENDING else "", dir=folder)
    os.close(handle)
    return Path(name)


@contextlib.contextmanager
def temporary_folder(within: str | Path | None = None) -> Iterator[Path]:
    """A new folder that is deleted at the end, in that of temporary files or within another; so is what killed processes left."""
    place = Path(tempfile.gettempdir() if within is None else within)
    _delete_left(place)
    with tempfile.TemporaryDirectory(prefix=f"{'.' if within else ''}{_prefix()}", dir=place, ignore_cleanup_errors=True) as folder:
        yield Path(folder)


@contextlib.contextmanager
def place_for_kernels() -> Iterator[None]:
    """A block in which Numba can keep compiled kernels: in a temporary folder if nowhere else, where it would refuse to compile.

    Numba looks beside the package, then in the user's cache. It reads the environment when it is imported.
    """
    if _NUMBA in os.environ or os.access(Path(__file__).parent, os.W_OK) or _can_be_written("numba"):
        yield
        return
    announce("WARNING: Compiled kernels can be kept neither beside softtact nor in the user's cache, so each run compiles them; "
             f"set {_NUMBA} to a folder in which files can be written.")
    with temporary_folder() as folder:
        os.environ[_NUMBA] = str(folder)
        try:
            yield
        finally:
            del os.environ[_NUMBA]


def _can_be_written(name):
    """Whether a file can be made in a folder of the user's cache."""
    with contextlib.suppress(OSError, OutputError):
        folder = cache_folder().with_name(name)
        folder.mkdir(parents=True, exist_ok=True)
        os.unlink(temporary_file(folder, ""))
        return True
    return False


def _prefix():
    return f"softtact-{_machine()}-{os.getpid()}-"


def _machine():
    """What tells this machine, or this container, from others that write into the same folder."""
    numbers = ""
    with contextlib.suppress(OSError):
        numbers = os.readlink("/proc/self/ns/pid")     # Linux: the space in which processes are numbered
    return hashlib.sha256(f"{platform.node()} {numbers}".encode()).hexdigest()[:8]


def _delete_left(folder):
    """Delete the temporary files and folders of processes of this machine that have ended."""
    with contextlib.suppress(OSError):
        for entry in os.scandir(folder):
            found = _OURS.fullmatch(entry.name)
            if found and found[1] == _machine() and _has_ended(int(found[2])):
                with contextlib.suppress(OSError):     # of another user, or another process was faster
                    shutil.rmtree(entry.path) if entry.is_dir(follow_symlinks=False) else os.unlink(entry.path)


def _has_ended(process):
    try:
        if os.name == "posix":     # elsewhere the call would end the process
            os.kill(process, 0)
    except ProcessLookupError:
        return True
    except OSError:     # it runs for another user
        return False
    return False


@contextlib.contextmanager
def held(folder: str | Path, *, busy: str = "another run of this study is in progress") -> Iterator[None]:
    """Lock a folder, made where it is missing, against a second run while the block runs.

    busy: what its message says of the other run
    The system releases this lock whenever its holder dies; Snakemake's lock would remain.
    """
    import fcntl  # of POSIX alone, while the rest of this module serves every reader and writer

    file = Path(folder, ".running")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        lock = file.open("a")     # does not change the file's modification time
    except OSError as error:
        raise InputError(f"{folder}: cannot be written to ({error.strerror}); correct that.") from None
    with lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(f"{folder}: {busy}; wait for its end.") from None
        yield
