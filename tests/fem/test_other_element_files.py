"""Formats that meshio reads: numbers of materials become regions, and cells that it leaves out are refused by their names."""

import meshio
import numpy as np
import pytest

from softtact.errors import InputError
from softtact.fem.files.solids import read_body, write_mesh
from softtact.fem.structured_meshes import box
from tests.support.element_files import BLOCK_MM3, block, hexahedra, skin

NODES, TETRA = block()
NUMBER = np.where(NODES[TETRA].mean(axis=1)[:, 2] > 2, 7, 3)
TOP = skin(NODES, TETRA)[0]


def vtu(nodes, blocks, piece=1, **arrays):
    """A VTU file of blocks [(VTK's type, cells)] and arrays of whole numbers on all cells."""
    def array(name, values, kind="Int64"):
        return f'<DataArray type="{kind}" Name="{name}" format="ascii">{" ".join(map(str, values))}</DataArray>'
    cells = [cell for _, block in blocks for cell in block]
    types = [kind for kind, block in blocks for _ in block]
    data = "".join(array(name, values) for name, values in arrays.items())
    one = (f'<Piece NumberOfPoints="{len(nodes)}" NumberOfCells="{len(cells)}"><Points><DataArray type="Float64" '
           f'NumberOfComponents="3" format="ascii">{" ".join(f"{v:g}" for v in np.ravel(nodes))}</DataArray></Points><Cells>'
           + array("connectivity", [n for cell in cells for n in cell]) + array("offsets", np.cumsum(list(map(len, cells))))
           + array("types", types, "UInt8") + f"</Cells><CellData>{data}</CellData></Piece>")
    return ('<?xml version="1.0"?><VTKFile type="UnstructuredGrid" version="0.1" byte_order="LittleEndian"><UnstructuredGrid>'
            + one * piece + "</UnstructuredGrid></VTKFile>")


def medit(folder):
    rows = "".join(f"{' '.join(str(n + 1) for n in cell)} {number}\n" for cell, number in zip(TETRA, NUMBER, strict=True))
    facets = "".join(f"{' '.join(str(n + 1) for n in facet)} 5\n" for facet in TOP)
    (folder / "body.mesh").write_text("MeshVersionFormatted 2\nDimension 3\nVertices\n27\n"
                                      + "".join(f"{x:g} {y:g} {z:g} 0\n" for x, y, z in NODES)
                                      + f"Triangles\n{len(TOP)}\n{facets}Tetrahedra\n{len(TETRA)}\n{rows}End\n")
    return folder / "body.mesh"


def nastran(folder, card="CTETRA"):
    grid = "".join(f"GRID,{k + 1},,{x:.1f},{y:.1f},{z:.1f}\n" for k, (x, y, z) in enumerate(NODES))
    cards = "".join(f"{card},{k + 1},{number},{','.join(str(n + 1) for n in cell)}\n"
                    for k, (cell, number) in enumerate(zip(TETRA, NUMBER, strict=True)))
    (folder / "body.bdf").write_text(f"BEGIN BULK\n{grid}{cards}ENDDATA\n")
    return folder / "body.bdf"


def tetgen(folder):
    (folder / "body.node").write_text("27 3 0 0\n" + "".join(f"{k + 1} {x:g} {y:g} {z:g}\n" for k, (x, y, z) in enumerate(NODES)))
    rows = [f"{k + 1} {' '.join(str(n + 1) for n in cell)} {number}\n" for k, (cell, number)
            in enumerate(zip(TETRA, NUMBER, strict=True))]
    (folder / "body.ele").write_text("48 4 1\n" + "".join(rows))
    return folder / "body.ele"


def paraview(folder, name="MaterialIDs"):
    (folder / "body.vtu").write_text(vtu(NODES, [(10, TETRA)], **{name: NUMBER}))
    return folder / "body.vtu"


def med(folder):
    mesh = meshio.Mesh(NODES, [("tetra", TETRA)], cell_data={"cell_tags": [np.where(NUMBER == 7, -7, -3)]})
    mesh.cell_tags = {-7: ["7"], -3: ["3"]}
    mesh.write(folder / "body.med")
    return folder / "body.med"


@pytest.mark.parametrize("write", [medit, nastran, tetgen, paraview, med])
def test_materials_by_number_become_regions(write, tmp_path):
    body = read_body(write(tmp_path), unit="mm")
    assert {region: len(nodes) for region, _, nodes in body.mesh.cells} == {"3": 24, "7": 24}
    upper = np.concatenate([nodes for region, _, nodes in body.mesh.cells if region == "7"])
    assert body.mesh.points[upper][..., 2].min() == 2 and body.mesh.volume_mm3() == pytest.approx(BLOCK_MM3)


def test_numbers_of_facets_become_faces(tmp_path):
    assert len(read_body(medit(tmp_path), unit="mm").mesh.faces["5"]["triangle6"]) == 8


def test_one_number_for_all_elements_distinguishes_nothing(tmp_path):
    (tmp_path / "body.vtu").write_text(vtu(NODES, [(10, TETRA)], MaterialIDs=[4] * len(TETRA)))
    assert read_body(tmp_path / "body.vtu", unit="mm").mesh.regions == ["body"]


@pytest.mark.parametrize("kind", ["tetrahedra", "hexahedra"])
def test_cells_of_vtk_that_are_others_by_another_name_are_taken(kind, tmp_path):
    nodes, hexes = hexahedra()
    blocks = {"tetrahedra": [(10, TETRA[:9]), (71, TETRA[9:])], "hexahedra": [(12, hexes[4:]), (72, hexes[:4])]}[kind]
    (tmp_path / "body.vtu").write_text(vtu(nodes, blocks))
    assert read_body(tmp_path / "body.vtu", unit="mm").mesh.volume_mm3() == pytest.approx(BLOCK_MM3)


