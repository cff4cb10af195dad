"""Unknowns eliminated layer by layer leave what one dense elimination leaves, to single precision."""

import numpy as np
import pytest

from softtact.fem.static_condensation import Condensation, Springs, packed
from softtact.fem.substructuring import LayerwiseElimination
from softtact.linalg.workers import Workers

BODIES, UNKNOWNS, HELD = 3, 12, 5
LAYERS = [[np.array([[0, 1, 2, 3], [2, 3, 4, -1]])],                  # -1: a held unknown
          [np.array([[3, 4, 6, 7]]), np.array([[6, 7, 8]])],          # two groups of elements
          [np.array([[7, 8, 9, 10], [8, 9, 10, 11]])]]
ELIMINATED = np.isin(np.arange(UNKNOWNS), [0, 1, 2, 4, 6, 7, 8, 9])
LEFT = [3, 10, 11]
SPRING = np.array([[0, 11]])       # from the first layer to an unknown that else only the last one knows
EPSILON = 5e-6                     # single precision, times the condition of these matrices (below 100)


class Bodies:
    """Random positive definite elements, and the whole matrices that they make."""

    def __init__(self, seed, *, stiffness=1.0):
        rng = np.random.default_rng(seed)
        self.elimination = LayerwiseElimination(BODIES, ELIMINATED, LAYERS, coupled=[SPRING.ravel(), *[np.zeros(0, dtype=int)] * 2])
        self.tangents = [[stiffness * _positive(rng, (BODIES, *group.shape)) for group in groups] for groups in LAYERS]
        self.spring = rng.uniform(1, 2, (BODIES, 1))
        self.force = rng.normal(size=(BODIES, UNKNOWNS))
        self.force[:, HELD] = 0.0

    def set(self, bodies, **options):
        springs = Springs(self.spring[bodies], self.elimination.stages[0].place[SPRING], np.array([[1.0, -1.0]]))
        tangents = [[packed(group[bodies]) for group in groups] for groups in self.tangents]
        self.elimination.set(bodies, zip(tangents, [springs, None, None], strict=True), **options)

    def whole(self, body):
        """The body's matrix; the held unknown is alone with itself."""
        matrix = np.zeros((UNKNOWNS, UNKNOWNS))
        matrix[HELD, HELD] = 1.0
        for groups, tangents in zip(LAYERS, self.tangents, strict=True):
            for group, tangent in zip(groups, tangents, strict=True):
                for element, part in zip(group, tangent[body], strict=True):
                    free = element >= 0
                    matrix[np.ix_(element[free], element[free])] += part[np.ix_(free, free)]
        pair = np.zeros(UNKNOWNS)
        pair[SPRING[0]] = 1.0, -1.0
        return matrix + self.spring[body] * np.outer(pair, pair)


def _positive(rng, shape):
    root = rng.normal(size=(*shape, shape[-1]))
    return root @ root.swapaxes(-1, -2) + np.eye(shape[-1])


def schur(matrix):
    """What a dense elimination of all inner unknowns leaves."""
    inner = np.flatnonzero(ELIMINATED)
    return matrix[np.ix_(LEFT, LEFT)] - matrix[np.ix_(LEFT, inner)] @ np.linalg.solve(matrix[np.ix_(inner, inner)],
                                                                                     matrix[np.ix_(inner, LEFT)])


@pytest.fixture
def bodies():
    made = Bodies(0)
    made.set(np.arange(BODIES))
    return made


def test_what_is_left_is_the_schur_complement_of_the_whole_matrix(bodies):
    np.testing.assert_array_equal(bodies.elimination.outer, LEFT)
    for body, left in enumerate(bodies.elimination.matrices):
        np.testing.assert_allclose(left, schur(bodies.whole(body)), atol=EPSILON * np.abs(left).max())


def test_each_layer_eliminates_what_no_later_one_knows(bodies):
    assert [stage.inner.tolist() for stage in bodies.elimination.stages] == [[0, 1, 2], [4, 6], [7, 8, 9]]


@pytest.mark.parametrize("threads", [1, 2])
def test_forces_and_steps_are_those_of_the_whole_system(bodies, threads):
    workers = Workers(threads)
    force = bodies.force.copy()
    forward_solved = bodies.elimination.residual(force, workers=workers)
    step = np.zeros((BODIES, UNKNOWNS))
    for body in range(BODIES):
        step[body, LEFT] = -np.linalg.solve(schur(bodies.whole(body)), force[body, LEFT])
    bodies.elimination.recover(forward_solved, step, workers=workers)
    workers.close()
    for body in range(BODIES):
        expected = -np.linalg.solve(bodies.whole(body), bodies.force[body])
        np.testing.assert_allclose(step[body], expected, atol=10 * EPSILON * np.abs(expected).max())


