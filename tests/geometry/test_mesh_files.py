"""Mesh files in every dialect that the documentation names give the body that was written; others are refused with the place."""

import struct

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from support.mesh_files import SQUARE, U_SHAPE, binary_stl, obj_file, ply_file, prism, text_stl

from softtact.errors import InputError
from softtact.geometry.meshes import read_mesh
from softtact.geometry.repair import read_mended

quick = settings(max_examples=40, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture])
U_PLATE = prism(U_SHAPE, 8)
BOX, SMALL_BOX = prism(SQUARE, 8), prism([(0, 0), (6, 0), (6, 6), (0, 6)], 4, at=(0, 0, 20))


@st.composite
def bodies(draw):
    """One to three prisms over a skyline of columns, turned, beside each other: concave, with collinear corners."""
    turn = Rotation.from_euler("xyz", draw(st.sampled_from([(0, 0, 0), (90, 0, 0), (0, 180, 0), (33, -71, 128)])), degrees=True)
    solids = []
    for number in range(draw(st.integers(1, 3))):
        heights = draw(st.lists(st.integers(1, 6), min_size=1, max_size=4))
        base = [(x, 0) for x in range(len(heights) + 1)]
        skyline = [corner for x in range(len(heights) - 1, -1, -1) for corner in ((x + 1, heights[x]), (x, heights[x]))]
        polygon = 3.7 * np.array([*base, *(c for k, c in enumerate(skyline) if k == 0 or c != skyline[k - 1])])
        start = draw(st.integers(0, len(polygon) - 1))
        solids.append(prism(polygon, draw(st.sampled_from([1.5, 8])), start=start, turn=turn.as_matrix(), at=(0, 0, 60 * number)))
    return solids


def options(**choices):
    return st.fixed_dictionaries({name: st.sampled_from(values) for name, values in choices.items()})


WRITERS = {
    "obj": (obj_file, options(
        indices=["absolute", "relative", "interleaved"], corner=["{}", "{}/1", "{}//1", "{}/1/1", "{}/"], gap=[" ", "\t", " \t "],
        indent=["", "  ", "\t"], end=["\n", "\r\n", "\r"], number=["%.9g", "%.12e", "%+.8f"], upper=[False, True],
        continued=[False, True], comments=[False, True], extras=[False, True], tail=["", " 1", " 0.2 0.5 1", " nan nan nan"])),
    "ply": (ply_file, options(
        form=["ascii", "binary_little_endian", "binary_big_endian"], coordinate=["float", "double"],
        length=["uchar", "ushort", "int"], index=["int", "uint", "uchar"],
        extras=[False, True], edges=["none", "before", "after"], end=["\n", "\r\n", "\r"])),
    "text STL": (text_stl, options(
        name=["", "part", "two words", "vertex_cover", "facet normal 0 0 1", "endsolid"],
        normal=["0 0 0", "nan nan nan", "-1.#IND 1.#QNAN 0"],
        indent=["", "  ", "\t"], gap=[" ", "\t", "  "], end=["\n", "\r\n", "\r"], number=["%.9g", "%.9e", "%+.8f"],
        case=[str, str.upper, str.title], tail=["", "\n\n", "  \n \n"])),
    "binary STL": (binary_stl, options(header=[b"", b"solid part", b"\0" * 80], tail=[b"", b"\n", b"\r\n", b" \n"])),
}


@pytest.mark.parametrize("kind", WRITERS)
def test_a_body_is_read_from_every_dialect_as_it_was_written(kind, tmp_path):
    write, dialects = WRITERS[kind]
    path = tmp_path / f"body.{kind[-3:].lower()}"

    @quick
    @given(bodies(), dialects)
    def write_and_read(solids, dialect):
        path.write_bytes(write(solids, **dialect))
        mesh = read_mesh(path, unit="mm")
        assert mesh.volume == pytest.approx(sum(solid.volume for solid in solids), rel=1e-4)
        assert mesh.area == pytest.approx(sum(solid.area for solid in solids), rel=1e-4)
        assert mesh.body_count == len(solids)

    write_and_read()


