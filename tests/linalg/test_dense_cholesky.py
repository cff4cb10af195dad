"""Cholesky's method by blocks on threads, against NumPy's."""

import numpy as np
import pytest

from softtact.linalg import lapack
from softtact.linalg.lapack import factor_in_place
from softtact.linalg.workers import Workers

BLOCK = lapack._BLOCK


def positive_matrix(size):
    """A random symmetric positive definite matrix (n, n) of condition 100 or less."""
    vectors, _ = np.linalg.qr(np.random.default_rng(0).normal(size=(size, size)))
    return (vectors * np.geomspace(1.0, 100.0, size)) @ vectors.T


@pytest.fixture
def workers():
    pool = Workers(2)
    yield pool
    pool.close()


def test_the_upper_triangle_becomes_the_factor(workers):
    for size in [1, 7, BLOCK, BLOCK + 1, 2 * BLOCK + 100]:
        matrix = positive_matrix(size)
        found = matrix.astype(np.float32)
        assert factor_in_place(found, workers=workers), size
        # Single precision's 6e-8 of the largest entry, 10, some ten times over.
        np.testing.assert_allclose(np.triu(found), np.linalg.cholesky(matrix).T, atol=1e-5)


def test_what_is_below_the_diagonal_is_not_read_beside_the_diagonals_blocks():
    matrix = positive_matrix(2 * BLOCK + 100).astype(np.float32)
    upper = np.triu(matrix)
    assert factor_in_place(matrix) and factor_in_place(upper)
    np.testing.assert_array_equal(np.triu(matrix), np.triu(upper))


def test_as_many_threads_give_the_same_to_the_last_digit():
    matrix, found = positive_matrix(3 * BLOCK).astype(np.float32), []
    for threads in (1, 2, 3):
        pool = Workers(threads)
        found.append(matrix.copy())
        assert factor_in_place(found[-1], workers=pool)
        pool.close()
    np.testing.assert_array_equal(np.triu(found[0]), np.triu(found[1]))
    np.testing.assert_array_equal(np.triu(found[0]), np.triu(found[2]))


def test_a_matrix_that_is_not_positive_definite_is_reported():
    for value in [-50.0, np.nan]:
        for place in [0, BLOCK + 5, 2 * BLOCK + 99]:
            matrix = positive_matrix(2 * BLOCK + 100).astype(np.float32)
            matrix[place, place] = value
            assert not factor_in_place(matrix), place
