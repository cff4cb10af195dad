"""Files that are too large, or would become so, are refused by their size and headers, before they are read."""

import os
import re
import struct
import zipfile
from itertools import pairwise
from pathlib import Path

import h5py
import meshio
import numpy as np
import openpyxl
import pytest

from softtact.errors import InputError
from softtact.fem.files.solids import read_mesh_file
from softtact.files import read_arrays, read_dataset, read_json, read_yaml
from softtact.geometry.meshes import read_mesh
from softtact.imaging.marker_motion import MarkerMotion
from softtact.imaging.markers import read_image
from softtact.imaging.reading import read_frame
from softtact.inputs import LIMITS, VARIABLE, _shown, check_limit
from softtact.learning.network import load
from softtact.press.vtu import read_vtu
from softtact.published.table import Outliers
from softtact.published.table import read_table as read_archive
from softtact.readout.tsf85 import read_recording
from softtact.tables import read_sheet

HUGE = 50e9     # bytes; of a file with a hole, which takes no room on the disk
MERGES = "".join(f"{name}: &{name} {{<<: [{', '.join(9 * [f'*{before}'])}], {name}: 1}}\n" for before, name in
                 pairwise("abcdefghij"))


def read_npz(path):
    with read_arrays(path):
        pass


def a_mesh(path):
    return read_mesh(path, unit="mm")


def an_archive(path):
    return read_archive(path, columns=28, force=True, outliers=Outliers())


READERS = [
    ("sensor.yaml", lambda path: read_yaml(path, missing="")), ("card.json", read_json), ("recording.csv", read_recording),
    ("curve.xlsx", read_sheet), ("part.stl", a_mesh), ("part.obj", a_mesh), ("part.ply", a_mesh),
    ("part.step", a_mesh), ("part.zip", a_mesh),
    ("body.vtu", lambda path: read_mesh_file(path, unit="mm")), ("pressed.vtu", read_vtu), ("press.nc", read_dataset),
    ("cache.npz", read_npz), ("model.pt", load), ("frame.png", read_frame), ("image.png", read_image),
    ("clip.mp4", read_frame), ("markers.csv", MarkerMotion.read), ("Flat_Real_Abaqus.csv", an_archive)]


@pytest.mark.parametrize(("name", "read"), READERS)
def test_a_pointer_of_git_lfs_is_named_as_what_it_is(name, read, tmp_path):
    (tmp_path / name).write_text(f"version https://git-lfs.github.com/spec/v1\noid sha256:{64 * '4'}\nsize 12345\n")
    with pytest.raises(InputError, match=rf"{name}: it is a pointer of Git LFS, the file itself was not fetched; run git lfs pull"):
        read(tmp_path / name)


@pytest.mark.parametrize(("name", "read"), READERS)
def test_a_huge_file_is_refused_by_its_size(name, read, tmp_path):
    with open(tmp_path / name, "wb") as file:
        file.truncate(int(HUGE))
    with pytest.raises(InputError, match=rf"{name}: it has 50 GB, and the limit of .* raise all limits: set {VARIABLE}="):
        read(tmp_path / name)


def a_workbook(path):
    openpyxl.Workbook().save(path)
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as parts:
        parts.writestr("xl/worksheets/sheet2.xml", bytes(500_000))
    read_sheet(path)


def a_sheet_with_a_far_cell(path):
    book = openpyxl.Workbook()
    book.active["XFD1048576"] = 1
    book.save(path)
    read_sheet(path)


def a_packed_mesh(path):
    meshio.Mesh(np.eye(4, 3), [("tetra", [[0, 1, 2, 3]])], point_data={"moved": np.zeros((4, 100_000))}).write(path)
    read_mesh_file(path, unit="mm")


def a_mesh_packed_by_paraview(path):
    numbers = struct.pack("<4Q", 1_000_000, 2**15, 2**10, 30)
    path.write_bytes(b'<VTKFile byte_order="LittleEndian" header_type="UInt64" compressor="vtkZLibDataCompressor">'
                     b'<DataArray type="Float64" format="appended" offset="0"/><AppendedData encoding="raw">_' + numbers)
    read_vtu(path)


def arrays_without_contents(path):
    with h5py.File(path, "w") as file:
        file.create_dataset("map", (10**6, 10**6), "f8", chunks=(1000, 1000))
    read_dataset(path)


