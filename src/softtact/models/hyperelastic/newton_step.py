"""Newton steps that are linear in the rubber and exact in the object's contact, with one factor of the rubber for many of them.

Where an object touches changes far more within a step than how the rubber resists: a tangent that has lost a contact point
lets it fly into the object. So a step s minimises r.s + s.A s/2 + Phi(gaps + B s), with the rubber's tangent A, the residual r
and the contact's energy Phi: a convex problem whose Newton systems A + B'.W.B, bordered by the object's indentation increment,
are solved by conjugate gradients.

They are preconditioned by the rubber of an earlier step with the contact of now. The contact changes some seven times within a
step and much, A hardly in several steps: so conjugate gradients take one to three iterations, the other way round twenty.
The surface nodes' movements along the object's normals and the indentation increment come last in the elimination. What is left on
them is a dense matrix, small beside the whole; the contact changes that matrix alone, as far as its normals are the nodes' own.
"""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.sparse as sp
from numba import njit

from softtact.linalg.block_tridiagonal import BlockTridiagonalSolver
from softtact.linalg.direct import PardisoSolver, SuperLUSolver
from softtact.linalg.lapack import factor_in_place
from softtact.linalg.multifrontal_solver import Bordered, DissectedSolver
from softtact.linalg.nodal_frames import NodeFrames
from softtact.linalg.workers import SERIAL, Workers
from softtact.models.hyperelastic.slab import Slab
from softtact.models.hyperelastic.states import LinearGaps, ObjectSurface, SlabState

_SOON_MM, _NEAR_MM = 0.01, 0.1     # gaps of points that may touch within a step or two, and within some load steps
# Share of the squared normals that a node's directions may leave out, when asked whether they are enough and when chosen.
_BENT, _SLIGHTLY_BENT = 0.02, 0.005
_ALIKE = 0.002               # of all points' stiffness together: contacts that differ by less are taken for one
_LEAST_CORNER = 1e-9         # N/mm: rounding must not turn the object's stiffness negative
_INNER_STEPS = 12
_FACINGS = 4                 # lookups of what the points face; an edge that slides over them moves forces from point to point
_INNER_TOLERANCE = 0.1       # of the residual that the step is to cut
_FORCING = 0.3               # conjugate gradients end when the preconditioned residual has fallen to this share, or the residual
                             # itself is as small as the gradient has to be in the end, which costs no further solve to see ...
_MOST_ITERATIONS = 6         # ... or when they would take more than so many; then a new factor follows
_JUDGED_AFTER = 3            # iterations after which it is judged how many it would take


class StepContact:
    """The object's contact in the course of a step from a `SlabState`; `planes` and `points` are what it is at present.

    surface: looked up anew where the step leads; None: the points keep the planes that they face
    largest_mm: to which a step is cut: where a longer one leads far under an edge, points face what they do where it is cut
    """

    def __init__(self, slab: Slab, state: SlabState, indentation: float, surface: ObjectSurface | None = None, *,
                 largest_mm: float = np.inf, workers: Workers = SERIAL) -> None:
        self._slab, self._state, self._indentation, self._surface, self._workers = slab, state, indentation, surface, workers
        self._largest_mm = largest_mm
        self._face(state.projection)

    def _face(self, projection):
        self.projection, self.points = projection, self._slab.linear_gaps(self._state.displacement, projection,
                                                                             self._indentation, self._state.history)

    def frames(self, kept: NodeFrames | None) -> NodeFrames:
        """`NodeFrames` of the nodes whose contact with the object may change, along the normals that they face.

        kept: frames of before, whose nodes and numbers of vectors stay if they are enough for the nodes that may touch soon
        """
        now = self._frames_within(_SOON_MM, _BENT)
        if kept is not None and kept.covers(now):
            return kept.turned_as(now)
        return self._frames_within(_NEAR_MM, _SLIGHTLY_BENT)

    def _frames_within(self, within_mm, bent):
        """Of nodes with gaps of less; wanted are vectors along which the normals' squares exceed a share `bent` of the most."""
        nodes, normals = self._slab.top.projected_nodes(self.points.gaps, self.projection, within_mm)
        unknowns = self._slab.unknowns_of(nodes)
        free = (unknowns >= 0).all(axis=1)
        size, turns = np.linalg.eigh(normals[free])
        upright = (size[:, 1] < 1e-9 * size[:, 2]) & (np.abs(turns[:, 2, 2]) > 1 - 1e-9)
        turns[upright] = np.eye(3)     # to the last digit, which spares the turning
        return NodeFrames(first=unknowns[free, 0], turns=turns, wanted=(size > bent * size[:, 2:]).sum(axis=1),
                          others=unknowns[~free][unknowns[~free] >= 0])

    def rubber_forces(self, rubber: sp.csr_matrix, step: np.ndarray) -> np.ndarray:
        """Forces (unknowns,) of the rubber's tangent against a step (unknowns,) in mm."""
        return self._slab.product(rubber.data, step, workers=self._workers)

    def follow(self, step: np.ndarray, indentation_increment: float) -> bool:
        """Look up what the points face after a step (unknowns,) in mm of the slab; True if there is a surface to ask."""
        if self._surface is None:
            return False
        share = min(1.0, self._largest_mm / max(np.abs(step).max(), abs(indentation_increment), 1e-30))
        projection = self._projected(step, indentation_increment)
        if share < 1.0 and projection.overrun.any():
            projection = self._projected(share * step, share * indentation_increment)
        self._face(projection)
        return True

    def _projected(self, step, indentation_increment):
        """What the points face after a step."""
        displacement = self._state.displacement.copy()
        displacement.ravel()[self._slab.unknowns] += step
        return self._slab.project(displacement, self._surface, self._indentation + indentation_increment)


