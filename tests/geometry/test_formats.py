"""Mesh formats with a unit of their own give the body that was written, in mm and in its place; others are refused by name."""

import json

import numpy as np
import pytest
import trimesh
from support.mesh_files import obj_file, text_stl
from support.object_files import BOX, ONE, file_3mf, file_amf, file_dae, file_glb, file_off, mesh_3mf, packed
from support.step_files import step_ball, step_cylinder

from softtact.cli import main
from softtact.errors import InputError, missing_extra
from softtact.geometry.meshes import read_mesh
from softtact.geometry.repair import read_mended

MOVED = '<item objectid="1" transform="0 0 1 0 1 0 -1 0 0 30 0 0"/>'      # x to z, z to -x, then 30 along x
COMPONENTS = ('<object id="2"><components><component objectid="1"/><component objectid="1" transform="1 0 0 0 1 0 0 0 1 0 0 20"/>'
              "</components></object>")
RIGHT = [     # name, content, bounds in mm, volume in mm3, unit that is reported
    ("box.3mf", file_3mf(mesh_3mf(), ONE), [[0, 0, 0], [20, 20, 8]], 3200, "mm"),
    ("default.3mf", file_3mf(mesh_3mf(), ONE, ""), [[0, 0, 0], [20, 20, 8]], 3200, "mm"),
    ("inch.3mf", file_3mf(mesh_3mf(scale=0.1), ONE, 'unit="inch"'), [[0] * 3, [50.8, 50.8, 20.32]], 52438.6, "inch"),
    ("moved.3mf", file_3mf(mesh_3mf(), MOVED), [[22, 0, 0], [30, 20, 20]], 3200, "mm"),
    ("components.3mf", file_3mf(mesh_3mf() + COMPONENTS, '<item objectid="2"/>'), [[0, 0, 0], [20, 20, 28]], 6400, "mm"),
    ("mirrored.3mf", file_3mf(mesh_3mf(), '<item objectid="1" transform="-1 0 0 0 1 0 0 0 1 0 0 0"/>'),
     [[-20, 0, 0], [0, 20, 8]], 3200, "mm"),
    ("not_built.3mf", file_3mf(mesh_3mf() + mesh_3mf(2, 3), ONE), [[0, 0, 0], [20, 20, 8]], 3200, "mm"),
    ("support.3mf", file_3mf(mesh_3mf() + mesh_3mf(2, 3, "support"), '<item objectid="1"/><item objectid="2"/>'),
     [[0, 0, 0], [20, 20, 8]], 3200, "mm"),
    ("box.amf", file_amf(), [[0, 0, 0], [20, 20, 8]], 3200, "mm"),
    ("metre.amf", file_amf('unit="meter"', scale=1e-3), [[0, 0, 0], [20, 20, 8]], 3200, "m"),
    ("packed.amf", packed(**{"box.amf": file_amf()}), [[0, 0, 0], [20, 20, 8]], 3200, "mm"),
    ("turned.amf", file_amf(constellation='<constellation id="1"><instance objectid="0"><deltax>5</deltax><rz>90</rz></instance>'
                                          "</constellation>"), [[-15, 0, 0], [5, 20, 8]], 3200, "mm"),
    ("box.glb", file_glb(), [[0, 0, 0], [20, 20, 8]], 3200, "m"),
    ("turned.glb", file_glb(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0])), [[0, -8, 0], [20, 0, 20]], 3200, "m"),
    ("two.glb", file_glb(np.eye(4), trimesh.transformations.translation_matrix([0, 0, 0.02])),
     [[0, 0, 0], [20, 20, 28]], 6400, "m"),
    ("mirrored.glb", file_glb(np.diag([-1, 1, 1, 1])), [[-20, 0, 0], [0, 20, 8]], 3200, "m"),
]


