"""The layer's compliance to forces in all directions: quarters and parities against the whole layer's stiffness."""


import numpy as np
import pytest
import scipy.sparse as sp
from support.sensors import CORO
from whole_layer import WholeLayer

from softtact.linalg.direct import make_solver
from softtact.models.elastic.compliance import elastic_compliance
from softtact.models.elastic.tangential import SurfaceCompliance, surface_compliance

SMALL = CORO.model_copy(update={"footprint_mm": (7.2, 9.6), "map_shape": (13, 9)})


@pytest.fixture(scope="module")
def surface():
    return surface_compliance(SMALL)


def some_nodes(grid):
    """Nodes of all quarters, some on the planes of symmetry, and one in the middle."""
    return np.unique(np.concatenate([np.arange(0, grid.count, 17), [grid.count // 2, grid.count // 2 + 3]]))


def test_displacements_in_all_directions_are_those_of_the_whole_layer(surface):
    whole, nodes = WholeLayer(SMALL), some_nodes(surface.grid)
    force = np.random.default_rng(2).standard_normal((len(nodes), 3))
    down = np.array([1.0, 1.0, -1.0])
    right = np.zeros(whole.stiffness.shape[0])
    places = whole.top[:, None] + np.arange(-2, 1)       # `top` numbers the vertical unknowns, x and y stand before them
    right[places[nodes].ravel()] = (force * down).ravel()
    solver, upper = make_solver(), sp.triu(whole.stiffness, format="csr")
    upper.sort_indices()
    solver.factor(upper)
    expected = solver.solve(right)[places] * down
    solver.close()
    got = surface.between(np.arange(surface.grid.count), nodes) @ force
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-6 * np.abs(expected).max())      # kept in single precision


def test_its_vertical_part_is_the_vertical_compliance(surface):
    vertical, nodes = elastic_compliance(SMALL), some_nodes(surface.grid)
    places = surface.grid.quarter(nodes)
    force = np.random.default_rng(3).standard_normal(len(nodes))
    got = surface.between(nodes, nodes, row_axes=(2,), column_axes=(2,)) @ force[:, None]
    expected = vertical.blocks.between(*places, *places).astype(float) @ force
    np.testing.assert_allclose(got[:, 0], expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    assert surface.foundation_modulus == vertical.foundation_modulus


def test_transposed_and_diagonal_are_those_of_the_dense_matrix(surface):
    nodes = some_nodes(surface.grid)
    coupling, tangential = (surface.between(nodes, nodes, row_axes=rows, column_axes=(0, 1)) for rows in ((2,), (0, 1)))
    units = np.eye(2 * len(nodes)).reshape(-1, len(nodes), 2)
    dense = np.stack([(tangential @ unit).ravel() for unit in units], axis=1)
    np.testing.assert_allclose(tangential.diagonal.ravel(), np.diag(dense), rtol=1e-6)
    np.testing.assert_allclose(dense, dense.T, atol=1e-7 * np.abs(dense).max())
    down, aside = np.random.default_rng(4).standard_normal((2, len(nodes), 2))
    assert (down[:, :1] * (coupling @ aside)).sum() == pytest.approx(((coupling.T @ down[:, :1]) * aside).sum(), rel=1e-9)


def test_saved_and_loaded_it_is_the_same(surface, tmp_path):
    surface.save(tmp_path / "surface.npz")
    loaded = SurfaceCompliance.load(tmp_path / "surface.npz")
    np.testing.assert_array_equal(loaded.triangles, surface.triangles)
    np.testing.assert_array_equal(loaded.grid.points, surface.grid.points)
    assert loaded.foundation_modulus == surface.foundation_modulus
