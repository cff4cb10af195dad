"""The inverse among some unknowns is that part of the dense one, whatever stands where and whatever is coupled with it."""

import numpy as np
import pytest
import scipy.sparse as sp
from support.plates import plate

from softtact.linalg.condensed_inverse import condensed_inverse, mirror


def whole_inverse(upper, kept, places, **options):
    """The symmetric matrix of which `condensed_inverse` gives a triangle."""
    triangle = condensed_inverse(upper, kept, places, **options)
    out = np.zeros((len(kept), len(kept)), dtype=triangle.dtype)
    mirror(triangle, np.arange(len(kept)), out)
    return out


def some_of(matrix, count):
    return np.random.default_rng(1).permutation(matrix.shape[0])[:count]     # in no order


@pytest.mark.parametrize("count", [1, 90, 1200])
@pytest.mark.parametrize("threads", [1, 2])
def test_it_is_the_dense_inverse_s_rows_and_columns(count, threads):
    matrix, upper, places = plate(40, 30)
    kept = some_of(matrix, count)
    expected = np.linalg.inv(matrix.toarray())[np.ix_(kept, kept)]
    np.testing.assert_allclose(whole_inverse(upper, kept, places, threads=threads), expected, atol=1e-11 * np.abs(expected).max())


def test_what_stands_near_need_not_be_coupled_and_what_is_coupled_need_not_stand_near():
    rng = np.random.default_rng(5)
    random = sp.random(900, 900, density=0.002, random_state=rng)
    matrix = (random @ random.T + sp.diags(rng.uniform(0.1, 1.0, 900))).tocsr()
    kept, upper = some_of(matrix, 70), sp.triu(matrix, format="csr")
    upper.sort_indices()
    expected = np.linalg.inv(matrix.toarray())[np.ix_(kept, kept)]
    got = whole_inverse(upper, kept, rng.uniform(0, 1, (900, 2)))
    np.testing.assert_allclose(got, expected, atol=1e-10 * np.abs(expected).max())


def test_in_single_precision_it_is_rounded_and_no_worse():
    matrix, upper, places = plate(40, 30)
    kept = some_of(matrix, 200)
    exact, rounded = whole_inverse(upper, kept, places), whole_inverse(upper, kept, places, dtype=np.float32)
    size = np.sqrt(np.outer(np.diag(exact), np.diag(exact)))
    assert rounded.dtype == np.float32
    assert np.abs(rounded - exact).max() > 0
    assert (np.abs(rounded - exact) / size).max() < 1e-5     # a hundred times single precision's unit, for a matrix of this size


@pytest.mark.parametrize("held", ["what is kept", "the others"])
def test_a_matrix_that_is_not_positive_definite_is_refused(held):
    matrix, upper, places = plate(40, 30)
    kept = some_of(matrix, 200)
    shift = np.zeros(matrix.shape[0])
    shift[kept if held == "what is kept" else np.setdiff1d(np.arange(len(shift)), kept)] = 100.0 * upper.diagonal().max()
    indefinite = (upper - sp.diags(shift)).tocsr()
    indefinite.sort_indices()
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        condensed_inverse(indefinite, kept, places)


def test_a_part_that_nothing_couples_with_what_is_kept_must_be_positive_definite_too():
    upper = sp.diags([1.0, 2.0, -3.0], format="csr")
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        condensed_inverse(upper, np.array([0, 1]), np.zeros((3, 2)))
