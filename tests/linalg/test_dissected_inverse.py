"""What an inverse does between functionals is what the dense one does, whatever stands where and whatever is coupled with it."""

import numpy as np
import pytest
import scipy.sparse as sp
from support.plates import plate

from softtact.linalg.dissected_inverse import inverse_between

RNG = np.random.default_rng(1)


def functionals(count, size, *, width):
    """Functionals (count, size) that weigh some unknowns each, anywhere."""
    places, rows = RNG.integers(0, size, (count, width)).ravel(), np.repeat(np.arange(count), width)
    return sp.csr_matrix((RNG.uniform(-1, 1, len(places)), (rows, places)), shape=(count, size))


@pytest.mark.slow
@pytest.mark.parametrize(("count", "width"), [(1, 1), (90, 1), (90, 12), (2500, 2)])
@pytest.mark.parametrize("threads", [1, 2])
def test_it_is_what_the_dense_inverse_gives(count, width, threads):
    matrix, upper, places = plate(40, 30)
    some = functionals(count, matrix.shape[0], width=width)
    expected = some @ np.linalg.inv(matrix.toarray()) @ some.T
    got = inverse_between(upper, some, places, threads=threads)
    np.testing.assert_allclose(got, expected, atol=1e-11 * np.abs(expected).max())


def test_what_stands_near_need_not_be_coupled_and_what_is_coupled_need_not_stand_near():
    random = sp.random(900, 900, density=0.002, random_state=np.random.default_rng(5))
    matrix = (random @ random.T + sp.diags(RNG.uniform(0.1, 1.0, 900))).tocsr()
    some, upper = functionals(70, 900, width=3), sp.triu(matrix, format="csr")
    upper.sort_indices()
    expected = some @ np.linalg.inv(matrix.toarray()) @ some.T
    got = inverse_between(upper, some, RNG.uniform(0, 1, (900, 2)))
    np.testing.assert_allclose(got, expected, atol=1e-10 * np.abs(expected).max())


def test_a_functional_of_nothing_gives_zeros_and_changes_no_other():
    matrix, upper, places = plate(40, 30)
    some = functionals(20, matrix.shape[0], width=3)
    with_nothing = sp.vstack([some[:7], sp.csr_matrix((1, matrix.shape[0])), some[7:]], format="csr")
    got = inverse_between(upper, with_nothing, places)
    assert not got[7].any() and not got[:, 7].any()
    np.testing.assert_array_equal(np.delete(np.delete(got, 7, 0), 7, 1), inverse_between(upper, some, places))


def test_in_single_precision_it_is_the_same_rounded():
    matrix, upper, places = plate(40, 30)
    some = functionals(200, matrix.shape[0], width=3)
    rounded = inverse_between(upper, some, places, dtype=np.float32)
    assert rounded.dtype == np.float32
    np.testing.assert_array_equal(rounded, inverse_between(upper, some, places).astype(np.float32))


@pytest.mark.parametrize("where", [0, 600, 2399])
def test_a_matrix_that_is_not_positive_definite_is_refused(where):
    matrix, upper, places = plate(40, 30)
    shift = np.zeros(matrix.shape[0])
    shift[where] = 100.0 * upper.diagonal().max()
    indefinite = (upper - sp.diags(shift)).tocsr()
    indefinite.sort_indices()
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        inverse_between(indefinite, functionals(20, len(shift), width=2), places)


def test_a_matrix_that_holds_what_is_no_number_is_refused():
    _, upper, places = plate(40, 30)
    upper.data[700] = np.nan
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        inverse_between(upper, functionals(20, upper.shape[0], width=2), places)


def test_a_part_that_no_functional_asks_for_must_be_positive_definite_too():
    upper = sp.diags([1.0, 2.0, -3.0], format="csr")
    with pytest.raises(np.linalg.LinAlgError, match="not positive definite"):
        inverse_between(upper, sp.csr_matrix([[1.0, 1.0, 0.0]]), np.zeros((3, 2)))
