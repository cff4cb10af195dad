"""Newton's method with line search for all models.

A model describes its equilibrium as a `Problem`: the residual, the Newton step, and whether a trial state is better.
Features of a single model (updates of the contact projection, cached tangents and factorisations) are in its problem.
Reference: Nocedal and Wright, Numerical Optimization, 2nd ed., ch. 3.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

HALVINGS = 10     # of a step, before the line search fails
_CLEARLY = 0.8    # share of former residuals below which the present ones are on their way to balance


class Problem(Protocol):
    """An equilibrium problem. The types of states and steps are those of the model."""

    def prepared(self, state: Any, iteration: int) -> Any:
        """The state at an iteration's start, with updates such as a new contact projection."""

    def residual(self, state: Any) -> float:
        """Largest unbalanced force in N."""

    def balanced(self, state: Any, residual: float) -> bool:
        """Whether the state is good enough."""

    def step(self, state: Any) -> tuple[Any, Any]:
        """The state from which a step starts, and the step; None if it cannot be computed."""

    def first_share(self, step: Any) -> float:
        """The share of a step that is tried first."""

    def moved(self, state: Any, step: Any, share: float) -> Any:
        """The state after a share of a step; None if it is invalid, for example with an inverted element."""

    def better(self, trial: Any, state: Any, residual: float) -> bool:
        """Whether a trial is closer to equilibrium than the state with its residual (N)."""

    def accepted(self, state: Any, trial: Any) -> None:
        """Called after a trial has replaced the state."""

    def recovered(self, state: Any) -> bool:
        """Called after a failed line search: whether another step may help, for example with a new tangent."""


@dataclass(frozen=True)
class Solution:
    """The result of Newton's method."""

    state: Any
    """The equilibrium state; None if it was not found."""
    iterations: int
    """Steps that were taken."""
    residual_n: float
    """The last largest unbalanced force in N."""
    last: Any
    """The last state, at equilibrium or not."""


def solve(problem: Problem, state: Any, *, max_iterations: int, nearly_n: float = 0.0, patience: int = 1) -> Solution:
    """Solve a problem from a start state; `Solution.state` is None without convergence in `max_iterations`.

    nearly_n: if the residual is at most this after these iterations, as many more follow
    patience: up to so many times the iterations are taken, as long as residuals fall (`_falls`)
    """
    residuals: list[float] = []
    limit = max_iterations
    for iteration in range(max(2, patience) * max_iterations):
        state = problem.prepared(state, iteration)
        residuals.append(problem.residual(state))
        if problem.balanced(state, residuals[-1]):
            return Solution(state, iteration, residuals[-1], state)
        if iteration == limit:
            limit = _longer(limit, residuals, max_iterations, nearly_n, patience)
            if iteration == limit:
                return Solution(None, iteration, residuals[-1], state)
        state, step = problem.step(state)
        trial = None if step is None else line_search(problem, state, step, residuals[-1])
        if trial is not None:
            problem.accepted(state, trial)
            state = trial
        elif not problem.recovered(state):
            return Solution(None, iteration, residuals[-1], state)
    return Solution(None, len(residuals), residuals[-1], state)


def _longer(limit, residuals, max_iterations, nearly_n, patience):
    """The number of iterations that may be taken after `limit` of them, or `limit`."""
    if residuals[-1] <= nearly_n and limit < 2 * max_iterations:
        return 2 * max_iterations
    longer = limit < patience * max_iterations and _falls(residuals, max_iterations // 2)
    return limit + max_iterations // 2 if longer else limit


def _falls(residuals, count):
    """Whether the last `count` residuals are clearly smaller than those before: medians, as single ones jump."""
    return bool(np.median(residuals[-count:]) < _CLEARLY * np.median(residuals[-2 * count:-count]))


def line_search(problem: Problem, state: Any, step: Any, residual: float) -> Any:
    """Backtracking: the first better trial among 1, 1/2, 1/4 ... of the first share of a step; None if none is better."""
    share = problem.first_share(step)
    for _ in range(HALVINGS):
        trial = problem.moved(state, step, share)
        if trial is not None and problem.better(trial, state, residual):
            return trial
        share *= 0.5
    return None


def line_search_each(accept: Callable[[np.ndarray, float], np.ndarray], count: int, *, halvings: int) -> np.ndarray:
    """Backtracking for many small problems at once, each with a separate share: which (count,) found a better trial.

    accept(waiting, share): tries a share of the steps of the problems with these numbers (k,), keeps better trials, and returns
    which (k,) were better
    """
    waiting = np.arange(count)
    for halving in range(halvings):
        waiting = waiting[~accept(waiting, 0.5**halving)]
        if not len(waiting):
            break
    return ~np.isin(np.arange(count), waiting)


def lowers_potential(before: float, after: float, scale: float) -> bool | None:
    """Whether a potential decreases; None if rounding hides the difference, so that the residuals have to decide.

    scale: size of the terms whose sum is the potential
    """
    resolution = 1e-11 * scale
    change = after - before
    return True if change < -resolution else None if change <= resolution else False
