"""Files that softtact writes carry a checksum: one flipped bit anywhere is noticed, or changes no value."""

from pathlib import Path

import h5py
import meshio
import numpy as np
import pytest
import torch
import xarray

from softtact import checksums
from softtact.errors import InputError
from softtact.files import atomic_path, read_arrays, read_dataset, write_dataset
from softtact.learning.network import load, save
from softtact.press.vtu import read_vtu

FLIPS = 200
NUMBERS = np.linspace(0.05, 1, 60).reshape(3, 4, 5)
TETRAHEDRON = meshio.Mesh(np.eye(4, 3), [("tetra", [[0, 1, 2, 3]])], cell_data={"layer": [np.zeros(1)]},
                          point_data={"displacement_mm_5N": NUMBERS.reshape(-1, 3)[:4]})


def write_arrays(path):
    with atomic_path(path) as temporary:
        np.savez(temporary, numbers=NUMBERS)


def numbers_of_arrays(path):
    with read_arrays(path) as data:
        return data["numbers"]


def write_mesh(path):
    with atomic_path(path) as temporary:
        TETRAHEDRON.write(temporary, file_format="vtu")


def write_press(path):
    data = xarray.Dataset({"numbers": (("step", "y", "x"), NUMBERS, {"units": "mm"})}, attrs={"sensor": "coro"})
    write_dataset(path, data, seed=1, settings={})


def values_of_press(path):
    data = read_dataset(path)
    return np.append(data.numbers.values, [len(str(data.attrs)), data.numbers.attrs["units"] == "mm"])


KINDS = {"press.nc": (write_press, values_of_press), "cache.npz": (write_arrays, numbers_of_arrays),
         "model.pt": (lambda path: save(path, {"weights": torch.from_numpy(NUMBERS)}), lambda path: load(path)["weights"].numpy()),
         "pressed.vtu": (write_mesh, lambda path: read_vtu(path).displacement_mm)}


@pytest.fixture(params=KINDS)
def written(request, tmp_path):
    """A small file of a kind, the function that reads its numbers, and the function that writes it."""
    write, read = KINDS[request.param]
    path = tmp_path / request.param
    write(path)
    return path, read, write


def test_a_flipped_bit_is_refused_in_one_sentence_or_changes_no_number(written):
    path, read, _ = written
    whole, expected, refused = bytearray(path.read_bytes()), read(path), 0
    for bit in np.random.default_rng(0).integers(8 * len(whole), size=FLIPS):
        damaged = whole.copy()
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        try:
            np.testing.assert_array_equal(read(path), expected)
        except InputError as error:
            assert str(error).startswith(f"{path}: ") and "\n" not in str(error)
            refused += 1
    assert refused > 0.9 * FLIPS


def test_a_file_of_a_kind_has_the_same_bytes_each_time(written):
    path, _, write = written
    before = path.read_bytes()
    write(path)
    assert path.read_bytes() == before


def test_a_file_without_a_checksum_is_read_with_a_word(written, capsys):
    path, read, _ = written
    expected = read(path)
    assert capsys.readouterr().err == ""
    path.write_bytes(path.read_bytes()[:-checksums._LENGTH])
    np.testing.assert_array_equal(read(path), expected)
    np.testing.assert_array_equal(read(path), expected)
    assert capsys.readouterr().err.count(f"{path}: it has no checksum") == 1


def test_a_file_that_another_program_changed_is_read_with_a_word(tmp_path, capsys):
    write_press(tmp_path / "press.nc")
    with h5py.File(tmp_path / "press.nc", "r+") as file:
        file["numbers"][0, 0, 0] = 7.0
        file.attrs["note"] = "a longer file"
    assert read_dataset(tmp_path / "press.nc").numbers.values[0, 0, 0] == 7.0
    assert "press.nc: it has no checksum" in capsys.readouterr().err


def test_a_file_without_a_checksum_is_refused_in_one_sentence_where_its_reader_fails(written):
    path, read, _ = written
    whole = bytearray(path.read_bytes()[:-checksums._LENGTH])
    for bit in np.random.default_rng(1).integers(8 * len(whole), size=64):
        damaged = whole.copy()
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        try:
            read(path)
        except InputError as error:
            assert str(error).startswith(f"{path}: ") and "\n" not in str(error)


def test_a_network_with_code_in_it_is_refused_without_advice_to_run_it(tmp_path):
    path = tmp_path / "model.pt"
    torch.save({"weights": Path("a class of another module")}, path)
    with pytest.raises(InputError, match="model.pt: not a network's file") as refusal:
        load(path)
    assert "weights_only" not in str(refusal.value)


@pytest.mark.parametrize("ending", checksums.SEALED)
def test_each_kind_of_binary_file_gets_a_checksum_when_it_is_written(ending, tmp_path):
    path = tmp_path / f"file{ending}"
    with atomic_path(path) as temporary:
        temporary.write_bytes(b"contents")
    assert checksums.check(path)
    path.write_bytes(path.read_bytes().replace(b"contents", b"contentt"))
    with pytest.raises(InputError, match="its contents do not fit its checksum, so it was damaged after it was written"):
        checksums.check(path)
