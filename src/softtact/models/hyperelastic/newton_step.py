"""Newton steps that are linear in the rubber and exact in the object's contact, with one factorisation of the rubber for many.

Within a step the contact changes far more than the rubber's tangent: with a linearised contact, a point that lost contact in the
tangent would move deep into the object. So a step s minimises r.s + s.A s/2 + Phi(gaps + B s), with the rubber's tangent A, the
residual r and the contact's energy Phi: a convex problem whose Newton systems A + B'.W.B, bordered by the object's indentation
increment, are solved by conjugate gradients.

The preconditioner is the rubber's tangent of an earlier step with the current contact. The contact changes about seven times within
a step, A hardly in several steps: so conjugate gradients take one to three iterations (with the roles exchanged, twenty).
The surface nodes' displacements along the object's normals and the indentation increment are eliminated last. Their Schur
complement is a small dense matrix; a change of contact affects this matrix alone, as far as normals lie in the nodes' frames."""

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
import scipy.sparse as sp

from softtact.compiled import compiled
from softtact.linalg.block_tridiagonal import BlockTridiagonalSolver
from softtact.linalg.direct import PardisoSolver, SuperLUSolver
from softtact.linalg.lapack import factor_in_place
from softtact.linalg.multifrontal_solver import Bordered, DissectedSolver
from softtact.linalg.nodal_frames import NodeFrames
from softtact.linalg.workers import SERIAL, Workers
from softtact.models.hyperelastic.slab import Slab
from softtact.models.hyperelastic.states import LinearGaps, ObjectSurface, SlabState

_SOON_MM, _NEAR_MM = 0.01, 0.1     # gaps of points that may touch within a step or two, and within some load steps
# Share of the squared normals that a node's frame may neglect: when a frame is checked, and when it is chosen.
_BENT, _SLIGHTLY_BENT = 0.02, 0.005
_BENT_ROUNDED = 0.05         # factor of both under rounded edges, whose points are ten times as stiff: what frames neglect of them
                             # would be stiffer than rubber, and every contact would want a new factorisation
_ALIKE = 0.002               # of the sum of all points' stiffnesses: contacts that differ by less count as equal
_LEAST_CORNER = 1e-9         # N/mm: keeps the object's stiffness positive despite rounding
_INNER_STEPS = 12
_FACINGS = 4                 # updates of the contact projection; an edge that slides over points shifts forces between them
_INNER_TOLERANCE = 0.1       # of the residual that the step is to reduce
_FORCING = 0.3               # conjugate gradients stop when the preconditioned residual has fallen to this share, or the residual
                             # itself is as small as the final gradient has to be, which needs no further solve to check ...
_MOST_ITERATIONS = 6         # ... or when they would take more than this; then a new factorisation follows
_JUDGED_AFTER = 3            # iterations after which the number of iterations is estimated