class ContactFactor:
    """With any solver of `linear_solvers`: a new factor for each contact."""

    def __init__(self, solver: PardisoSolver | BlockTridiagonalSolver | SuperLUSolver | DissectedSolver) -> None:
        self.solver = solver

    def reset(self) -> None:
        """Nothing is kept from one factor to the next."""

    def renew(self, problem: "_StepProblem", slope: np.ndarray) -> bool:
        """Factor with the rubber's tangent and the points' stiffness (p,) of now; False if that is not positive definite."""
        rows, indentation_increment = problem.points.rows, problem.points.indentation_increment
        border, corner = problem.friction_border
        upper = (problem.rubber + sp.triu(rows.T @ sp.diags_array(slope) @ rows)).tocsr()
        upper.sort_indices()
        if not self.solver.factor(upper):
            return False
        self._border = rows.T @ (slope * indentation_increment) + border
        self._along = self.solver.solve(self._border)
        self._corner = max(slope @ indentation_increment**2 + corner - self._border @ self._along, _LEAST_CORNER)
        return True

    def follow(self, problem: "_StepProblem", slope: np.ndarray) -> bool:
        """Take over the points' stiffness alone; False if that cannot be done."""
        return self.renew(problem, slope)

    def solve(self, right: np.ndarray, *, held: bool) -> np.ndarray:
        """Solution for forces on the unknowns (n,), or on them and a free object (n + 1,); held: the object stays where it is."""
        inner = self.solver.solve(right[:len(self._border)])
        if len(right) == len(inner):
            return inner
        lowered = 0.0 if held else (right[-1] - self._border @ inner) / self._corner
        return np.append(inner - lowered * self._along, lowered)