def a_network_of_packed_zeros(path):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as parts:
        parts.writestr("archive/data/0", b"")
    content = path.read_bytes()      # the directory states 4 GB for each of five parts
    entry = content[content.index(b"PK\1\2"):content.index(b"PK\5\6")]
    entry = entry[:24] + struct.pack("<I", 2**32 - 2) + entry[28:]
    start = content.index(b"PK\1\2")
    path.write_bytes(content[:start] + 5 * entry + struct.pack("<4s4H2IH", b"PK\5\6", 0, 0, 5, 5, 5 * len(entry), start, 0))
    load(path)


def merges_of_merges(path):
    path.write_text("a: &a {x: 1, y: 2}\n" + MERGES)
    read_yaml(path, missing="")


def many_facets(path):
    with open(path, "wb") as file:
        file.write(bytes(80) + struct.pack("<I", 50_000))
        file.truncate(84 + 50 * 50_000)
    a_mesh(path)


@pytest.mark.parametrize(("name", "use"), [
    ("a.xlsx", a_workbook), ("a.xlsx", a_sheet_with_a_far_cell), ("a.vtu", a_packed_mesh), ("a.vtu", a_mesh_packed_by_paraview),
    ("a.nc", arrays_without_contents), ("a.pt", a_network_of_packed_zeros), ("a.yaml", merges_of_merges), ("a.stl", many_facets)])
def test_a_small_file_that_would_become_huge_is_refused_by_its_header(name, use, tmp_path, monkeypatch):
    monkeypatch.setenv(VARIABLE, "0.01")
    with pytest.raises(InputError, match=rf"{name}: it has .*, and the limit of .* raise all limits: set {VARIABLE}="):
        use(tmp_path / name)


def test_an_anchor_that_contains_itself_is_refused(tmp_path):
    (tmp_path / "a.yaml").write_text("a: &a {b: [*a]}\n")
    with pytest.raises(InputError, match=r"a.yaml: not valid YAML \(line 1 contains itself\)"):
        read_yaml(tmp_path / "a.yaml", missing="")


@pytest.mark.parametrize("text", ["a: " + 30_000 * "[" + 30_000 * "]", 30_000 * "- " + "1"])
def test_nesting_that_would_end_the_process_is_refused(text, tmp_path):
    (tmp_path / "a.yaml").write_text("b: 1\n" * text.startswith("a") + text)
    with pytest.raises(InputError, match=r"a.yaml: not valid YAML \(line [12] is nested more than 100 deep\)"):
        read_yaml(tmp_path / "a.yaml", missing="")


@pytest.mark.parametrize(("text", "words"), [("a:\n\tb: 1\n", r"character '\\t'"), ("a: *other\n", "undefined alias 'other'")])
def test_a_fault_of_yaml_is_shown_with_its_character_or_alias(text, words, tmp_path):
    (tmp_path / "a.yaml").write_text(text)
    with pytest.raises(InputError, match=words):
        read_yaml(tmp_path / "a.yaml", missing="")


def test_the_variable_raises_all_limits(monkeypatch):
    count = 3 * LIMITS["facets"].most
    with pytest.raises(InputError, match=f"set {VARIABLE}=3."):
        check_limit("part.stl", "facets", count)
    monkeypatch.setenv(VARIABLE, "3")
    check_limit("part.stl", "facets", count)


@pytest.mark.parametrize("text", ["", "many", "0", "-1", "nan"])
def test_a_variable_that_is_no_factor_is_refused(text, monkeypatch):
    monkeypatch.setenv(VARIABLE, text)
    with pytest.raises(InputError, match=f"{VARIABLE}={text}: it is no number above 0"):
        check_limit("part.stl", "facets", 1)


def test_the_table_of_the_documentation_holds_all_limits():
    text = (Path(__file__).parents[1] / "docs/reference/limits.md").read_text()
    rows = re.findall(r"\| `(\w+)` \| ([^|]+) \| ([^|]+) \|", text)
    assert rows == [(name, _shown(one.most, one.unit), one.of) for name, one in LIMITS.items()]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs pipes with a name")
def test_a_pipe_is_refused_and_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "card.json")
    with pytest.raises(InputError, match="card.json: it is a device or a pipe; save what it gives to a file"):
        read_json(tmp_path / "card.json")


def test_a_lack_of_memory_is_not_told_as_a_damaged_file(tmp_path):
    np.savez(tmp_path / "a.npz", x=np.zeros(3))
    with pytest.raises(MemoryError), read_arrays(tmp_path / "a.npz"):
        raise MemoryError