@pytest.mark.parametrize(("name", "content", "bounds", "volume", "unit"), RIGHT, ids=[case[0] for case in RIGHT])
def test_a_format_with_a_unit_is_read_in_mm_and_in_its_place(name, content, bounds, volume, unit, tmp_path):
    (tmp_path / name).write_bytes(content)
    mesh = read_mesh(tmp_path / name)
    np.testing.assert_allclose(mesh.bounds, bounds, atol=1e-5)
    assert mesh.volume == pytest.approx(volume, rel=1e-5)
    assert mesh.metadata["notes"][0].startswith(f"read in {unit}, ")


@pytest.mark.parametrize("head", ["OFF\n8 6 0\n", "OFF 8 6 12\n", "# made\nCOFF\n8 6\n"])
def test_an_off_file_is_read_with_its_polygons_and_colours_and_needs_a_unit(head, tmp_path):
    (tmp_path / "box.off").write_bytes(file_off(head))
    assert read_mesh(tmp_path / "box.off", unit="cm", max_size_mm=1000).volume == pytest.approx(3.2e6)
    with pytest.raises(InputError, match=r"box.off: no unit is stated, and the file holds none; state one of mm, cm"):
        read_mesh(tmp_path / "box.off")


@pytest.mark.parametrize(("unit", "size"), [("mm", 1.0), ("m", 1e-3), ("inch", 1 / 25.4)])
def test_a_step_cylinder_is_that_of_its_closed_form_within_the_chord(unit, size, tmp_path):
    pytest.importorskip("cascadio", reason="pip install 'softtact[cad]'")
    (tmp_path / "pin.step").write_bytes(step_cylinder(5 * size, 8 * size, unit=unit))
    mesh = read_mesh(tmp_path / "pin.step")
    chord = 0.01
    assert np.pi * (5 - chord)**2 * 8 < mesh.volume < np.pi * 25 * 8
    np.testing.assert_allclose(mesh.bounds, [[-5, -5, 0], [5, 5, 8]], atol=chord)
    np.testing.assert_allclose(np.hypot(*mesh.vertices[:, :2].T)[mesh.vertices[:, 2] > 7.9], 5, atol=1e-5)
    assert mesh.metadata["notes"] == [f"read in {unit}, as the file states; its curved faces are facets within 0.01 mm"]


def test_a_step_ball_is_that_of_its_closed_form_within_the_chord(tmp_path):
    pytest.importorskip("cascadio", reason="pip install 'softtact[cad]'")
    (tmp_path / "ball.stp").write_bytes(step_ball(2.0))
    mesh = read_mesh(tmp_path / "ball.stp", unit="mm")
    assert 4 / 3 * np.pi * 1.99**3 < mesh.volume < 4 / 3 * np.pi * 8
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices, axis=1), 2.0, atol=1e-6)
    middles = np.vstack([mesh.triangles_center, mesh.vertices[mesh.edges].mean(axis=1)])
    assert np.linalg.norm(middles, axis=1).min() > 1.99


def test_a_step_file_without_the_extra_says_which_extra_reads_it():
    assert "pip install 'softtact[cad]'" in missing_extra(ModuleNotFoundError(name="cascadio"))


@pytest.mark.parametrize(("unit", "name", "size"), [
    ('<unit name="millimeter" meter="0.001"/>', "mm", 1.0), ('<unit name="i" meter="0.0254"/>', "inch", 25.4)])
def test_a_dae_file_is_read_in_its_unit_and_place_and_a_mirrored_body_keeps_its_outside(unit, name, size, tmp_path):
    pytest.importorskip("collada", reason="pip install 'softtact[cad]'")
    for matrix, low in (("1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1", 5), ("-1 0 0 5 0 1 0 0 0 0 1 0 0 0 0 1", -15)):
        (tmp_path / "box.dae").write_bytes(file_dae(unit, matrix))
        mesh = read_mesh(tmp_path / "box.dae", max_size_mm=1e4)
        np.testing.assert_allclose(mesh.bounds, np.array([[low, 0, 0], [low + 20, 20, 8]]) * size, rtol=1e-6)
        assert mesh.volume == pytest.approx(3200 * size**3) and mesh.metadata["notes"][0].startswith(f"read in {name}, ")


