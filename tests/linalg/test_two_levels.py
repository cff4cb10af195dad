"""A factor on the corners of quadratic elements with Chebyshev's polynomial around it: a good preconditioner at any size."""

from functools import partial

import numpy as np
import pytest
import scipy.sparse as sp

from softtact.fem.structured_meshes import box, in_tetrahedra
from softtact.linalg import refined
from softtact.linalg.refined import RefinedSolver
from softtact.linalg.two_levels import TwoLevels
from softtact.materials.laws.registry import make_law
from softtact.models.solid import blocks
from softtact.models.solid.body import SolidBody


def system(n, *, bulk=5.0):
    """(upper triangle, places, lift) of a bonded cube of tetrahedra, n to an edge."""
    law = make_law("neo_hooke", {"c10": 0.1}, bulk_over_shear=bulk)
    body = SolidBody(in_tetrahedra(box((0, 0, 0), (1, 1, 1), (n, n, n))), {"body": law}, held={"z0": "xyz"})
    return body.tangent(body.rest()).copy(), body.points[body.free // 3], blocks.lift_from_corners(body.mesh, body.laws, body.free)


@pytest.fixture(autouse=True)
def small_bodies_too(monkeypatch):
    monkeypatch.setattr(blocks, "_LARGE", 0)


def whole(upper):
    return sp.csr_matrix(upper + sp.triu(upper, 1).T)


def energy_error(upper, found, right):
    """Energy norm of a solution's error as a share of the solution's, by another solver."""
    exact = sp.linalg.spsolve(whole(upper).tocsc(), right)
    return np.sqrt((found - exact) @ (whole(upper) @ (found - exact)) / (exact @ right))


def test_a_cycle_is_symmetric_and_positive_and_comes_near_the_inverse():
    upper, places, lift = system(2)
    levels = TwoLevels(places, lift)
    assert levels.factor(upper, whole(upper).dot)
    cycle = np.column_stack([levels.solve(column) for column in np.eye(len(places))])
    np.testing.assert_allclose(cycle, cycle.T, atol=1e-3 * np.abs(cycle).max())      # single precision on the corners: 3e-4
    values = np.linalg.eigvals(cycle @ whole(upper).toarray()).real
    # An exact cycle has at most 1; one tenth of the smoothed spectrum is left to the corners.
    assert 0.2 < values.min() and values.max() < 1.01


def test_the_corners_are_factored_by_where_they_stand():
    _, places, lift = system(2)
    at = TwoLevels(places, lift)._corners._places
    between = np.asarray(lift.sum(axis=1)).ravel() == 1.0     # not beside the floor, whose corners are held
    assert between.sum() > len(at)
    np.testing.assert_allclose((lift @ at)[between], places[between], atol=1e-14)


def test_the_steps_do_not_grow_with_the_body():
    steps = []
    for n in (3, 6):
        upper, places, lift = system(n)
        levels, right = TwoLevels(places, lift), np.random.default_rng(0).normal(size=len(places))
        assert levels.factor(upper, whole(upper).dot)
        _, taken = refined._conjugate_gradients(whole(upper).dot, right, levels.solve, 30)
        steps.append(taken)
    assert steps[1] <= steps[0] + 1 <= 10


def test_a_solver_with_a_lift_makes_no_factor_of_the_whole(monkeypatch):
    upper, places, lift = system(4)
    solver, right = RefinedSolver(places, lift=lift), np.random.default_rng(0).normal(size=(len(places), 2))
    monkeypatch.setattr(solver._quick, "factor", None)
    found = solver.solve(upper, right)
    assert max(energy_error(upper, found[:, k], right[:, k]) for k in range(2)) < 2e-3     # the last correction is below 1e-3
    assert solver.name == "conjugate gradients, two levels of nodes"


def test_a_preconditioner_as_good_as_a_factor_is_one_where_it_is_asked_for():
    upper, places, lift = system(4)
    solver, right = RefinedSolver(places, lift=lift), np.random.default_rng(0).normal(size=(len(places), 1))
    solver.solve(upper, right, factored=True)
    assert energy_error(upper, solver.precondition(right[:, 0]), right[:, 0]) < 1e-3


def test_a_matrix_that_takes_too_many_cycles_is_factored_from_then_on(monkeypatch):
    monkeypatch.setattr(refined, "_MOST_CYCLES", 3)
    upper, places, lift = system(4, bulk=90)
    solver, right = RefinedSolver(places, lift=lift), np.random.default_rng(0).normal(size=(len(places), 1))
    for _ in range(2):
        assert energy_error(upper, solver.solve(upper, right)[:, 0], right[:, 0]) < 1e-3
        assert "dissected" in solver.name


@pytest.mark.parametrize("fault", ["a diagonal below zero", "a matrix shifted below zero"])
def test_an_indefinite_matrix_is_told(fault):
    upper, places, lift = system(3)
    if fault == "a diagonal below zero":
        upper.data[upper.indptr[100]] = -1.0
    else:
        lowest = sp.linalg.eigsh(whole(upper).tocsc(), k=1, sigma=0)[0][0]
        upper.data[upper.indptr[:-1]] -= 3 * lowest
    solver = RefinedSolver(places, lift=lift)
    assert solver.solve(upper, np.ones((len(places), 1))) is None


def test_in_doubt_a_matrix_whose_corners_have_no_factor_is_factored_whole(monkeypatch):
    upper, places, lift = system(3)
    solver, right = RefinedSolver(places, lift=lift), np.random.default_rng(0).normal(size=(len(places), 1))
    monkeypatch.setattr(solver._levels._corners, "factor", lambda upper: False)
    assert solver.solve(upper, right) is None
    assert energy_error(upper, solver.solve(upper, right, doubt=True)[:, 0], right[:, 0]) < 1e-3


def test_a_sheet_without_free_corners_has_no_second_level():
    body = partial(SolidBody, in_tetrahedra(box((0, 0, 0), (2, 2, 1), (2, 2, 1))), {"body": make_law("neo_hooke", {"c10": 0.1})})
    free = body(held={"z0": "xyz", "z1": "xyz"})
    assert len(free.free) and blocks.lift_from_corners(free.mesh, free.laws, free.free) is None
