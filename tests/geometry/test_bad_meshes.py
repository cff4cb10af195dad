"""A gallery of bad meshes: each is mended, which is said and gives the clean mesh's map, or refused with the reason."""

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree
from support.mesh_files import U_SHAPE, prism
from support.sensors import CORO

from softtact.cli import main
from softtact.errors import InputError
from softtact.files import read_dataset
from softtact.geometry.meshes import read_mesh
from softtact.geometry.polygons import triangulated
from softtact.geometry.repair import read_mended
from softtact.models.elastic.compliance import elastic_compliance
from softtact.press.sensor import Sensor

ROOT = Path(__file__).resolve().parents[2]
DATA = os.environ.get("SOFTTACT_TEST_DATA")


def punch(height=5.0, *, low=0.0):
    """A punch of radius 2 mm, turned a little so that no facet stands upright, from z = low to z = low + height."""
    mesh = trimesh.creation.cylinder(radius=2.0, height=height, sections=24)
    return mesh.apply_translation([0.3, -0.2, low + height / 2])


def of(points, faces):
    return trimesh.Trimesh(points, faces, process=False)


def lower(mesh):
    """Numbers of the facets that look down."""
    return np.flatnonzero(mesh.face_normals[:, 2] < -0.5)


def with_a_hole(mesh):
    return of(mesh.vertices, np.delete(mesh.faces, lower(mesh)[:5], axis=0))


def without_its_top(mesh):
    return of(mesh.vertices, mesh.faces[mesh.face_normals[:, 2] < 0.5])


def inside_out(mesh):
    return of(mesh.vertices, mesh.faces[:, ::-1])


def partly_turned(mesh):
    faces = mesh.faces.copy()
    faces[lower(mesh)[:4]] = faces[lower(mesh)[:4]][:, ::-1]
    return of(mesh.vertices, faces)


def with_doubles(mesh):
    return of(mesh.vertices, np.vstack([mesh.faces, mesh.faces[:7], mesh.faces[:2]]))


def with_a_fin(mesh):
    """Two facets back to back hang at an edge, so that four facets meet there."""
    a, b = mesh.edges[0]
    points = np.vstack([mesh.vertices, [9.0, 9.0, 4.0]])
    return of(points, np.vstack([mesh.faces, [[a, b, len(points) - 1], [b, a, len(points) - 1]]]))


def of_two_overlapping_pieces(mesh):
    return trimesh.util.concatenate([punch(3.0), punch(3.5, low=1.5)])


def with_facets_without_area(mesh):
    """An edge has a corner in its middle on one side only; a facet without area closes the slit."""
    a, b, c = mesh.faces[lower(mesh)[0]]
    points = np.vstack([mesh.vertices, (mesh.vertices[a] + mesh.vertices[b]) / 2])
    m = len(points) - 1
    faces = np.delete(mesh.faces, lower(mesh)[0], axis=0)
    return of(points, np.vstack([faces, [[a, m, c], [m, b, c], [a, b, m], [a, a, b]]]))


def with_rounded_corners(mesh):
    """Each facet has corners of its own, 10 to 20 nm beside its neighbours'."""
    points = mesh.triangles.reshape(-1, 3) + np.random.default_rng(3).uniform(-2e-5, 2e-5, (3 * len(mesh.faces), 3))
    return of(points, np.arange(len(points)).reshape(-1, 3))


def with_nan(mesh):
    points = np.vstack([mesh.vertices, [np.nan, 0, 0]])
    faces = mesh.faces.copy()
    faces[lower(mesh)[0], 0] = len(points) - 1
    return of(points, faces)


MENDED = [
    (with_a_hole, "closed 1 hole"),
    (without_its_top, "closed 1 hole"),
    (inside_out, "turned all facets: they faced inwards"),
    (partly_turned, "turned 4 facets that faced against the neighbours"),
    (with_doubles, "left out 9 facets of those that were there twice"),
    (with_a_fin, "left out 2 facets of those that were there twice"),
    (of_two_overlapping_pieces, "united 2 bodies that overlap or touch into 1"),
    (with_facets_without_area, None),
    (with_rounded_corners, "joined"),
    (with_nan, "left out 1 facet whose coordinates are not finite numbers"),
]


KEEP_CORNERS = (with_a_fin, with_facets_without_area, with_rounded_corners)


@pytest.fixture(scope="module")
def sensor():
    """A piece of the sensor with a map of 17 x 17."""
    spec = CORO
    spec = spec.model_copy(update={"footprint_mm": (9.6, 9.6), "map_shape": (17, 17)})
    return Sensor(spec, laws={}, prepared_models={"elastic": elastic_compliance(spec)})