@pytest.mark.parametrize(("content", "words"), [
    (file_dae()[:900], "not a readable DAE file"),
    (file_dae('<unit name="parsec" meter="3e16"/>'), "its unit of 3e.16 m is none of"),
    (b'<!DOCTYPE a [<!ENTITY b "c">]>' + file_dae(), "declares a document type"),
    (file_dae().replace(b'<instance_visual_scene url="#s"/>', b""), "scene|DAE")], ids=["cut", "unit", "entity", "no scene"])
def test_a_dae_file_that_is_no_mesh_is_refused_in_a_sentence(content, words, tmp_path):
    pytest.importorskip("collada", reason="pip install 'softtact[cad]'")
    (tmp_path / "box.dae").write_bytes(content)
    with pytest.raises(InputError, match=words) as caught:
        read_mesh(tmp_path / "box.dae")
    assert "\n" not in str(caught.value) and str(caught.value).startswith(str(tmp_path / "box.dae"))


STEP = step_cylinder(5, 8)
CYCLE = '<object id="2"><components><component objectid="2"/></components></object>'
REFUSED = [
    ("pin.step", STEP, "inch", r"the unit is given as inch, and that of the file is mm; leave the unit out"),
    ("cut.step", STEP[:2000], None, "it ends without END-ISO-10303-21, so it was cut off"),
    ("text.step", b"solid", None, "it does not begin with ISO-10303-21"),
    ("crash.step", STEP.replace(b"#140=EDGE_CURVE(", b"#140=EDGE_CURVE%(").replace(b"VECTOR('',", b"VECTOR(,"), None,
     "Open CASCADE crashed as it read the file, which is damaged or too large; export it again"),
    ("empty.step", STEP.replace(b"MANIFOLD_SOLID_BREP", b"NO_BREP"), None, "Open CASCADE finds no body in it|holds no triangles"),
    ("inch.3mf", file_3mf(mesh_3mf(scale=0.1), ONE, 'unit="inch"'), "mm",
     "given as mm, and that of the file is inch"),
    ("glb.glb", file_glb(), "mm", "given as mm, and that of the file is m"),
    ("in_mm.glb", file_glb(scale=1), None, r"read in m, its largest side is 2e\+04 mm, .* perhaps its unit is mm \(20 mm\)"),
    ("parsec.3mf", file_3mf(mesh_3mf(), ONE, 'unit="parsec"'), None, "its unit 'parsec' is none of micron"),
    ("nothing.3mf", file_3mf(mesh_3mf(), '<item objectid="7"/>'), None, "it holds no object 7, which it builds"),
    ("cycle.3mf", file_3mf(CYCLE, '<item objectid="2"/>'), None, "the object 2 is a component of itself"),
    ("range.3mf", file_3mf(mesh_3mf().replace('v3="35"', 'v3="36"'), ONE), None,
     "a corner is vertex 36, but the mesh's 36"),
    ("entity.3mf", packed(**{"3D/3dmodel.model": '<!DOCTYPE a [<!ENTITY b "c">]><model/>'}), None, "it declares a document type"),
    ("damaged.3mf", b"PK\3\4 and no more", None, "not a readable ZIP archive"),
    ("cut.amf", file_amf()[:-20], None, "not a readable AMF file"),
    ("text.glb", b"glTF 1.0", None, "it does not begin as a GLB file does"),
    ("short.off", file_off().replace(b"8 6 0", b"8 7 0"), "mm", "it declares 8 points and 7 faces, and has 14 lines of them"),
    ("two.zip", packed(**{"a.stl": text_stl([BOX]), "b/c.obj": obj_file([BOX])}), "mm",
     "it holds 2 meshes, a.stl, b/c.obj; unpack it"),
    ("none.zip", packed(**{"a.txt": "text", ".b.stl": "x"}), "mm", "it holds no mesh; pack a file of STL"),
    ("part.igs", b"IGES", None, "the format '.igs' is not read; save the mesh as STL, OBJ, PLY, OFF, 3MF, AMF, DAE, GLB or STEP"),
]