class StepContact:
    """The object's contact during a step from a `SlabState`; `planes` and `points` are its current projection and gaps.

    surface: for contact projections at the step's end; None: the points keep their planes
    turning: the planes are those at the step's end; if not, they keep their normals and move once to where the gaps are those at
    its end. Along a curved surface a step leaves its planes by more than the stiff contact allows, though it begins along them, and
    its end is hardly better than its start (Maratos' effect; Nocedal and Wright, Numerical Optimization, 2nd ed., section 18.3).
    largest_mm: largest movement in a step; the projection of a longer step is taken where the step is cut
    """

    def __init__(self, slab: Slab, state: SlabState, indentation: float, surface: ObjectSurface | None = None, *,
                 turning: bool = True, largest_mm: float = np.inf, workers: Workers = SERIAL) -> None:
        self._turning = turning
        self._slab, self._state, self._indentation, self._surface, self._workers = slab, state, indentation, surface, workers
        self._largest_mm = largest_mm
        self.straight: tuple[np.ndarray, float] | None = None      # the step that was corrected
        self._face(state.projection)

    def _face(self, projection):
        self.projection, self.points = projection, self._slab.linear_gaps(self._state.displacement, projection,
                                                                             self._indentation, self._state.history)

    def frames(self, kept: NodeFrames | None, *, change: np.ndarray | float = 0.0) -> NodeFrames:
        """`NodeFrames` along the contact normals, of the nodes whose contact with the object may change.

        kept: earlier frames, whose nodes and numbers of vectors are kept if they suffice for the nodes that may touch soon
        change (p,): of the points' gaps in mm, so far in the step: points that it brought to the object count, too
        """
        gaps = self.points.gaps + np.minimum(change, 0.0)
        share = _BENT_ROUNDED if self._slab.top.rounds_edges else 1.0
        now = self._frames_within(gaps, _SOON_MM, share * _BENT)
        if kept is not None and kept.covers(now):
            return kept.turned_as(now)
        return self._frames_within(gaps, _NEAR_MM, share * _SLIGHTLY_BENT)

    def _frames_within(self, gaps, within_mm, bent):
        """Frames of nodes with smaller gaps; vectors are needed if the squared normals along them exceed the share `bent`."""
        nodes, normals = self._slab.top.projected_nodes(gaps, self.projection, within_mm)
        unknowns = self._slab.unknowns_of(nodes)
        free = (unknowns >= 0).all(axis=1)
        size, turns = np.linalg.eigh(normals[free])
        upright = (size[:, 1] < 1e-9 * size[:, 2]) & (np.abs(turns[:, 2, 2]) > 1 - 1e-9)
        turns[upright] = np.eye(3)     # exact, which saves the rotation
        return NodeFrames(first=unknowns[free, 0], turns=turns, wanted=(size > bent * size[:, 2:]).sum(axis=1),
                          others=unknowns[~free][unknowns[~free] >= 0])

    def rubber_forces(self, rubber: sp.csr_matrix, step: np.ndarray) -> np.ndarray:
        """Product (unknowns,) of the rubber's tangent with a step (unknowns,) in mm."""
        return self._slab.product(rubber.data, step, workers=self._workers)

    def follow(self, step: np.ndarray, indentation_increment: float) -> bool:
        """Update the contact projection for a step (unknowns,) in mm of the slab; returns whether it has changed anything."""
        share = min(1.0, self._largest_mm / max(np.abs(step).max(), abs(indentation_increment), 1e-30))
        if self._surface is None or (share < 1.0 and not self._turning):
            return False
        if not self._turning:
            self._correct(step, indentation_increment)
            return True
        projection = self._projected(step, indentation_increment)
        if share < 1.0 and projection.overrun.any():
            projection = self._projected(share * step, share * indentation_increment)
        self._face(projection)
        return True

    def _correct(self, step, indentation_increment):
        """Take the gaps at a step's end, once; points that come to the object or leave it keep those of their planes."""
        projection, depth = self._projected(step, indentation_increment), self._indentation + indentation_increment
        at_end = self._slab.top.gaps(self._moved(step), projection, depth)
        change = self.points.rows @ step + self.points.indentation_increment * indentation_increment
        near = (projection.covered > 0) & (self.projection.covered > 0)
        self.points = replace(self.points, gaps=np.where(near, at_end - change, self.points.gaps))
        self._surface, self.straight = None, (step, indentation_increment)

    def _projected(self, step, indentation_increment):
        """The contact projection after a step."""
        return self._slab.project(self._moved(step), self._surface, self._indentation + indentation_increment)

    def _moved(self, step):
        """The slab's displacement after a step."""
        displacement = self._state.displacement.copy()
        displacement.ravel()[self._slab.unknowns] += step
        return displacement


class ContactFactor:
    """With any direct solver: a new factorisation for each contact."""

    def __init__(self, solver: PardisoSolver | BlockTridiagonalSolver | SuperLUSolver | DissectedSolver) -> None:
        self.solver = solver

    def reset(self) -> None:
        """Nothing is kept between factorisations."""

    def renew(self, problem: "_StepProblem", slope: np.ndarray, *, change: np.ndarray | float = 0.0) -> bool:
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
        """Update the points' stiffness without a factorisation; False if that is impossible."""
        return self.renew(problem, slope)

    def solve(self, right: np.ndarray, *, held: bool) -> np.ndarray:
        """Solution for forces on the unknowns (n,), or on them and a free object (n + 1,); held: the object stays where it is."""
        inner = self.solver.solve(right[:len(self._border)])
        if len(right) == len(inner):
            return inner
        lowered = 0.0 if held else (right[-1] - self._border @ inner) / self._corner
        return np.append(inner - lowered * self._along, lowered)


class DissectedContact:
    """With a `DissectedSolver`, which eliminates the unknowns of the contact last."""

    _frames: NodeFrames | None
    _points: LinearGaps | None
    _slope: np.ndarray | None

    def __init__(self, solver: DissectedSolver, *, workers: Workers = SERIAL) -> None:
        self.solver, self._workers = solver, workers
        self.reset()

    def reset(self) -> None:
        """Discard the nodes' frames, which a factorisation otherwise takes from the last one."""
        self._frames, self._points, self._slope = None, None, None

    def renew(self, problem: "_StepProblem", slope: np.ndarray, *, change: np.ndarray | float = 0.0) -> bool:
        """Factor with the rubber's tangent and the points' stiffness (p,) of now; False if that is not positive definite.

        change (p,): of the points' gaps in mm, which chooses the nodes whose contact can change without a new factor
        """
        self._frames, self._points, self._slope = problem.contact.frames(self._frames, change=change), None, None
        border, corner = problem.friction_border
        column = np.append(np.broadcast_to(border, self.solver.unknowns), corner)
        if not self.solver.factor_bordered(Bordered(upper=problem.rubber, column=column, frames=self._frames)):
            return False
        return self.follow(problem, slope)

    def follow(self, problem: "_StepProblem", slope: np.ndarray) -> bool:
        """Update the points' stiffness (p,) in the Schur complement only; False if it is not positive definite."""
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
        """The Schur complement with points of a stiffness (p,): upper triangle of k displacements, object's column and corner."""
        if self._points is not points:
            self._points, self._rows = points, points.rows @ self._frames.movements(self.solver.unknowns)
        left = self.solver.schur_complement
        matrix, border = left[:-1, :-1].copy(), left[:-1, -1] + self._rows.T @ (slope * points.indentation_increment)
        _add_points(matrix, self._rows.indptr, self._rows.indices, self._rows.data, slope)
        return matrix, border, float(left[-1, -1]) + slope @ points.indentation_increment**2


