"""Tangents of elements without negative stiffness."""

import numpy as np

from softtact.fem.static_condensation import make_positive


def of_eigenvalues(*values):
    """Symmetric matrices in single precision of given eigenvalues, each in a random basis, and these bases."""
    rng = np.random.default_rng(4)
    bases = [np.linalg.qr(rng.normal(size=(len(own), len(own))))[0] for own in values]
    return np.stack([(basis * own) @ basis.T for basis, own in zip(bases, values, strict=True)]).astype(np.float32)


def test_negative_modes_resist_by_as_much_and_all_others_as_before():
    tangents = of_eigenvalues([0.0, 0.0, 1.0, 50.0], [0.0, -0.3, -2.0, 50.0])
    before = tangents.copy()
    assert make_positive(tangents) == 1
    assert (tangents[0] == before[0]).all()     # motions without stiffness, as an element's rigid ones, make it not indefinite
    values, vectors = np.linalg.eigh(before[1].astype(float))
    np.testing.assert_allclose(tangents[1], (vectors * np.abs(values)) @ vectors.T, atol=1e-5 * 50)


def test_tangents_that_are_not_finite_stay_so():
    tangents = np.full((1, 4, 4), np.nan, dtype=np.float32)
    assert make_positive(tangents) == 0 and np.isnan(tangents).all()


def test_no_tangents_are_no_matter():
    assert make_positive(np.zeros((0, 4, 4), dtype=np.float32)) == 0
