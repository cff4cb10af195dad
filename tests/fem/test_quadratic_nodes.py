"""Nodes between the corners of quadratic elements take the means of what the corners have."""

import numpy as np
import pytest

from softtact.fem.elements import HEX20
from softtact.fem.quadratic_nodes import QUADRATIC, raised, shares_of_corners
from softtact.fem.structured_meshes import box, in_tetrahedra


@pytest.mark.parametrize("kind", list(QUADRATIC))
def test_a_linear_field_is_known_everywhere_from_the_corners_of_a_skewed_element(kind):
    element = QUADRATIC[kind]
    corners = element.nodes[element.vtk_order[:{"tetra": 4, "hexahedron": 8, "wedge": 6, "triangle": 3, "quad": 4}[kind]]]
    skewed = corners + 0.2 * corners[:, [1, 0, *range(2, corners.shape[1])]] ** 2
    points, (nodes,), _ = raised(skewed, [(kind, np.arange(len(corners))[None])])
    shares = shares_of_corners(len(points), [(element, nodes)])
    np.testing.assert_allclose(shares @ points, points, atol=1e-14)
    assert (shares.diagonal() == 1).sum() == len(corners) and (np.asarray(shares.sum(axis=1)) == 1).all()


def test_elements_share_their_nodes_and_nodes_of_none_have_no_share():
    mesh = in_tetrahedra(box((0, 0, 0), (1, 1, 1), (2, 1, 1)))
    shares = shares_of_corners(len(mesh.points) + 1, [(element, nodes) for _, element, nodes in mesh.parts()])
    np.testing.assert_allclose(shares[:-1, :-1] @ mesh.points, mesh.points, atol=1e-14)
    assert shares[-1].nnz == 0


def test_elements_without_nodes_in_their_faces_middles_have_none():
    assert shares_of_corners(20, [(HEX20, np.arange(20)[None])]) is None
