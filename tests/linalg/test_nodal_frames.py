"""Nodes whose coordinates are turned: the same matrix and vectors as with the whole orthogonal matrix of the turns."""

import numpy as np
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

from softtact.linalg.nodal_frames import NodeFrames

NODES = 9
UNKNOWNS = 3 * NODES - 1     # the last node is held along z


def frames_of(nodes, wanted, *, others=(), seed=0):
    turns = Rotation.random(len(nodes), rng=np.random.default_rng(seed)).as_matrix()
    return NodeFrames(first=3 * np.asarray(nodes), turns=turns, wanted=np.asarray(wanted),
                      others=np.asarray(others, dtype=np.int64))


def whole_turn(frames):
    """The orthogonal matrix (n, n) of all turns: its columns are the new unknowns."""
    out = np.eye(UNKNOWNS)
    for first, turn in zip(frames.first, frames.turns, strict=True):
        out[first:first + 3, first:first + 3] = turn
    return out


def random_matrix(seed=1):
    """Symmetric, whole, and its upper triangle; nodes couple with all their components or with none."""
    rng = np.random.default_rng(seed)
    couple = sp.random(NODES, NODES, density=0.3, rng=rng) + sp.eye(NODES)
    half = sp.kron(couple, np.ones((3, 3))).tocsr()[:UNKNOWNS, :UNKNOWNS]
    half.data = rng.normal(size=half.nnz)
    whole = (half + half.T).toarray()
    upper = sp.triu(half + half.T, format="csr")
    upper.sort_indices()
    return whole, upper


def test_a_turned_matrix_is_that_between_the_turns():
    for nodes in [[0], [1, 2, 5], range(NODES - 1)]:
        frames, (whole, upper) = frames_of(nodes, [1] * len(nodes)), random_matrix()
        found = sp.csr_matrix((frames.turned_matrix(upper), upper.indices, upper.indptr), shape=upper.shape).toarray()
        turn = whole_turn(frames)
        np.testing.assert_allclose(found, np.triu(turn.T @ whole @ turn), atol=1e-13)


def test_a_vector_is_turned_by_the_same_turns_and_back():
    frames, x = frames_of([1, 2, 5], [1, 1, 1]), np.random.default_rng(2).normal(size=UNKNOWNS)
    np.testing.assert_allclose(frames.turned(x), whole_turn(frames).T @ x, atol=1e-14)
    np.testing.assert_allclose(frames.turned_back(frames.turned(x)), x, atol=1e-14)


def test_what_is_meant_are_the_last_vectors_of_each_node_and_the_others():
    frames = frames_of([1, 2, 5], [1, 3, 2], others=[UNKNOWNS - 2, UNKNOWNS - 1])
    assert frames.last.tolist() == [5, 6, 7, 8, 16, 17, UNKNOWNS - 2, UNKNOWNS - 1]
    np.testing.assert_array_equal(frames.movements(UNKNOWNS).toarray(), whole_turn(frames)[:, frames.last])


def test_upright_frames_leave_a_matrix_as_it_is():
    frames = NodeFrames(first=np.array([0, 9]), turns=np.tile(np.eye(3), (2, 1, 1)), wanted=np.array([1, 1]),
                        others=np.zeros(0, dtype=np.int64))
    _, upper = random_matrix()
    assert frames.turned_matrix(upper) is upper.data


def test_frames_cover_those_of_fewer_nodes_vectors_and_others():
    for nodes, wanted, others, covered in [
        ([1, 5], [1, 2], [25], True), ([1, 3], [1, 1], [], False), ([1], [2], [], False), ([1], [1], [24], False)]:
        assert frames_of([1, 2, 5], [1, 3, 2], others=[25]).covers(frames_of(nodes, wanted, others=others)) is covered, nodes


def test_covering_frames_take_over_the_vectors_of_now():
    kept, now = frames_of([1, 2, 5], [1, 3, 2]), frames_of([1, 5], [1, 1], seed=3)
    turned = kept.turned_as(now)
    np.testing.assert_array_equal(turned.turns[[0, 2]], now.turns)
    np.testing.assert_array_equal(turned.turns[1], kept.turns[1])
    np.testing.assert_array_equal(turned.last, kept.last)
