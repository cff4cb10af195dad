"""Files that a crash or a full disk left: refused in one sentence with the file's name, and nothing half-written stays."""

import json
import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np
import pandas as pd
import pytest
import xarray

from softtact.errors import InputError
from softtact.files import atomic_path, read_csv, read_dataset, read_json, write_csv, write_dataset, write_json
from softtact.models.elastic.compliance import Compliance
from softtact.models.foundation.compliance import FoundationCompliance
from softtact.models.foundation.frustum_spring import FrustumLaw
from softtact.press.vtu import read_vtu

ROOT = Path(__file__).parents[1]
MAPS = xarray.Dataset({"deformation_map_mm": (("step", "y", "x"), np.arange(5 * 57 * 33, dtype=float).reshape(5, 57, 33))})
TETRAHEDRON = meshio.Mesh(np.eye(4, 3), [("tetra", [[0, 1, 2, 3]])], cell_data={"layer": [np.zeros(1)]},
                          point_data={"displacement_mm_5N": np.zeros((4, 3))})


def write_arrays(path):
    np.savez(path, x=np.arange(1000.0))


def test_a_truncated_file_is_refused_by_its_name_and_with_a_remedy(tmp_path):
    for name, write, read in [
        ("press.nc", lambda path: write_dataset(path, MAPS, seed=1, settings={}), read_dataset),
        ("card.json", lambda path: write_json(path, {"laws": list(range(100))}), read_json),
        ("compliance.npz", write_arrays, Compliance.load),
        ("compliance.npz", write_arrays, FoundationCompliance.load),
        ("law.npz", write_arrays, FrustumLaw.load),
        ("body.vtu", TETRAHEDRON.write, read_vtu)]:
        path = tmp_path / name
        write(path)
        path.write_bytes(path.read_bytes()[:-len(path.read_bytes()) // 2])
        with pytest.raises(InputError, match=f"{name}: not .*(again)"):
            read(path)


def test_a_data_set_is_written_the_same_twice_and_read_as_it_was(tmp_path):
    for name in ("a.nc", "b.nc"):
        write_dataset(tmp_path / name, MAPS, seed=1, settings={})
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()
    assert read_dataset(tmp_path / "a.nc").equals(MAPS)


FULL_DISK = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))     # as if the disk were full after 2 kB
from softtact.studies.__main__ import main
sys.exit(main(["score_complexity", *sys.argv[1:]]))
"""


def test_a_stage_on_a_full_disk_says_so_and_leaves_nothing(tmp_path):
    objects = [{"name": f"a_rather_long_name_of_an_object_{k}", "unit": "mm"} for k in range(60)]
    settings = {"objects": objects, "footprint_mm": [22, 37], "reach_mm": 2.5, "rule": "any",
                "thresholds": {"total": 10, "overlap": 8}}
    meshes = [f"--in=meshes={ROOT}/config/objects/indenters/square.stl"] * len(objects)
    out = tmp_path / "objects/complexity.csv"
    done = subprocess.run([sys.executable, "-c", FULL_DISK, *meshes, f"--out=table={out}", "--settings", json.dumps(settings)],
                          capture_output=True, text=True)
    assert done.returncode == 4 and "Traceback" not in done.stderr
    assert f"softtact score_complexity: {out}: cannot be written (File too large); make room" in done.stderr
    assert list(out.parent.iterdir()) == []


@pytest.mark.parametrize("write", [lambda path: write_dataset(path, MAPS, seed=1, settings={}), lambda path: write_json(path, {}),
                                   lambda path: write_csv(path, pd.DataFrame({"a": [1]}))])
def test_where_a_folder_cannot_be_made_the_file_is_named(tmp_path, write):
    (tmp_path / "results").write_text("a file, where a folder is wanted")
    with pytest.raises(InputError, match="results/tables/a.nc: a part of its path is a file, not a folder"):
        write(tmp_path / "results/tables/a.nc")


def test_what_fails_while_it_is_written_leaves_the_old_file(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("old")
    with pytest.raises(ZeroDivisionError), atomic_path(path) as temporary:
        temporary.write_text("half of the n")
        raise ZeroDivisionError
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("content", [b"", b"a,b\n1,2\n3,4,5\n", b"a,b\n\xff\xfe,2\n", b'a,b\n"1,2\n'])
def test_a_damaged_table_of_a_study_is_refused_in_one_sentence(content, tmp_path):
    (tmp_path / "scores.csv").write_bytes(content)
    with pytest.raises(InputError, match=r"scores.csv: not a readable table \(.*\); take a copy of it, or make it again\.$"):
        read_csv(tmp_path / "scores.csv")
