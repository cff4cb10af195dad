"""Elements keep their tangents as long as their nodes have not moved against each other."""

import numpy as np
import pytest

from softtact.fem.extruded_mesh import extrude, sheet_mesh_2d
from softtact.fem.solid_block import HexBlock
from softtact.fem.static_condensation import Condensation, TangentCache, packed
from softtact.materials.laws.registry import make_law

LAW = make_law("mooney_rivlin", {"c10": 0.17, "c01": 0.004}, bulk_modulus=7.0)
KEPT_MM = 1e-3


@pytest.fixture
def block():
    mesh = extrude(sheet_mesh_2d(np.zeros((1, 2)), (1, 1), 1.2, 0.9, (1.2, 1.2)).mesh_2d, np.array([0.0, 0.2]))
    return HexBlock(mesh.points[mesh.layer(0)], LAW)


@pytest.fixture
def displacement(block):
    return np.random.default_rng(0).normal(scale=0.01, size=(len(block.at_rest.shapes), 27, 3))


def tangents(block, displacement, elements):
    return packed(block.tangent(displacement, elements, precision=np.float32))


def test_a_packed_matrix_is_its_upper_triangle_row_after_row():
    assert packed(np.array([[[1.0, 2.0, 3.0], [2.0, 4.0, 5.0], [3.0, 5.0, 6.0]]])).tolist() == [[1, 2, 3, 4, 5, 6]]


def test_an_unknown_that_stands_twice_in_an_element_gets_all_four_entries():
    body = Condensation(1, 0, 2, [np.array([[0, 1, 0]])])
    body.set(np.array([0]), [packed(np.array([[[[1.0, 2.0, 3.0], [2.0, 4.0, 5.0], [3.0, 5.0, 6.0]]]]))])
    np.testing.assert_array_equal(body.outer[0], [[1 + 3 + 3 + 6, 2 + 5], [2 + 5, 4]])


def test_the_first_tangents_are_those_of_the_place(block, displacement):
    chosen = np.array([1, 4, 2])
    found = TangentCache(block).at(displacement[chosen], chosen, kept_mm=KEPT_MM)
    np.testing.assert_array_equal(found, tangents(block, displacement[chosen], chosen))


@pytest.mark.parametrize(("moved_mm", "kept"), [(0.9 * KEPT_MM, True), (1.2 * KEPT_MM, False)])
def test_a_tangent_is_kept_until_a_node_has_moved_against_the_others(block, displacement, moved_mm, kept):
    keeper, chosen = TangentCache(block), np.array([0, 3])
    before = keeper.at(displacement[chosen], chosen, kept_mm=KEPT_MM)
    displacement[3, 5, 2] += moved_mm
    after = keeper.at(displacement[chosen], chosen, kept_mm=KEPT_MM)
    np.testing.assert_array_equal(after[0], before[0])
    np.testing.assert_array_equal(after[1], before[1] if kept else tangents(block, displacement[3:4], chosen[1:])[0])


def test_many_small_moves_are_one_large_one(block, displacement):
    keeper, chosen = TangentCache(block), np.array([3])
    for _ in range(6):
        found = keeper.at(displacement[chosen], chosen, kept_mm=KEPT_MM)
        displacement[3, 5, 2] += 0.3 * KEPT_MM
    last = displacement[chosen].copy()
    last[0, 5, 2] -= (6 - 4) * 0.3 * KEPT_MM     # found anew at the fifth look, 1.2 mm / 1000 after the first
    np.testing.assert_allclose(found, tangents(block, last, chosen), rtol=1e-5, atol=1e-5 * np.abs(found).max())


def test_what_all_nodes_share_changes_no_tangent(block, displacement):
    keeper, chosen = TangentCache(block), np.array([3])
    before = keeper.at(displacement[chosen], chosen, kept_mm=KEPT_MM)
    np.testing.assert_array_equal(keeper.at(displacement[chosen] + 0.5, chosen, kept_mm=KEPT_MM), before)


def test_nothing_is_kept_where_nothing_may_move(block, displacement):
    keeper, chosen = TangentCache(block), np.array([3])
    keeper.at(displacement[chosen], chosen, kept_mm=0.0)
    displacement[3, 5, 2] += 1e-5
    found = keeper.at(displacement[chosen], chosen, kept_mm=0.0)
    np.testing.assert_array_equal(found, tangents(block, displacement[chosen], chosen))
