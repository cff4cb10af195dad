"""Systems of changing rows and springs, solved from an earlier one's factor, against the dense solution with the depth bordered."""

import numpy as np
import pytest
import scipy.linalg as sla

from softtact.models.foundation import active_system
from softtact.models.foundation.active_system import ActiveSystem

SIZE, PATCHES, TOTAL = 120, 80, 3.0


@pytest.fixture
def problem():
    """A compliance as of points on a line, which falls with their distance, springs in series, and displacements."""
    rng, place = np.random.default_rng(3), np.arange(SIZE)
    matrix = (0.05 * np.exp(-np.abs(place[:, None] - place) / 8.0)).astype(np.float32)
    return matrix, rng.uniform(0.0, 0.05, SIZE), rng.normal(scale=0.05, size=SIZE)


def dense(matrix, rows, spring, right):
    """Forces (n,) and the depth by one solution with the depth as a further unknown."""
    loaded = (rows < PATCHES).astype(float)
    system = np.block([[matrix[np.ix_(rows, rows)] + np.diag(spring[rows]), -loaded[:, None]], [loaded[None], np.zeros((1, 1))]])
    found = np.linalg.solve(system.astype(float), [*right[rows], TOTAL])
    forces = np.zeros(SIZE)
    forces[rows] = found[:-1]
    return forces, found[-1]


def check(system, problem, rows, spring, start=None):
    """Solve, and compare with the dense solution; returns the forces."""
    matrix, _, right = problem
    forces, moved, depth = system.solve(rows, spring, right, np.zeros(SIZE) if start is None else start, TOTAL, 1e-6)
    expected, expected_depth = dense(matrix, rows, spring, right)
    np.testing.assert_allclose(forces, expected, atol=2e-5)      # single precision of displacements over the least compliance
    np.testing.assert_allclose(moved, matrix.astype(float) @ expected, atol=1e-6)
    assert depth == pytest.approx(expected_depth, abs=1e-6)
    return forces


@pytest.fixture
def factors(monkeypatch):
    """The factors that were made."""
    made = []

    class Counted(active_system._Factor):
        def __init__(self, *what):
            made.append(self)
            super().__init__(*what)

    monkeypatch.setattr(active_system, "_Factor", Counted)
    return made


def test_rows_that_come_and_go_border_the_first_factor(problem, factors):
    system, (_, spring, _) = ActiveSystem(problem[0], PATCHES), problem
    rows = np.arange(10, 110)
    forces = check(system, problem, rows, spring)
    for change in ([10], [10, 11, 70], [4, 5], [4, 5, 100, 60], []):
        forces = check(system, problem, np.setxor1d(rows, np.array(change, dtype=int)), spring, forces)
    assert len(factors) == 1


def test_springs_may_change_a_little_or_some_of_them_much(problem, factors):
    system, (_, spring, _), rows = ActiveSystem(problem[0], PATCHES), problem, np.arange(10, 110)
    check(system, problem, rows, spring)
    check(system, problem, rows, 1.4 * spring)
    stiff_and_soft = spring.copy()
    stiff_and_soft[[20, 90, 91]] = 1e3, 0.0, 5.0
    check(system, problem, rows, stiff_and_soft)
    assert len(factors) == 1


def test_where_much_has_changed_a_new_factor_is_made(problem, factors):
    system, (_, spring, _) = ActiveSystem(problem[0], PATCHES), problem
    check(system, problem, np.arange(10, 110), spring)
    check(system, problem, np.arange(30, 110), spring)
    check(system, problem, np.arange(30, 110), spring + 10.0)
    assert len(factors) == 3


@pytest.mark.parametrize("height_mm", [1.0, 5.0])
def test_forces_are_found_to_single_precision_however_far_above_the_object_starts(problem, height_mm):
    matrix, spring, right = problem
    rows, away, enough = np.arange(10, 110), np.where(np.arange(SIZE) < PATCHES, -height_mm, 0.0), 1e-7 * TOTAL
    near, far = (ActiveSystem(matrix, PATCHES).solve(rows, spring, moved, np.zeros(SIZE), TOTAL, enough)
                 for moved in (right, right + away))
    np.testing.assert_allclose(far[0], near[0], atol=2e-5)
    assert far[2] == pytest.approx(near[2] + height_mm, abs=1e-6)


def test_a_system_that_is_not_positive_definite_is_refused(problem):
    matrix, spring, right = problem
    with pytest.raises(sla.LinAlgError):
        ActiveSystem(matrix - 0.1 * np.eye(SIZE, dtype=np.float32), PATCHES).solve(np.arange(SIZE), spring, right, np.zeros(SIZE),
                                                                                  TOTAL, 1e-6)