def test_cells_that_are_not_taken_are_refused_by_name(tmp_path):
    nodes, hexes = hexahedra()
    voxels = hexes[:, [0, 1, 3, 2, 4, 5, 7, 6]]
    for blocks, told in [
        ([(10, TETRA[24:]), (11, voxels[:4])], "voxel, type 11 of VTK"),
        ([(12, hexes[4:]), (11, voxels[:4])], "voxel, type 11 of VTK"),
        ([(12, hexes[4:]), (79, hexes[:4])], "vtk_bezier_hexahedron"),
        ([(10, TETRA), (8, hexes[2:4, [0, 1, 3, 2]])], "pixel"),
        ([(12, hexes[4:]), (65, hexes[:4])], "type 65 of VTK"),
        ([(12, hexes[4:]), (7, hexes[:4, :5])], "polygon"),
        ([(12, hexes[4:]), (14, hexes[:4, :5])], "pyramid"),
    ]:
        (tmp_path / "body.vtu").write_text(vtu(nodes, blocks))
        with pytest.raises(InputError, match=told) as refusal:
            read_body(tmp_path / "body.vtu", unit="mm")
        assert "body.vtu" in str(refusal.value) and "\n" not in str(refusal.value)


def test_a_file_of_which_cells_would_be_lost_is_refused(tmp_path):
    (tmp_path / "body.vtu").write_text(vtu(NODES, [(10, TETRA)], piece=2))
    with pytest.raises(InputError, match="only 48 of its 96 cells can be read; save it in one piece"):
        read_body(tmp_path / "body.vtu", unit="mm")
    text = nastran(tmp_path).read_text()
    for wrong, told in ((text.replace("CTETRA,9,", "CTETRA*,9,"), "only 47 of its 48 cells"),
                        (text.replace("GRID,4,,", "GRID,4,1,"), "field CP of GRID")):
        (tmp_path / "body.bdf").write_text(wrong)
        with pytest.raises(InputError, match=told):
            read_body(tmp_path / "body.bdf", unit="mm")


def test_a_region_and_a_face_of_one_name_survive_softtact_s_own_file(tmp_path):
    mesh = box((0, 0, 0), (1, 1, 1), (1, 1, 1), region="gel").with_faces(gel=lambda middles: middles[:, 2] > 0.9)
    write_mesh(mesh, tmp_path / "body.vtu")
    found = read_body(tmp_path / "body.vtu")
    assert found.mesh.regions == ["gel"] and len(found.mesh.faces["gel"]["quad9"]) == 1 and not found.remarks


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("shape", ["tetra", "hexahedron"])
def test_elements_of_med_are_turned_the_other_way_round(shape, order, tmp_path):
    nodes, cells = (NODES, TETRA) if shape == "tetra" else hexahedra()
    corners = {"tetra": [0, 2, 1, 3], "hexahedron": [0, 3, 2, 1, 4, 7, 6, 5]}[shape]
    turned, kind = cells[:, corners], shape
    if order == 2:      # the edges of the turned corners in the order of the manual of MED
        edges = {"tetra": [(0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)],
                 "hexahedron": [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]}
        pairs = turned[:, edges[shape]].reshape(-1, 2)
        kind, middles = {"tetra": "tetra10", "hexahedron": "hexahedron20"}[shape], np.arange(len(pairs)).reshape(len(turned), -1)
        turned, nodes = np.hstack([turned, len(nodes) + middles]), np.vstack([nodes, nodes[pairs].mean(axis=1)])
        nodes, number = np.unique(nodes, axis=0, return_inverse=True)
        turned = number.ravel()[turned]
    meshio.Mesh(nodes, [(kind, turned)]).write(tmp_path / "body.med")
    assert read_body(tmp_path / "body.med", unit="mm").mesh.volume_mm3() == pytest.approx(BLOCK_MM3)


def test_bulk_data_of_nastran_needs_no_beginning_and_may_be_in_small_letters(tmp_path):
    text = nastran(tmp_path).read_text()
    for written in (text.removeprefix("BEGIN BULK\n"), text.lower(), "SOL 101\nCEND\nTITLE = x\n" + text):
        (tmp_path / "body.bdf").write_text(written)
        assert read_body(tmp_path / "body.bdf", unit="mm").mesh.regions == ["3", "7"]
    for card, told in (("include 'nodes.bdf'", "include 'nodes.bdf' is not read; put that file in its place"),
                       ("GRDSET,,5", "GRDSET is not read")):
        (tmp_path / "body.bdf").write_text(text.replace("BULK\n", f"BULK\n{card}\n"))
        with pytest.raises(InputError, match=told):
            read_body(tmp_path / "body.bdf", unit="mm")


def test_an_array_that_may_name_regions_is_told_where_it_is_left_out(tmp_path):
    body = read_body(paraview(tmp_path, name="label"), unit="mm")
    assert body.mesh.regions == ["body"] and "the array label of whole numbers is left out" in body.remarks[0]


def test_whole_numbers_of_pyvista_in_old_vtk_files_are_read(tmp_path):
    meshio.Mesh(NODES, [("tetra", TETRA)], cell_data={"MaterialIDs": [NUMBER]}).write(tmp_path / "body.vtk", binary=False)
    text = (tmp_path / "body.vtk").read_text()
    (tmp_path / "body.vtk").write_text(text.replace("MaterialIDs 1 48 vtktypeint64", "MaterialIDs 1 48 long"))
    assert " long" in (tmp_path / "body.vtk").read_text()
    assert read_body(tmp_path / "body.vtk", unit="mm").mesh.regions == ["3", "7"]
