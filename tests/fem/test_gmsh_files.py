"""Files of Gmsh keep every group of every entity, in msh 2.2 and 4.1, as text and binary; what cannot be read is refused."""

import meshio
import numpy as np
import pytest

from softtact.errors import InputError
from softtact.fem.files.gmsh import read_gmsh
from softtact.fem.files.solids import read_body
from tests.support.element_files import BLOCK_MM3, block, hexahedra, msh22, msh41, quadratic, skin

NODES, TETRA = block()
TOP, BOTTOM, SIDE = skin(NODES, TETRA)
UPPER = NODES[TETRA].mean(axis=1)[:, 2] > 2
NAMES = [(2, 2, "top"), (2, 3, "skin"), (2, 4, "base"), (3, 1, "gel")]


@pytest.fixture(params=["2.2", "2.2 binary", "4.1", "4.1 binary"])
def read(request, tmp_path):
    """A function that reads a mesh of entities [(dimension, number, groups, Gmsh's type, cells)] in each format."""
    def of(entities, names=(), nodes=NODES, **options):
        binary = "binary" in request.param
        if request.param.startswith("4.1"):
            content = msh41(nodes, entities, names, binary)
        else:       # an element stands once for each of its groups
            rows = [(kind, group, number, cells) for _, number, groups, kind, cells in entities for group in groups or [0]]
            content = msh22(nodes, rows, names, binary)
        (tmp_path / "body.msh").write_bytes(content)
        return read_body(tmp_path / "body.msh", unit="mm", **options)
    return of


def facets(body):
    return {name: sum(map(len, face.values())) for name, face in body.mesh.faces.items()}


def test_a_surface_of_two_groups_belongs_to_both_faces(read):
    body = read([(2, 1, [2, 3], 2, TOP), (2, 2, [3], 2, SIDE), (2, 3, [4], 2, BOTTOM), (3, 1, [1], 4, TETRA)], NAMES)
    assert facets(body) == {"top": 8, "skin": 40, "base": 8}
    assert body.mesh.regions == ["gel"] and body.mesh.volume_mm3() == pytest.approx(BLOCK_MM3) and not body.remarks


def test_a_volume_of_two_groups_is_refused_until_the_regions_are_named(read):
    entities, names = [(3, 1, [1, 5], 4, TETRA)], [(3, 1, "gel"), (3, 5, "all")]
    with pytest.raises(InputError, match="is in 2 regions, of the sets gel, all"):
        read(entities, names)
    body = read(entities, names, regions=["all"])
    assert body.mesh.regions == ["all"] and body.mesh.volume_mm3() == pytest.approx(BLOCK_MM3)
    assert body.remarks == ["sets that are no regions: gel (--region names others)"]


def test_one_name_may_be_that_of_a_surface_and_of_a_volume(read):
    body = read([(2, 1, [2], 2, TOP), (3, 1, [1], 4, TETRA)], [(2, 2, "gel"), (3, 1, "gel")])
    assert body.mesh.regions == ["gel"] and facets(body) == {"gel": 8}


def test_elements_without_a_group_beside_others_are_left_out_with_a_word(read):
    body = read([(2, 1, [5], 2, TOP), (2, 2, [], 2, BOTTOM), (3, 1, [1], 4, TETRA[UPPER]), (3, 2, [], 4, TETRA[~UPPER])],
                [(2, 5, "top"), (3, 1, "gel")])
    assert body.mesh.volume_mm3() == pytest.approx(BLOCK_MM3 / 2) and facets(body) == {"top": 8}
    assert body.remarks[0] == "24 elements that are in no physical group are left out" and "8 facets" in body.remarks[1]


def test_groups_without_names_are_called_by_their_numbers(read):
    body = read([(2, 1, [7], 2, TOP), (3, 1, [1], 4, TETRA[UPPER]), (3, 2, [2], 4, TETRA[~UPPER])])
    assert sorted(body.mesh.regions) == ["1", "2"] and facets(body) == {"7": 8}
    assert read([(3, 1, [1], 4, TETRA)]).mesh.regions == ["body"]      # one number for all distinguishes nothing


def test_elements_without_any_group_are_the_body(read):
    assert read([(3, 1, [], 4, TETRA)]).mesh.regions == ["body"]


def test_quadratic_elements_keep_their_nodes(read):
    nodes, cells = quadratic(NODES, TETRA)
    of_gmsh = cells[:, [0, 1, 2, 3, 4, 5, 6, 7, 9, 8]]
    assert read([(3, 1, [1], 11, of_gmsh)], nodes=nodes).mesh.volume_mm3() == pytest.approx(BLOCK_MM3)


