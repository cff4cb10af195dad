"""Curved facets as flat triangles: of all the area, seen from outside, nearer to the surface the finer they are."""

import numpy as np
import pytest

from softtact.fem.solid_mesh import fine_triangles, flat_triangles
from softtact.fem.structured_meshes import box, cylinder, in_tetrahedra


def area_vectors(triangles):
    return 0.5 * np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


@pytest.mark.parametrize("kind", ["hexahedra", "tetrahedra"])
@pytest.mark.parametrize("divisions", [1, 2, 3])
def test_triangles_cover_a_box_and_look_outwards(kind, divisions):
    mesh = box((0, 0, 0), (2, 3, 1), (2, 1, 1))
    mesh = in_tetrahedra(mesh) if kind == "tetrahedra" else mesh
    for triangles in (mesh.points[flat_triangles(mesh.boundary)], fine_triangles(mesh.boundary, mesh.points, divisions=divisions)):
        vectors, middles = area_vectors(triangles), triangles.mean(axis=1)
        assert np.linalg.norm(vectors, axis=1).sum() == pytest.approx(2 * (6 + 3 + 2))
        assert ((vectors * (middles - [1, 1.5, 0.5])).sum(axis=1) > 0).all()
        assert (vectors * middles).sum() / 3 == pytest.approx(6.0)      # the volume, by Gauss


@pytest.mark.parametrize("kind", ["hexahedra", "tetrahedra"])
def test_finer_triangles_follow_a_curved_side_to_second_order(kind):
    mesh = cylinder(8.0, 12.0, (3, 2))
    mesh = in_tetrahedra(mesh) if kind == "tetrahedra" else mesh
    missed = []
    for divisions in (2, 4, 8):
        triangles = fine_triangles(mesh.face("side"), mesh.points, divisions=divisions)
        missed.append(mesh.volume_mm3() - (area_vectors(triangles) * triangles[:, 0]).sum() / 3 - _ends(mesh, divisions))
    assert np.log2(np.array(missed[:-1]) / missed[1:]) == pytest.approx([2, 2], abs=0.15)


def _ends(mesh, divisions):
    """What both flat ends add to the volume, by Gauss."""
    ends = [fine_triangles(mesh.face(name), mesh.points, divisions=divisions) for name in ("z0", "z1")]
    return sum((area_vectors(triangles) * triangles[:, 0]).sum() / 3 for triangles in ends)
