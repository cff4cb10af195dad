"""Surfaces that meet: their points' rules, their ends, and what a pair tells of its overlap."""

from math import factorial

import numpy as np
import pytest

from softtact.contact.pair import ContactPair
from softtact.contact.surfaces import Surface, quadrature_points

TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0], [0.5, 0.5, 0], [0, 0.5, 0]])
SQUARE = np.array([[2.0, 0, 0], [3, 0, 0], [3, 1, 0], [2, 1, 0], [2.5, 0, 0], [3, 0.5, 0], [2.5, 1, 0], [2, 0.5, 0]])


def test_a_triangles_points_integrate_what_is_of_fourth_degree():
    """Over the right triangle of sides 1, x^i y^j gives i! j! / (i + j + 2)!."""
    points = quadrature_points(Surface.of({"triangle6": np.arange(6)[None]}), TRIANGLE)
    x, y, _ = (points.values[:, :6] @ TRIANGLE).T
    for i, j in [(0, 0), (1, 0), (0, 2), (2, 1), (3, 0), (4, 0), (2, 2), (1, 3), (0, 4)]:
        expected = factorial(i) * factorial(j) / factorial(i + j + 2)
        assert points.weight @ (x**i * y**j) == pytest.approx(expected, rel=1e-12), (i, j)


def test_facets_of_several_kinds_keep_their_own_nodes():
    surface = Surface.of({"triangle6": np.arange(6)[None], "quad8": np.arange(6, 14)[None]})
    assert surface.nodes[0, 6:].tolist() == [-1] * 3 and surface.nodes[1, 8] == -1
    assert surface.used.tolist() == list(range(14)) and surface.width == 8
    points = quadrature_points(surface, np.vstack([TRIANGLE, SQUARE]))
    areas = [points.weight[points.facet == facet].sum() for facet in (0, 1)]
    assert areas == pytest.approx([0.5, 1.0])


@pytest.mark.parametrize("size_mm", [1e-2, 1.0, 1e2])
@pytest.mark.parametrize(("degrees", "ends"), [(40.0, False), (50.0, True)])
def test_an_edge_over_which_a_surface_turns_by_more_than_45_degrees_ends_it_at_any_size(size_mm, degrees, ends):
    """Two triangles that share the edge along y, the second one bent down about it."""
    angle = np.radians(degrees)
    x = size_mm * np.array([[-1.0, 0, 0], [0, -1, 0], [0, 1, 0], [np.cos(angle), 0, -np.sin(angle)]])
    rims = Surface.of({"triangle": np.array([[0, 1, 2], [3, 2, 1]])}).rims(x)
    assert rims[:, 1].tolist() == [ends, ends] and rims[:, [0, 2]].all()


def pair_over(gap_mm, *, offset_mm=0.0):
    """A triangle that looks down at a large rigid one `gap_mm` below, moved along x by `offset_mm`; (pair, history, state)."""
    upper = np.array([[0.2, 0.2, 0], [0.2, 0.4, 0], [0.4, 0.2, 0]]) + [offset_mm, 0, gap_mm]
    x = np.vstack([upper, [[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    pair = ContactPair(Surface.of({"triangle": np.array([[0, 1, 2]])}), Surface.of({"triangle": np.array([[3, 4, 5]])}),
                       stiffness=10.0, reach_mm=0.5, rigid=True)  # fmt: skip
    history = pair.first(x)
    return pair, history, pair.evaluate(history, x)


def test_a_pair_tells_how_deep_its_surfaces_overlap_and_presses_in_proportion():
    _, history, state = pair_over(-3e-3)
    assert state.penetration_mm() == pytest.approx(3e-3) and state.pressure == pytest.approx(0.03)
    assert state.energy == pytest.approx(0.5 * 10 * 3e-3**2 * 0.02) and history.points.weight.sum() == pytest.approx(0.02)


def test_surfaces_apart_do_not_overlap_nor_press():
    _, _, state = pair_over(2e-3)
    assert state.penetration_mm() == 0.0 and not state.pressure.any() and state.energy == 0.0


def test_a_pair_is_settled_only_where_its_overlap_is_within_the_tolerance():
    pair, history, state = pair_over(-3e-3)
    assert pair.settled(history, state, 3.1e-3) and not pair.settled(history, state, 2.9e-3)
    assert pair.overlap_mm(history, state) == pytest.approx(3e-3)
