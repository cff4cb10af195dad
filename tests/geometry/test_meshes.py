"""Reading meshes: what is read is in mm, what a solver would get wrong is refused with its remedy."""

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh

from softtact.contact.lower_envelope import NO_CONTACT_MM
from softtact.errors import InputError, MissError
from softtact.geometry.meshes import HIGHEST_MM, check_over_sensor, facets_over, merge_facets, place, read_mesh, read_triangles
from softtact.geometry.pose import Pose

FOOTPRINT = (22.0, 37.0)
DATA = os.environ.get("SOFTTACT_TEST_DATA")
needs_data = pytest.mark.skipif(not DATA, reason="SOFTTACT_TEST_DATA is not set")


def box(extents=(10.0, 20.0, 30.0), shift=(0.0, 0.0, 0.0)):
    mesh = trimesh.creation.box(extents=extents)
    mesh.apply_translation(shift)
    return mesh


def saved(mesh, path):
    mesh.export(path)
    return path


def refusal(path, **options):
    """The sentence with which `read_mesh` refuses a file: one sentence that names the file."""
    with pytest.raises(InputError) as caught:
        read_mesh(path, **({"unit": "mm"} | options))
    sentence = str(caught.value)
    assert sentence.startswith(str(path)) and sentence.endswith(".") and "\n" not in sentence
    return sentence


def test_every_format_is_read_in_mm(tmp_path):
    for suffix in ["stl", "obj", "ply"]:
        for unit, factor in [("mm", 1), ("cm", 10), ("inch", 25.4)]:
            mesh = read_mesh(saved(box((1, 2, 3)), tmp_path / f"box.{suffix}"), unit=unit)
            assert mesh.extents == pytest.approx(np.array([1, 2, 3]) * factor), unit
            assert mesh.volume == pytest.approx(6 * factor**3), unit
            assert mesh.is_watertight and mesh.vertices.dtype == float and len(mesh.vertices) == 8, unit


def test_text_stl_is_read(tmp_path):
    (tmp_path / "box.stl").write_text(box().export(file_type="stl_ascii"))
    assert read_mesh(tmp_path / "box.stl", unit="mm").volume == pytest.approx(6000)


def test_binary_stl_whose_header_says_solid_is_read(tmp_path):
    content = box().export(file_type="stl")
    (tmp_path / "box.STL").write_bytes(b"solid box".ljust(80) + content[80:])
    assert read_mesh(tmp_path / "box.STL", unit="mm").volume == pytest.approx(6000)


def test_raw_facets_are_not_merged(tmp_path):
    assert read_triangles(saved(box(), tmp_path / "box.stl"), unit="mm").shape == (12, 3, 3)


def test_a_cavity_is_part_of_a_closed_body(tmp_path):
    hole = box((2, 2, 2))
    hole.invert()
    mesh = read_mesh(saved(trimesh.util.concatenate([box(), hole]), tmp_path / "hollow.stl"), unit="mm")
    assert mesh.volume == pytest.approx(6000 - 8)


def test_two_separate_bodies_are_one_object(tmp_path):
    apart = trimesh.util.concatenate([box(), box(shift=(15, 0, 0))])
    assert read_mesh(saved(apart, tmp_path / "two.stl"), unit="mm").volume == pytest.approx(12000)


def test_a_missing_file_is_refused(tmp_path):
    assert "no such mesh file" in refusal(tmp_path / "none.stl")


def test_another_format_is_refused(tmp_path):
    (tmp_path / "part.igs").write_text("IGES")
    assert "'.igs'" in refusal(tmp_path / "part.igs")


def test_an_empty_file_is_refused(tmp_path):
    for suffix in ["stl", "obj", "ply"]:
        (tmp_path / f"empty.{suffix}").touch()
        assert "empty" in refusal(tmp_path / f"empty.{suffix}"), suffix


