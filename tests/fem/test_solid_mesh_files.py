"""Meshes of solids keep their regions and faces in files; those of other programs become quadratic, and faults are named."""

import meshio
import numpy as np
import pytest

from softtact.errors import InputError
from softtact.fem.files.solids import read_mesh_file, write_mesh
from softtact.fem.quadratic_nodes import raised
from softtact.fem.structured_meshes import box

CUBE = np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], dtype=float)
TETRAHEDRA = np.array([[0, 1, 3, 4], [1, 2, 3, 6], [1, 3, 4, 6], [1, 4, 5, 6], [3, 4, 6, 7]])      # of CUBE's eight corners


def write(path, kinds, **data):
    form = "gmsh22" if path.suffix == ".msh" else None     # meshio's writer of the newer format drops the names of groups
    meshio.Mesh(CUBE, kinds, **data).write(path, file_format=form)
    return path


def test_a_written_mesh_is_read_back_with_regions_faces_and_geometry(tmp_path):
    lower, upper = box((0, 0, 0), (2, 2, 1), (2, 1, 1), region="gel"), box((0, 0, 1), (2, 2, 2), (1, 2, 1), region="skin")
    for mesh in (lower.joined(upper, prefix="upper "), box((1, 0), (2, 3), (2, 2), geometry="axisymmetric"),
                 box((1, 0), (2, 3), (2, 2), thickness_mm=4.0)):
        write_mesh(mesh, tmp_path / "body.vtu", {"temperature": np.arange(len(mesh.points), dtype=float)})
        found = read_mesh_file(tmp_path / "body.vtu")
        assert np.array_equal(found.points, mesh.points)
        assert found.regions == mesh.regions and found.faces.keys() == mesh.faces.keys()
        assert (found.geometry, found.thickness_mm) == (mesh.geometry, mesh.thickness_mm)
        for own, other in zip(mesh.cells, found.cells, strict=True):
            assert own[:2] == other[:2] and np.array_equal(own[2], other[2])
        for name in mesh.faces:
            assert np.array_equal(found.face_nodes(name), mesh.face_nodes(name))


def test_names_with_signs_of_xml_are_written_and_read(tmp_path):
    names = ["gel & skin", "gel <30A>", 'the "soft" one', "a&amp;b", "two\nlines"]
    for name in names:
        mesh = box((0, 0, 0), (1, 1, 1), (1, 1, 1), region=name).with_faces(**{name: lambda x: x[:, 2] > 0.9})
        write_mesh(mesh, tmp_path / "body.vtu", {name: np.arange(27.0)})
        found = read_mesh_file(tmp_path / "body.vtu")
        assert found.regions == [name] and np.array_equal(found.face_nodes(name), mesh.face_nodes(name))
        assert np.array_equal(meshio.read(tmp_path / "body.vtu").point_data[name], np.arange(27.0))


def test_a_unit_a_geometry_or_a_thickness_that_is_not_that_of_the_file_is_refused(tmp_path):
    for name, mesh in (("solid", box((0, 0, 0), (1, 2, 3), (1, 1, 1))), ("plane", box((0, 0), (1, 2), (1, 1), thickness_mm=5.0)),
                       ("ring", box((0, 0), (1, 2), (1, 1), geometry="axisymmetric"))):
        write_mesh(mesh, tmp_path / f"{name}.vtu")
        again = {"unit": "mm", "geometry": mesh.geometry} | ({"thickness_mm": 5.0} if name == "plane" else {})
        assert read_mesh_file(tmp_path / f"{name}.vtu", **again).volume_mm3() == pytest.approx(mesh.volume_mm3(), rel=1e-12)
    for name, options, told in [
        ("solid", {"unit": "m"}, "unit is given as m, and softtact wrote the file in mm; leave the unit out"),
        ("solid", {"geometry": "axisymmetric"}, "given as axisymmetric, and that of the file is solid"),
        ("solid", {"thickness_mm": 2.0}, "thickness of 2 mm has no effect on a mesh of the geometry 'solid'"),
        ("plane", {"geometry": "axisymetric"}, "given as axisymetric, and that of the file is plane_strain"),
        ("plane", {"thickness_mm": 2.0}, "thickness is given as 2 mm, and that of the file is 5 mm"),
        ("ring", {"thickness_mm": 2.0}, "thickness of 2 mm has no effect on a mesh of the geometry 'axisymmetric'"),
    ]:
        with pytest.raises(InputError, match=rf"{name}.vtu: .*{told}"):
            read_mesh_file(tmp_path / f"{name}.vtu", **options)


def test_a_plane_mesh_needs_a_thickness_above_0_and_may_lie_beside_z_0_by_round_off(tmp_path):
    square, noise = [("quad", np.arange(4)[None])], CUBE.copy()
    noise[3, 2] = 1e-13
    meshio.Mesh(noise, square).write(tmp_path / "square.vtu")
    mesh = read_mesh_file(tmp_path / "square.vtu", unit="mm", geometry="plane_strain", thickness_mm=2.0)
    assert mesh.volume_mm3() == pytest.approx(2.0) and not mesh.points[:, 2].any()
    for thickness in (0.0, -2.0, np.nan, np.inf):
        with pytest.raises(InputError, match=rf"square.vtu: The thickness of the body is {thickness:g} mm; give a positive"):
            read_mesh_file(tmp_path / "square.vtu", unit="mm", geometry="plane_strain", thickness_mm=thickness)


