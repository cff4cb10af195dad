"""Decks of Abaqus and CalculiX are read whole: parts, instances, sets, surfaces, included files; what cannot be read is refused."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.fem.files.solids import read_body
from tests.support.element_files import (
    BLOCK_MM3,
    TETRAHEDRA,
    WEDGES,
    block,
    cut,
    hexahedra,
    inp_assembly,
    inp_elements,
    inp_nodes,
    inp_part,
    quadratic,
)

NODES, TETRA = block()
PLAIN = inp_nodes(NODES) + inp_elements("C3D4", TETRA)


@pytest.fixture
def read(tmp_path):
    """A function that reads a deck of this text, and other files {name: text} beside it."""
    def of(text, files=None, **options):
        for name, content in {"deck.inp": text, **(files or {})}.items():
            (tmp_path / name).write_text(content)
        return read_body(tmp_path / "deck.inp", unit="mm", **options)
    return of


def sizes(body):
    """{region: number of elements}"""
    found = {}
    for region, _, nodes in body.mesh.cells:
        found[region] = found.get(region, 0) + len(nodes)
    return found


def extent(body):
    points = body.mesh.points[body.mesh.face_nodes("boundary")]
    return points.min(axis=0).tolist(), points.max(axis=0).tolist()


@pytest.mark.parametrize("count", [1, 2])
def test_each_part_keeps_its_own_numbers_of_nodes_and_elements(read, count):
    parts = inp_part("A", *hexahedra()) + inp_part("B", *hexahedra(count, 2.0))
    body = read("*HEADING\n" + parts + inp_assembly({"A-1": ("A", ""), "B-1": ("B", "1, 1, 4\n")}))
    assert sizes(body) == {"EA": 8, "EB": count**3} and body.mesh.volume_mm3() == pytest.approx(72)
    assert extent(body) == ([0, 0, 0], [4, 4, 6]) and body.pieces == 2
    assert any("EA and EB touch" in remark for remark in body.remarks)


def test_each_instance_of_a_part_stands_in_its_place(read):
    part = inp_part("A", *hexahedra())
    twice = read(part + inp_assembly({"A-1": ("A", ""), "A-2": ("A", "6, 0, 0\n")}))
    assert twice.mesh.volume_mm3() == pytest.approx(2 * BLOCK_MM3) and sizes(twice) == {"EA": 16}
    assert extent(twice) == ([0, 0, 0], [10, 4, 4])
    assert extent(read(part + inp_assembly({"A-1": ("A", "0, 0, 10\n")}))) == ([0, 0, 10], [4, 4, 14])


def test_an_instance_is_moved_and_then_turned_about_its_axis(read):
    turned = read(inp_part("A", *hexahedra()) + inp_assembly({"A-1": ("A", "10, 0, 0\n10, 0, 0, 10, 0, 5, 90.\n")}))
    assert np.allclose(extent(turned), ([6, 0, 0], [10, 4, 4]))
    # Moved to x = 10 ... 14, then a quarter turn about the line along z through the origin.
    turned = read(inp_part("A", *hexahedra()) + inp_assembly({"A-1": ("A", "10, 0, 0\n0, 0, 0, 0, 0, 1, 90.\n")}))
    assert np.allclose(extent(turned), ([-4, 10, 0], [0, 14, 4]))


def test_a_mesh_in_an_instance_and_a_single_part_without_an_assembly_are_read(read):
    nodes, hexes = hexahedra()
    inside = inp_nodes(nodes) + inp_elements("C3D8", hexes, "GEL")
    body = read("*PART, NAME=A\n*END PART\n" + inp_assembly({"A-1": ("A", f"0, 0, 1\n{inside}")}))
    assert sizes(body) == {"GEL": 8} and extent(body) == ([0, 0, 1], [4, 4, 5])
    assert sizes(read(inp_part("A", nodes, hexes))) == {"EA": 8}


def test_sets_of_one_name_in_two_parts_are_told_apart_by_the_part(read):
    parts = inp_part("A", *hexahedra(), elset="GEL") + inp_part("B", *hexahedra(1), elset="GEL")
    body = read(parts + inp_assembly({"A-1": ("A", ""), "B-1": ("B", "9, 0, 0\n")}))
    assert sizes(body) == {"A.GEL": 8, "B.GEL": 1}
    parts = inp_part("A.1", *hexahedra(), elset="GEL") + inp_part("B", *hexahedra(1))
    assert sizes(read(parts + inp_assembly({"A-1": ("A.1", ""), "B-1": ("B", "9, 0, 0\n")}))) == {"GEL": 8, "EB": 1}


def test_sets_may_hold_sets_be_continued_and_leave_out_the_step(read):
    halves = "*ELSET, ELSET=LOWER, GENERATE\n1, 24\n*ELSET, ELSET=UPPER, GENERATE\n25, 48, 1\n"
    assert sizes(read(PLAIN + "*ELSET, ELSET=ALL\nLOWER, UPPER\n" + halves, regions=["ALL"])) == {"ALL": 48}
    assert sizes(read(PLAIN + halves)) == {"LOWER": 24, "UPPER": 24}
    numbers = ", ".join(map(str, range(1, 13)))
    assert sizes(read(PLAIN + f"*ELSET, ELSET=GEL\n{numbers},\n*Elset, elset=gel, generate\n13, 47, 2\n14, 48, 2\n")) == {"GEL": 48}


def test_sections_say_which_sets_are_the_regions(read):
    sets = "*ELSET, ELSET=LOWER, GENERATE\n1, 24\n*ELSET, ELSET=UPPER, GENERATE\n25, 48\n*ELSET, ELSET=ALL\nLOWER, UPPER\n"
    sections = "*SOLID SECTION, ELSET=LOWER, MATERIAL=M\n*SOLID SECTION, ELSET=UPPER, MATERIAL=N\n*MATERIAL, NAME=M\n"
    body = read(PLAIN + sets + sections)
    assert sizes(body) == {"LOWER": 24, "UPPER": 24}
    assert any("ALL" in remark for remark in body.remarks) and any("*MATERIAL" in remark for remark in body.remarks)


def test_a_set_of_the_assembly_takes_elements_of_several_instances(read):
    part = inp_part("A", *hexahedra())
    rest = ("*ELSET, ELSET=LOW, INSTANCE=A-1, GENERATE\n1, 4\n*ELSET, ELSET=LOW, INSTANCE=A-2, GENERATE\n1, 4\n"
            "*ELSET, ELSET=HIGH\nA-1.5, A-1.6, A-1.7, A-1.8, A-2.5, A-2.6, A-2.7, A-2.8\n")
    body = read(part + inp_assembly({"A-1": ("A", ""), "A-2": ("A", "6, 0, 0\n")}, rest), regions=["LOW", "HIGH"])
    assert sizes(body) == {"LOW": 8, "HIGH": 8}
    low = np.concatenate([nodes for region, _, nodes in body.mesh.cells if region == "LOW"])
    assert body.mesh.points[low][..., 2].max() == 2


@pytest.mark.parametrize(("kind", "cells", "bottom", "count"), [
    ("C3D8R", hexahedra()[1], "S1", 4), ("C3D8R", hexahedra()[1], "S2", 4), ("C3D6", cut(hexahedra()[1], WEDGES), "S1", 8)])
def test_a_surface_on_sides_of_elements_becomes_a_face(read, kind, cells, bottom, count):
    lower = bottom == "S1"
    of = range(1, len(cells) // 2 + 1) if lower else range(len(cells) // 2 + 1, len(cells) + 1)
    rows = "".join(f"{number}, {bottom}\n" for number in of)
    body = read(inp_nodes(NODES) + inp_elements(kind, cells, "GEL") + f"*SURFACE, NAME=PRESSED, TYPE=ELEMENT\n{rows}")
    assert sum(map(len, body.mesh.faces["PRESSED"].values())) == count
    assert set(body.mesh.points[body.mesh.face_nodes("PRESSED")][:, 2]) == {0.0 if lower else 4.0}


def test_sides_of_quadratic_tetrahedra_are_numbered_as_in_abaqus(read):
    nodes, cells = quadratic(NODES, TETRA)
    corners = {"S1": [0, 1, 2], "S2": [0, 3, 1], "S3": [1, 3, 2], "S4": [2, 3, 0]}
    rows = "".join(f"{k + 1}, {side}\n" for k, cell in enumerate(cells) for side, of in corners.items()
                   if (nodes[cell[of]][:, 2] == 4).all())
    body = read(inp_nodes(nodes) + inp_elements("C3D10", cells, "GEL") + f"*SURFACE, NAME=TOP\n{rows}")
    assert len(body.mesh.faces["TOP"]["triangle6"]) == 8 and (body.mesh.points[body.mesh.face_nodes("TOP")][:, 2] == 4).all()


def test_a_surface_of_a_set_without_sides_is_its_outside(read):
    body = read(PLAIN + "*ELSET, ELSET=GEL, GENERATE\n1, 48\n*SURFACE, NAME=SKIN\nGEL,\n")
    assert len(body.mesh.faces["SKIN"]["triangle6"]) == 48


def test_a_surface_on_an_element_that_the_deck_does_not_have_is_told(read):
    body = read(PLAIN + "*SURFACE, NAME=FLOOR\n1, S1\n999, S1\n*SURFACE, NAME=LOST\n998, S2\n")
    assert list(body.mesh.faces) == ["FLOOR"]
    assert body.remarks == [f"the surface {name} is without element {number}, which is not among the elements that are read"
                            for name, number in (("FLOOR", 999), ("LOST", 998))]


def test_a_surface_of_the_assembly_names_sets_of_its_instances(read):
    nodes, hexes = hexahedra()
    part = inp_part("A", nodes, hexes).replace("*END PART", "*ELSET, ELSET=TOP, GENERATE, INTERNAL\n5, 8\n*END PART")
    body = read(part + inp_assembly({"A-1": ("A", ""), "A-2": ("A", "0, 0, 9\n")}, "*SURFACE, NAME=UPPER\nA-2.TOP, S2\n"))
    assert body.mesh.points[body.mesh.face_nodes("UPPER")][:, 2].min() == 13
    assert sizes(body) == {"EA": 16} and list(body.mesh.faces) == ["UPPER"]


def test_shells_in_a_set_name_a_face_also_before_the_elements(read):
    bottom = np.array([facet for facet in cut(hexahedra()[1])[:, [0, 1, 2]] if (NODES[facet][:, 2] == 0).all()])
    body = read(inp_nodes(NODES) + inp_elements("S3", bottom, "FLOOR", 1001) + inp_elements("C3D4", TETRA, "GEL"))
    assert sizes(body) == {"GEL": 48} and len(body.mesh.faces["FLOOR"]["triangle6"]) == len(bottom) > 0


@pytest.mark.parametrize("kind", ["C3D4", "C3D4H", "C3D6", "C3D6H", "C3D8", "C3D8H", "C3D8RH", "C3D8I", "C3D8RT", "C3D10", "C3D10H",
                                  "C3D10MH", "C3D10HS", "C3D10I"])
def test_hybrid_reduced_and_coupled_elements_are_elements_of_their_shape(read, kind):
    nodes, hexes = hexahedra()
    pattern = {"C3D4": TETRAHEDRA, "C3D6": WEDGES, "C3D8": [list(range(8))]}.get(kind[:4])
    nodes, cells = quadratic(nodes, cut(hexes)) if pattern is None else (nodes, cut(hexes, pattern))
    body = read(inp_nodes(nodes) + inp_elements(kind, cells, "GEL"))
    assert body.mesh.volume_mm3() == pytest.approx(BLOCK_MM3) and sizes(body) == {"GEL": len(cells)}


@pytest.mark.parametrize(("kind", "geometry", "volume"), [
    ("CAX4", "axisymmetric", np.pi * 64), ("CAX4RH", "axisymmetric", np.pi * 64), ("CPE4H", "plane_strain", 16),
    ("CPE4", "plane_strain", 16)])
def test_the_names_of_plane_elements_state_their_geometry(read, kind, geometry, volume):
    nodes, hexes = hexahedra()
    text = inp_nodes(nodes[:9]) + inp_elements(kind, hexes[:4, :4], "GEL")
    body = read(text)
    assert body.mesh.geometry == geometry and body.mesh.volume_mm3() == pytest.approx(volume) and not body.remarks
    other = read(text, geometry="axisymmetric")
    assert other.mesh.geometry == "axisymmetric" and bool(other.remarks) == (geometry != "axisymmetric")


def test_keywords_in_any_case_with_continued_lines_comments_and_exponents_of_fortran(read):
    text = "** a comment\n" + PLAIN.replace("*ELEMENT, TYPE=C3D4", "*ELEMENT,\nTYPE=C3D4, ELSET=GEL")
    assert sizes(read(text.lower())) == {"gel": 48}
    assert sizes(read("\ufeff" + text.removeprefix("** a comment\n"))) == {"GEL": 48}     # the mark of UTF-8 of Windows
    assert read(text.replace("1, 0, 0, 0\n", "1, 0.D0, 0d+0, 0\n")).mesh.volume_mm3() == pytest.approx(BLOCK_MM3)


def test_elements_over_several_lines_and_nodes_in_several_blocks_are_read(read):
    nodes, cells = quadratic(NODES, TETRA)
    rows = "".join(f"{k + 1}, {', '.join(str(n + 1) for n in cell[:5])},\n{', '.join(str(n + 1) for n in cell[5:])}\n"
                   for k, cell in enumerate(cells))
    text = inp_nodes(nodes[:9]) + inp_nodes(nodes[9:], 10) + f"*ELEMENT, TYPE=C3D10, ELSET=GEL\n{rows}"
    assert read(text).mesh.volume_mm3() == pytest.approx(BLOCK_MM3)


def test_files_are_included_from_the_folder_of_the_deck(read):
    elements = inp_elements("C3D4", TETRA, "GEL")
    for text, files in (("*INCLUDE, INPUT=nodes.inp\n" + elements, {"nodes.inp": inp_nodes(NODES)}),
                        ("*include, input=\"all.inp\"\n", {"all.inp": "*INCLUDE, INPUT=nodes.inp\n" + elements,
                                                             "nodes.inp": inp_nodes(NODES)}),
                        ("*INCLUDE, INPUT=.\\nodes.inp\n" + elements, {"nodes.inp": inp_nodes(NODES)}),
                        ("*NODE, INPUT=nodes.dat\n" + elements, {"nodes.dat": inp_nodes(NODES).partition("\n")[2]})):
        assert sizes(read(text, files)) == {"GEL": 48}


def test_what_is_no_part_of_a_body_is_left_out_with_a_word(read):
    more = inp_elements("SPRINGA", [[0, 1]], "", 901) + inp_elements("T3D2", [[0, 1], [1, 2]], "", 911)
    surface = "*NSET, NSET=N\n1\n*SURFACE, NAME=S, TYPE=NODE\nN\n*STEP\n*ELEMENT, TYPE=C3D4\n*END STEP\n"
    parts = "*PART, NAME=SPARE\n*END PART\n*PART, NAME=B\n*END PART\n*INSTANCE, NAME=B-1, PART=B\n*END INSTANCE\n"
    body = read(PLAIN + more + surface + parts)
    told = " / ".join(body.remarks)
    assert all(word in told for word in ("1 SPRINGA, 2 T3D2", "surface S", "*STEP", "SPARE has no instance"))
    assert body.mesh.volume_mm3() == pytest.approx(BLOCK_MM3)


def test_what_cannot_be_read_right_is_refused_with_the_line(read):
    part = inp_part("A", *hexahedra())
    for text, told in [
        (PLAIN + "*NGEN\n1, 5, 1\n", r"line \d+: \*NGEN"),
        (PLAIN.replace("C3D4", "C3D15V"), "C3D15V are not taken"),
        (PLAIN + inp_elements("COH3D8", [range(8)], "", 900), "COH3D8 are not taken"),
        (PLAIN.replace("TYPE=C3D4", "ELSET=A"), "has no TYPE="),
        (inp_nodes(NODES) + "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3\n", "3 nodes in place of 4"),
        (inp_nodes(NODES) + "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 4, 5, 6\n", "6 nodes in place of 4"),
        (inp_nodes(NODES) + "*ELEMENT, TYPE=C3D4\n1, 1, 2, 3, 99\n", "element 1 has the node 99, which is not defined"),
        (inp_nodes(NODES) + "*ELEMENT, TYPE=C3D4\n1, 1, 2, x, 9\n", "line 30: '1, 1, 2, x, 9'"),
        (PLAIN + inp_elements("C3D4", TETRA[:1]), "element 1 is defined 2 times"),
        (PLAIN + inp_elements("C3D4", TETRA[:1], "", 900), "1 elements stand there twice"),
        (PLAIN + "*NODE\n1, 9, 9, 9\n", "node 1 has a second place"),
        (inp_nodes(NODES, head="*NODE, SYSTEM=C") + inp_elements("C3D4", TETRA), "cylindrical"),
        (PLAIN + "*ELSET, ELSET=ALL\nLOWER\n", "no set 'LOWER'"),
        (PLAIN + "*ELSET, ELSET=A\nB\n*ELSET, ELSET=B\nA\n", "contains itself"),
        (PLAIN + "*ELSET, ELSET=A, GENERATE\n5, 1\n", "is no range"),
        (PLAIN + "*SURFACE, NAME=S\n1, S5\n", "4 sides have no side S5"),
        (PLAIN + "*SURFACE, NAME=S\n1, S9\n", "'S9' is no side"),
        (PLAIN + "*SURFACE, NAME=S\nGEL, S1\n", "no set 'GEL'"),
        (part + inp_assembly({"B-1": ("B", "")}), "no part 'B'"),
        (part + part, "second part is called 'A'"),
        (part + inp_part("B", *hexahedra()), "no \\*INSTANCE"),
        (part + inp_assembly({"A-1": ("A", "1, 2, 3\n1, 2\n3\n")}), "a translation and a rotation"),
        (part + inp_assembly({"A-1": ("A", "nan, 0, 0\n")}), "not finite"),
        (part + inp_assembly({"A-1": ("A", "")}, "*ELSET, ELSET=X, INSTANCE=A-9\n1\n"), "no instance 'A-9'"),
        ("*INCLUDE, INPUT=none.inp\n", "none.inp: there is no such file, which deck.inp includes in line 1"),
        ("*INCLUDE, INPUT=deck.inp\n", "includes itself"),
        ("*INCLUDE\n", "names no file"),
        ("no deck", "no elements"),
    ]:
        with pytest.raises(InputError, match=told) as refusal:
            read(text)
        assert "\n" not in str(refusal.value)


def test_files_that_include_each_other_ever_deeper_end(read):
    files = {f"f{k}.inp": f"*INCLUDE, INPUT=f{k + 1}.inp\n" for k in range(1, 20)}
    with pytest.raises(InputError, match="more than 8 deep"):
        read("*INCLUDE, INPUT=f1.inp\n", files)
