"""How softly a face's contact points are held beside an edge of the object."""

import numpy as np
import pytest

from softtact.contact.edges import ENDS, contact_compliance, point_areas
from softtact.contact.penalty import Contact
from softtact.fem.quadrature import gauss

WIDTH = np.ones(1)


def of_columns(low, middle, high):
    """Softness (3, 3) of a face whose columns of points, along x, are covered by these shares."""
    return contact_compliance(np.repeat([low, middle, high], 3).astype(float), WIDTH).reshape(3, 3)


def test_points_that_are_covered_wholly_are_hard():
    assert not of_columns(1, 1, 1).any()


def test_points_get_softer_the_less_of_them_is_covered():
    assert (of_columns(1, 1, 0.2)[2] > of_columns(1, 1, 0.5)[2]).all() and not of_columns(1, 1, 0.5)[:2].any()


def test_the_first_column_that_an_edge_comes_to_is_the_hardest_for_it_follows_close_on_those_of_the_face_before():
    first, middle, last = of_columns(0.5, 0, 0)[0, 0], of_columns(1, 0.5, 0)[1, 0], of_columns(1, 1, 0.5)[2, 0]
    assert 0 < first < middle < last


def test_an_edge_along_one_side_softens_all_points_of_a_column_by_that_columns_compliance():
    assert np.allclose(of_columns(1, 1, 0.5)[2], 0.4 * 0.5) and np.allclose(of_columns(1, 0.5, 0)[1], 0.3 * 0.5)


def test_faces_do_not_notice_each_other():
    shares = [np.repeat([1, 0.5, 0], 3), np.tile([1, 0.5, 0], 3), np.ones(9)]
    alone = [contact_compliance(share, WIDTH) for share in shares]
    assert np.allclose(contact_compliance(np.concatenate(shares), np.ones(3)), np.concatenate(alone))


def test_a_mirrored_edge_is_felt_alike():
    assert np.allclose(of_columns(0, 0.3, 1), of_columns(1, 0.3, 0)[::-1])


def test_rows_and_columns_are_felt_alike():
    share = np.array([[1, 1, 1], [0.6, 0.6, 0.6], [0, 0, 0]], dtype=float)
    assert np.allclose(contact_compliance(share.ravel(), WIDTH).reshape(3, 3),
                       contact_compliance(share.T.ravel(), WIDTH).reshape(3, 3).T)


def test_softness_grows_with_the_face():
    share = np.repeat([1, 0.5, 0], 3)
    assert np.allclose(contact_compliance(np.tile(share, 2), np.array([1.0, 2.0])).reshape(2, 9)[1],
                       2 * contact_compliance(share, WIDTH))


def test_the_areas_of_a_faces_points_fill_it():
    points, _ = gauss(3, 2)
    corners = point_areas(np.array([[0.3, 0.2]]), points)[0] + (np.array([0.3, 0.2]) * points)[:, None]
    sides = np.ptp(corners, axis=1)
    assert sides.prod(axis=1).sum() == pytest.approx(0.6 * 0.4) and np.allclose(np.unique(corners[..., 0].round(9)), 0.3 * ENDS)


def test_a_points_spring_gives_way_by_its_softness_times_the_pressure():
    """In series with a penalty of 1 / 3000 mm/MPa, at twice the depth where it is linear."""
    contact, gap = Contact(contact_compliance=np.array([0.0, 0.01])), np.array([-2e-3, -2e-3])
    _, pressure, _ = contact.response(gap)
    assert np.allclose(contact.surface_gaps(gap), gap + [0.0, 0.01 * pressure[1]]) and pressure[1] < pressure[0] / 20


def test_the_compression_of_a_spring_is_not_augmented():
    contact, gap = Contact(contact_compliance=np.array([0.01])), np.array([-4e-3])
    _, pressure, _ = contact.response(gap)
    held, there = contact.augmented(gap), -0.01 * pressure     # the surface where the spring alone gives way
    assert held.response(there)[1] == pytest.approx(pressure) and held.error(there) == pytest.approx(0.0, abs=1e-12)
    assert contact.error(gap) == pytest.approx(-(gap + 0.01 * pressure)[0])
