"""Newton steps that are linear in the rubber and exact in the object's contact, with one factor of the rubber for many of them.

Where an object touches changes far more within a step than how the rubber resists: a tangent that has lost a contact point
lets it fly into the object. So a step s minimises r.s + s.A s/2 + Phi(gaps + B s), with the rubber's tangent A, the residual r
and the contact's energy Phi: a convex problem whose Newton systems A + B'.W.B are solved by conjugate gradients. They are
preconditioned by the rubber of an earlier step with the contact of now (`contact_factor`).
"""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy.sparse as sp

from softtact.contact.penalty import Contact
from softtact.models.hyperelastic.preconditioner import ContactFactor, DissectedContact

if TYPE_CHECKING:
    from softtact.models.hyperelastic.linearised_contact import StepContact

_INNER_STEPS = 12
_FACINGS = 4                 # lookups of what the points face; an edge that slides over them moves forces from point to point
_INNER_TOLERANCE = 0.1       # of the residual that the step is to cut
_FORCING = 0.3               # conjugate gradients end when the preconditioned residual has fallen to this share, or the residual
                             # itself is as small as the gradient has to be in the end, which costs no further solve to see ...
_MOST_ITERATIONS = 6         # ... or when they would take more than so many; then a new factor follows
_JUDGED_AFTER = 3            # iterations after which it is judged how many it would take


@dataclass(frozen=True)
class LinearGaps:
    """Contact points (p,) as they depend on a step: gaps (mm) at none, rows (p, n) of their change by each unknown.

    indentation increment (p,): their change when the object is lowered by 1 mm;  area (p,) in mm2;  contact: a `Contact`
    """

    gaps: np.ndarray
    rows: sp.csr_matrix
    indentation_increment: np.ndarray
    area: np.ndarray
    contact: Contact

    def pressure(self, change: np.ndarray | float) -> np.ndarray:
        """Forces (p,) in N that the points carry after their gaps have changed, positive in compression."""
        return self.area * self.contact.response(self.gaps + change)[1]

    def slope(self, change: np.ndarray | float) -> np.ndarray:
        """Stiffness (p,) in N/mm of the points after their gaps have changed."""
        return self.area * self.contact.response(self.gaps + change)[2]


@dataclass(frozen=True)
class _Move:
    """A step or a direction x (n,) or (n + 1,), and what depends on it linearly.

    change (p,): of the gaps in mm;  elastic (n,) or (n + 1,): the rubber's forces in N
    Steps are sums of directions, so both are found once for each direction, the costliest thing in it but for the factor's use.
    """

    x: np.ndarray
    change: np.ndarray
    elastic: np.ndarray

    def plus(self, share, other):
        """This and a share of another."""
        return _Move(self.x + share * other.x, self.change + share * other.change, self.elastic + share * other.elastic)


class ContactStepper:
    """Steps of one body; keeps the last factor for the next step. factor: of `contact_factor`."""

    def __init__(self, factor: ContactFactor | DissectedContact) -> None:
        self.factor = factor
        self.factors, self.iterations = 0, 0     # so far, of the matrix and of conjugate gradients
        self.reset()

    def reset(self) -> None:
        """Forget the last factor."""
        self._factored = False
        self.factor.reset()

    def step(self, rubber: sp.csr_matrix, residual: np.ndarray, contact: "StepContact", *,
             friction_border: tuple[np.ndarray | float, float] = (0.0, 0.0), excess: float | None = None,
             largest: float = np.inf) -> tuple[np.ndarray, float] | None:
        """Step (n,) in mm of the unknowns, and how far the object is lowered with it; None if A is not positive definite.

        rubber: A, upper triangle (csr), with friction;  residual (n,) in N
        contact: its `points` are `LinearGaps`, its `rubber_forces(rubber, step)` A times a step (n,), its `follow(step, indentation
        increment)` looks up what the points face where a step leads, and says whether that was done; its `frames` are for
        `contact_factor`
        friction_border: friction's border (n,) and corner in N/mm, between the unknowns and the object's indentation increment
        excess: the object's force less the wanted one in N; None holds the object where it is. A free object that touches
        nothing finds no stiffness: it is lowered by nan.
        largest: mm, by which a free object is moved at most; farther steps end there with the contact of that depth
        """
        problem = _Problem(rubber, contact, residual, friction_border, excess)
        at = problem.move(problem.rest())
        if problem.free and not contact.points.slope(0.0).any():
            return problem.parts(np.append(at.x[:-1], np.nan))
        problem.judge(at)
        for number in range(_FACINGS):
            at = self._least(problem, at, largest)
            if at is None or number == _FACINGS - 1 or not contact.follow(*problem.parts(at.x)):
                break
            at = problem.projected_anew(at)
            if problem.solved(at):
                break
        return None if at is None else problem.parts(at.x)

    def _least(self, problem, at, largest):
        """The step of least energy, from one on, until its gradient is small enough; None if A is not positive definite."""
        for _ in range(_INNER_STEPS):
            if problem.solved(at):
                break
            direction = self._direction(problem, at)
            if direction is None:
                return None
            share = problem.best_share(at, direction)
            lowered = share * direction.x[-1]
            beyond = problem.free and not problem.held and abs(at.x[-1] + lowered) > largest
            if beyond:       # the object stops on the way
                share = (np.copysign(largest, lowered) - at.x[-1]) / direction.x[-1]
            at = at.plus(share, direction)
            if beyond:
                problem.hold(at)
        return at

    def _direction(self, problem, at):
        """Newton's step of the convex problem, with the present factor if it still serves."""
        slope, gradient = problem.points.slope(at.change), problem.gradient(at)
        if self._factored and self.factor.follow(problem, slope):
            direction, good, positive = self._conjugate_gradients(problem, slope, -gradient)
            if good:
                return direction
            if not positive:     # no factor of this matrix would be found
                return None
        self.factors += 1
        self._factored = self.factor.renew(problem, slope)
        if not self._factored:
            return None
        direction, good, _ = self._conjugate_gradients(problem, slope, -gradient)
        return direction if good or direction.x.any() else None

    def _conjugate_gradients(self, problem, slope, right):
        """Approximate solution of the Newton system, whether it is as good as wanted, and whether the matrix is positive
        definite as far as was seen; given up where it would take too long."""
        found, r = problem.nowhere(), right
        z = self.factor.solve(r, held=problem.held)
        p, size = z, r @ z
        first = size
        for iteration in range(_MOST_ITERATIONS):
            self.iterations += 1
            along = problem.move(p)
            q = problem.product(slope, along)
            curvature = p @ q
            if not curvature > 0:
                return found, False, False
            found = found.plus(size / curvature, along)
            r = r - (size / curvature) * q
            if problem.small(r):
                return found, True, True
            z = self.factor.solve(r, held=problem.held)
            size, before = r @ z, size
            if size <= _FORCING**2 * first:
                return found, True, True
            if iteration >= _JUDGED_AFTER and size > first * _FORCING ** (2 * iteration / _MOST_ITERATIONS):
                return found, False, True
            p = z + (size / before) * p
        return found, False, True


