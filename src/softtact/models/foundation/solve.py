"""A press in the foundation model: the object on the slab, the slab on the frusta, load step by load step.

Unknown are the object's forces f >= 0 on patches of the cover and the frusta's forces q >= 0:
    gap  = gap0 - depth + E u + k f >= 0,     f gap = 0,  sum f = F       (k: softness beside edges, `soft_edges`)
    w    = extension(q),                      w <= 0 where q = 0          (w: how far the slab comes down on a frustum)
    u, w = G [E' f; -(q + r)]
Active sets and Newton's method, each step solved directly. Where the contact is large, four points that the object covers whole
share a patch and its uniform pressure, which leaves some hundred unknowns, at 0.1 to 0.4 % of the map
(docs/notebook/2026-11-23-foundation-model.md).
Frusta rock, lean and stiffen, and slab and object move sideways: what finite displacement adds to these equations is followed from
step to step (`finite_displacement`), e the frusta's rise and l lateral forces on their roots:
    extension(q) = w + e,       u, w = G [E' f; -(q + r)] + L' l
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg as sla

from softtact.contact.node_grid import patches_of
from softtact.contact.object_points import ObjectPoints
from softtact.errors import ConvergenceError
from softtact.models.foundation.compliance import FoundationCompliance
from softtact.models.foundation.dof_maps import Places, SoftEdges
from softtact.models.foundation.finite_displacement import Effects, FiniteDisplacement

_LOOKS_AGAIN = 6     # at what the object covers where points have moved, once forces have settled; the last of them halfway only
_STRAYED = 0.03      # of a step, and of the depth: movements of points and object after which covered shares are found anew
_PATIENCE = 8        # iterations, after which loads that swing are followed by half only
_ABSURD_MM = 1e6     # where an iteration has run away; on its first few points an object may be thought to sink by metres
_ROUGHLY = 100       # times the tolerance is enough for a force between load steps
_FIRST_PATCHES = 30
_FREE, _SOFTEST = 1e6, 1e4     # mm/N: softness of a point that the object does not cover; from where on a patch cannot touch
_SHORTER = 0.25      # share of a step to a force that is tried next where the step failed
_SHORTEST = 0.004    # share of the force itself: steps that are still shorter are not tried


@dataclass(frozen=True)
class FoundationSettings:
    """When a load step counts as reached.

    tolerance: largest change of a frustum's force in the last step, of the whole force;  gap_mm: overlap that joins a contact
    follow: whether the effects of finite displacement are taken in;  rocking: whether frusta rock
    patches: whether four points share one
    same_slope: share by which frusta's compliances may change before a step's matrix is factored anew, if no contact changed
    """

    tolerance: float = 5e-5     # a hundredth changes the map by 0.03 % at most (root mean square)
    gap_mm: float = 3e-5     # single precision leaves 1e-5
    max_iterations: int = 60
    follow: bool = True
    rocking: bool = True
    patches: bool = True
    same_slope: float = 0.05     # a step's error is cut to as much: a load step's second step needs no further factor


@dataclass(frozen=True)
class FoundationLoadStep:
    """One load step.

    load (n + b,): N at nodes and frusta;  lateral (4, b): see `Effects`;  touching (c,): points under pressure
    compression (b,): of frusta in mm, negative where one is lifted;  penetration in mm: of patches as a whole, softness included
    """

    force_n: float
    depth: float
    load: np.ndarray
    lateral: np.ndarray
    touching: np.ndarray
    compression: np.ndarray
    penetration: float
    iterations: int


def press_foundation(compliance: FoundationCompliance, points: ObjectPoints, forces_n: Iterable[float], *,
                     settings: FoundationSettings = FoundationSettings()) -> Iterator[FoundationLoadStep]:
    """Yield a `FoundationLoadStep` for each force (N, increasing). Raises ConvergenceError naming the load step that was not
    reached.
    """
    press = _Press(compliance, points, settings)
    path = [(0.0, press.first())]
    for force in forces_n:
        yield _advance(press, path, float(force))


def lifted(compliance: FoundationCompliance, points: ObjectPoints, depth_mm: float) -> FoundationLoadStep:
    """The `FoundationLoadStep` of an object that something else carries so deep: the sensor is at rest."""
    frusta = int(np.prod(compliance.counts))
    return FoundationLoadStep(force_n=0.0, depth=depth_mm, load=np.zeros(points.count + frusta), lateral=np.zeros((4, frusta)),
                              touching=np.zeros(points.count, dtype=bool), compression=np.zeros(frusta), penetration=0.0,
                              iterations=0)


def _advance(press, path, target):
    """Reach a force (N) from the end of a path of forces and states, through smaller ones where no step leads there at once.

    Appends what it reaches to the path. At once is what nearly always works but from rest under a tilted object.
    """
    force, spent = target, 0
    while True:
        state, before = _continued(path, force), path[-1][0]
        load_step, iterations = press.load_step(state, force, rough=force < target)
        spent += iterations
        if load_step is not None:
            path.append((force, state))
            if force == target:
                return replace(load_step, iterations=spent)
            force = target
        elif _SHORTER * (force - before) < _SHORTEST * target:
            raise ConvergenceError(f"The foundation model did not reach {target:g} N: from {before:.3g} N on the corrections for "
                                   "finite displacement diverge; use smaller forces, or the hyperelastic model.")
        else:
            force = before + _SHORTER * (force - before)


class FoundationMaps:
    """Deformation maps in mm of the load steps of one press."""

    def __init__(self, compliance: FoundationCompliance, points: ObjectPoints) -> None:
        self._places = Places(compliance, points)

    def __call__(self, load_steps: Sequence[FoundationLoadStep]) -> np.ndarray:
        """Maps (l, ny, nx) of some `FoundationLoadStep`s, with the held edges."""
        return self._places.maps(np.stack([load_step.load for load_step in load_steps], axis=1),
                                 np.stack([load_step.lateral.ravel() for load_step in load_steps], axis=1))


@dataclass
class _State:
    """Which patches and frusta act, the forces q (b,) of the frusta's law in N, and the effects of finite displacement.

    depth: of the object since its first touch, in mm
    """

    touching: np.ndarray
    standing: np.ndarray
    q: np.ndarray
    effects: Effects
    depth: float


def _continued(path, force):
    """The state at a force, guessed on the line through the last two of a path, or its only one."""
    second, now = path[-1]
    if len(path) == 1:
        return replace(now)
    first, before = path[-2]
    share = (force - second) / (second - first)
    return replace(now, q=np.maximum(now.q + share * (now.q - before.q), 0.0), depth=now.depth + share * (now.depth - before.depth),
                   effects=now.effects.continued(before.effects, share))


class _Press:
    def __init__(self, compliance, points, settings):
        self.law, self.points, self.settings = compliance.law, points, settings
        places = Places(compliance, points)
        self.frusta = len(places.frusta)
        self.patch = patches_of(points, compliance.grid, settings.patches)
        self.slab, self.edges = _Slab(places.surface(), self.patch), SoftEdges(compliance)
        self.possible, self._factored = np.ones(self.patch.shape[0], dtype=bool), None
        self.finite = FiniteDisplacement(compliance, points, places, settings)

    def first(self):
        """Where a press begins: the lowest patches touch."""
        gap = self.patch @ self.points.gap
        return _State(gap <= np.sort(gap)[:_FIRST_PATCHES][-1], np.ones(self.frusta, dtype=bool), np.zeros(self.frusta),
                      self.finite.none(), 0.0)

    def load_step(self, state, force, *, rough=False):
        """Newton's method from a state, which is brought up to the load step; None if it is not reached, and iterations.

        rough: as a start for another
        """
        c, look, again = self.patch.shape[0], True, 0 if rough else _LOOKS_AGAIN
        moved, down_by = state.effects.moved, state.depth     # where the contact was looked at
        enough = (_ROUGHLY if rough else 1.0) * self.settings.tolerance * force
        for iteration in range(1, self.settings.max_iterations + 1):
            if look:      # followed from step to step, points at edges would swing
                share = 0.5 if iteration > 1 and again < _LOOKS_AGAIN // 2 else 1.0
                moved, down_by = moved + share * (state.effects.moved - moved), down_by + share * (state.depth - down_by)
                gap0, look = self._contact(state, moved, down_by), False
            if not state.touching.any():     # nothing carries the force
                break
            effects, already = state.effects, self.slab.seen(self.finite.down(state.effects))
            try:
                f, q, depth = self._solve(gap0, already, state, force)
            except sla.LinAlgError:
                break
            if not abs(depth) < _ABSURD_MM:
                break
            forces = np.concatenate([f, q + effects.loads])
            displacement = (self.slab.matrix @ forces.astype(np.float32)).astype(float) + already
            gap, down, load = gap0 - depth + displacement[:c], -displacement[c:], self.slab.load(forces)
            change, state.depth = self._take(state, q), depth - self.points.gap.min()
            share = 1.0 if iteration <= _PATIENCE else 0.5
            state.effects, missing = self.finite.renewed(effects, load, down, state.q, share=share)
            same = self._same_sets(state, f, q, gap, down)
            if same and max(change, missing) <= enough:
                if again and self._elsewhere(state, moved, down_by):
                    again, look = again - 1, True
                    continue
                touched = self.patch.T @ (state.touching * 1.0) > 0
                overlap = float(max(0.0, -gap[self.possible].min()))
                return FoundationLoadStep(force_n=force, depth=depth, load=load, lateral=effects.lateral, touching=touched,
                                       iterations=iteration, compression=down, penetration=overlap), iteration
        return None, iteration

    def _contact(self, state, moved, depth):
        """Gaps (c,) of patches where their points have moved sideways by `moved` (2, c) and the object has come down by `depth`.

        Patches beside which the object ends are softer, and those that it has left cannot touch.
        """
        points = self.points.as_deep(depth)
        contact_compliance = self.patch.power(2) @ np.minimum(self.edges(points, moved, depth), _FREE)
        self.possible = contact_compliance < _SOFTEST
        state.touching = state.touching & self.possible
        self.slab.soften(contact_compliance)
        self._factored = None
        return self.patch @ (points.gap + (points.slope.T * moved).sum(axis=0))

    def _elsewhere(self, state, moved, depth):
        """Whether points have moved on, or the object come down, since the contact was looked at, by what counts."""
        steps = np.abs(state.effects.moved - moved).max() / self.points.step.min()
        return steps > _STRAYED or abs(state.depth - depth) > _STRAYED * abs(state.depth)

    def _solve(self, gap0, already, state, force):
        """Forces of patches (c,) and frusta (b,), and the depth, of the present active sets with the law's tangent.

        already (c + b,): what else has moved patches down and frusta up
        """
        c, law, matrix, slope = len(gap0), self.law, self.slab.matrix, self.law.slope(state.q)
        if self._factored is None or not self._factored.serves(state, slope, self.settings.same_slope):
            self._factored = _Factored(matrix, state, slope)
        factored, a, b = self._factored, np.flatnonzero(state.touching), np.flatnonzero(state.standing)
        moved = (matrix[:, c:] @ state.effects.loads.astype(np.float32) + already)[factored.rows]
        reached = factored.slope[b] * state.q[b] - law.extension(state.q[b]) + state.effects.rise[b]
        at_rest = factored.solve(np.concatenate([-gap0[a], reached]) - moved)
        depth = (force - at_rest[:len(a)].sum()) / factored.per_depth[:len(a)].sum()
        forces = np.zeros(len(matrix))
        forces[factored.rows] = at_rest + depth * factored.per_depth
        return forces[:c], forces[c:], depth

    @staticmethod
    def _take(state, q):
        """Take over the frusta's forces; the largest change of one in N."""
        pressing = np.maximum(q, 0.0)
        change = float(np.abs(pressing - state.q).max())
        state.q = pressing
        return change

    def _same_sets(self, state, f, q, gap, down):
        """Let patches and frusta join that overlap, and leave that pull; whether none did."""
        small = self.settings.gap_mm
        touching = np.where(state.touching, f >= 0, self.possible & (gap < -small))
        standing = np.where(state.standing, q >= 0, down + state.effects.rise > small)
        same = bool((touching == state.touching).all() and (standing == state.standing).all())
        state.touching, state.standing = touching, standing
        return same


