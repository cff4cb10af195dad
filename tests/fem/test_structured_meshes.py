"""Structured meshes cut into tetrahedra, and mirrored."""

import numpy as np
import pytest

from softtact.errors import InputError
from softtact.fem.structured_meshes import box, in_tetrahedra, mirrored


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


@pytest.mark.parametrize("make", [curved, lambda: in_tetrahedra(curved())], ids=["hexahedra", "tetrahedra"])
def test_a_mirrored_mesh_has_the_volume_and_the_faces_of_the_first(make):
    mesh = make()
    image = mirrored(mesh, 0)
    assert image.volume_mm3() == pytest.approx(mesh.volume_mm3(), rel=1e-12)
    assert image.points[image.face_nodes("x1"), 0].max() < -1.9
    assert area(image, "z1") == pytest.approx(area(mesh, "z1"), rel=1e-2)     # quadrilaterals are cut along the other diagonal
