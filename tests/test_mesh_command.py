"""`softtact mesh`: a surface or another program's elements become a body; what cannot be used is refused before work."""

import contextlib
import io
import json

import meshio
import numpy as np
import pytest
import trimesh

from softtact.cli import main
from softtact.fem.files.solids import read_mesh_file
from tests.support.element_files import hexahedra, inp_assembly, inp_part

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)


@pytest.fixture
def box(tmp_path):
    trimesh.creation.box((6, 4, 3)).export(tmp_path / "box.stl")
    return tmp_path / "box.stl"


@pytest.fixture(scope="module")
def meshed(tmp_path_factory):
    """(result, messages, folder) of a box that was meshed in that folder, where a file had the name that fTetWild writes."""
    pytest.importorskip("pytetwild")
    folder, shown, told = tmp_path_factory.mktemp("meshed"), io.StringIO(), io.StringIO()
    trimesh.creation.box((6, 4, 3)).export(folder / "box.stl")
    (folder / "__tracked_surface.stl").write_text("of the user")
    line = "mesh box.stl --unit mm --size 2 --region gel --face bottom=z<-1.49 --json --out box.vtu"
    with contextlib.chdir(folder), contextlib.redirect_stdout(shown), contextlib.redirect_stderr(told):
        assert main(line.split()) == 0
    return json.loads(shown.getvalue()), told.getvalue(), folder


def test_a_surface_becomes_a_mesh_with_named_faces_and_its_quality_is_told(meshed):
    result, told, folder = meshed
    assert "elements and" in told      # what it costs is said first
    assert result["volume_error"] == pytest.approx(0, abs=1e-3) and result["least_quality"] > 0.1
    mesh = read_mesh_file(folder / "box.vtu")
    assert mesh.regions == result["regions"] == ["gel"]
    assert len(mesh.faces["bottom"]["triangle6"]) == result["faces"]["bottom"]
    assert mesh.points[mesh.face_nodes("bottom")][:, 2].max() == pytest.approx(-1.5)


def test_meshing_writes_nothing_else_into_the_working_folder(meshed):
    _, _, folder = meshed
    assert (folder / "__tracked_surface.stl").read_text() == "of the user"
    assert {path.name for path in folder.iterdir()} == {"box.stl", "box.vtu", "__tracked_surface.stl"}


def test_elements_of_another_program_become_a_body(tmp_path, capsys):
    meshio.Mesh(CORNERS, [("tetra", np.arange(4)[None])]).write(tmp_path / "one.vtk")
    written = tmp_path / "one.vtu"
    assert main(["mesh", str(tmp_path / "one.vtk"), "--unit", "cm", "--face", "floor=z<0.1", "--out", str(written)]) == 0
    assert read_mesh_file(written).volume_mm3() == pytest.approx(1000 / 6)
    assert "floor" in capsys.readouterr().out


def test_pieces_and_what_is_left_out_are_reported(tmp_path, capsys):
    nodes, hexes = hexahedra(1)
    (tmp_path / "two.inp").write_text(inp_part("A", nodes, hexes) + inp_assembly({"A-1": ("A", ""), "A-2": ("A", "0, 0, 4\n")},
                                                                              "*STEP\n"))
    written = tmp_path / "two.vtu"
    assert main(["mesh", str(tmp_path / "two.inp"), "--unit", "mm", "--json", "--out", str(written)]) == 0
    shown = capsys.readouterr()
    result = json.loads(shown.out)
    assert (result["pieces"], result["regions"], len(result["remarks"])) == (2, ["EA"], 3)
    for remark in ("*STEP", "in 2 pieces that share no node", "touch at"):
        assert remark in shown.err
    assert read_mesh_file(written).volume_mm3() == pytest.approx(128)


def test_what_it_cannot_use_is_refused_in_one_sentence_and_nothing_is_written(box, tmp_path, capsys):
    meshio.Mesh(CORNERS, [("tetra", np.arange(4)[None])]).write(tmp_path / "one.vtk")
    for arguments, told in [
        ([box], "--size"),
        ([box, "--size", "0"], "not possible"),
        ([box, "--size", "2", "--face", "bottom"], "NAME=VALUE"),
        ([box, "--size", "2", "--face", "bottom=z~0"], "not understood"),
        ([box, "--size", "2", "--geometry", "axisymmetric"], "plane mesh"),
        ([box, "--size", "2", "--region", "a", "--region", "b"], "one region"),
        ([box, "--size", "5"], "larger than the body"),
        ([tmp_path / "one.vtk", "--size", "1"], "has elements already"),
        ([tmp_path / "none.vtu"], "no such mesh file"),
    ]:
        out = tmp_path / "out.vtu"
        assert main(["mesh", *map(str, arguments), "--unit", "mm", "--out", str(out)]) == 1
        assert told in capsys.readouterr().err.splitlines()[-1]
        assert not out.exists()
    assert main(["mesh", str(box), "--unit", "mm", "--size", "2", "--out", str(tmp_path / "out.stl")]) == 1