class DissectedContact:
    """With a `DissectedSolver`, which leaves what the contact changes for last."""

    _frames: NodeFrames | None
    _points: LinearGaps | None
    _slope: np.ndarray | None

    def __init__(self, solver: DissectedSolver, *, workers: Workers = SERIAL) -> None:
        self.solver, self._workers = solver, workers
        self.reset()

    def reset(self) -> None:
        """Forget the nodes' frames, which a factor otherwise takes over from the last one."""
        self._frames, self._points, self._slope = None, None, None

    def renew(self, problem: "_StepProblem", slope: np.ndarray) -> bool:
        """Factor with the rubber's tangent and the points' stiffness (p,) of now; False if that is not positive definite."""
        self._frames, self._points, self._slope = problem.contact.frames(self._frames), None, None
        border, corner = problem.friction_border
        column = np.append(np.broadcast_to(border, self.solver.unknowns), corner)
        if not self.solver.factor_bordered(Bordered(upper=problem.rubber, column=column, frames=self._frames)):
            return False
        return self.follow(problem, slope)

    def follow(self, problem: "_StepProblem", slope: np.ndarray) -> bool:
        """Take over the points' stiffness (p,) alone, as far as it acts on what was left; False if not positive definite."""
        if self._slope is not None and np.abs(slope - self._slope).sum() <= _ALIKE * slope.sum():
            return True
        left, border, corner = self._left_with(problem.points, slope)
        self._slope = slope if factor_in_place(left, workers=self._workers) else None
        if self._slope is None:
            return False
        self._lower = left.T
        self._border = self._halfway(border)
        self._corner = max(corner - float(self._border @ self._border), _LEAST_CORNER)
        return True

    def solve(self, right: np.ndarray, *, held: bool) -> np.ndarray:
        """Solution for forces on the unknowns (n,), or on them and a free object (n + 1,); held: the object stays where it is."""
        free = len(right) > self.solver.unknowns
        whole, held = right if free else np.append(right, 0.0), held or not free
        found = self.solver.solve_bordered(whole, lambda rest: self._finish(rest, held))
        return found if free else found[:-1]

    def _finish(self, rest, held):
        half = self._halfway(rest[:-1])
        lowered = 0.0 if held else (float(rest[-1]) - float(self._border @ half)) / self._corner
        inner, _ = scipy.linalg.lapack.strtrs(self._lower, half - np.float32(lowered) * self._border, lower=True, trans=1)
        return np.append(inner, lowered)

    def _halfway(self, right):
        return scipy.linalg.lapack.strtrs(self._lower, right.astype(np.float32), lower=True)[0]

    def _left_with(self, points, slope):
        """What is left with points of a stiffness (p,): the upper triangle on the k movements, the object's column and corner."""
        if self._points is not points:
            self._points, self._rows = points, points.rows @ self._frames.movements(self.solver.unknowns)
        left = self.solver.left
        matrix, border = left[:-1, :-1].copy(), left[:-1, -1] + self._rows.T @ (slope * points.indentation_increment)
        _add_points(matrix, self._rows.indptr, self._rows.indices, self._rows.data, slope)
        return matrix, border, float(left[-1, -1]) + slope @ points.indentation_increment**2


@njit(cache=True, nogil=True)
def _add_points(out, indptr, indices, data, slope):
    """Add the stiffness (p,) of points, whose gaps change with the unknowns by rows (csr), to an upper triangle."""
    for p in range(len(slope)):
        if slope[p] == 0.0:
            continue
        for e in range(indptr[p], indptr[p + 1]):
            weighted, row = slope[p] * data[e], indices[e]
            for f in range(indptr[p], indptr[p + 1]):
                if indices[f] >= row:
                    out[row, indices[f]] += weighted * data[f]


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
    """Steps of one body; keeps the last factor for the next step. factor: a `ContactFactor` or `DissectedContact`."""

    def __init__(self, factor: ContactFactor | DissectedContact) -> None:
        self.factor = factor
        self.factors, self.iterations = 0, 0     # so far, of the matrix and of conjugate gradients
        self.reset()

    def reset(self) -> None:
        """Forget the last factor."""
        self._factored = False
        self.factor.reset()

    def step(self, rubber: sp.csr_matrix, residual: np.ndarray, contact: StepContact, *,
             friction_border: tuple[np.ndarray | float, float] = (0.0, 0.0), excess: float | None = None,
             largest: float = np.inf) -> tuple[np.ndarray, float] | None:
        """Step (n,) in mm of the unknowns, and the indentation increment with it; None if A is not positive definite.

        rubber: A, upper triangle (csr), with friction;  residual (n,) in N
        contact: its `points` are `LinearGaps`, its `rubber_forces(rubber, step)` A times a step (n,), its `follow(step, indentation
        increment)` looks up what the points face where a step leads, and returns whether that was done; its `frames` are for
        `DissectedContact`
        friction_border: friction's border (n,) and corner in N/mm, between the unknowns and the object's indentation increment
        excess: the object's force less the wanted one in N; None holds the object where it is. A free object that touches
        nothing finds no stiffness: its increment is nan.
        largest: mm, by which a free object is moved at most; farther steps end there with the contact of that depth
        """
        problem = _StepProblem(rubber, contact, residual, friction_border, excess)
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
            if beyond:       # the object stops before its end
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


class _StepProblem:
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
