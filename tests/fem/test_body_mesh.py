"""Any closed surface becomes a body of quadratic tetrahedra that keeps its volume, its faces and its edges; others are refused."""

import numpy as np
import pytest
import trimesh

from softtact.errors import InputError, MeshWarning
from softtact.fem.body_mesh import body_report, mesh_body, meshed_body, surface_points

pytest.importorskip("pytetwild")
SIDES = np.array([6.0, 4.0, 3.0])


@pytest.fixture(scope="module")
def ball():
    """Its surface, as a trimesh, and its mesh."""
    surface = trimesh.creation.icosphere(subdivisions=4, radius=3.0)
    return surface, mesh_body(surface, size_mm=1.5)


def test_a_box_keeps_its_flat_faces_and_its_edges():
    mesh = mesh_body(trimesh.creation.box(SIDES), size_mm=2.0)
    report = body_report(mesh, trimesh.creation.box(SIDES))
    assert report.volume_error == pytest.approx(0.0, abs=1e-12)      # round-off
    assert report.deviation_mm == pytest.approx(0.0, abs=1e-9)
    outside = mesh.points[mesh.face_nodes("boundary")]
    assert np.abs(np.abs(outside) - SIDES / 2).min(axis=1).max() < 1e-9


def test_a_ball_is_followed_by_curved_elements(ball):
    surface, mesh = ball
    report = body_report(mesh, surface)
    # Straight facets of 1.5 mm lie up to 1.5^2 / (8 x 3) = 0.09 mm below the ball, and would lose about 3 % of it.
    assert report.deviation_mm < 0.03
    assert abs(report.volume_error) < 2e-3
    straight = mesh.points[mesh.cells[0][2][:, :4]]
    assert np.linalg.det(straight[:, 1:] - straight[:, :1]).sum() / 6 < 0.99 * surface.volume
    assert report.least_quality > 0.2 and report.least_jacobian >= 0.3
    assert report.unknowns == 3 * len(mesh.points)


def test_a_surface_in_another_unit_gives_the_mesh_in_mm():
    mesh = mesh_body(trimesh.creation.box(SIDES / 10), unit="cm", size_mm=3.0, region="gel")
    assert mesh.regions == ["gel"]
    # A unit is wrong by a thousand. Elements as large as the box may cut a corner (by 0.07 %), for the mesher's order is random.
    assert mesh.volume_mm3() == pytest.approx(SIDES.prod(), rel=0.01)


def pierced():
    """A box whose top is drawn down in one point through its bottom."""
    box = trimesh.creation.box(SIDES).subdivide().subdivide()
    box.vertices[np.argmin(np.linalg.norm(box.vertices - [0, 0, 1.5], axis=1))] = [0.1, 0.1, -2.5]
    return box


def test_what_is_no_body_or_no_size_is_refused_in_one_sentence():
    box = trimesh.creation.box(SIDES)
    opened = box.copy()
    opened.update_faces(np.arange(len(box.faces)) > 0)
    for surface, options, told in [
        (opened, {"size_mm": 1.0}, "not closed"),
        (pierced(), {"size_mm": 1.0}, "intersects itself"),
        (box, {"size_mm": 3.5}, "larger than the body's smallest side, 3 mm; give 1 mm"),
        (box, {"size_mm": 0.01}, "more than 400,000; give"),
        (box, {"size_mm": 1.0, "most_elements": 100}, "more than 100; give"),
        (box, {"size_mm": float("nan")}, "not possible"),
        (box, {"size_mm": 1.0, "envelope_mm": 0.0}, "envelope"),
        (box, {"size_mm": 1.0, "unit": "m"}, "perhaps its unit is mm"),
        (box, {"size_mm": 1.0, "unit": "ell"}, "not known"),
        ("missing.stl", {"size_mm": 1.0, "unit": "mm"}, "no such mesh file"),
        ("missing.stl", {"size_mm": 1.0}, "no such mesh file"),
    ]:
        with pytest.raises(InputError) as refusal:
            mesh_body(surface, **options)
        assert told in str(refusal.value) and str(refusal.value).count(". ") == 0


