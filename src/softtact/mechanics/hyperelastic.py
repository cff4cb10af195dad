"""Presses under force control: Newton's method with line search, prediction along the force path, adaptive steps."""

from dataclasses import dataclass, field

import numpy as np

from softtact.errors import ConvergenceError
from softtact.mechanics.layered_body import BodyState


@dataclass(frozen=True)
class NewtonSettings:
    """Tolerance as a share of the force (at least of `smallest_scale_n`); iterations and largest movement per step;

    the smallest force increment that is still tried; how the first touch is found; the cut of the residual after which
    a tangent is used again.
    """

    relative_tolerance: float = 1e-4   # of a nodal force; 1e-6 changes the indentation by 2e-6 of itself
    max_iterations: int = 40
    largest_step_mm: float = 0.12
    smallest_increment_n: float = 0.02
    smallest_scale_n: float = 10.0
    first_touch_mm: float = 0.01
    first_touch_tolerance_n: float = 0.01   # a start for the first level, not a result
    good_reduction: float = 0.1


@dataclass(frozen=True)
class Level:
    """One converged force level."""

    force_n: float
    state: BodyState
    iterations: int
    residual_n: float


@dataclass
class Path:
    """Converged states along the force path; the last two give the start of the next step."""

    forces: list = field(default_factory=list)
    states: list = field(default_factory=list)

    def append(self, force, state):
        self.forces, self.states = [*self.forces[-1:], force], [*self.states[-1:], state]

    def predict(self, force):
        """Displacements extrapolated linearly in force; from one state alone, that state."""
        last = self.states[-1]
        now = (last.slab.displacement, last.bed.displacement, last.indentation)
        if len(self.states) < 2 or self.forces[1] <= self.forces[0]:
            return now
        first = self.states[0]
        before = (first.slab.displacement, first.bed.displacement, first.indentation)
        ratio = min(1.0, (force - self.forces[1]) / (self.forces[1] - self.forces[0]))
        return tuple(b + ratio * (b - a) for a, b in zip(before, now, strict=True))


def press_levels(body, surface, forces_n, *, settings=NewtonSettings()):
    """Yield a `Level` for each force (N, increasing). Raises ConvergenceError naming the level that was not reached."""
    path = Path()
    path.append(0.0, _first_touch(body, surface, settings))
    for force in forces_n:
        level = _advance(body, surface, path, float(force), settings)
        yield level


def _first_touch(body, surface, settings):
    """Equilibrium at a small given indentation: under force control alone the free object has no stiffness."""
    slab, bed = body.rest()
    planes = body.slab.facing(slab, surface)
    depth = settings.first_touch_mm + planes.anchors[:, 2].min()   # a tip may lie between the points that feel contact
    start = body.evaluate(slab, bed, depth, planes)
    state, _, _ = _newton(body, planes, start, None, settings.first_touch_tolerance_n, settings)
    if state is None:
        raise ConvergenceError("The first touch of the object did not converge.")
    return state


def _advance(body, surface, path, target, settings):
    """Reach `target`, halving the increment where Newton's method fails and growing it again where it succeeds."""
    iterations, increment = 0, target - path.forces[-1]
    while True:
        force = min(target, path.forces[-1] + increment)
        state, spent, residual = _attempt(body, surface, path, force, settings)
        iterations += spent
        if state is not None:
            path.append(force, state)
            increment *= 2
            if force >= target:
                return Level(force_n=target, state=state, iterations=iterations, residual_n=residual)
        else:
            increment = 0.5 * (force - path.forces[-1])
            if increment < settings.smallest_increment_n:
                raise ConvergenceError(f"The press did not converge between {path.forces[-1]:.3g} N and {force:.3g} N.")


def _attempt(body, surface, path, force, settings):
    last = path.states[-1]
    planes = body.slab.facing(last.slab.displacement, surface)
    start = body.evaluate(*path.predict(force), planes)
    if start is None:
        start = body.evaluate(last.slab.displacement, last.bed.displacement, last.indentation, planes)
    return _newton(body, planes, start, force, settings.relative_tolerance * max(force, settings.smallest_scale_n), settings)


def _newton(body, planes, state, force, tolerance, settings):
    """Equilibrium state (None if not reached), iterations, and the last residual in N.

    A step that cut the residual well is followed by one with the same tangent, which is cheap and nearly as good.
    """
    residual, reuse = body.residual_norm(state, force), False
    for iteration in range(settings.max_iterations):
        if residual <= tolerance:
            return state, iteration, residual
        step = body.newton_step(state, force, same_tangent=reuse)
        trial = _line_search(body, planes, state, step, force, residual, settings) if np.isfinite(step.largest()) else None
        if trial is None and not reuse:
            return None, iteration, residual
        before = residual
        if trial is not None:
            state, residual = trial, body.residual_norm(trial, force)
        reuse = trial is not None and residual < settings.good_reduction * before
    return None, settings.max_iterations, residual


def _potential(state, force):
    return state.energy - (force or 0.0) * state.indentation


def _line_search(body, planes, state, step, force, residual, settings):
    """The first of the shares 1, 1/2, 1/4 ... of the step that lowers the potential.

    Close to equilibrium the potential no longer resolves the difference; there a smaller residual decides.
    """
    share = min(1.0, settings.largest_step_mm / max(step.largest(), 1e-30))
    before = _potential(state, force)
    resolution = 1e-11 * (abs(state.energy) + abs(before))
    for _ in range(10):
        trial = body.evaluate(state.slab.displacement + share * step.slab, state.bed.displacement + share * step.bed,
                              state.indentation + share * step.indentation, planes)
        if trial is not None:
            change = _potential(trial, force) - before
            if change < -resolution or (change <= resolution and body.residual_norm(trial, force) < residual):
                return trial
        share *= 0.5
    return None
