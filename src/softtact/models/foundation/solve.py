"""A press in the foundation model: the object on the slab, the slab on the frusta, load step by load step.

The unknowns are the object's forces f >= 0 on patches of the cover and the frusta's forces q >= 0:
    gap  = gap0 - depth + E u + k f >= 0,     f gap = 0,  sum f = F       (k: contact compliance beside edges, `SoftEdges`)
    w    = extension(q),                      w <= 0 where q = 0          (w: descent of the slab at a frustum)
    u, w = G [E' f; -(q + r)]
Active-set and Newton's method, each step solved directly. In large contacts, four points that the object covers completely
share a patch of uniform pressure, which leaves about a hundred unknowns and changes the map by 0.1 to 0.4 %
(docs/notebook/2026-11-23-foundation-model.md).
Frusta rock, tilt and stiffen, and slab and object move sideways: these effects of finite displacements are updated from step to
step (`FiniteDisplacement`), with e the lift by rocking frusta and l lateral forces on their roots:
    extension(q) = w + e,       u, w = G [E' f; -(q + r)] + L' l

Effects of finite displacements
Rocking: where the sheet moves sideways, a frustum under a small force tilts on the rim of its tip and lifts the sheet
(`FrustumLaw.rise`).
Stiffening (`FrustumLaw.stiffening`): the stiffness against a root's displacement u and tilt t increases with the compression c,
    K(c) = K(0) + dK(c):    force and moment -dK (u, t), and 1/2 (u, t) dK'(c) (u, t) more force against compression.
Pressure: the slab's second variation under the pressure p between object and board is, for rubber of constant volume,
1/2 p du_i/dx_j du_j/dx_i. For a uniform pressure only boundary terms remain, which vanish on the top under a free object. On
the board's side they are forces p t and moments p u on roots that tilt and move: pressure pushes inclined surfaces sideways.
Slopes: membrane forces N, the integrals of s_xx, s_yy and s_xy over the height, act where the slab is inclined: loads
r = -div(N grad w) on the frusta (initial stress; von Karman's plate). They push the deepest parts down and lift the slab beside.
Edges: the top moves sideways, so the object's edges touch other points of it (`SoftEdges`), and points under an inclined facet
get another gap.

Not modelled: second-order strains of the slab, local rotations that differ from its mean slope, pressures that vary over the
height, friction. Their effects:
docs/notebook/2026-11-23-foundation-model.md.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import astuple, dataclass, replace
from typing import Any

import numpy as np
import scipy.linalg as sla

from softtact.contact.node_grid import patches_of
from softtact.contact.object_points import ObjectPoints
from softtact.contact.unilateral import depth_on_springs
from softtact.errors import ConvergenceError
from softtact.models.foundation.active_system import ActiveSystem
from softtact.models.foundation.compliance import FoundationCompliance
from softtact.models.foundation.dof_maps import Places, Sideways, SoftEdges

_STEP = 0.01         # of a force, for a difference quotient
_WITHIN = 0.005      # of the tolerance: error of the forces that a step's linear system is solved to
_REPEATS = 6         # updates of the covered shares after convergence of the forces; the last one relaxed by half
_STRAYED = 0.03      # of a grid step, and of the depth: movements of points and object that require an update of covered shares
_PATIENCE = 14       # iterations after which updates of oscillating loads are relaxed by half
_ABSURD_MM = 1e6     # depth at which an iteration counts as diverged; with few active points it may reach metres
_ROUGHLY = 100       # factor of the tolerance for intermediate forces between load steps
_FIRST_PATCHES = 30
_FREE, _SOFTEST = 1e6, 1e4     # mm/N: contact compliance of an uncovered point; from which a patch cannot touch
_SHORTER = 0.25      # share of a force step that is tried after the step failed
_SHORTEST = 0.004    # of the force: shorter steps are not tried


@dataclass(frozen=True)
class FoundationSettings:
    """Convergence criteria of a load step, and options of the model.

    tolerance: largest change of a frustum's force in the last step over the total force;  gap_mm: overlap that activates a point
    follow: whether the effects of finite displacements are included;  rocking: whether frusta rock
    patches: whether four points share a patch
    """

    tolerance: float = 5e-5     # a hundredth of it changes the map by at most 0.03 % (root mean square)
    gap_mm: float = 3e-5     # the error of single precision is 1e-5
    max_iterations: int = 60
    follow: bool = True
    rocking: bool = True
    patches: bool = True


@dataclass(frozen=True)
class Effects:
    """loads (b,): N upwards on the frusta;  lateral (4, b): forces (N) and moments (N mm) on roots along x, then along y

    moved (2, c): lateral displacements of the points in mm;  rise (b,): lift of roots by rocking frusta in mm
    """

    loads: np.ndarray
    lateral: np.ndarray
    moved: np.ndarray
    rise: np.ndarray

    def towards(self, other: "Effects", share: float, *, loads: np.ndarray | float) -> "Effects":
        """Relaxation towards other effects by a share of the difference, with a separate share for loads."""
        shares = (loads, share, 1.0, share)
        return Effects(*(a + part * (b - a) for a, b, part in zip(astuple(self), astuple(other), shares, strict=True)))

    def continued(self, before: "Effects", share: float) -> "Effects":
        """Extrapolation from earlier effects by a share of the difference."""
        loads, lateral, moved, rise = (b + share * (b - a) for a, b in zip(astuple(before), astuple(self), strict=True))
        return Effects(loads, lateral, moved, np.maximum(rise, 0.0))


class FiniteDisplacement:
    """The effects of one press, of loads (n + b,) on its nodes and frusta."""

    def __init__(self, compliance: FoundationCompliance, points: ObjectPoints, places: Places,
                 settings: FoundationSettings) -> None:
        """settings: `FoundationSettings`, of which only `follow` and `rocking` are used"""
        self.law, self.settings, self.lattice = compliance.law, settings, compliance.counts[::-1]
        self.frusta, self.points = len(places.frusta), points
        if settings.follow or settings.rocking:
            self.lateral = places.lateral()
        if settings.follow:
            self.lateral_self, self.membrane = places.lateral_self(), places.membrane()
            self.sideways, self._own = Sideways(compliance, points, places), self._own_compliance()

    def none(self) -> Effects:
        """The effects in the unloaded sensor: zero."""
        b = self.frusta
        return Effects(np.zeros(b), np.zeros((4, b)), np.zeros((2, self.points.count)), np.zeros(b))

    def down(self, effects: Effects) -> np.ndarray:
        """Descent (n + b,) in mm of nodes and frusta under lateral loads on the frusta."""
        if not self.settings.follow:
            return np.zeros(self.points.count + self.frusta, dtype=np.float32)
        return effects.lateral.ravel().astype(np.float32) @ self.lateral

    def renewed(self, effects: Effects, load: np.ndarray, down: np.ndarray, q: np.ndarray, *,
                share: float) -> tuple[Effects, float]:
        """The effects under a load, with descents `down` (b,) of the frusta under their law's forces q (b,), relaxed by `share`.

        Returns the effects and their remaining change, as the largest change of a frustum's force in N.
        """
        found, missing, load = effects, 0.0, load.astype(np.float32)
        roots: Any = self._roots(effects, load) if self.settings.follow or self.settings.rocking else None
        if self.settings.follow:
            found = self._found(effects, load, down.reshape(self.lattice), q, roots)
            missing = max(np.abs(found.loads - effects.loads).max(), np.abs(found.lateral - effects.lateral).max())
        if self.settings.rocking:
            rise = self.law.rise(np.hypot(*roots[:, :, 0].T), q)
            found = Effects(found.loads, found.lateral, found.moved, rise)
            missing = max(missing, (np.abs(rise - effects.rise) / self.law.slope(q)).max())
        return effects.towards(found, share, loads=share * self._pace(q, roots)), float(missing)

    def _pace(self, q, roots):
        """Relaxation factors (b,) of the loads: additional forces on a frustum reduce the force of its law, and full updates would
        oscillate where the law becomes steep.
        """
        if not self.settings.follow:
            return 1.0
        step = np.maximum(_STEP * q, _STEP * self.law.force_n[1])
        slope = (self._stiffened(q + step, roots)[1] - self._stiffened(q, roots)[1]) / step
        return 1.0 / (1.0 + np.maximum(slope, 0.0))

    def _roots(self, effects, load):
        """Displacement in mm and tilt of roots along x and along y (b, axis, displacement or tilt)."""
        moved = self.lateral @ load
        if self.settings.follow:
            moved += self.lateral_self @ effects.lateral.ravel().astype(np.float32)
        return moved.astype(float).reshape(2, 2, -1).transpose(2, 0, 1)

    def _found(self, effects, load, down, q, roots):
        forces = (self.membrane @ load).reshape(3, *self.lattice)
        more, pushed = self._stiffened(q, roots)
        loads = membrane_loads(down, forces).ravel() + pushed
        pressed = more - q[:, None, None] * [[0.0, 1.0], [1.0, 0.0]]
        return Effects(loads, self._lateral(effects.lateral, pressed, roots), self.sideways(load), effects.rise)

    def _stiffened(self, q, roots):
        """Additional stiffness (b, 2, 2) of roots beyond the linear one, and forces (b,) in N of frusta beyond their law."""
        more, growth = self.law.stiffening(q)
        return more, 0.5 * np.einsum("bai,bij,baj->b", roots, growth, roots)

    def _lateral(self, present, stiffness, roots):
        """Forces and moments (4, b) of the additional stiffness (b, 2, 2) of roots, implicit in each root's local response, as
        compressed frusta are stiffer than the slab around them.
        """
        present = present.reshape(2, 2, -1).transpose(2, 0, 1)
        free = roots - present @ self._own.T
        resisted = np.linalg.solve(np.eye(2) + stiffness @ self._own, stiffness @ free.transpose(0, 2, 1))
        return -resisted.transpose(2, 1, 0).reshape(4, -1)

    def _own_compliance(self):
        """Compliance (2, 2) of the central frustum's displacement and tilt along x to force and moment on it."""
        middle = np.ravel_multi_index([count // 2 for count in self.lattice], self.lattice)
        both = middle + self.frusta * np.arange(2)
        units = np.zeros((4 * self.frusta, 2))
        units[both, [0, 1]] = 1.0
        return (self.lateral_self @ units)[both].astype(float)


def membrane_loads(down: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Loads on the frusta (..., ny, nx), upwards in N, from membrane forces (..., 3, ny, nx) in N/mm in a slab with descents `down`
    (..., ny, nx) in mm: the gradient of 1/2 sum N_ab w_a w_b over the cells; beyond the lattice the slab is fixed.

    Slopes w_a are taken over two pitches: the slab is thicker than a pitch and rotates as a whole only over such lengths.
    """
    x, y = _centred(down, -1), _centred(down, -2)
    along_x, along_y, shear = np.moveaxis(forces, -3, 0)
    return -_centred(along_x * x + shear * y, -1) - _centred(along_y * y + shear * x, -2)


def _centred(values, axis):
    """Half the difference of the neighbours along an axis, zero beyond the borders; minus its transpose."""
    out, along = np.zeros_like(values), np.moveaxis(values, axis, 0)
    difference = np.moveaxis(out, axis, 0)
    difference[:-1] = 0.5 * along[1:]
    difference[1:] -= 0.5 * along[:-1]
    return out


@dataclass(frozen=True)
class FoundationLoadStep:
    """One load step.

    load (n + b,): N at nodes and frusta;  lateral (4, b): see `Effects`;  touching (c,): points under pressure
    compression (b,): of frusta in mm, negative if lifted;  penetration in mm: of whole patches, with their contact compliance
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
    for found in settled_contacts(compliance, points, forces_n, settings=settings):
        yield found.load_step


@dataclass(frozen=True)
class SettledContact:
    """A load step with what it was solved with: the active sets, the frusta's forces q (b,) in N, and the effects of finite
    displacements; patch (c, n): shares of the nodes in patches;  points, contact_compliance (c,): of the patches beside edges in
    mm/N, and possible (c,), which of them can touch, as last updated
    """

    load_step: FoundationLoadStep
    touching: np.ndarray
    standing: np.ndarray
    q: np.ndarray
    effects: Effects
    patch: Any
    points: ObjectPoints
    contact_compliance: np.ndarray
    possible: np.ndarray


def settled_contacts(compliance: FoundationCompliance, points: ObjectPoints, forces_n: Iterable[float], *,
                     settings: FoundationSettings = FoundationSettings()) -> Iterator[SettledContact]:
    """Yield a `SettledContact` for each force, as `press_foundation` its load step."""
    press = _Press(compliance, points, settings)
    path: list[tuple[float, _State]] = []
    for force in forces_n:
        path = path or [(0.0, press.first(float(force)))]
        load_step = _advance(press, path, float(force))
        state = path[-1][1]
        yield SettledContact(load_step, state.touching, state.standing, state.q, state.effects, press.patch,
                             press.touched, press.slab.contact_compliance, press.possible)


def lifted(compliance: FoundationCompliance, points: ObjectPoints, depth_mm: float) -> FoundationLoadStep:
    """The `FoundationLoadStep` of an object that rests on the shell at this depth without touching the sensor."""
    frusta = int(np.prod(compliance.counts))
    return FoundationLoadStep(force_n=0.0, depth=depth_mm, load=np.zeros(points.count + frusta), lateral=np.zeros((4, frusta)),
                              touching=np.zeros(points.count, dtype=bool), compression=np.zeros(frusta), penetration=0.0,
                              iterations=0)


def _advance(press, path, target):
    """Reach a force (N) from the end of a path of forces and states, through intermediate forces if a direct step fails.

    Appends the reached forces and states to the path. Direct steps rarely fail, except from rest under a tilted object.
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
        """Maps (l, ny, nx) of some `FoundationLoadStep`s, with the fixed edges."""
        return self._places.maps(np.stack([load_step.load for load_step in load_steps], axis=1),
                                 np.stack([load_step.lateral.ravel() for load_step in load_steps], axis=1))


@dataclass
class _State:
    """Active sets of patches and frusta, the forces q (b,) of the frusta's law in N, and the effects of finite displacements.

    solved (c + b,): forces of patches and frusta in N as last solved for;  depth: of the object below its first touch in mm
    """

    touching: np.ndarray
    standing: np.ndarray
    q: np.ndarray
    effects: Effects
    solved: np.ndarray
    depth: float


def _continued(path, force):
    """First guess of the state at a force: linear extrapolation from the last two states of a path, or its only one."""
    second, now = path[-1]
    if len(path) == 1:
        return replace(now)
    first, before = path[-2]
    share = (force - second) / (second - first)
    return replace(now, q=np.maximum(now.q + share * (now.q - before.q), 0.0), depth=now.depth + share * (now.depth - before.depth),
                   solved=now.solved + share * (now.solved - before.solved), effects=now.effects.continued(before.effects, share))


class _Press:
    def __init__(self, compliance, points, settings):
        self.law, self.points, self.settings = compliance.law, points, settings
        self.touched = points     # as of the last update of the contact
        self._springs = compliance.grid.areas(points.nodes) * compliance.foundation_modulus
        places = Places(compliance, points)
        self.frusta = len(places.frusta)
        self.patch = patches_of(points, compliance.grid, settings.patches)
        self.slab, self.edges = _Slab(places.surface(), self.patch), SoftEdges(compliance)
        self.possible, self.system = np.ones(self.patch.shape[0], dtype=bool), ActiveSystem(self.slab.matrix, self.patch.shape[0])
        self.finite = FiniteDisplacement(compliance, points, places, settings)

    def first(self, force):
        """The start of a press: the patches touch that are lower than the object would come on springs, and the lowest ones."""
        gap = self.patch @ self.points.gap
        depth = depth_on_springs(self.points.gap - gap.min(), self._springs, force)
        touching = gap <= max(gap.min() + depth, np.sort(gap)[:_FIRST_PATCHES][-1])
        return _State(touching, np.ones(self.frusta, dtype=bool), np.zeros(self.frusta), self.finite.none(),
                      np.zeros(len(self.slab.matrix)), 0.0)

    def load_step(self, state, force, *, rough=False):
        """Newton's method from a state, which is updated to the load step; returns it, or None on failure, and the iterations.

        rough: with the tolerance of intermediate forces
        """
        c, look, repeats = self.patch.shape[0], True, 0 if rough else _REPEATS
        moved, down_by = state.effects.moved, state.depth     # at the last update of the contact
        enough = (_ROUGHLY if rough else 1.0) * self.settings.tolerance * force
        for iteration in range(1, self.settings.max_iterations + 1):
            if look:      # updated in every step, points at edges would oscillate
                share = 0.5 if iteration > 1 and repeats < _REPEATS // 2 else 1.0
                moved, down_by = moved + share * (state.effects.moved - moved), down_by + share * (state.depth - down_by)
                gap0, look = self._contact(state, moved, down_by), False
            if not state.touching.any():     # nothing carries the force
                break
            effects, already = state.effects, self.slab.seen(self.finite.down(state.effects))
            try:
                displacement, depth = self._solve(gap0, already, state, force, _WITHIN * enough)
            except sla.LinAlgError:
                break
            if not abs(depth) < _ABSURD_MM:
                break
            f, q = state.solved[:c], state.solved[c:]
            gap, down = gap0 - depth + displacement[:c] + self.slab.contact_compliance * f, -displacement[c:]
            load = self.slab.load(np.concatenate([f, q + effects.loads]))
            change, state.depth = self._take(state, q), depth - self.points.gap.min()
            share = 1.0 if iteration <= _PATIENCE else 0.5
            state.effects, missing = self.finite.renewed(effects, load, down, state.q, share=share)
            same = self._same_sets(state, f, q, gap, down)
            if same and max(change, missing) <= enough:
                if repeats and self._elsewhere(state, moved, down_by):
                    repeats, look = repeats - 1, True
                    continue
                touched = self.patch.T @ (state.touching * 1.0) > 0
                overlap = float(max(0.0, -gap[self.possible].min()))
                return FoundationLoadStep(force_n=force, depth=depth, load=load, lateral=effects.lateral, touching=touched,
                                       iterations=iteration, compression=down, penetration=overlap), iteration
        return None, iteration

    def _contact(self, state, moved, depth):
        """Gaps (c,) of patches for lateral displacements `moved` (2, c) of their points and the object at `depth`.

        Patches at an edge of the object get a contact compliance, and those that it has left cannot touch.
        """
        points = self.touched = self.points.as_deep(depth)
        contact_compliance = self.patch.power(2) @ np.minimum(self.edges(points, moved, depth), _FREE)
        self.possible = contact_compliance < _SOFTEST
        state.touching = state.touching & self.possible
        self.slab.contact_compliance = contact_compliance
        return self.patch @ (points.gap + (points.slope.T * moved).sum(axis=0))

    def _elsewhere(self, state, moved, depth):
        """Whether points or the object have moved beyond the tolerance since the last update of the contact."""
        steps = np.abs(state.effects.moved - moved).max() / self.points.step.min()
        return steps > _STRAYED or abs(state.depth - depth) > _STRAYED * abs(state.depth)

    def _solve(self, gap0, already, state, force, enough):
        """Displacements (c + b,) of patches downwards and frusta upwards, and the depth, for the current active sets with the law's
        tangent; sets `state.solved`.

        already (c + b,): displacements from other causes than patches and frusta;  enough: error of the forces in N
        """
        c, law, slab, slope = len(gap0), self.law, self.slab, self.law.slope(state.q)
        rows = np.flatnonzero(np.concatenate([state.touching, state.standing]))
        spring = np.concatenate([slab.contact_compliance, slope + law.rocking_compliance(state.effects.rise)])
        already = already + slab.matrix[:, c:] @ state.effects.loads.astype(np.float32)
        reached = spring[c:] * state.q - law.extension(state.q) + state.effects.rise
        right = np.concatenate([-gap0, reached]) - already
        state.solved, moved, depth = self.system.solve(rows, spring, right, state.solved, force, enough)
        return moved + already, depth

    @staticmethod
    def _take(state, q):
        """Store the frusta's forces; returns the largest change in N."""
        pressing = np.maximum(q, 0.0)
        change = float(np.abs(pressing - state.q).max())
        state.q = pressing
        return change

    def _same_sets(self, state, f, q, gap, down):
        """Add patches and frusta that overlap to the active sets, remove those in tension; returns whether none changed."""
        small = self.settings.gap_mm
        touching = np.where(state.touching, f >= 0, self.possible & (gap < -small))
        standing = np.where(state.standing, q >= 0, down + state.effects.rise > small)
        same = bool((touching == state.touching).all() and (standing == state.standing).all())
        state.touching, state.standing = touching, standing
        return same


class _Slab:
    """The compliance among patches, downwards, and frusta, upwards: matrix (c + b, c + b) in mm/N.

    contact_compliance (c,): of a spring in series with each patch, in mm/N
    """

    def __init__(self, compliance, patch):
        """compliance (n + b, n + b) of n nodes and of frusta, downwards;  patch (c, n): shares of nodes in patches"""
        c, n = patch.shape
        self._patch = at = patch.astype(np.float32)
        self.matrix = np.empty((c + len(compliance) - n,) * 2, dtype=np.float32)
        self.matrix[:c, :c] = at @ np.ascontiguousarray((at @ compliance[:n, :n]).T)
        self.matrix[:c, c:] = -(at @ np.ascontiguousarray(compliance[:n, n:]))
        self.matrix[c:, :c] = self.matrix[:c, c:].T
        self.matrix[c:, c:] = compliance[n:, n:]
        self.contact_compliance = np.zeros(c)

    def seen(self, down):
        """Displacements (c + b,) of patches downwards and frusta upwards from descents (n + b,) of nodes and frusta."""
        nodes = self._patch.shape[1]
        return np.concatenate([self._patch @ down[:nodes], -down[nodes:]])

    def load(self, forces):
        """Downward forces (n + b,) on nodes and frusta from forces (c + b,) on patches downwards and on frusta upwards."""
        patches = self._patch.shape[0]
        return np.concatenate([self._patch.T @ forces[:patches], -forces[patches:]])