@pytest.fixture(scope="module")
def clean(sensor):
    return sensor.press(punch(), force_n=[5, 20], model="elastic", label="").deformation_map_mm


@pytest.mark.parametrize(("spoil", "said"), MENDED, ids=lambda value: getattr(value, "__name__", ""))
def test_a_repaired_mesh_says_what_was_done_and_gives_the_clean_meshs_map(spoil, said, sensor, clean, tmp_path):
    path = tmp_path / ("bad.ply" if spoil in KEEP_CORNERS else "bad.stl")     # a PLY shares corners, an STL does not
    spoil(punch()).export(path)
    mended = read_mended(path, unit="mm")
    assert (mended.repairs == []) if said is None else mended.repairs[0].startswith(said)
    assert len(mended.repairs) == (2 if spoil is with_nan else int(said is not None))     # no step mends what another broke
    assert mended.mesh.volume == pytest.approx(punch().volume, rel=1e-4)
    got = sensor.press(mended.mesh, force_n=[5, 20], model="elastic", label="").deformation_map_mm
    assert np.abs(got - clean).max() < 1e-3 * clean.max()     # corners are rounded by up to 20 nm, in single precision


def third_wall(mesh):
    """A facet that hangs at an edge of two others, and whose other two edges are open."""
    a, b = mesh.edges[0]
    points = np.vstack([mesh.vertices, [9.0, 9.0, 4.0]])
    return of(points, np.vstack([mesh.faces, [[a, b, len(points) - 1]]]))


def large_curved_hole(mesh):
    ball = trimesh.creation.icosphere(subdivisions=2, radius=4)
    keep = ball.triangles_center @ [0.3, 0.5, 0.8] < 1.5
    rough = np.random.default_rng(0).uniform(0.9, 1.1, (len(ball.vertices), 1))
    return of(ball.vertices * rough, ball.faces[keep])


def flat(mesh):
    return of(mesh.vertices * [1, 1, 0], mesh.faces)


def double_sided(mesh):
    return of(mesh.vertices, np.vstack([mesh.faces, mesh.faces[:, ::-1]]))


def beside_a_double_sided_body(mesh):
    return trimesh.util.concatenate([mesh, double_sided(mesh.copy().apply_translation([9, 0, 0]))])


def cut_from_one_corner(mesh):
    """A U whose bottom and top are cut into triangles that all begin at one corner, so that some lie on others."""
    body = prism(U_SHAPE, 8)
    return of(body.points, [[face[0], *face[k:k + 2]] for face in body.polygons for k in range(1, len(face) - 1)])


def with_a_corner_moved(mesh):
    """One facet's corner lies elsewhere than its neighbours'; the file keeps the facets' corners apart."""
    points = mesh.triangles.reshape(-1, 3).copy()
    points[0] += [0.1, 0.2, 0.3]
    return of(points, np.arange(len(points)).reshape(-1, 3))


REFUSED = [(double_sided, "96 facets of a closed surface are there front and back"),
           (beside_a_double_sided_body, "96 facets of a closed surface are there front and back"),
           (cut_from_one_corner, "3 facets lie on a neighbour"), (with_a_corner_moved, "the surface is not closed"),
           (third_wall, "1 edges with more than two facets"), (large_curved_hole, "the surface is not closed"),
           (flat, "degenerate")]


def test_a_mesh_whose_repair_would_be_a_guess_is_refused(tmp_path):
    for spoil, said in REFUSED:
        spoil(punch()).export(tmp_path / "bad.stl")
        with pytest.raises(InputError, match=said):
            read_mended(tmp_path / "bad.stl", unit="mm")


def with_corners_on_edges(edges, places):
    """A box in which one of the two facets at each of these edges has corners along it that the other has not."""
    box = trimesh.creation.box((20, 20, 8))
    points, faces = list(box.vertices), [list(face) for face in box.faces]
    for edge in edges:
        (facet, _), (a, b) = box.face_adjacency[edge], box.face_adjacency_edges[edge]
        on = [len(points) + k for k in range(len(places))]
        points += [box.vertices[a] + place * (box.vertices[b] - box.vertices[a]) for place in places]
        polygon = faces[facet]
        at = next(k for k in range(len(polygon)) if {polygon[k], polygon[(k + 1) % len(polygon)]} == {a, b})
        polygon[at + 1:at + 1] = on if polygon[at] == a else on[::-1]
    split = [np.array(polygon)[triangulated(np.array(points)[polygon][None])[0]] for polygon in faces]
    return of(points, np.concatenate(split))