class _Slab:
    """The compliance among patches, downwards, and frusta, upwards: matrix (c + b, c + b) in mm/N."""

    def __init__(self, compliance, patch):
        """compliance (n + b, n + b) of n nodes and of frusta, downwards;  patch (c, n): shares of nodes in patches"""
        c, n = patch.shape
        self._patch = at = patch.astype(np.float32)
        self.matrix = np.empty((c + len(compliance) - n,) * 2, dtype=np.float32)
        self.matrix[:c, :c] = at @ np.ascontiguousarray((at @ compliance[:n, :n]).T)
        self.matrix[:c, c:] = -(at @ np.ascontiguousarray(compliance[:n, n:]))
        self.matrix[c:, :c] = self.matrix[:c, c:].T
        self.matrix[c:, c:] = compliance[n:, n:]
        self._hard = np.diag(self.matrix)[:c].copy()

    def soften(self, contact_compliance):
        """Let a spring of softness (c,) in mm/N act in series with each patch."""
        place = np.arange(len(contact_compliance))
        self.matrix[place, place] = self._hard + contact_compliance

    def seen(self, down):
        """How far patches move down and frusta up (c + b,) where nodes and frusta come down (n + b,)."""
        nodes = self._patch.shape[1]
        return np.concatenate([self._patch @ down[:nodes], -down[nodes:]])

    def load(self, forces):
        """Forces (n + b,) downwards on nodes and frusta of those (c + b,) on patches downwards and on frusta upwards."""
        patches = self._patch.shape[0]
        return np.concatenate([self._patch.T @ forces[:patches], -forces[patches:]])