@pytest.mark.parametrize("kind", ["hexahedron27", "hexahedron20", "quad9", "tetra10"])
def test_the_order_of_nodes_of_gmsh_is_that_of_meshio(tmp_path, kind):
    count = int("".join(filter(str.isdigit, kind)))
    points = np.random.default_rng(1).random((count, 3))
    for form in ("gmsh", "gmsh22"):
        for binary in (True, False):
            meshio.Mesh(points, [(kind, [np.arange(count)])]).write(tmp_path / "one.msh", file_format=form, binary=binary)
            raw = read_gmsh(tmp_path / "one.msh")
            nodes = dict(raw.blocks)[kind]
            assert np.allclose(raw.points[nodes[0]], points)


def test_a_wedge_of_second_order_has_its_nodes_where_gmsh_puts_them(read):
    """After the figure of Prism18 in Gmsh's manual: which corners each further node lies between."""
    between = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 4), (2, 5), (3, 4), (3, 5), (4, 5), (0, 1, 4, 3), (0, 2, 5, 3), (1, 2, 5, 4)]
    corners = np.array([[0, 0, 0], [3, 0, 0], [0, 2, 0], [0, 0, 4], [3, 0, 4], [0, 2, 4]], dtype=float)
    nodes = np.vstack([corners, *(corners[list(of)].mean(axis=0) for of in between)])
    body = read([(3, 1, [1], 13, np.arange(18)[None])], nodes=nodes)
    element = body.mesh.cells[0]
    assert element[1] == "wedge18" and body.mesh.volume_mm3() == pytest.approx(12)
    assert np.allclose(nodes[element[2][0]][:, 2], [0] * 6 + [4] * 6 + [2] * 6)


def test_copies_of_elements_count_once_and_are_told(tmp_path):
    (tmp_path / "body.msh").write_bytes(msh22(NODES, [(4, 1, 1, TETRA), (4, 1, 1, TETRA[:3])], [(3, 1, "gel")]))
    body = read_body(tmp_path / "body.msh", unit="mm")
    assert body.mesh.volume_mm3() == pytest.approx(BLOCK_MM3) and "3 elements or facets stand there again" in body.remarks[0]


def test_what_cannot_be_read_right_is_refused(tmp_path):
    good, whole = msh22(NODES, [(4, 1, 1, TETRA)]), msh41(NODES, [(3, 1, [1], 4, TETRA)])
    nodes, hexes = hexahedra()
    for content, told in [
        (good.replace(b"2.2 0 8", b"4.0 0 8"), "save it as 4.1 or 2.2"),
        (good[:-400], "does not end"),
        (good.replace(b"$Elements\n48", b"$Elements\n49"), "fewer numbers than it states"),
        (whole.replace(b"1 27 1 27", b"1 27 1 27 x"), "words stand where numbers belong"),
        (whole.replace(b"$Elements", b"$PartitionedEntities\n$EndPartitionedEntities\n$Elements"), "without partitions"),
        (msh22(nodes, [(92, 1, 1, np.tile(hexes, 8))]), "Gmsh's type 92"),
        (msh22(nodes[:20], [(5, 1, 1, hexes)]), r"has the node \d+, which is not in the file"),
        (good.replace(b"\n2 2 0 0\n", b"\n1 2 0 0\n"), "two nodes have the same number"),
        (good.replace(b"\n2 2 0 0\n", b"\n2 nan 0 0\n"), "not a finite number"),
        (good.replace(b"\n2 2 0 0\n", b"\n2 1e200 0 0\n"), "below 1e\\+06 mm"),
        (b"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n", "no nodes"),
    ]:
        (tmp_path / "body.msh").write_bytes(content)
        with pytest.raises(InputError, match=told) as refusal:
            read_body(tmp_path / "body.msh", unit="mm")
        assert "\n" not in str(refusal.value)


def test_comments_may_stand_before_the_format(tmp_path):
    content = msh22(NODES, [(4, 1, 1, TETRA)], [(3, 1, "gel")])
    (tmp_path / "body.msh").write_bytes(b"$Comments\nby hand\n$EndComments\n" + content)
    assert read_body(tmp_path / "body.msh", unit="mm").mesh.regions == ["gel"]


def test_groups_whose_elements_have_lost_them_are_told(tmp_path):
    (tmp_path / "body.msh").write_bytes(msh22(NODES, [(4, 0, 1, TETRA)], NAMES))
    body = read_body(tmp_path / "body.msh", unit="mm")
    assert body.mesh.regions == ["body"] and "groups without elements: top, skin, base, gel" in body.remarks[0]


def test_a_face_between_two_regions_is_left_out_with_a_word(read):
    hexes = hexahedra()[1]
    between = hexes[:4, 4:]
    body = read([(2, 1, [2], 3, between), (3, 1, [1], 5, hexes[:4]), (3, 2, [3], 5, hexes[4:])],
                [(2, 2, "interface"), (3, 1, "lower"), (3, 3, "upper")])
    assert body.mesh.regions == ["lower", "upper"] and not body.mesh.faces
    assert body.remarks == ["the face interface is left out, because 4 of its facets are inside the body"]