@pytest.mark.parametrize("edges", [[0], [0, 1], [0, 4, 9], range(18)], ids=["one", "two", "three", "all"])
@pytest.mark.parametrize("places", [[0.5], [0.2, 0.3, 0.9]], ids=["a corner", "three corners"])
def test_corners_on_edges_of_facets_that_lack_them_become_theirs(edges, places, tmp_path):
    with_corners_on_edges(edges, places).export(tmp_path / "box.stl")
    mended = read_mended(tmp_path / "box.stl", unit="mm")
    assert len(mended.repairs) == 1 and mended.repairs[0].startswith("split ") and "at corners of others" in mended.repairs[0]
    assert (mended.mesh.volume, mended.mesh.area) == pytest.approx((3200, 1440))


def test_corners_on_an_edge_that_differ_on_its_two_sides_become_both_facets(tmp_path):
    points = [[-10, -10, 0], [10, -10, 0], [10, 10, 0], [-10, 10, 0], [0, 0, 9], [2, -10, 0], [-7, -10, 0]]
    below, walls = [[0, 3, 5], [5, 3, 2], [5, 2, 1]], [[0, 6, 4], [6, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]]
    of(np.array(points, float), below + walls).export(tmp_path / "pyramid.stl")
    mended = read_mended(tmp_path / "pyramid.stl", unit="mm")
    assert mended.repairs == ["split 2 facets at corners of others that lie on the edges"]
    assert mended.mesh.volume == pytest.approx(1200)


def test_a_concave_polygon_cut_from_one_corner_is_refused_without_repair_too(tmp_path):
    cut_from_one_corner(None).export(tmp_path / "u.stl")
    with pytest.raises(InputError, match=r"u.stl: 3 facets lie on a neighbour \(the first at .* mm\).*triangulate it again"):
        read_mesh(tmp_path / "u.stl", unit="mm")


def test_a_body_that_fills_a_cavity_of_another_makes_it_whole(tmp_path):
    inner = trimesh.creation.box((4, 4, 4))
    cavity = inner.copy()
    cavity.invert()
    trimesh.util.concatenate([trimesh.creation.box((9, 9, 9)), cavity, inner]).export(tmp_path / "filled.stl")
    mended = read_mended(tmp_path / "filled.stl", unit="mm")
    assert mended.repairs == ["left out 24 facets of those that were there twice"]
    assert mended.mesh.volume == pytest.approx(9**3)


@pytest.mark.parametrize(("side", "repairs", "volume"), [
    (2.0, [], 9**3 - 4**3 + 2**3), (6.0, ["united 2 bodies that overlap or touch into 1"], 9**3)], ids=["free", "pressed in"])
def test_a_body_in_a_cavity_stays_where_it_lies_free_and_fills_it_where_it_is_pressed_in(side, repairs, volume, tmp_path):
    cavity = trimesh.creation.box((4, 4, 4))
    cavity.invert()
    parts = [trimesh.creation.box((9, 9, 9)), cavity, trimesh.creation.box((side, side, side))]
    trimesh.util.concatenate(parts).export(tmp_path / "inner.stl")
    mended = read_mended(tmp_path / "inner.stl", unit="mm")
    assert mended.repairs == repairs and mended.mesh.volume == pytest.approx(volume)


def test_a_cavity_stays_and_a_body_inside_out_is_turned(tmp_path):
    cavity, other = trimesh.creation.box((1, 1, 1)), trimesh.creation.box((2, 2, 2)).apply_translation([20, 0, 0])
    cavity.invert()
    other.invert()
    trimesh.util.concatenate([trimesh.creation.box((9, 9, 9)), cavity, other]).export(tmp_path / "three.stl")
    mended = read_mended(tmp_path / "three.stl", unit="mm")
    assert mended.repairs == ["turned 1 body inside out"]
    assert mended.mesh.volume == pytest.approx(9**3 - 1 + 8)


def test_an_object_a_thousand_times_too_small_or_too_large_is_named_with_the_likely_unit(tmp_path):
    for unit_of_file, factor in [("m", 1e-3), ("inch", 1 / 25.4)]:
        mesh = trimesh.creation.box((20, 20, 30))
        mesh.apply_scale(factor).export(tmp_path / "part.stl")
        if unit_of_file == "m":
            with pytest.raises(InputError, match=r"0.03 mm, outside 1 to 500 mm; perhaps its unit is m \(30 mm\)"):
                read_mended(tmp_path / "part.stl", unit="mm")
        mesh.apply_scale(1 / factor).export(tmp_path / "part.stl")
        with pytest.raises(InputError, match=r"perhaps its unit is mm \(30 mm\)"):
            read_mended(tmp_path / "part.stl", unit={"m": "m", "inch": "inch"}[unit_of_file])


