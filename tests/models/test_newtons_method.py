"""Newton's method of all models: how long it goes on."""

import pytest

from softtact.models.newton import solve


class Halving:
    """A balance of which each step leaves half, or `left`, of what is unbalanced; it counts its steps."""

    def __init__(self, tolerance, *, left=0.5):
        self.tolerance, self.left, self.steps = tolerance, left, 0

    def prepared(self, state, iteration):
        return state

    def residual(self, state):
        return state

    def balanced(self, state, residual):
        return residual <= self.tolerance

    def step(self, state):
        return state, (1 - self.left) * state

    def first_share(self, step):
        return 1.0

    def moved(self, state, step, share):
        return state - share * step

    def better(self, trial, state, residual):
        return trial < state

    def accepted(self, state, trial):
        self.steps += 1

    def recovered(self, state):
        return False


@pytest.mark.parametrize(("nearly_n", "reached"), [(0.0, False), (0.05, False), (0.07, True)])
def test_what_is_nearly_balanced_after_its_iterations_is_given_as_many_again(nearly_n, reached):
    problem = Halving(tolerance=1 / 128)
    found = solve(problem, 1.0, max_iterations=4, nearly_n=nearly_n)     # 1 / 16 N is left after four steps
    assert (found.state is not None) == reached
    assert problem.steps == (7 if reached else 4)


def test_it_ends_after_as_many_again():
    problem = Halving(tolerance=1 / 1024)
    found = solve(problem, 1.0, max_iterations=4, nearly_n=1.0)
    assert found.state is None and found.iterations == problem.steps == 8


@pytest.mark.parametrize(("left", "steps", "reached"), [(0.9, 29, True), (0.93, 40, False), (0.96, 10, False)])
def test_a_patient_run_goes_on_while_residuals_clearly_fall_up_to_so_many_times_its_iterations(left, steps, reached):
    """In five steps the residual falls to 0.59, 0.70 and 0.82 of itself; 0.9^29 is the first power below 0.05, 0.93^40 is above."""
    problem = Halving(tolerance=0.05, left=left)
    found = solve(problem, 1.0, max_iterations=10, patience=4)
    assert (found.state is not None) == reached and problem.steps == found.iterations == steps
