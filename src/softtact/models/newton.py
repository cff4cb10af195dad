"""Newton's method with line search, once for all models.

A model describes its balance as a `Problem`: what is out of balance, the step of its tangent, and whether a trial is better.
What belongs to a model alone (a new projection of the contact, kept tangents, a factor for several steps) stays in its problem.
Reference: Nocedal and Wright, Numerical Optimization, 2nd ed., ch. 3.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

HALVINGS = 10     # of a step, until it is given up


class Problem(Protocol):
    """A balance to be found. States and steps are the model's own."""

    def prepared(self, state: Any, iteration: int) -> Any:
        """The state as an iteration sees it."""

    def residual(self, state: Any) -> float:
        """Largest unbalanced force in N."""

    def balanced(self, state: Any, residual: float) -> bool:
        """Whether the state is good enough."""

    def step(self, state: Any) -> tuple[Any, Any]:
        """The state from which a step leads, and the step; None where the tangent gives none."""

    def first_share(self, step: Any) -> float:
        """The share of a step that is tried first."""

    def moved(self, state: Any, step: Any, share: float) -> Any:
        """The state after a share of a step; None where there is none, as with an element inside out."""

    def better(self, trial: Any, state: Any, residual: float) -> bool:
        """Whether a trial is nearer to the balance than the state with its residual (N)."""

    def accepted(self, state: Any, trial: Any) -> None:
        """Take note that a trial has taken the state's place."""

    def recovered(self, state: Any) -> bool:
        """Whether another step may lead on from a state whose step was of no use: say, with a new tangent."""


@dataclass(frozen=True)
class Solution:
    """What Newton's method found."""

    state: Any
    """The balanced state; None where none was found."""
    iterations: int
    """Steps that were taken."""
    residual_n: float
    """The last largest unbalanced force in N."""


def solve(problem: Problem, state: Any, *, max_iterations: int, nearly_n: float = 0.0) -> Solution:
    """Balance of a problem, from a state on; `Solution.state` is None where it was not reached in so many iterations.

    nearly_n: where no larger force is unbalanced after these, as many follow
    """
    residual = float("inf")
    for iteration in range(2 * max_iterations):
        state = problem.prepared(state, iteration)
        residual = problem.residual(state)
        if problem.balanced(state, residual):
            return Solution(state, iteration, residual)
        if iteration == max_iterations and residual > nearly_n:
            return Solution(None, iteration, residual)
        state, step = problem.step(state)
        trial = None if step is None else line_search(problem, state, step, residual)
        if trial is not None:
            problem.accepted(state, trial)
            state = trial
        elif not problem.recovered(state):
            return Solution(None, iteration, residual)
    return Solution(None, 2 * max_iterations, residual)


def line_search(problem: Problem, state: Any, step: Any, residual: float) -> Any:
    """The first better trial among the shares 1, 1/2, 1/4 ... of the first share of a step; None where none is better."""
    share = problem.first_share(step)
    for _ in range(HALVINGS):
        trial = problem.moved(state, step, share)
        if trial is not None and problem.better(trial, state, residual):
            return trial
        share *= 0.5
    return None


def line_search_each(accept: Callable[[np.ndarray, float], np.ndarray], count: int, *, halvings: int) -> np.ndarray:
    """The same for many small problems at once, each with a share of its own: which (count,) found a better trial.

    accept(waiting, share): tries a share of the steps of the problems with these numbers (k,), keeps what is better, and says
    which (k,) it was
    """
    waiting = np.arange(count)
    for halving in range(halvings):
        waiting = waiting[~accept(waiting, 0.5**halving)]
        if not len(waiting):
            break
    return ~np.isin(np.arange(count), waiting)


def lowers_potential(before: float, after: float, scale: float) -> bool | None:
    """Whether a potential falls; None where rounding hides the difference, so that the residuals have to decide.

    scale: size of the terms that the potential is the sum of
    """
    resolution = 1e-11 * scale
    change = after - before
    return True if change < -resolution else None if change <= resolution else False