def test_a_file_that_holds_no_mesh_is_refused(tmp_path):
    for content in [b"not a mesh at all", b"\x00" * 200, b"solid x\nendsolid x\n"]:
        (tmp_path / "text.stl").write_bytes(content)
        assert "export" in refusal(tmp_path / "text.stl"), content


def test_a_truncated_file_is_refused(tmp_path):
    (tmp_path / "half.stl").write_bytes(box().export(file_type="stl")[:300])
    assert "export" in refusal(tmp_path / "half.stl")


def test_a_file_of_points_only_is_refused(tmp_path):
    (tmp_path / "points.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n")
    assert "no triangles" in refusal(tmp_path / "points.obj") or "not readable" in refusal(tmp_path / "points.obj")


def test_coordinates_that_are_no_numbers_are_refused(tmp_path):
    for bad in [np.nan, np.inf]:
        content = bytearray(box().export(file_type="stl"))
        content[84 + 12:84 + 16] = np.float32(bad).tobytes()  # first corner of the first facet
        (tmp_path / "bad.stl").write_bytes(content)
        assert "1 of 12 facets" in refusal(tmp_path / "bad.stl"), bad


def test_a_missing_or_unknown_unit_is_refused(tmp_path):
    for unit, phrase in [(None, "no unit is stated"), ("furlong", "'furlong' is not known")]:
        assert phrase in refusal(saved(box(), tmp_path / "box.stl"), unit=unit), unit


def test_an_implausible_size_is_refused_with_the_likely_unit(tmp_path):
    in_metres = saved(box((0.01, 0.02, 0.03)), tmp_path / "small.stl")
    assert "0.03 mm" in refusal(in_metres) and "m (30 mm)" in refusal(in_metres)
    in_mm = saved(box(), tmp_path / "large.stl")
    assert "3e+04 mm" in refusal(in_mm, unit="m") and "mm (30 mm)" in refusal(in_mm, unit="m")


def test_a_size_that_no_unit_makes_plausible_is_refused(tmp_path):
    assert "scale the mesh" in refusal(saved(box((1e9, 1e9, 1e9)), tmp_path / "huge.stl"))


def test_a_plausible_range_can_be_widened(tmp_path):
    file = saved(box((600, 20, 20)), tmp_path / "long.stl")
    assert "600 mm" in refusal(file)
    assert read_mesh(file, unit="mm", max_size_mm=700).extents[0] == pytest.approx(600)


def test_an_open_mesh_is_refused_with_its_boundary(tmp_path):
    mesh = box()
    mesh.update_faces(np.arange(12) != 3)
    assert "3 boundary edges" in refusal(saved(mesh, tmp_path / "open.stl"))


def test_inward_normals_are_refused(tmp_path):
    mesh = box()
    mesh.invert()
    assert "point inwards" in refusal(saved(mesh, tmp_path / "inverted.stl"))


def test_inconsistent_normals_are_refused(tmp_path):
    mesh = box()
    mesh.faces[0] = mesh.faces[0][::-1]
    assert "opposite ways" in refusal(saved(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False),
                                            tmp_path / "mixed.stl"))


def test_a_flat_mesh_is_refused_as_degenerate(tmp_path):
    flat = trimesh.Trimesh([[0, 0, 0], [9, 0, 0], [9, 9, 0], [0, 9, 0]], [[0, 1, 2], [0, 2, 3]])
    assert "degenerate" in refusal(saved(flat, tmp_path / "flat.stl"))


def test_facets_without_area_are_refused_as_degenerate(tmp_path):
    points = trimesh.Trimesh([[0, 0, 0], [9, 9, 9]], [[0, 1, 1], [1, 0, 0]], process=False)
    assert "degenerate" in refusal(saved(points, tmp_path / "needles.stl"))


def test_closed_pieces_that_overlap_or_touch_are_refused(tmp_path):
    for shift in [5.0, 10.0]:
        pieces = trimesh.util.concatenate([box(), box((10, 5, 5), shift=(shift, 0, 0))])
        assert "2 closed pieces overlap or touch" in refusal(saved(pieces, tmp_path / "pieces.stl")), shift