class _Factored:
    """The matrix of some active sets and slopes (b,), factored in single precision.

    rows: those of the touching patches, then of the standing frusta;  per_depth: their forces in N for each mm of depth
    """

    def __init__(self, matrix, state, slope):
        self._touching, self._standing, self.slope = state.touching.copy(), state.standing.copy(), slope
        a, b = np.flatnonzero(state.touching), np.flatnonzero(state.standing)
        self.rows, frusta = np.concatenate([a, len(state.touching) + b]), np.arange(len(a), len(a) + len(b))
        self._system = matrix.take(self.rows, axis=0).take(self.rows, axis=1)
        self._system[frusta, frusta] += slope[b].astype(np.float32)
        self._factor = sla.cho_factor(self._system.T, lower=False, check_finite=False)      # the transpose is in LAPACK's order
        self.per_depth = self.solve(np.arange(len(self.rows)) < len(a))

    def serves(self, state, slope, share):
        """Whether the sets are still these, and the slopes within a share of these."""
        same = np.array_equal(state.touching, self._touching) and np.array_equal(state.standing, self._standing)
        return same and bool((np.abs(slope - self.slope) <= share * self.slope).all())

    def solve(self, right):
        """The solution (rows,), with the residual of single precision corrected once."""
        first = sla.cho_solve(self._factor, right.astype(np.float32), check_finite=False)
        missing = (right - self._system @ first).astype(np.float32)
        return first + sla.cho_solve(self._factor, missing, check_finite=False).astype(float)
