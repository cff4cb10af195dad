"""Structured meshes cut into tetrahedra, and mirrored."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.fem.structured_meshes import box, cylinder, in_tetrahedra, mirrored, with_level


def curved():
    return box((0, 0, 0), (2, 1, 1), (3, 2, 1)).moved(lambda x: x + 0.03 * np.sin(2 * x[:, [1, 2, 0]]))


def area(mesh, name):
    """Of the triangles between the corners of a face's facets."""
    total = 0.0
    for kind, nodes in mesh.face(name).items():
        corners = mesh.points[nodes[:, :4 if kind == "quad9" else 3]]
        for k in range(1, corners.shape[1] - 1):
            total += 0.5 * np.linalg.norm(np.cross(corners[:, k] - corners[:, 0], corners[:, k + 1] - corners[:, 0]), axis=1).sum()
    return total


def test_tetrahedra_fill_the_hexahedra_and_keep_their_faces():
    mesh = box((0, 0, 0), (2, 1, 1), (3, 2, 1))
    cut = in_tetrahedra(mesh)
    assert len(cut.cells[0][2]) == 6 * 6 and cut.volume_mm3() == pytest.approx(2.0)
    assert set(cut.faces) == set(mesh.faces)
    assert area(cut, "x1") == pytest.approx(1.0) and area(cut, "boundary") == pytest.approx(10.0)


def test_only_hexahedra_are_cut():
    with pytest.raises(InputError, match="quad9"):
        in_tetrahedra(box((0, 0), (1, 1), (1, 1)))


@pytest.mark.parametrize(("make", "told"), [
    (lambda: box((0, 0, 0), (-1, 1, 1), (1, 1, 1)), "go from 0 to -1 mm along x"),
    (lambda: box((0, 0, 0), (1, np.nan, 1), (1, 1, 1)), "go from 0 to nan mm along y"),
    (lambda: box((0, 0, 0), (1, 1, 1), (1, 1, 0)), "have 0 divisions along z"),
    (lambda: box((0, 0, 0), (1, 1, 1), (2, 1, 1), grading=([0, 1.5, 1], None, None)), "grading along x does not fit 2 divisions"),
    (lambda: box((0, 0, 0), (1, 1, 1), (2, 1, 1), grading=([0, 1], None, None)), "give 3 rising shares from 0 to 1"),
    (lambda: box((0, 0, 0), (1, 1, 1), (1, 1, 1), geometry="axisymmetric"), "do not fit the geometry 'axisymmetric'"),
    (lambda: box((0, 0, 0), (1, 1, 1), (1, 1, 1), thickness_mm=2.0), "has no effect on a mesh of the geometry 'solid'"),
    (lambda: box((0, 0), (1, 1), (1, 1), thickness_mm=-1.0), "thickness of the body is -1 mm"),
    (lambda: box((-1, 0), (1, 1), (2, 1), geometry="axisymmetric"), r"6 nodes lie beyond the axis x = 0 \(one at -1, 0, 0 mm\)"),
    (lambda: box((0, 0, 0), (1, 1, 1), (1, 1, 1)).moved(lambda x: np.where(x == 1, np.nan, x)), "19 nodes of elements have a"),
    (lambda: cylinder(-1.0, 1.0, (2, 1)), "radius -1 mm"),
])
def test_what_is_no_body_is_refused(make, told):
    with pytest.raises(InputError, match=told):
        make()


def test_joined_meshes_keep_all_facets_of_the_faces_that_both_have():
    lower, upper = box((0, 0, 0), (1, 1, 1), (1, 1, 1)), box((0, 0, 2), (1, 1, 3), (2, 1, 1), region="upper")
    both = lower.joined(in_tetrahedra(upper))
    assert area(both, "boundary") == pytest.approx(12.0) and area(both, "z0") == pytest.approx(2.0)
    assert {kind: len(nodes) for kind, nodes in both.face("x0").items()} == {"quad9": 1, "triangle6": 2}
    apart = lower.joined(upper, prefix="up ")
    assert area(apart, "boundary") == pytest.approx(12.0) and area(apart, "up boundary") == pytest.approx(6.0)
    assert area(apart, "z0") == area(apart, "up z0") == pytest.approx(1.0)
    with pytest.raises(InputError, match="of 2 mm thickness cannot join one of 1 mm"):
        box((0, 0), (1, 1), (1, 1)).joined(box((0, 2), (1, 3), (1, 1), thickness_mm=2.0))


def test_a_level_takes_the_place_of_the_nearest_inner_one():
    levels = np.array([0.0, 1.0, 2.0, 4.0])
    for level, expected in [(1.4, [0, 1.4, 2, 4]), (2.9, [0, 1, 2.9, 4]), (0.3, [0, 0.3, 1, 2, 4]), (3.5, [0, 1, 2, 3.5, 4]),
                            (2.0, [0, 1, 2, 4]), (5.0, [0, 1, 2, 4])]:
        assert with_level(levels, level) == pytest.approx(expected)


@pytest.mark.parametrize("make", [curved, lambda: in_tetrahedra(curved())], ids=["hexahedra", "tetrahedra"])
def test_a_mirrored_mesh_has_the_volume_and_the_faces_of_the_first(make):
    mesh = make()
    image = mirrored(mesh, 0)
    assert image.volume_mm3() == pytest.approx(mesh.volume_mm3(), rel=1e-12)
    assert image.points[image.face_nodes("x1"), 0].max() < -1.9
    assert area(image, "z1") == pytest.approx(area(mesh, "z1"), rel=1e-2)     # quadrilaterals are cut along the other diagonal