def test_a_half_that_was_cut_in_double_precision_gives_that_share_of_the_step(bodies):
    forward_solved = bodies.elimination.residual(bodies.force.copy())
    step, share = np.zeros((2, BODIES, UNKNOWNS)), np.float64(0.25)
    bodies.elimination.recover(forward_solved, step[0])
    bodies.elimination.recover([share * half for half in forward_solved], step[1])
    np.testing.assert_allclose(step[1], 0.25 * step[0], atol=EPSILON * np.abs(step[0]).max())


def test_bodies_that_are_not_asked_for_keep_their_matrices(bodies):
    before = bodies.elimination.matrices.copy()
    bodies.tangents = Bodies(1).tangents
    bodies.set(np.array([1]))
    changed = (bodies.elimination.matrices != before).any(axis=(1, 2))
    assert changed.tolist() == [False, True, False]
    np.testing.assert_allclose(bodies.elimination.matrices[1], schur(bodies.whole(1)), rtol=1e-4)


def test_a_body_of_negative_stiffness_keeps_steps_that_go_down(bodies):
    weak = Bodies(2, stiffness=-1.0)
    weak.set(np.arange(BODIES))
    force = weak.force.copy()
    force[:, LEFT] = 0.0
    inner = force.copy()
    forward_solved, step = weak.elimination.residual(inner), np.zeros((BODIES, UNKNOWNS))
    weak.elimination.recover(forward_solved, step)       # the outer unknowns held: each body's own way to balance
    assert ((step * force).sum(axis=1) < 0).all()
    assert weak.elimination.stages[0].condensed.modified == BODIES


def test_damping_is_a_stiffness_on_inner_unknowns():
    damped = Bodies(3)
    damped.set(np.arange(BODIES), damping=np.array([0.0, 1.0, 5.0]))
    for body, damping in enumerate((0.0, 1.0, 5.0)):
        expected = schur(damped.whole(body) + damping * np.diag(ELIMINATED.astype(float)))
        np.testing.assert_allclose(damped.elimination.matrices[body], expected, atol=EPSILON * np.abs(expected).max())


@pytest.mark.parametrize("stiffest", [1e3, 1e8])
def test_soft_modes_that_go_down_stay_so_beside_one_of_any_stiffness(stiffest):
    """A layer near instability may leave 1e8 N/mm to the next one; what single precision rounds off is more than soft modes."""
    inner, outer, rng = 60, 9, np.random.default_rng(8)
    values = np.append(np.geomspace(0.1, 4e3, inner - 1) * rng.choice([-1, 1], inner - 1), stiffest)
    basis = np.linalg.qr(rng.normal(size=(inner, inner)))[0]
    matrix = np.zeros((inner + outer, inner + outer))
    matrix[:inner, :inner] = (basis * values) @ basis.T
    matrix[:inner, inner:] = rng.normal(size=(inner, outer))
    matrix[inner:, :inner] = matrix[:inner, inner:].T
    body = Condensation(1, inner, outer, [np.arange(inner + outer)[None]])
    body.set(np.array([0]), [packed(matrix[None, None])])
    assert body.modified == 1
    force = rng.normal(size=(1, inner))
    _, half = body.residual(force)
    step = body.recover(half, np.zeros((1, outer)))
    assert np.isfinite(body.outer).all()
    assert (step * force).sum() < 0 and np.linalg.norm(step) < np.linalg.norm(force) / 0.1     # of the softest mode alone


def one_body(outer_values):
    """A body of two inner unknowns and as many outer ones as there are eigenvalues to be left on these."""
    rng, count = np.random.default_rng(6), len(outer_values)
    basis = np.linalg.qr(rng.normal(size=(count, count)))[0]
    coupling, matrix = rng.normal(size=(2, count)), np.eye(2 + count)
    matrix[:2, 2:], matrix[2:, :2] = coupling, coupling.T
    matrix[2:, 2:] = (basis * np.array(outer_values)) @ basis.T + coupling.T @ coupling
    return matrix, basis


def test_what_a_body_leaves_is_made_positive_with_eigenvalues_of_the_same_size():
    matrix, basis = one_body([-3.0, -0.5, 2.0, 10.0])
    body = Condensation(1, 2, 4, [np.arange(6)[None]])
    body.set(np.array([0]), [packed(matrix[None, None])])
    np.testing.assert_allclose(body.positive_outer()[0], (basis * [3.0, 0.5, 2.0, 10.0]) @ basis.T, atol=1e-4)
    assert np.linalg.eigvalsh(body.outer[0].astype(float))[0] < -2.9     # itself it stays


def test_what_was_made_positive_is_found_anew_with_the_body():
    body = Condensation(1, 2, 4, [np.arange(6)[None]])
    for values in ([-3.0, -0.5, 2.0, 10.0], [1.0, 0.5, 2.0, 10.0], [-2.0, 0.5, 2.0, 10.0]):
        matrix, basis = one_body(values)
        body.set(np.array([0]), [packed(matrix[None, None])])
        np.testing.assert_allclose(body.positive_outer()[0], (basis * np.abs(values)) @ basis.T, atol=1e-4)
        assert (body.positive_outer() == body.positive_outer()).all()
