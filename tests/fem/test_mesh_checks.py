"""Elements that do not meet are refused with the kinds and a place; pieces that touch or overlap are told."""

import re

import meshio
import numpy as np
import pytest

from softtact.errors import InputError, MeshWarning
from softtact.fem.files.solids import read_body, read_mesh_file
from tests.support.element_files import BLOCK_MM3, TETRAHEDRA, WEDGES, cut, hexahedra

NODES, HEXES = hexahedra()
TETRA = cut(HEXES)


@pytest.fixture
def read(tmp_path):
    """A function that reads nodes and cells [(kind, cells)] from a file."""
    def of(nodes, *cells, reader=read_body):
        meshio.Mesh(nodes, list(cells)).write(tmp_path / "body.vtk")
        return reader(tmp_path / "body.vtk", unit="mm")
    return of


def both(nodes, shift, turn=None):
    """Two bodies of the same nodes, the other moved."""
    return np.vstack([nodes, (nodes if turn is None else nodes @ turn) + shift])


@pytest.mark.parametrize(("pattern", "kind", "name"), [(TETRAHEDRA, "tetra", "tetrahedra"), (WEDGES, "wedge", "wedges")])
def test_hexahedra_on_triangles_are_refused_with_both_kinds_and_a_place(read, pattern, kind, name):
    lower = slice(0, 4)
    cells = cut(HEXES[lower], pattern)
    with pytest.raises(InputError, match=f"a face of hexahedra lies on two triangles of {name} \\(at 1, 1, 2 mm\\)"):
        read(NODES, ("hexahedron", HEXES[4:]), (kind, cells))


def test_hexahedra_beside_wedges_that_share_their_quadrilaterals_are_read(read):
    body = read(NODES, ("hexahedron", HEXES[::2]), ("wedge", cut(HEXES[1::2], WEDGES)))
    assert body.mesh.volume_mm3() == pytest.approx(BLOCK_MM3) and body.pieces == 1 and not body.remarks


def test_triangles_of_neighbours_that_cross_are_refused(read):
    turned = cut(HEXES[4:][:, [1, 2, 3, 0, 5, 6, 7, 4]])      # their diagonals at z = 2 are the other ones
    with pytest.raises(InputError, match="the triangles of two neighbours cross"):
        read(NODES, ("tetra", np.vstack([cut(HEXES[:4]), turned])))
    assert read(NODES, ("tetra", TETRA)).pieces == 1
    assert read(NODES[[0, 1, 3, 9]], ("tetra", [[0, 1, 2, 3]])).pieces == 1      # four corners, but not in a plane


@pytest.mark.parametrize(("shift", "told"), [
    ([0, 0, 4], r"two pieces of body touch at [\d., ]*4 mm"), ([1, 1, 4], r"two pieces of body touch at [\d., ]*4 mm"),
    ([0, 0, 3], r"two pieces of body overlap by 1 mm or more at .*, so that about 1\d mm3 count twice"),
    ([1.7, 0.9, 1.3], "two pieces of body overlap"), ([0, 0, 4.1], None)])
def test_pieces_that_touch_or_overlap_are_told_with_a_place(read, shift, told):
    for cells in (("tetra", TETRA), ("hexahedron", HEXES)):
        body = read(both(NODES, shift), (cells[0], np.vstack([cells[1], cells[1] + len(NODES)])))
        assert body.pieces == 2 and body.mesh.volume_mm3() == pytest.approx(2 * BLOCK_MM3)
        assert body.remarks[0] == "the body is in 2 pieces that share no node" and len(body.remarks) == 1 + bool(told)
        assert told is None or re.search(told, body.remarks[1])


def test_bars_that_cross_without_a_node_in_each_other_overlap(read):
    bar, turn = NODES * [5, 0.2, 0.2], np.array([[0, 1, 0], [1, 0, 0], [0, 0, 1]])
    hexes = np.vstack([HEXES, HEXES[:, [0, 3, 2, 1, 4, 7, 6, 5]] + len(NODES)])      # a mirrored one
    body = read(both(bar, [0, 0, 0], turn) + np.repeat([[0, 0, 0], [10, -10, 0.1]], len(NODES), axis=0), ("hexahedron", hexes))
    assert "overlap" in body.remarks[1]


def test_plane_pieces_are_told_too(read):
    square, quads = NODES[:9], HEXES[:4, :4]
    for shift, told in (([4, 0, 0], "touch at 4, 2, 0 mm"), ([3, 0, 0], "overlap by 1 mm or more"), ([5, 0, 0], None)):
        body = read(both(square, shift), ("quad", np.vstack([quads, quads + 9])),
                    reader=lambda path, unit: read_body(path, unit=unit, geometry="plane_strain"))
        assert body.pieces == 2 and (told in body.remarks[1] if told else len(body.remarks) == 1)


def test_small_elements_that_hang_on_a_large_one_are_told(read):
    (fine, small), large = hexahedra(2, 4.0), hexahedra(1, 4.0, (0, 0, -4))[0]
    corners = [0, 2, 6, 8]
    nodes = np.vstack([fine, large[:4]])
    hexes = np.array([[27, 28, 30, 29, *np.array(corners)[[0, 1, 3, 2]]]])
    body = read(nodes, ("hexahedron", np.vstack([small, hexes])))
    assert body.pieces == 1 and "pairs of nodes of one piece lie in one place" in body.remarks[0]


def test_elements_that_share_no_node_at_all_are_told(read):
    nodes, hexes = hexahedra(3)
    body = read(nodes[hexes].reshape(-1, 3), ("hexahedron", np.arange(27 * 8).reshape(-1, 8)))
    assert body.pieces == 27 and body.remarks[0] == "the body is in 27 pieces that share no node"
    assert "pairs of nodes lie in one place and are not joined" in body.remarks[1]


def test_an_axisymmetric_body_that_reaches_beyond_its_axis_is_refused(read):
    def axisymmetric(path, unit):
        return read_body(path, unit=unit, geometry="axisymmetric")
    square, quads = NODES[:9], HEXES[:4, :4]
    assert read(square, ("quad", quads), reader=axisymmetric).mesh.volume_mm3() == pytest.approx(64 * np.pi)
    with pytest.raises(InputError, match=r"10 nodes lie beyond the axis x = 0 \(one at -2, "):
        read(square - [2, 0, 0], ("quad", quads), reader=axisymmetric)


def test_collapsed_and_repeated_elements_are_refused(read):
    with pytest.raises(InputError, match="1 elements have a node twice"):
        read(NODES, ("hexahedron", np.vstack([HEXES[1:], [[0, 1, 4, 4, 9, 10, 13, 13]]])))
    with pytest.raises(InputError, match="2 elements stand there twice"):
        read(NODES, ("tetra", np.vstack([TETRA, TETRA[:2]])))


def test_a_reader_without_a_report_warns(read):
    with pytest.warns(MeshWarning, match="body.vtk: the body is in 2 pieces"):
        mesh = read(both(NODES, [9, 0, 0]), ("tetra", np.vstack([TETRA, TETRA + len(NODES)])), reader=read_mesh_file)
    assert mesh.volume_mm3() == pytest.approx(2 * BLOCK_MM3)
