"""Cholesky's method on dissected bodies: the factor is one, the order is cheap, and what comes last may be left open."""

import numpy as np
import pytest
import scipy.sparse as sp
from support.plates import plate
from support.six_frusta import six_frusta

from softtact.linalg.direct import make_solver
from softtact.linalg.multifrontal_solver import DissectedSolver
from softtact.linalg.symbolic import dissect, lay_out
from softtact.linalg.workers import Workers
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.models.hyperelastic.newton_step import ContactFactor
from softtact.models.hyperelastic.path import press_load_steps


def operations(pattern, places):
    """How many operations and entries a factor in the order of the dissection takes."""
    fronts, _ = lay_out(pattern.indptr, pattern.indices, dissect(pattern.indptr, pattern.indices, places))
    pivots, boundary = np.diff(fronts.pivot_at).astype(float), np.diff(fronts.boundary_at)
    count = np.sum(pivots**3 / 3 + pivots**2 * boundary + pivots * boundary**2)
    return count, np.sum(pivots * (pivots + 1) / 2 + pivots * boundary)


def energy_error(whole, found, right):
    """Energy norm of a solution's error as a share of the solution's, by another solver."""
    exact = sp.linalg.spsolve(whole.tocsc(), right)
    norm = lambda x: np.sqrt(x @ (whole @ x))  # noqa: E731
    return norm(found - exact) / norm(exact)


@pytest.fixture
def workers():
    pool = Workers(2)
    yield pool
    pool.close()


def test_every_unknown_is_in_one_piece_and_no_entry_joins_the_two_sides_of_a_cut():
    _, upper, places = plate(30, 17)
    pieces = dissect(upper.indptr, upper.indices, places)
    assert len(pieces) > 5
    np.testing.assert_array_equal(np.sort(np.concatenate([piece.pivots for piece in pieces])), np.arange(len(places)))
    below = []
    for piece in pieces:
        below.append(np.concatenate([piece.pivots, *(below[k] for k in piece.before)]))
        for k in piece.before:
            for other in piece.before:
                assert k == other or not upper[below[k]][:, below[other]].nnz


def test_operations_grow_with_the_cube_of_a_plates_width_and_entries_with_its_area(monkeypatch):
    # Nested dissection of n x n points takes of the order of n^3 operations and n^2 log n entries (George 1973), rows one after
    # the other n^4 and n^3: 8 and 4 times, little more for the logarithm, against 16 and 8 for twice the width.
    monkeypatch.setattr("softtact.linalg.symbolic._SMALLEST", 10)     # whole parts of 200 unknowns would outweigh all cuts
    small, large = (operations(*plate(n, n, layers=1)[1:]) for n in (64, 128))
    assert 7 < large[0] / small[0] < 10 and 4 < large[1] / small[1] < 5.5


@pytest.mark.slow
def test_triangles_and_rows_of_16_bits_hold_the_factor(workers):
    for size in [(3, 2), (30, 17), (60, 40)]:
        whole, upper, places = plate(*size)
        solver = DissectedSolver(places, workers=workers)
        assert solver.factor(upper)
        fronts, store, order, n = solver._fronts, solver._store, solver._order, len(places)
        factor = np.zeros((n, n))
        for p in range(len(fronts.pivot_at) - 1):
            first, end = fronts.pivot_at[p], fronts.pivot_at[p + 1]
            boundary = fronts.boundary[fronts.boundary_at[p]:fronts.boundary_at[p + 1]]
            triangle = np.zeros((end - first, end - first))
            triangle[np.triu_indices(end - first)] = store.triangles[fronts.triangle_at[p]:fronts.triangle_at[p + 1]]
            np.fill_diagonal(triangle, 1.0 / triangle.diagonal())
            short = store.short[fronts.short_at[p]:fronts.short_at[p + 1]].reshape(end - first, -1)
            factor[first:end, first:end] = triangle
            factor[first:end, boundary] = store.scale[first:end, None] * short
        # An entry is off by half a unit of 16 bits, 1.5e-5 of its row's largest, which is 1 here; up to 70 of them meet.
        np.testing.assert_allclose(factor.T @ factor, whole[order][:, order].toarray(), atol=1e-4)


@pytest.mark.slow
def test_a_solution_balances_its_right_side_to_what_16_bits_leave(workers):
    for columns in [None, 3]:
        whole, upper, places = plate(40, 30)
        right = np.random.default_rng(0).normal(size=len(places) if columns is None else (len(places), columns))
        solver = DissectedSolver(places, workers=workers)
        assert solver.factor(upper.astype(np.float32))
        found = solver.solve(1e5 * right)
        assert found.shape == right.shape and found.dtype == np.float64
        np.testing.assert_allclose(whole @ found / 1e5, right, atol=1e-3)


