"""Any closed surface becomes a body of quadratic tetrahedra that keeps its volume, its faces and its edges; others are refused."""

import numpy as np
import pytest
import trimesh

from softtact.errors import InputError
from softtact.fem.body_mesh import body_report, mesh_body

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
