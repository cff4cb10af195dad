"""Cholesky by layers: the layers couple to their neighbours only, and the answers are those of a dense solver."""

import sys

import numpy as np
import pytest
import scipy.sparse as sp

from softtact.linalg import direct
from softtact.linalg.block_tridiagonal import BlockTridiagonalSolver, layers


def slab(nx=3, ny=7, nz=2, *, shift=0.2, beside=0):
    """A Laplacian on nx * ny * nz points plus a shift, points in a mixed order, and `beside` unknowns that couple to nothing."""
    def line(count):
        return sp.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(count, count))

    whole = sp.kronsum(sp.kronsum(line(nx), line(ny)), line(nz)) + shift * sp.eye(nx * ny * nz)
    whole = sp.block_diag([whole, *[[[2.0]]] * beside]).tocsr()
    order = np.random.default_rng(1).permutation(whole.shape[0])
    return whole[order][:, order].tocsr()


def upper_of(matrix):
    upper = sp.triu(matrix, format="csr")
    upper.sort_indices()
    return upper


@pytest.mark.parametrize("beside", [0, 2])
def test_a_layer_couples_to_itself_and_its_neighbours_only_and_layers_lie_across_the_long_side(beside):
    matrix = slab(beside=beside)
    layer, entries = layers(matrix), matrix.tocoo()
    assert np.abs(layer[entries.row] - layer[entries.col]).max() == 1
    assert np.bincount(layer).min() >= 1 and np.bincount(layer).max() <= 2 * 3 * 2     # twice the cross-section


@pytest.mark.parametrize("beside", [0, 2])
@pytest.mark.parametrize("columns", [None, 4])
def test_a_solution_is_that_of_a_dense_solver(beside, columns):
    matrix = slab(beside=beside)
    size = matrix.shape[0]
    right = np.random.default_rng(0).normal(size=size if columns is None else (size, columns))
    solver = BlockTridiagonalSolver()
    assert solver.factor(upper_of(matrix))
    np.testing.assert_allclose(solver.solve(right), np.linalg.solve(matrix.toarray(), right), atol=1e-13)


def test_a_matrix_that_is_not_positive_definite_is_reported_and_the_next_one_factored():
    matrix, solver = slab(), BlockTridiagonalSolver()
    indefinite = matrix - 3.0 * sp.eye(matrix.shape[0])
    assert not solver.factor(upper_of(indefinite)) and solver.factor(upper_of(matrix))
    right = np.ones(matrix.shape[0])
    np.testing.assert_allclose(matrix @ solver.solve(right), right, atol=1e-12)


def test_it_takes_the_place_of_mkl_where_that_is_missing(monkeypatch):
    monkeypatch.setitem(sys.modules, "pypardiso", None)
    assert direct.make_solver().name == BlockTridiagonalSolver.name