def test_linear_elements_of_every_kind_become_quadratic_ones_of_the_same_volume(tmp_path):
    wedges = np.array([[0, 1, 2, 4, 5, 6], [0, 2, 3, 4, 6, 7]])
    for cells, kind in [([("tetra", TETRAHEDRA)], "tetra10"), ([("hexahedron", np.arange(8)[None])], "hexahedron27"),
                        ([("wedge", wedges)], "wedge18")]:
        for ending in ("vtu", "vtk", "msh"):
            mesh = read_mesh_file(write(tmp_path / f"cube.{ending}", cells), unit="cm")
            assert mesh.cells[0][1] == kind and mesh.regions == ["body"]
            assert mesh.volume_mm3() == pytest.approx(1000.0, rel=1e-12)
    square = read_mesh_file(write(tmp_path / "square.vtu", [("triangle", np.array([[0, 1, 2], [0, 2, 3]]))]), unit="mm",
                            geometry="plane_strain", thickness_mm=2.0)
    assert square.cells[0][1] == "triangle6" and square.volume_mm3() == pytest.approx(2.0)


def test_neighbours_share_the_nodes_in_their_middles():
    points, (nodes,), number = raised(CUBE, [("tetra", TETRAHEDRA)])
    assert len(points) == 8 + 18      # corners and edges of five tetrahedra in a cube: 12 and the diagonals of 6 faces
    assert np.array_equal(points[number], CUBE)
    assert np.allclose(points[nodes[:, 4]], points[nodes[:, :2]].mean(axis=1))


@pytest.mark.filterwarnings("ignore::softtact.errors.MeshWarning")     # of the set that is no region
def test_sets_of_abaqus_and_groups_of_gmsh_name_regions_and_faces(tmp_path):
    bottom = np.array([[0, 1, 3], [1, 2, 3]])
    cells, soft, hard = [("tetra", TETRAHEDRA), ("triangle", bottom)], np.array([0, 2]), np.array([1, 3, 4])
    every = np.arange(5)
    deck = write(tmp_path / "cube.inp", [("tetra", TETRAHEDRA)], cell_sets={"soft": [soft], "hard": [hard], "every": [every]})
    tags = [np.where(np.isin(np.arange(5), soft), 1, 2), np.array([7, 7])]
    group = write(tmp_path / "cube.msh", cells, cell_data={"gmsh:physical": tags, "gmsh:geometrical": tags},
                  field_data={"soft": np.array([1, 3]), "hard": np.array([2, 3]), "floor": np.array([7, 2])})
    with pytest.raises(InputError, match="element 0 is in 2 regions"):
        read_mesh_file(deck, unit="mm")
    with pytest.raises(InputError, match="no set or group of elements 'hrad'"):
        read_mesh_file(deck, unit="mm", regions=["soft", "hrad"])
    for path, faces in ((deck, {"floor": "z<0.01"}), (group, {})):
        mesh = read_mesh_file(path, unit="mm", faces=faces, regions=["soft", "hard"])
        assert {region: len(nodes) for region, _, nodes in mesh.cells} == {"soft": 2, "hard": 3}
        assert len(mesh.faces["floor"]["triangle6"]) == 2 and mesh.points[mesh.face_nodes("floor")][:, 2].max() == 0


def test_faulty_files_and_rules_are_refused_with_the_place(tmp_path):
    good = write(tmp_path / "good.vtu", [("tetra", TETRAHEDRA)])
    (tmp_path / "text.vtu").write_text("no mesh")
    outer = next(iter(read_mesh_file(good, unit="mm").boundary.values()))[0, :3]
    inner = write(tmp_path / "inner.msh", [("tetra", TETRAHEDRA), ("triangle", np.array([[1, 3, 4], outer]))],
                  cell_data={"gmsh:physical": [np.full(5, 1), np.full(2, 2)], "gmsh:geometrical": [np.full(5, 1), np.full(2, 2)]},
                  field_data={"soft": np.array([1, 3]), "inside": np.array([2, 2])})
    for path, options, told in [
        (tmp_path / "none.vtu", {"unit": "mm"}, "no such mesh file"),
        (tmp_path / "text.vtu", {"unit": "mm"}, "not readable"),
        (good, {}, "no unit is stated"),
        (good, {"unit": "foot"}, "not known"),
        (write(tmp_path / "turned.vtu", [("tetra", TETRAHEDRA[:, [1, 0, 2, 3]])]), {"unit": "mm"}, "5 of 5 elements of the region"),
        (write(tmp_path / "surface.vtu", [("triangle", np.array([[0, 1, 4]]))]), {"unit": "mm"}, "surface in space"),
        (write(tmp_path / "plane.vtu", [("triangle", np.array([[0, 1, 2]]))]), {"unit": "mm"}, "plane_strain or axisymmetric"),
        (write(tmp_path / "pyramid.vtu", [("pyramid", np.arange(5)[None])]), {"unit": "mm"}, "pyramid"),
        (write(tmp_path / "points.vtu", [("vertex", np.zeros((1, 1), int))]), {"unit": "mm"}, "no elements"),
        (inner, {"unit": "mm"}, "not on the outside"),
        (good, {"unit": "mm", "faces": {"top": "z=1"}}, "not understood"),
        (good, {"unit": "mm", "faces": {"top": "z>5"}}, "'top' would be empty"),
    ]:
        with pytest.raises(InputError, match=told):
            read_mesh_file(path, **options)
