"""Files of compiled kernels: a damaged one is compiled again, and a full disk stops no kernel."""

import errno
import importlib.util
from pathlib import Path

import pytest

from softtact import kernel_files

KERNEL = """
from softtact.compiled import compiled

@compiled
def double(x):
    return 2 * x
"""


@pytest.fixture
def kernel(tmp_path, monkeypatch):
    """A function that imports the kernel as a new process would; it returns the kernel, which has not been called."""
    monkeypatch.setattr("numba.config.CACHE_DIR", "")     # beside the source, wherever the user keeps kernels
    (tmp_path / "kernel.py").write_text(KERNEL)
    kernel_files._warn.cache_clear()

    def imported():
        spec = importlib.util.spec_from_file_location("kernel", tmp_path / "kernel.py")
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        return module.double

    return imported


def is_loaded(kernel):
    """Call a kernel; whether it came from its file."""
    assert kernel(21) == 42
    return sum(kernel.stats.cache_hits.values()) == 1


def files_of(folder, ending):
    (path,) = Path(folder, "__pycache__").glob(f"*{ending}")
    return path


def test_a_kernel_is_loaded_from_its_file(kernel):
    assert not is_loaded(kernel()) and is_loaded(kernel())


@pytest.mark.parametrize("ending", [".nbi", ".nbc"])
@pytest.mark.parametrize("place", [0.1, 0.5, 0.9])
def test_a_damaged_file_is_told_and_compiled_again(ending, place, kernel, tmp_path, capsys):
    assert not is_loaded(kernel())
    path = files_of(tmp_path, ending)
    content = bytearray(path.read_bytes())
    content[int(place * len(content))] ^= 4
    path.write_bytes(content)
    assert not is_loaded(kernel()) and is_loaded(kernel())
    assert capsys.readouterr().err.count("WARNING") == 1


def test_a_full_disk_stops_no_kernel_and_is_told_once(kernel, monkeypatch, capsys):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(kernel_files.IndexDataCacheFile, "_open_for_write", full)
    assert not is_loaded(kernel()) and not is_loaded(kernel())
    told = capsys.readouterr().err
    assert told.count("WARNING") == 1 and "compiled kernels cannot be kept (No space left on device)" in told


def test_files_of_numba_alone_are_taken(kernel, tmp_path):
    assert not is_loaded(kernel())
    for ending in (".nbi", ".nbc"):
        path = files_of(tmp_path, ending)
        path.write_bytes(path.read_bytes()[:-len(kernel_files._MARK) - 40])
    assert is_loaded(kernel())