@st.composite
def mutated(draw, content):
    """The content cut off, or with a line or a byte left out, or with a byte replaced or added that is part of no number.

    Other coordinates in a PLY or an OBJ are another body, which no reader can know.
    """
    at = draw(st.integers(0, len(content) - 1))
    kind = draw(st.sampled_from(["cut", "line", "left out", "replaced", "added"]))
    if kind == "cut":
        return content[:at]
    if kind == "line":
        lines = content.splitlines(keepends=True)
        del lines[at % len(lines)]
        return b"".join(lines)
    letter = draw(st.sampled_from(list(b"x \n/,_\\#")))
    header = content.find(b"end_header") if b"format binary" in content else len(content)
    structure = [k for k, byte in enumerate(content[:header]) if byte not in b"0123456789.+-e"]
    at = structure[at % len(structure)]
    return content[:at] + (b"" if kind == "left out" else bytes([letter])) + content[at + (kind != "added"):]


MUTATED = {"part.obj": obj_file([U_PLATE]), "part.ply": ply_file([U_PLATE]), "text.stl": text_stl([U_PLATE]),
           "binary.stl": binary_stl([U_PLATE]), "binary.ply": ply_file([U_PLATE], form="binary_big_endian")}


@pytest.mark.parametrize("name", MUTATED)
def test_a_mutated_file_is_read_to_the_same_body_or_refused(name, tmp_path):
    path = tmp_path / name

    @settings(quick, max_examples=80)
    @given(mutated(MUTATED[name]))
    def mutate(content):
        path.write_bytes(content)
        try:
            mesh = read_mended(path, unit="mm").mesh
        except InputError as error:
            assert str(path) in str(error) and "\n" not in str(error)
        else:
            assert mesh.volume == pytest.approx(U_PLATE.volume, rel=1e-3)

    mutate()


OBJ, PLY, STL = obj_file([BOX]).decode(), ply_file([BOX]).decode(), text_stl([BOX]).decode()
BINARY = binary_stl([BOX])
REFUSED = [
    ("zero.obj", OBJ.replace("f 4 3 2 1", "f 3 2 1 0"), "line 11: a corner is vertex 0, but the file's 8 vertices are 1 to 8"),
    ("relative_zero.obj", OBJ.replace("f 4 3 2 1", "f -1 -2 -3 0"), "line 11: a corner is vertex 0, but vertices are counted"),
    ("large.obj", OBJ.replace("f 4 3 2 1", "f 4 3 2 9"), "line 11: a corner is vertex 9, but the file's 8 vertices are 1 to 8"),
    ("digits.obj", OBJ.replace("f 4 3 2 1", "f 4 3 2 " + 30 * "9"), "line 11: '9{30}' is not the number of a vertex"),
    ("before.obj", OBJ.replace("f 4 3 2 1", "f 4 3 2 -9"), "line 11: a corner is vertex -9, but only 8 vertices come before it"),
    ("two.obj", OBJ.replace("f 4 3 2 1", "f 4 3"), "line 11: the face has 2 corners"),
    ("point.obj", OBJ.replace("f 4 3 2 1", "f 4 3 2.0"), "line 11: '2.0' is not the number of a vertex"),
    ("comma.obj", OBJ.replace("v 20 20 8", "v 20,0 20 8"), "line 9: '20,0' is no finite number; write decimals with points"),
    ("dash.obj", OBJ.replace("v 20 20 8", "v 20- 20 8"), "line 9: '20-' is no finite number"),
    ("nan.obj", OBJ.replace("v 20 20 8", "v nan 20 8"), "line 9: 'nan' is no finite number"),
    ("infinite.obj", OBJ.replace("v 20 20 8", "v 1e999 20 8"), "line 9: the vertex has a coordinate that is no finite number"),
    ("flat.obj", OBJ.replace("v 20 20 8", "v 20 20"), "line 9: a vertex has three coordinates"),
    ("weight.obj", OBJ.replace("v 20 20 8", "v 20 20 8 2"), "line 9: the vertex has the weight 2"),
    ("curve.obj", OBJ + "cstype bspline\n", "line 17: 'cstype' belongs to free-form"),
    ("call.obj", OBJ + "call other.obj\n", "line 17: 'call' calls another file"),
    ("word.obj", OBJ + "facet 1 2 3\n", "line 17: 'facet' is not a statement"),
    ("anew.obj", OBJ + obj_file([SMALL_BOX]).decode(), "6 faces are repeated, and no face uses 8 of the vertices"),
    ("cut.obj", OBJ + "v 1 1 1\nv 2 2 2\n", "line 17: no face uses the 2 vertices from here on, so the file was cut off"),
    ("continued.obj", OBJ.replace("f 4 3 2 1", "f 4 3 \\\n2 9"), "line 11: .*vertex 9"),
    ("continued_cut.obj", OBJ.rstrip() + " \\\n", "its last line continues in a next one, so the file was cut off"),
    ("utf16.obj", OBJ.encode("utf-16"), "UTF-16"),
    ("utf16.stl", STL.encode("utf-16"), "UTF-16"),
    ("more.ply", PLY.replace("face 6", "face 5"), "line 25: '4 3 0 4 7' follows the last row that the header declares"),
    ("fewer.ply", PLY.replace("face 6", "face 7"), "declares 7 rows of 'face', and the file ends or is damaged after 6"),
    ("digits.ply", PLY.replace("face 6", "face " + 5000 * "6"), "line 9: 'element face 66.*' is no line of a PLY header"),
    ("range.ply", PLY.replace("4 3 2 1 0", "4 3 2 1 8"), "line 20: a corner is vertex 8, but the file's 8 vertices are 0 to 7"),
    ("two.ply", PLY.replace("4 3 2 1 0", "2 3 2"), "line 20: the face has 2 corners"),
    ("nan.ply", PLY.replace("20 20 8", "20 nan 8"), "line 18: the vertex has a coordinate that is no finite number"),
    ("comma.ply", PLY.replace("20 20 8", "20 20,5 8"), "line 18: '20 20,5 8' is no row of 'vertex'"),
    ("strips.ply", PLY.replace("element face", "element tristrips"), "strips of triangles"),
    ("type.ply", PLY.replace("float y", "float3 y"), "line 7: 'property float3 y' is no line of a PLY header"),
    ("longer.ply", ply_file([BOX], form="binary_big_endian") + b"\0", "end at byte 418, but the file has 419"),
    ("comma.stl", STL.replace("20 20 8", "20 20 8,5"), r"line \d+: '8,5' is no finite number; write decimals with points"),
    ("nan.stl", STL.replace("20 20 8", "20 nan 8"), r"line \d+: 'nan' is no finite number"),
    ("second.stl", text_stl([BOX, SMALL_BOX])[:-200], "ends without 'endsolid', so it was cut off"),
    ("open.stl", STL.replace("endsolid part\n", "") + STL, "line 86: 'solid' stands where 'facet' or 'endsolid' is due"),
    ("word.stl", STL.replace("outer loop", "outer", 1), "line 4: 'vertex' stands where 'loop' is due"),
    ("last.stl", STL.replace("endfacet\nendsolid part", "endsolid"), "line 85: 'endsolid' stands where 'endfacet' is due"),
    ("behind.stl", STL + "facet normal 0 0 1\n", "line 87: 'facet' stands where 'solid' is due"),
    ("zero.stl", binary_stl([BOX], count=0), "declares 0 facets, which take 84 bytes, but has 684"),
    ("fewer.stl", binary_stl([BOX], count=11), "declares 11 facets, which take 634 bytes, but has 684, so it holds more"),
    ("more.stl", binary_stl([BOX], header=b"solid", count=13), "13 facets, which take 734 bytes, but has 684, so it was cut"),
    ("bytes.stl", binary_stl([BOX], tail=b"xyz"), "declares 12 facets, which take 684 bytes, but has 687"),
    ("inserted.stl", BINARY[:300] + b"\0" + BINARY[300:], "declares 12 facets, which take 684 bytes, but has 685"),
]