class _Problem:
    """The convex problem of one step, in the unknowns and, where the object is free, its indentation increment behind them."""

    def __init__(self, rubber, contact, residual, friction_border, excess):
        self.rubber, self.contact, self.friction_border = rubber, contact, friction_border
        self.size, self.free, self.held = len(residual), excess is not None, False
        # What the points face may change under way: the residual less the contact's share in it stays.
        residual = np.append(residual, excess) if self.free else residual
        self.residual = residual + self._spread(self.points.pressure(0.0))

    @property
    def points(self):
        return self.contact.points

    def rest(self):
        return np.zeros(self.size + self.free)

    def nowhere(self):
        """The `_Move` of no step."""
        return _Move(self.rest(), np.zeros(len(self.points.gaps)), self.rest())

    def move(self, x):
        """The `_Move` of a step."""
        return _Move(x, self._change(x), self._elastic(x))

    def projected_anew(self, move):
        """The same step after the points came to face something else."""
        return replace(move, change=self._change(move.x))

    def judge(self, at):
        """Let the gradient at a step decide which gradient is small enough."""
        self._enough = _INNER_TOLERANCE * np.abs(self.gradient(at)).max()

    def solved(self, at):
        return self.small(self.gradient(at))

    def small(self, gradient):
        """Whether a gradient is as small as the step's is to be in the end."""
        return np.abs(gradient).max() <= self._enough

    def hold(self, at):
        """Keep a free object where it is: no longer is its force to be balanced, only those of the body."""
        self.held = True
        self.judge(at)

    def parts(self, x):
        return x[:self.size], float(x[-1]) if self.free else 0.0

    def _change(self, x):
        change = self.points.rows @ x[:self.size]
        return change + self.points.indentation_increment * x[-1] if self.free else change

    def _spread(self, forces):
        """Forces (p,) of the points on the unknowns."""
        spread = self.points.rows.T @ forces
        return np.append(spread, self.points.indentation_increment @ forces) if self.free else spread

    def _elastic(self, x):
        u = x[:self.size]
        product = self.contact.rubber_forces(self.rubber, u)
        if not self.free:
            return product
        border, corner = self.friction_border
        return np.append(product + border * x[-1], np.sum(border * u) + corner * x[-1])

    def gradient(self, at):
        return self._of_unknowns(self.residual + at.elastic - self._spread(self.points.pressure(at.change)))

    def product(self, slope, along):
        return self._of_unknowns(along.elastic + self._spread(slope * along.change))

    def _of_unknowns(self, forces):
        """Forces as they are, without the object's where it is held."""
        if self.held:
            forces[-1] = 0.0
        return forces

    def best_share(self, at, direction):
        """The share of the direction, at most all of it, with the least energy along it."""
        linear, curvature = (self.residual + at.elastic) @ direction.x, direction.x @ direction.elastic

        def slope(share):
            return linear + share * curvature - direction.change @ self.points.pressure(at.change + share * direction.change)

        start, end = slope(0.0), slope(1.0)
        low, high, share = 0.0, 1.0, 1.0
        for _ in range(30):
            if abs(end) <= 0.1 * abs(start) or (share == 1.0 and end < 0):
                break
            low, high = (share, high) if end < 0 else (low, share)
            share = 0.5 * (low + high)
            end = slope(share)
        return share