def test_the_default_pose_centres_the_box_and_touches():
    placed = place(box(shift=(50, -7, 3)))
    assert placed.bounds == pytest.approx(np.array([[-5, -10, 0], [5, 10, 30]]))


def test_placing_leaves_the_users_mesh_alone():
    mesh = box(shift=(50, 0, 0))
    place(mesh)
    assert mesh.bounds[0, 0] == 45


def test_a_pose_turns_about_fixed_axes_then_moves():
    turned = Pose.parse("1,2,3,90,0,90").apply([[0, 1, 0]])  # y -> z about x; z stays about z
    assert turned == pytest.approx(np.array([[1, 2, 4]]))
    assert Pose.parse("0,0,0,0,90,90").apply([[1, 0, 0]]) == pytest.approx(np.array([[0, 0, -1]]))


def test_a_pose_that_is_not_six_numbers_is_refused():
    for text in ["1,2,3", "1,2,3,4,5,x", "1,2,3,4,5,nan", ""]:
        with pytest.raises(InputError, match="x,y,z,rx,ry,rz"):
            Pose.parse(text)


def test_an_object_beside_the_sensor_is_refused():
    with pytest.raises(InputError, match="misses the sensor: it spans x 25 to 35 mm"):
        check_over_sensor(place(box(), pose=Pose([30, 0, 15])), FOOTPRINT)


def test_an_object_that_covers_the_whole_sensor_is_over_it():
    mesh = place(box((100, 100, 10)))      # no corner lies over the footprint
    assert facets_over(mesh.triangles, FOOTPRINT).any()
    check_over_sensor(mesh, FOOTPRINT)


def test_an_object_a_metre_above_the_sensor_is_refused_with_its_height():
    check_over_sensor(place(box(), pose=Pose([0, 0, 900])), FOOTPRINT)
    with pytest.raises(MissError, match="The object is 1185 mm above the sensor, .* from below 1000 mm; lower its pose"):
        check_over_sensor(place(box(), pose=Pose([0, 0, 1200])), FOOTPRINT)
    assert HIGHEST_MM == NO_CONTACT_MM, "heights from there on stand for no object"


def test_a_ring_around_the_sensor_is_not_over_it():
    ring = merge_facets(trimesh.creation.annulus(r_min=60, r_max=70, height=10).triangles)
    with pytest.raises(InputError, match="misses"):
        check_over_sensor(place(ring), FOOTPRINT)


def test_a_triangle_past_a_corner_of_the_footprint_is_not_over_it():
    triangle = np.array([[[10, 24, 0], [16, 18, 0], [16, 24, 0.0]]])  # its box overlaps, its long side passes by
    assert not facets_over(triangle, FOOTPRINT)[0]
    assert facets_over(triangle - [3, 3, 0], FOOTPRINT)[0]


CLEAN = [("wondkim/cross.STL", "mm"), ("wondkim/torus.STL", "mm"), ("wondkim/S.STL", "mm"), ("taccel/peg.stl", "m"),
         ("taccel/patterns_dots.stl", "mm"), ("tacto/cube.obj", "inch"), ("tacto/textured_sphere_smooth.obj", "cm"),
         ("difftactile/A00_0.obj", "mm")]


@needs_data
def test_published_meshes_are_read():
    for file, unit in CLEAN:
        mesh = read_mesh(Path(DATA) / "meshes" / file, unit=unit)
        assert mesh.is_watertight and mesh.volume > 0, file


@needs_data
def test_published_faulty_meshes_are_refused_without_repair():
    for file, phrase in [("taccel_train.stl", "64 boundary edges"),
                         ("taccel_flashlight.stl", "10 boundary edges"),
                         ("tactilegym_green_cup_collision.obj", "overlap or touch")]:
        assert phrase in refusal(Path(DATA) / "meshes" / "dirty" / file, unit="m"), file