@pytest.mark.parametrize(("name", "content", "said"), REFUSED, ids=[name for name, _, _ in REFUSED])
def test_a_file_that_does_not_hold_what_it_declares_is_refused_with_the_place(name, content, said, tmp_path):
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError, match=rf"{name}: .*{said}"):
        read_mended(tmp_path / name, unit="mm")


def test_normals_that_are_no_numbers_leave_no_word_on_the_terminal(tmp_path, capfd, caplog):
    (tmp_path / "part.stl").write_bytes(text_stl([BOX], normal="-1.#IND 1.#QNAN 0"))
    assert read_mesh(tmp_path / "part.stl", unit="mm").volume == pytest.approx(BOX.volume)
    assert capfd.readouterr() == ("", "") and not caplog.records


def test_a_binary_ply_that_promises_more_than_it_holds_asks_for_no_memory(tmp_path):
    content = ply_file([BOX], form="binary_little_endian", length="uint")
    (tmp_path / "rows.ply").write_bytes(content.replace(b"vertex 8", b"vertex 9999999999"))
    (tmp_path / "list.ply").write_bytes(content.replace(struct.pack("<2I", 4, 3), struct.pack("<2I", 2**32 - 1, 3)))
    for name in ("rows.ply", "list.ply"):
        with pytest.raises(InputError, match=f"{name}: its header declares .* and the file ends or is damaged after"):
            read_mesh(tmp_path / name, unit="mm")