@compiled
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
    """A step or a direction x (n,) or (n + 1,), and its linear functions.

    change (p,): of the gaps in mm;  elastic (n,) or (n + 1,): the rubber's forces in N
    Steps are sums of directions, so both are computed once for each direction; only the solve costs more.
    """

    x: np.ndarray
    change: np.ndarray
    elastic: np.ndarray

    def plus(self, share, other):
        """The sum of this and a share of another."""
        return _Move(self.x + share * other.x, self.change + share * other.change, self.elastic + share * other.elastic)


class ContactStepper:
    """Steps of one body; keeps the last factorisation for the next step. factor: a `ContactFactor` or `DissectedContact`."""

    def __init__(self, factor: ContactFactor | DissectedContact) -> None:
        self.factor = factor
        self.factors, self.iterations = 0, 0     # so far, of the matrix and of conjugate gradients
        self.reset()

    def reset(self) -> None:
        """Discard the last factorisation."""
        self._factored = False
        self.factor.reset()

    def step(self, rubber: sp.csr_matrix, residual: np.ndarray, contact: StepContact, *,
             friction_border: tuple[np.ndarray | float, float] = (0.0, 0.0), excess: float | None = None,
             largest: float = np.inf) -> tuple[np.ndarray, float] | None:
        """Step (n,) in mm of the unknowns, and the indentation increment with it; None if A is not positive definite.

        rubber: A, upper triangle (csr), with friction;  residual (n,) in N
        contact: its `points` are `LinearGaps`; `rubber_forces(rubber, step)` is A times a step (n,); `follow(step,
        indentation_increment)` updates the contact projection for a step, and returns whether it did; its `frames` are for
        `DissectedContact`
        friction_border: friction's border (n,) and corner in N/mm, between the unknowns and the object's indentation increment
        excess: the object's force minus the prescribed one in N; None for a prescribed indentation. A free object without
        contact has no stiffness: its increment is nan.
        largest: largest movement of a free object in mm; longer steps end there with the contact at that depth
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
        """Minimise the energy from a first step until the gradient is small enough; None if A is not positive definite."""
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
        """Newton's step of the convex problem, with the present factorisation if it is still good enough."""
        slope, gradient = problem.points.slope(at.change), problem.gradient(at)
        if self._factored and self.factor.follow(problem, slope):
            direction, good, positive = self._conjugate_gradients(problem, slope, -gradient)
            if good:
                return direction
            if not positive:     # the factorisation of this matrix would fail
                return None
        self.factors += 1
        self._factored = self.factor.renew(problem, slope, change=at.change)
        if not self._factored:
            return None
        direction, good, _ = self._conjugate_gradients(problem, slope, -gradient)
        return direction if good or direction.x.any() else None

    def _conjugate_gradients(self, problem, slope, right):
        """Approximate solution of the Newton system, whether it converged, and whether the matrix was positive definite along
        all directions; stopped early if it would take too many iterations."""
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
    """The convex problem of one step in the unknowns, followed by the indentation increment if the object is free."""

    def __init__(self, rubber, contact, residual, friction_border, excess):
        self.rubber, self.contact, self.friction_border = rubber, contact, friction_border
        self.size, self.free, self.held = len(residual), excess is not None, False
        # The projection may change during the step: the residual without the contact's part is constant.
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
        """The same step after an update of the contact projection."""
        return replace(move, change=self._change(move.x))

    def judge(self, at):
        """Set the tolerance of the gradient from the gradient at a step."""
        self._enough = _INNER_TOLERANCE * np.abs(self.gradient(at)).max()

    def solved(self, at):
        return self.small(self.gradient(at))

    def small(self, gradient):
        """Whether a gradient is within the tolerance."""
        return np.abs(gradient).max() <= self._enough

    def hold(self, at):
        """Fix a free object: from now on only the body's forces have to be balanced, not the object's."""
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
        """The forces, without the object's if it is fixed."""
        if self.held:
            forces[-1] = 0.0
        return forces

    def best_share(self, at, direction):
        """The share in (0, 1] of the direction that minimises the energy along it."""
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
