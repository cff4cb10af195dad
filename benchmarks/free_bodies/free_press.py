"""Presses of a `FreeBody` to given indentations or forces: Newton's method with line search, one factor for several steps."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from free_bodies.free_body import FreeBody, FreeState
from softtact.errors import ConvergenceError
from softtact.models.newton import lowers_potential, solve


@dataclass(frozen=True)
class FreeSettings:
    """When a step is good enough, and when a tangent is used again.

    relative_residual: largest unbalanced force over the mean force component of the elements; relative_correction: last
    correction over the largest displacement of the increment (CalculiX asks for 0.005 and 0.01); good_reduction: a step that
    cuts the residual to less than this share is followed by one with the same tangent.
    """

    relative_residual: float = 1e-5
    relative_correction: float = 1e-2
    good_reduction: float = 0.4
    max_iterations: int = 40
    largest_step_mm: float = 0.2
    first_touch_mm: float = 0.01


@dataclass(frozen=True)
class FreeLoadStep:
    """A converged load step: its state, iterations, factorisations, and the largest unbalanced force in N."""

    state: FreeState
    iterations: int
    factorisations: int
    residual_n: float


def press_to_indentations(body: FreeBody, indentations_mm: Iterable[float], *,
                          settings: FreeSettings = FreeSettings()) -> Iterator[FreeLoadStep]:
    """Yield a `FreeLoadStep` for each indentation (mm, increasing)."""
    press = _Press(body, settings)
    for indentation in indentations_mm:
        yield press.advance(float(indentation), None)


def press_to_forces(body: FreeBody, forces_n: Iterable[float], *,
                    settings: FreeSettings = FreeSettings()) -> Iterator[FreeLoadStep]:
    """Yield a `FreeLoadStep` for each force (N, increasing); the first touch is made by a small indentation."""
    press = _Press(body, settings)
    press.advance(settings.first_touch_mm, None)
    for force in forces_n:
        yield press.advance(press.states[-1].indentation, float(force))


class _Press:
    """The states reached so far and whether the solver holds a factor."""

    def __init__(self, body, settings):
        self.body, self.settings = body, settings
        self.states, self.factored, self._slope = [body.rest()], False, None

    def advance(self, indentation, force, *, halvings=5):
        """Equilibrium at an indentation or, if given, at a force; where Newton's method fails, in two halves of the increment."""
        try:
            return self._increment(indentation, force)
        except ConvergenceError:
            if not halvings:
                raise
        last = self.states[-1]
        self.factored = False
        if force is None:
            first = self.advance(0.5 * (last.indentation + indentation), None, halvings=halvings - 1)
        else:
            first = self.advance(last.indentation, 0.5 * (last.object_force + force), halvings=halvings - 1)
        second = self.advance(indentation, force, halvings=halvings - 1)
        return replace(second, iterations=first.iterations + second.iterations,
                       factorisations=first.factorisations + second.factorisations)

    def _increment(self, indentation, force):
        body, last = self.body, self.states[-1]
        body.face(last.displacement)
        start = self._start(indentation) if force is None else body.evaluate(last.displacement, last.indentation)
        load_step = self._newton(start, force)
        self.states = [*self.states[-3:], load_step.state]
        return load_step

    def _start(self, indentation):
        """Displacements continued to the next indentation: along the tangent at first, then by a curve through the last states."""
        body, states = self.body, self.states
        if len(states) == 1:
            return self._along_the_tangent(states[-1], indentation)
        guess = self._continued(indentation)
        return (body.evaluate(body.carried(guess, indentation), indentation)
                or body.evaluate(body.carried(states[-1].displacement, indentation), indentation))

    def _along_the_tangent(self, state, indentation):
        """The first guess, from the state at rest; a first touch has no slope to follow."""
        body = self.body
        if any(contact.moves for contact in body.contacts):
            return body.evaluate(state.displacement, indentation)
        border, _ = body.border(state)
        body.factor(state)
        self.factored = True
        start = body.moved(state, -indentation * body.solver.solve(border), indentation)
        self._slope = start.displacement / indentation if start is not None else None
        return start

    def _continued(self, indentation):
        """u(d) through the last states; as long as they begin at rest, with the slope there: u = d u'(0) + d^2 w(d)."""
        states = self.states
        if self._slope is not None and states[0].indentation == 0:
            d = [s.indentation for s in states[1:]]
            w = [(s.displacement - s.indentation * self._slope) / s.indentation**2 for s in states[1:]]
            return indentation * self._slope + indentation**2 * _interpolated(d, w, indentation)
        states = states[-3:]
        return _interpolated([s.indentation for s in states], [s.displacement for s in states], indentation)

    def _newton(self, state, force):
        if state is None:
            raise ConvergenceError("The step inverts an element; use smaller steps.")
        problem = _Balance(self.body, self.settings, force, self.states[-1], factored=self.factored)
        found = solve(problem, state, max_iterations=self.settings.max_iterations)
        self.factored = problem.factored
        if found.state is None:
            raise ConvergenceError(f"No balance at an indentation of {problem.state.indentation:.4g} mm: "
                                   f"{found.residual_n:.3g} N are left.")
        return FreeLoadStep(found.state, found.iterations, problem.factorisations, found.residual_n)