QUADS = [[0, 3, 2, 1], [4, 5, 6, 7], [0, 1, 5, 4], [1, 2, 6, 5], [2, 3, 7, 6], [3, 0, 4, 7]]     # sides of a hexahedron


def carved(x, y, z, left_out):
    """The surface of a block between cuts x, y and z in mm, without those of its cells (i, j, k) that `left_out` takes."""
    number = np.arange(len(x) * len(y) * len(z)).reshape(len(x), len(y), len(z))
    quads = {}
    for i, j, k in np.ndindex(len(x) - 1, len(y) - 1, len(z) - 1):
        if not left_out(i, j, k):
            ring = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            corners = np.array([number[a, b, c] for c in (k, k + 1) for a, b in ring])
            for quad in corners[QUADS]:
                if quads.pop(tuple(sorted(quad)), None) is None:
                    quads[tuple(sorted(quad))] = quad
    points = np.stack(np.meshgrid(x, y, z, indexing="ij"), axis=-1).reshape(-1, 3)
    return trimesh.Trimesh(points, [quad[half] for quad in quads.values() for half in ([0, 1, 2], [0, 2, 3])])


SLIT = carved((-2, -0.04, 0.04, 2), (-1, 1), (0, 1, 3), lambda i, j, k: (i, k) == (1, 1))
HOLE = carved((-2, -0.05, 0.05, 2), (-2, -0.05, 0.05, 2), (0, 2), lambda i, j, k: (i, j) == (1, 1))
FIN = carved((-2, -0.03, 0.03, 2), (-1, 1), (0, 1, 2), lambda i, j, k: k == 1 and i != 1)
TWO = carved((-1, 1), (-1, 1), (0, 2, 2.05, 4), lambda i, j, k: k == 1)


@pytest.mark.slow
def test_a_slit_narrower_than_the_usual_envelope_is_kept_and_the_smaller_one_is_told():
    mesh, report = meshed_body(SLIT, size_mm=2.0)
    assert mesh.volume_mm3() == pytest.approx(SLIT.volume, rel=1e-3) and report.deviation_mm < 0.05
    assert report.remarks == ("an envelope of 0.1 mm would lose details of the body, so that one of 0.032 mm was taken",)


@pytest.mark.filterwarnings("ignore::softtact.errors.MeshWarning")     # the further ones
@pytest.mark.parametrize(("surface", "told", "holes", "shells"), [
    (SLIT, r"up to \d\.?\d* mm from the mesh's outside .*holes of 0.08 mm were filled.* give an --envelope of 0.032 mm", 0, 1),
    (HOLE, "the surface has 1 holes through it and the mesh has 0", 0, 1),
    (FIN, "of 0.06 mm were filled, or thin parts lost", 0, 1),
    (TWO, "the surface has 2 closed parts and the mesh has 1", 0, 1)])
def test_what_a_given_envelope_fills_joins_or_loses_is_told_with_a_place(surface, told, holes, shells):
    with pytest.warns(MeshWarning, match=told):
        mesh = mesh_body(surface, size_mm=1.9, envelope_mm=0.2)
    report = body_report(mesh, surface)
    assert (report.holes, report.shells) == (holes, shells) and report.deviation_mm > 0.4
    assert all(" mm)" in remark for remark in report.remarks)


def test_deviations_are_measured_from_points_within_large_facets():
    points, facets = surface_points(trimesh.creation.box((8, 8, 1)), spacing_mm=1.0)
    top = points[points[:, 2] == 0.5][:, :2]
    assert 64 <= len(top) <= 300 and (facets == -1).sum() == 8
    places = np.random.default_rng(0).uniform(-4, 4, (50, 2))
    assert np.linalg.norm(places[:, None] - top, axis=2).min(axis=1).max() < 1.2


def test_a_tunnel_and_a_cavity_are_counted():
    surface = carved(range(6), range(4), range(4), lambda i, j, k: (i, j) == (1, 1) or (i, j, k) == (3, 1, 1))
    report = body_report(mesh_body(surface, size_mm=1.5), surface)
    assert (report.shells, report.holes) == (2, 1) and not report.remarks