def test_a_solution_of_an_ill_conditioned_matrix_still_serves_conjugate_gradients():
    # Condition 8e5 / 0.01: as the matrix of a press, whose solutions are off by 3e-4 of their energy norm.
    whole, upper, places = plate(40, 30, stiffness=(1.0, 1e3, 1e5), shift=0.01)
    solver, right = DissectedSolver(places), np.random.default_rng(0).normal(size=len(places))
    assert solver.factor(upper)
    assert energy_error(whole, solver.solve(right), right) < 3e-3


def test_as_many_threads_give_the_same_to_the_last_digit():
    _, upper, places = plate(60, 40)
    right, found = np.random.default_rng(0).normal(size=len(places)), []
    for threads in (1, 2, 3):
        pool = Workers(threads)
        solver = DissectedSolver(places, workers=pool)
        assert solver.factor(upper)
        found.append(solver.solve(right))
        pool.close()
    np.testing.assert_array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[0], found[2])


def test_a_matrix_that_is_not_positive_definite_is_reported_and_the_next_one_factored(workers):
    for diagonal in [-50.0, np.nan]:
        whole, upper, places = plate(60, 40)
        solver, right = DissectedSolver(places, workers=workers), np.ones(len(places))
        for place in (0, len(places) // 2, len(places) - 1):
            indefinite = sp.csr_matrix((upper.data.copy(), upper.indices, upper.indptr), shape=upper.shape)
            indefinite.data[indefinite.indptr[place]] = diagonal
            assert solver.factor(upper) and not solver.factor(indefinite) and solver.factor(upper)
            np.testing.assert_allclose(whole @ solver.solve(right), right, atol=1e-3)


def test_plates_that_nothing_joins_are_solved_together():
    # Farther apart than either is wide, so that the cut between them has no unknowns.
    (one, _, here), (other, _, there) = plate(20, 12), plate(12, 20)
    whole, places = sp.block_diag([one, other], format="csr"), np.vstack([here, there + [40.0, 0.0]])
    upper = sp.triu(whole, format="csr")
    upper.sort_indices()
    assert any(not len(piece.pivots) for piece in dissect(upper.indptr, upper.indices, places))
    solver, right = DissectedSolver(places), np.random.default_rng(0).normal(size=len(places))
    assert solver.factor(upper)
    np.testing.assert_allclose(whole @ solver.solve(right), right, atol=1e-3)


def test_what_stood_in_its_memory_before_does_not_count(monkeypatch):
    # The last piece has nothing beyond itself, and so no rows of 16 bits; their scale was left as memory had it, mostly a number.
    stored = DissectedSolver._allocated

    def with_rubbish(self, **sizes):
        store = stored(self, **sizes)
        for values in store:
            values[:] = np.nan if values.dtype == np.float32 else -1
        return store

    monkeypatch.setattr(DissectedSolver, "_allocated", with_rubbish)
    whole, upper, places = plate(20, 12)
    solver, right = DissectedSolver(places), np.ones(len(places))
    assert solver.factor(upper)
    np.testing.assert_allclose(whole @ solver.solve(right), right, atol=1e-3)


def test_a_new_pattern_gets_an_analysis_of_its_own():
    whole, upper, places = plate(20, 12, layers=1)
    solver, right = DissectedSolver(places), np.ones(len(places))
    wider = sp.triu(whole @ whole, format="csr")
    wider.sort_indices()
    for matrix, full in ((upper, whole), (wider, whole @ whole), (upper, whole)):
        assert solver.factor(matrix)
        np.testing.assert_allclose(full @ solver.solve(right), right, atol=2e-3)
    solver.close()


def round_head(x, y):
    """A sphere of R 4 mm with its lowest point over the middle, and its normals."""
    height = 4.0 - np.sqrt(16.0 - x**2 - y**2)
    normals = np.column_stack([x, y, height - 4.0]) / 4.0
    return height, normals


@pytest.mark.slow
def test_a_press_ends_where_it_does_with_a_general_solver_in_double_precision():
    ends = []
    for general in (False, True):
        body = six_frusta()
        if general:
            body.solver = make_solver()
            body.stepper.factor = ContactFactor(body.solver)
        settings = NewtonSettings(relative_tolerance=1e-8)
        ends.append([level.state for level in press_load_steps(body, round_head, [0.5, 1.5], settings=settings)])
        assert (body.method == DissectedSolver.name) is not general
        body.close()
    for one, other in zip(*ends, strict=True):
        # Forces of 1e-7 N are left, on modes of 0.03 N/mm and more.
        assert one.indentation == pytest.approx(other.indentation, abs=1e-6)
        np.testing.assert_allclose(one.slab.displacement, other.slab.displacement, atol=3e-6)