class _Balance:
    """The body's balance under a force (N), or at its indentation where that is None, as a `Problem`."""

    def __init__(self, body, settings, force, last, *, factored):
        self.body, self.settings, self.force, self.last, self.factored = body, settings, force, last, factored
        self.reuse, self.correction, self.factorisations, self.memory = factored and force is None, np.inf, 0, _Memory()

    def prepared(self, state, iteration):
        self.state = state
        return state

    def residual(self, state):
        largest = float(np.abs(self.body.residual(state)).max())
        return largest if self.force is None else max(largest, abs(state.object_force - self.force))

    def balanced(self, state, residual):
        moved = float(np.abs(state.displacement - self.last.displacement).max())
        return (residual <= self.settings.relative_residual * state.mean_force
                and self.correction <= self.settings.relative_correction * moved)

    def step(self, state):
        """Step (unknowns,) and indentation increment of the object (mm), with a factor of before where it serves."""
        if not self.reuse:
            self.body.factor(state)
            self.factored, self.factorisations, self.memory = True, self.factorisations + 1, _Memory()
        step, indentation_increment = self._step(state)
        if self.force is None and not self.body.contacts:   # a mean of steps would not fulfil the contact
            step = self.memory.improved(step)
        self._step_size = float(np.abs(step).max())
        return state, (step, indentation_increment)

    def _step(self, state):
        body = self.body
        if self.force is None:
            return body.step(state), 0.0
        residual = body.residual(state)
        if not self.reuse:
            self._border, self._corner = body.border(state)
            step, self._along = -body.solver.solve(np.column_stack([residual, self._border])).T
        else:
            step = -body.solver.solve(residual)
        stiffness = abs(self._corner + self._border @ self._along)
        indentation_increment = (self.force - state.object_force - self._border @ step) / stiffness
        return step + indentation_increment * self._along, indentation_increment

    def first_share(self, step):
        return min(1.0, self.settings.largest_step_mm / max(float(np.abs(step[0]).max()), abs(step[1]), 1e-30))

    def moved(self, state, step, share):
        return self.body.moved(state, share * step[0], share * step[1])

    def better(self, trial, state, residual):
        before = self._potential(state)
        return self.residual(trial) < residual or bool(lowers_potential(before, self._potential(trial), abs(before)))

    def _potential(self, state):
        return state.energy - (self.force or 0.0) * state.indentation

    def accepted(self, state, trial):
        self.correction = self._step_size
        self.reuse = self.residual(trial) < self.settings.good_reduction * self.residual(state)

    def recovered(self, state):
        """A new factor may help where an old one was used, or points that join the contact."""
        helped = self.reuse or self.body.join_contact()
        self.reuse = False
        return helped


class _Memory:
    """Anderson's acceleration of steps with one tangent: earlier steps and what they changed correct the next one.

    Reference: Walker and Ni, SIAM J. Numer. Anal. 49 (2011) 1715.
    """

    _DEPTH = 5

    def __init__(self):
        self._raw, self._moves, self._changes = None, [], []

    def improved(self, step):
        """The step to take in place of the tangent's `step` (unknowns,); the whole of it is assumed to be taken."""
        if self._raw is not None:
            self._changes = [*self._changes, step - self._raw][-self._DEPTH:]
            weights = _least_squares(np.array(self._changes), step)
            better = step - weights @ (np.array(self._moves[-self._DEPTH:]) + np.array(self._changes))
        else:
            better = step
        self._raw, self._moves = step, [*self._moves, better][-self._DEPTH:]
        return better


def _least_squares(rows, target):
    """Weights of the rows (k, n) whose sum is nearest to a target (n,), by normal equations of rows scaled to one length.

    Rows that are alike within 1e-5 count as one, and rows of zeros for nothing.
    """
    lengths = np.linalg.norm(rows, axis=1)
    lengths[lengths == 0] = 1.0
    products = (rows @ rows.T) / np.outer(lengths, lengths)
    return np.linalg.lstsq(products, (rows @ target) / lengths, rcond=1e-10)[0] / lengths


def _interpolated(places, values, place):
    """Lagrange's polynomial through values at places, continued to `place`."""
    total = 0.0
    for x, value in zip(places, values, strict=True):
        others = [(place - y) / (x - y) for y in places if y != x]
        total = total + np.prod(others) * value
    return total