@pytest.mark.slow
def test_a_mesh_of_a_million_facets_is_read_in_its_own_size(tmp_path):
    """As a binary STL whose header begins with `solid`, like that of a text one."""
    count = 501     # of squares along a side: two sheets of 2 * 501^2 facets, and the border between them
    x, y = np.meshgrid(np.linspace(-5, 5, count + 1), np.linspace(-5, 5, count + 1))
    bowl = 0.02 * (x**2 + y**2)
    points = np.concatenate([np.column_stack([x.ravel(), y.ravel(), z]) for z in (bowl.ravel(), np.full(x.size, 3.0))])
    at = np.arange(x.size).reshape(x.shape)
    a, b, c, d = at[:-1, :-1].ravel(), at[:-1, 1:].ravel(), at[1:, 1:].ravel(), at[1:, :-1].ravel()
    sheet = np.concatenate([np.column_stack([a, c, b]), np.column_stack([a, d, c])])
    rim = np.concatenate([at[0, :-1], at[:-1, -1], at[-1, :0:-1], at[:0:-1, 0]])
    above, following = rim + x.size, np.roll(rim, -1)
    walls = np.concatenate([np.column_stack([rim, following, above]), np.column_stack([above, following, following + x.size])])
    content = of(points, np.vstack([sheet, sheet[:, ::-1] + x.size, walls])).export(file_type="stl")
    (tmp_path / "bowl.stl").write_bytes(b"solid bowl".ljust(80) + content[80:])
    mended = read_mended(tmp_path / "bowl.stl", unit="mm")
    assert mended.repairs == [] and len(mended.mesh.faces) > 1_000_000
    assert mended.mesh.extents == pytest.approx([10, 10, 3], abs=1e-5)     # corners are rounded to that


@pytest.mark.skipif(not DATA, reason="SOFTTACT_TEST_DATA is not set")
def test_published_faulty_meshes_are_repaired():
    for file, said in [
        ("taccel_train.stl", ["closed 2 holes, 161 mm2", "united 13 bodies that overlap or touch into 1"]),
        ("taccel_flashlight.stl", ["closed 1 hole, 89.3 mm2", "united 2 bodies that overlap or touch into 1"]),
        ("tactilegym_green_cup_collision.obj", ["united 46 bodies that overlap or touch into 7"]),
    ]:
        mended = read_mended(Path(DATA) / "meshes/dirty" / file, unit="m")
        assert [repair[:len(start)] for repair, start in zip(mended.repairs, said, strict=True)] == said, file
        assert mended.mesh.is_watertight and mended.mesh.volume > 0, file


def test_the_command_says_its_repairs_on_stderr_and_in_the_result(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(ROOT)
    with_a_hole(punch()).export(tmp_path / "bad.stl")
    press = ["press", str(tmp_path / "bad.stl"), "--unit", "mm", "--force", "5", "--model", "elastic"]
    assert main([*press, "--out", str(tmp_path / "p.nc")]) == 0
    assert "bad.stl was repaired: closed 1 hole" in capsys.readouterr().err
    assert read_dataset(tmp_path / "p.nc").attrs["mesh_repairs"].startswith("closed 1 hole")
    assert main([*press, "--no-repair"]) == 1
    assert "the surface is not closed" in capsys.readouterr().err


def scan(noise, *, fineness=5):
    """A pebble of some 12 mm with the noise of a scanner, in mm."""
    ball = trimesh.creation.icosphere(fineness, radius=1.0)
    vertices = ball.vertices * [6, 5, 4] + np.random.default_rng(3).normal(0, noise, ball.vertices.shape)
    return trimesh.Trimesh(vertices, ball.faces, process=False)


def test_a_scan_with_a_few_folds_is_smoothed_there_and_it_is_said(tmp_path):
    scan(0.1).export(tmp_path / "scan.ply")
    with pytest.raises(InputError, match="facets lie on a neighbour .* or smooth the scan"):
        read_mesh(tmp_path / "scan.ply", unit="mm")
    mended = read_mended(tmp_path / "scan.ply", unit="mm")
    (said,) = mended.repairs
    assert "of small facets, as noise of a scan makes them" in said
    moved, _ = cKDTree(scan(0.1).vertices).query(mended.mesh.vertices)
    assert 0 < (moved > 1e-5).mean() < 0.01 and moved.max() < 0.5     # others keep their places, as PLY stores them