@pytest.mark.parametrize(("name", "content", "unit", "sentence"), REFUSED, ids=[case[0] for case in REFUSED])
def test_a_file_that_is_not_what_it_should_be_is_refused_by_name(name, content, unit, sentence, tmp_path, capfd):
    if name.endswith(".step"):
        pytest.importorskip("cascadio", reason="pip install 'softtact[cad]'")
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=sentence) as caught:
        read_mended(tmp_path / name, unit=unit)
    assert str(caught.value).startswith(str(tmp_path / name)) and "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")     # what Open CASCADE prints is not for users


def test_a_glb_file_whose_points_are_compressed_is_refused_by_its_extension(tmp_path):
    tree = json.dumps({"asset": {"version": "2.0"}, "extensionsRequired": ["KHR_draco_mesh_compression"]}).encode()
    chunk = len(tree).to_bytes(4, "little") + b"JSON" + tree
    (tmp_path / "part.glb").write_bytes(b"glTF\2\0\0\0" + (12 + len(chunk)).to_bytes(4, "little") + chunk)
    with pytest.raises(InputError, match="it needs the extension KHR_draco_mesh_compression"):
        read_mesh(tmp_path / "part.glb")


def test_an_archive_of_one_mesh_is_read_without_the_hidden_files_beside_it(tmp_path):
    files = {"part/box.stl": text_stl([BOX]), "__MACOSX/part/._box.stl": b"x", "part/.DS_Store": b"x", "part/read me.txt": b"x"}
    (tmp_path / "box.zip").write_bytes(packed(**files))
    assert read_mesh(tmp_path / "box.zip", unit="mm").volume == pytest.approx(3200)


def test_an_archive_that_is_too_large_when_it_is_unpacked_is_refused(tmp_path, monkeypatch):
    monkeypatch.setenv("SOFTTACT_LIMITS", "0.0001")     # 30 kB of a mesh
    (tmp_path / "large.zip").write_bytes(packed(**{"part.stl": bytes(1_000_000)}))
    with pytest.raises(InputError, match="it has 1 MB, and the limit of a mesh file"):
        read_mesh(tmp_path / "large.zip", unit="mm")


@pytest.mark.parametrize("tail", [" 0.2 0.5 1", " 0.2 0.5 1 1", ""])
def test_colours_of_an_obj_are_passed_over_with_and_without_their_opacity(tail, tmp_path):
    (tmp_path / "box.obj").write_bytes(obj_file([BOX], tail=tail))
    assert read_mesh(tmp_path / "box.obj", unit="mm").volume == pytest.approx(3200)


def test_a_press_reports_the_unit_that_the_file_states(tmp_path, capsys):
    (tmp_path / "box.3mf").write_bytes(file_3mf(mesh_3mf(), ONE))
    assert main(["press", str(tmp_path / "box.3mf"), "--force", "5", "--model", "foundation", "--json"]) == 0
    assert f"{tmp_path / 'box.3mf'}: read in mm, the unit of the file" in capsys.readouterr().err


def test_a_folder_is_pressed_without_the_hidden_files_in_it(tmp_path):
    (tmp_path / "in").mkdir()
    for name, content in (("box.stl", text_stl([BOX])), ("._box.stl", b"\0\5\x16\7" + bytes(80)), (".DS_Store", bytes(100))):
        (tmp_path / "in" / name).write_bytes(content)
    press = ["press", str(tmp_path / "in"), "--unit", "mm", "--force", "5", "--model", "foundation", "--out", str(tmp_path / "out")]
    assert main(press) == 0
    assert [one.name for one in (tmp_path / "out").iterdir() if one.is_dir()] == ["box"]
