"""Presses of a `FreeBody` to given indentations or forces: Newton's method with line search, one factor for several steps."""

from dataclasses import dataclass, replace

import numpy as np

from softtact.errors import ConvergenceError
from softtact.models.solid.body import FreeState


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


def press_to_indentations(body, indentations_mm, *, settings=FreeSettings()):
    """Yield a `FreeLoadStep` for each indentation (mm, increasing)."""
    press = _Press(body, settings)
    for indentation in indentations_mm:
        yield press.advance(float(indentation), None)


def press_to_forces(body, forces_n, *, settings=FreeSettings()):
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
        body, settings = self.body, self.settings
        if state is None:
            raise ConvergenceError("The increment turns an element inside out; take smaller ones.")
        last, residual = self.states[-1], self._norm(state, force)
        reuse, correction, factorisations, memory = self.factored and force is None, np.inf, 0, _Memory()
        for iteration in range(settings.max_iterations):
            moved = float(np.abs(state.displacement - last.displacement).max())
            if residual <= settings.relative_residual * state.mean_force and correction <= settings.relative_correction * moved:
                return FreeLoadStep(state, iteration, factorisations, residual)
            if not reuse:
                body.factor(state)
                self.factored, factorisations, memory = True, factorisations + 1, _Memory()
            step, indentation_increment = self._step(state, force, reuse)
            if force is None and not body.contacts:   # a mean of steps would not fulfil the contact
                step = memory.improved(step)
            trial = self._line_search(state, step, indentation_increment, force, residual)
            if trial is None and not reuse and not body.join_contact():
                break
            reuse = trial is not None and self._norm(trial, force) < settings.good_reduction * residual
            if trial is not None:
                correction, residual, state = float(np.abs(step).max()), self._norm(trial, force), trial
        raise ConvergenceError(f"No balance at an indentation of {state.indentation:.4g} mm: {residual:.3g} N are left.")

    def _step(self, state, force, reuse):
        """Step (unknowns,) and indentation increment of the object (mm)."""
        body = self.body
        if force is None:
            return body.step(state), 0.0
        residual = body.residual(state)
        if not reuse:
            self._border, self._corner = body.border(state)
            step, self._along = -body.solver.solve(np.column_stack([residual, self._border])).T
        else:
            step = -body.solver.solve(residual)
        stiffness = abs(self._corner + self._border @ self._along)
        indentation_increment = (force - state.object_force - self._border @ step) / stiffness
        return step + indentation_increment * self._along, indentation_increment

    def _norm(self, state, force):
        largest = float(np.abs(self.body.residual(state)).max())
        return largest if force is None else max(largest, abs(state.object_force - force))

    def _line_search(self, state, step, indentation_increment, force, residual):
        """The first of the shares 1, 1/2, 1/4 ... of the step that lowers the residual or the potential."""
        share = min(1.0, self.settings.largest_step_mm / max(float(np.abs(step).max()), abs(indentation_increment), 1e-30))
        before = state.energy - (force or 0.0) * state.indentation
        for _ in range(10):
            trial = self.body.moved(state, share * step, share * indentation_increment)
            if trial is not None:
                change = trial.energy - (force or 0.0) * trial.indentation - before
                if self._norm(trial, force) < residual or change < -1e-11 * abs(before):
                    return trial
            share *= 0.5
        return None


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
