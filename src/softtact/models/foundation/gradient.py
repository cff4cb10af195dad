"""Derivatives of a settled press of the foundation model: implicit differentiation of its balance in double precision.

The unknowns are forces f of patches and q of frusta, the depth, and what finite displacements add (`models.foundation.solve`):
loads r, lateral loads l, lifts e by rocking, and gaps s by nodes that move sideways below a slope. With the active sets held,
    gap0 + s - depth + (A [f; q + r] + L' l) = 0    at touching patches,        sum f = F
    extension(q) - w - e = 0                        at standing frusta,         r, l, e, s = effects(f, q, r, l)
A number changes them by minus the tangent's inverse times the change of these residuals. The contact's tangent is Newton's,
factored once; the effects are found with GMRES (Saad and Schultz, SIAM J. Sci. Stat. Comput. 7 (1986) 856) about it, those by
several numbers as one vector, so that a product reads the compliance once for all: arrays have a first axis for the numbers. GMRES
takes products in single precision, which read half as much, and what it leaves is refined in double (Carson and Higham, SIAM J.
Sci. Comput. 40 (2018) A817). The
solver leaves gaps of some micrometres, as it seldom updates where nodes lie under the object, so Newton's method settles the
balance.

Held besides the active sets: the slopes over the points. The contact compliance of points beside edges changes with the share of
their surroundings that the object covers; `models.foundation.edge_rates` gives gap rates of the same effect.
"""

import copy
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Self

import numpy as np
import scipy.linalg as sla
from scipy.sparse.linalg import LinearOperator, gmres

from softtact.contact.object_points import ObjectPoints
from softtact.errors import ConvergenceError
from softtact.models.foundation.compliance import FoundationCompliance
from softtact.models.foundation.dof_maps import Places, Sideways
from softtact.models.foundation.solve import SettledContact, membrane_loads
from softtact.models.quarter_symmetry import ParityProduct

_ROUNDS, _RESTART = 10, 40     # of GMRES
_OF_RATES, _OF_STEPS = 1e-8, 1e-3     # what is left of the effects in rates, and in steps of Newton's method
_OF_ROUNDS = 1e-4     # what a round of GMRES leaves: its products are in single precision
_NEWTON, _SETTLED = 30, 1e-6     # steps at most, and a patch's change of force over the total force that ends them
_REMEDY = "ask for gradients of smaller forces, or of the elastic model."
_COUPLED = np.array([[0.0, 1.0], [1.0, 0.0]])     # of displacement and tilt of a root by pressure


@dataclass(frozen=True)
class Unknowns:
    """All unknowns of a balance, their rates, or the residuals of their equations.

    force (..., c): N on patches;  q (..., b): N on frusta;  depth (...) in mm, its equation: the sum of forces in N
    loads (..., b): N;  lateral (..., 4 b): N and N mm;  rise (..., b): mm
    shift (..., c): change of gaps in mm by nodes that move sideways
    """

    force: np.ndarray
    q: np.ndarray
    depth: np.ndarray
    loads: np.ndarray
    lateral: np.ndarray
    rise: np.ndarray
    shift: np.ndarray

    def plus(self, other: "Unknowns", factor: float = 1.0) -> "Unknowns":
        """The sum with `factor` times the others."""
        return Unknowns(*(getattr(self, one.name) + factor * getattr(other, one.name) for one in fields(self)))

    def times(self, factor: float) -> "Unknowns":
        """All times a factor."""
        return Unknowns(*(factor * getattr(self, one.name) for one in fields(self)))


@dataclass(frozen=True)
class Rates:
    """Rates of a load step by one number, or k: depth in mm; loads on nodes and frusta (..., n + b) and lateral ones (..., 4 b),
    for the map;  margin: the least change of the number, to either side, at which a patch or frustum gains or loses contact
    unknowns: all;  openings: of the gaps of patches (..., c) and of frusta over the board (..., b) in mm
    """

    depth: np.ndarray
    load: np.ndarray
    lateral: np.ndarray
    margin: np.ndarray
    unknowns: Unknowns
    openings: tuple[np.ndarray, np.ndarray]

    def each(self) -> list["Rates"]:
        """Those by each of k numbers."""
        unknowns = map(Unknowns, *(getattr(self.unknowns, one.name) for one in fields(Unknowns)))
        parts = zip(self.depth, self.load, self.lateral, self.margin, unknowns, zip(*self.openings, strict=True), strict=True)
        return [Rates(*one) for one in parts]


class _Rounded:
    """A compliance in single precision as a factor of loads that are rounded to it."""

    __array_ufunc__ = None     # so that `forces @ G` comes here

    def __init__(self, compliance: ParityProduct) -> None:
        self._compliance = compliance

    def __matmul__(self, loads: np.ndarray) -> np.ndarray:
        return self._compliance @ loads.astype(np.float32)

    def __rmatmul__(self, forces: np.ndarray) -> np.ndarray:
        return forces.astype(np.float32) @ self._compliance


class Balance:
    """The balance of a settled press of `ObjectPoints` on a compliance, in double precision; `of` another load step of it."""

    def __init__(self, compliance: FoundationCompliance, points: ObjectPoints, contact: SettledContact) -> None:
        self.places, self.law, self.patch = Places(compliance, points), compliance.law, contact.patch
        self._lattice, (self.patches, self.nodes) = compliance.counts[::-1], contact.patch.shape
        surface, at = self.places.surface().astype(float), contact.patch
        both = np.vstack([at @ surface[:self.nodes], -surface[self.nodes:]])
        self._hard = np.hstack([(at @ both[:, :self.nodes].T).T, -both[:, self.nodes:]])
        self._stored = [self.places.lateral(), self.places.lateral_self(), self.places.membrane()]
        products: list[ParityProduct | _Rounded] = [one.astype(float) for one in self._stored]
        self._lateral, self._lateral_self, self._membrane = products
        self._sideways: Callable[[np.ndarray], np.ndarray] = Sideways(compliance, points, self.places)
        self._at(contact)

    def _at(self, contact):
        self.contact, self._slope, place = contact, contact.points.slope.T, np.arange(self.patches)
        self.matrix = self._hard.copy()
        self.matrix[place, place] += contact.contact_compliance

    def of(self, contact: SettledContact) -> Self:
        """The balance of another load step of the same press."""
        other = copy.copy(self)
        other._at(contact)
        return other

    def rounded(self) -> Self:
        """The balance with products in single precision."""
        other = copy.copy(self)
        other._lateral, other._lateral_self, other._membrane = map(_Rounded, self._stored)
        other._sideways = lambda load: self._sideways(load.astype(np.float32))
        return other

    @property
    def unknowns(self) -> Unknowns:
        """Those of the solver's load step."""
        contact, effects = self.contact, self.contact.effects
        frusta = contact.q.size
        per_patch = np.asarray(self.patch.power(2).sum(axis=1)).ravel()
        force = self.patch @ contact.load_step.load[:-frusta] / np.maximum(per_patch, np.finfo(float).tiny)
        return Unknowns(force, contact.q, np.array(contact.load_step.depth), effects.loads, effects.lateral.ravel(), effects.rise,
                        self.patch @ (self._slope * effects.moved).sum(axis=0))

    def load(self, at: Unknowns) -> np.ndarray:
        """Downward loads (..., n + b) on nodes and frusta."""
        return np.concatenate([at.force @ self.patch, -(at.q + at.loads)], axis=-1)

    def _moved(self, at):
        """Displacements (..., c + b) of patches downwards and frusta upwards."""
        return self._moved_by_effects(at) + at.force @ self.matrix[:, :self.patches].T + at.q @ self.matrix[:, self.patches:].T

    def _moved_by_effects(self, at):
        """The part of `_moved` that comes from loads and lateral loads."""
        down = at.lateral @ self._lateral
        seen = np.concatenate([down[..., :self.nodes] @ self.patch.T, -down[..., self.nodes:]], axis=-1)
        return seen + at.loads @ self.matrix[:, self.patches:].T

    def _roots(self, at):
        """Displacements and tilts of roots (..., b, axis, displacement or tilt)."""
        roots = (self._lateral @ self.load(at).T + self._lateral_self @ at.lateral.T).T
        return np.moveaxis(roots.reshape(*at.lateral.shape[:-1], 2, 2, -1), -1, -3)

    def _on_lattice(self, moved):
        """Descents (..., ny, nx) of the frusta."""
        return -moved[..., self.patches:].reshape(*moved.shape[:-1], *self._lattice)

    def _membrane_forces(self, at):
        """Membrane forces (..., 3, ny, nx)."""
        return (self._membrane @ self.load(at).T).T.reshape(*at.force.shape[:-1], 3, *self._lattice)

    def gaps(self, at: Unknowns, gap_mm: np.ndarray) -> np.ndarray:
        """Gaps (c,) in mm of patches whose points have the gaps gap_mm (n,) at depth 0."""
        return self.patch @ gap_mm + at.shift - at.depth + self._moved(at)[:self.patches]

    def residual(self, at: Unknowns, gap_mm: np.ndarray, force_n: float) -> Unknowns:
        """Residuals of the equations for points with gaps gap_mm (n,) at depth 0 under a force in N, the active sets held."""
        moved, roots, law = self._moved(at), self._roots(at), self.law
        down = -moved[self.patches:]
        touching = np.where(self.contact.touching, self.gaps(at, gap_mm), at.force)
        standing = np.where(self.contact.standing, law.extension(at.q) - down - at.rise, at.q)
        more, growth = law.stiffening(at.q)
        stiffness = more - at.q[:, None, None] * _COUPLED
        pushed = 0.5 * np.einsum("bai,bij,baj->b", roots, growth, roots)
        return Unknowns(touching, standing, at.force.sum() - force_n,
                        at.loads - membrane_loads(self._on_lattice(moved), self._membrane_forces(at)).ravel() - pushed,
                        at.lateral + _flat(np.einsum("bij,baj->bai", stiffness, roots)),
                        at.rise - law.rise(np.hypot(*roots[:, :, 0].T), at.q), at.shift - self.shift(at))

    def active_sets(self, at: Unknowns, gap_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which patches (c,) touch and which frusta (b,) stand after the present ones of these pull or overlap."""
        contact, lifted = self.contact, self._moved(at)[self.patches:] - at.rise
        return (np.where(contact.touching, at.force > 0, contact.possible & (self.gaps(at, gap_mm) < 0)),
                np.where(contact.standing, at.q > 0, lifted < 0))

    def on_points(self, of_patches: np.ndarray) -> np.ndarray:
        """Forces (n,) in N on points, of forces (c,) on patches; or the contact compliance (n,) of each patch's points."""
        return of_patches @ self.patch

    def moved(self, at: Unknowns) -> np.ndarray:
        """Displacements (2, n) in mm of the points sideways."""
        return self._sideways(self.load(at))

    def shift(self, at: Unknowns) -> np.ndarray:
        """Changes (..., c) of the patches' gaps in mm by nodes that move sideways below a slope."""
        return np.einsum("an,an...->...n", self._slope, self._sideways(self.load(at).T)) @ self.patch.T

    def nothing(self, *numbers: int) -> Unknowns:
        """Unknowns that are all zero, with this first axis."""
        c, b = self.patches, len(self.contact.q)
        return Unknowns(*(np.zeros((*numbers, *size)) for size in ((c,), (b,), (), (b,), (4 * b,), (b,), (c,))))


def _flat(of_roots):
    """Values (..., 4 b) of roots (..., b, axis, displacement or tilt): along x, then along y."""
    return np.moveaxis(of_roots, -3, -1).reshape(*of_roots.shape[:-3], -1)


class Tangent:
    """The derivative of a `Balance`'s residuals at some of its unknowns."""

    def __init__(self, balance: Balance, at: Unknowns) -> None:
        self.balance, self.at = balance, at
        contact, law = balance.contact, balance.law
        self._touching, self._standing = np.flatnonzero(contact.touching), np.flatnonzero(contact.standing)
        self._down, self._roots = balance._on_lattice(balance._moved(self.at)), balance._roots(self.at)
        self._membrane = balance._membrane_forces(self.at)
        self._slope = law.slope(self.at.q)
        more, self._growth = law.stiffening(self.at.q)
        self._stiffness = more - self.at.q[:, None, None] * _COUPLED
        self._curving = law.stiffening_rate(self.at.q)
        rows = np.concatenate([self._touching, balance.patches + self._standing])
        self._by_active = balance.matrix[:, rows]
        matrix = self._by_active[rows]
        frusta = np.arange(len(self._touching), len(rows))
        matrix[frusta, frusta] += self._slope[self._standing]
        self._factor = sla.cho_factor(matrix, check_finite=False)
        self._ones = (np.arange(len(rows)) < len(self._touching)).astype(float)
        self._per_depth = sla.cho_solve(self._factor, self._ones)

    def by_gaps(self, gap_rates: np.ndarray, force_rates: np.ndarray | float = 0.0) -> Rates:
        """Rates by a number, or k, on which the points' gaps (..., n) in mm and the force (...) in N depend."""
        nothing = self.balance.nothing(*gap_rates.shape[:-1])
        return self._by(replace(nothing, force=gap_rates @ self.balance.patch.T, depth=nothing.depth - force_rates))

    def by_force(self) -> Rates:
        """Rates by the force in N."""
        return self.by_gaps(np.zeros(self.balance.nodes), 1.0)

    def by_moduli(self, by_force: Rates) -> Rates:
        """Rates by a common factor of all moduli, from those by force: displacements depend on force over factor."""
        force_n = self.balance.contact.load_step.force_n
        at, rate = self.at, by_force.unknowns.times(-force_n)
        rate = replace(rate, force=at.force + rate.force, q=at.q + rate.q, loads=at.loads + rate.loads,
                       lateral=at.lateral + rate.lateral)
        opening, lifting = (-force_n * one for one in by_force.openings)
        return Rates(-force_n * by_force.depth, -force_n * by_force.load, -force_n * by_force.lateral,
                     self._margin(rate, opening, lifting), rate, (opening, lifting))

    def by_compliance(self, lower: Balance, upper: Balance, apart: float, gap_mm: np.ndarray) -> Rates:
        """Rates by a number between whose values, `apart` from each other, the compliance changes; `load` is for this compliance.

        gap_mm (n,): of the points at depth 0
        """
        force_n = self.balance.contact.load_step.force_n
        below, above = (one.residual(self.at, gap_mm, force_n) for one in (lower, upper))
        opening = (upper.gaps(self.at, gap_mm) - lower.gaps(self.at, gap_mm)) / apart
        return self._by(replace(above.plus(below, -1.0).times(1 / apart), force=opening))

    def _by(self, change):
        found = self.solve(change)
        moving, c = self.balance._moved(found), self.balance.patches
        opening = change.force + found.shift - found.depth[..., None] + moving[..., :c]
        lifting = change.q + moving[..., c:] - found.rise
        return Rates(found.depth, self.balance.load(found), found.lateral, self._margin(found, opening, lifting), found,
                     (opening, lifting))

    @classmethod
    def settled(cls, balance: Balance, gap_mm: np.ndarray, force_n: float) -> Self:
        """Of the balance at points with gaps gap_mm (n,) at depth 0 under a force in N, from the solver's load step on."""
        tangent = cls(balance, balance.unknowns)
        for _ in range(_NEWTON):
            step = tangent.solve(balance.residual(tangent.at, gap_mm, force_n), _OF_STEPS)
            at = tangent.at.plus(step)
            touching, standing = balance.active_sets(at, gap_mm)
            same = np.array_equal(touching, balance.contact.touching) and np.array_equal(standing, balance.contact.standing)
            balance = balance.of(replace(balance.contact, touching=touching, standing=standing))
            tangent = cls(balance, replace(at, force=np.where(touching, at.force, 0.0), q=np.where(standing, at.q, 0.0)))
            if same and np.abs(step.force).max() <= _SETTLED * force_n:
                return tangent
        raise ConvergenceError(f"The gradient of the foundation model did not settle its balance at {force_n:g} N; {_REMEDY}")

    def _contact(self, balance, effects, change):
        """Rates of all unknowns, and of `Balance._moved`, for those of the effects, with the residuals' `change` balanced."""
        c, touching, standing = balance.patches, self._touching, self._standing
        nothing = balance.nothing(*effects[0].shape[:-1])
        still = Unknowns(nothing.force, nothing.q, nothing.depth, *effects)
        moved = balance._moved_by_effects(still)
        right = np.concatenate([-(change.force + still.shift + moved[..., :c])[..., touching],
                                (-change.q - moved[..., c:] + still.rise)[..., standing]], axis=-1)
        at_rest = sla.cho_solve(self._factor, right.T, check_finite=False).T
        depth = (-change.depth - at_rest @ self._ones) / (self._ones @ self._per_depth)
        both = at_rest + depth[..., None] * self._per_depth
        still.force[..., touching], still.q[..., standing] = np.split(both, [len(touching)], axis=-1)
        return replace(still, depth=depth), moved + both @ self._by_active.T

    def _effects(self, balance, rate, moved):
        """Rates of loads, lateral loads, rise and shift that follow from those of all unknowns and of `Balance._moved`."""
        law, roots = balance.law, balance._roots(rate)
        by_q = rate.q * self._slope      # of the compression
        loads = (membrane_loads(balance._on_lattice(moved), self._membrane)
                 + membrane_loads(self._down, balance._membrane_forces(rate)))
        pushed = (np.einsum("bai,bij,...baj->...b", self._roots, self._growth, roots)
                  + 0.5 * by_q * np.einsum("bai,bij,baj->b", self._roots, self._curving, self._roots))
        stiffer = by_q[..., None, None] * self._growth - rate.q[..., None, None] * _COUPLED
        lateral = -_flat(np.einsum("bij,...baj->...bai", self._stiffness, roots)
                         + np.einsum("...bij,baj->...bai", stiffer, self._roots))
        aside = self._roots[:, :, 0]
        length = np.maximum(np.hypot(*aside.T), np.finfo(float).tiny)
        sideways = (aside * roots[..., 0]).sum(axis=-1) / length
        rise = law.rise_rate(np.hypot(*aside.T), self.at.q, sideways, rate.q)
        return loads.reshape(pushed.shape) + pushed, lateral, rise, balance.shift(rate)

    def solve(self, change: Unknowns, left: float = _OF_RATES) -> Unknowns:
        """Rates of the unknowns at which rates `change` of the residuals are balanced, but for a share `left` of the effects."""
        balance, rounded = self.balance, self.balance.rounded()
        sizes, nothing = np.cumsum([one.shape[-1] for one in self._split(change)[:3]]), balance.nothing()
        scale = np.repeat(self._sizes(), np.diff([0, *sizes, sizes[-1] + change.shift.shape[-1]]))
        start = self._contact(balance, self._split(balance.nothing(*change.force.shape[:-1])), change)
        right = (np.concatenate(self._effects(balance, *start), axis=-1) - np.concatenate(self._split(change), axis=-1)) / scale
        right /= np.maximum(length := np.linalg.norm(right, axis=-1, keepdims=True), np.finfo(float).tiny)     # of each number's

        def missing(balance, x):
            effects = x.reshape(right.shape) * scale
            follow = self._effects(balance, *self._contact(balance, np.split(effects, sizes, axis=-1), nothing))
            return ((effects - np.concatenate(follow, axis=-1)) / scale).ravel()

        operator = LinearOperator((right.size,) * 2, matvec=lambda x: missing(rounded, x), dtype=float)
        x, remaining, enough = np.zeros(right.size), right.ravel(), left * np.linalg.norm(right)
        for _ in range(_ROUNDS):
            step, failed = gmres(operator, remaining, rtol=max(left, _OF_ROUNDS), atol=enough, restart=_RESTART, maxiter=_ROUNDS)
            x += step
            if not failed and left >= _OF_ROUNDS:
                break
            remaining = right.ravel() - missing(balance, x)
            if np.linalg.norm(remaining) <= enough:
                break
        else:
            force_n = balance.contact.load_step.force_n
            raise ConvergenceError(f"The gradient of the foundation model did not settle at {force_n:g} N; {_REMEDY}")
        return self._contact(balance, np.split(scale * length * x.reshape(right.shape), sizes, axis=-1), change)[0]

    def _split(self, at):
        return at.loads, at.lateral, at.rise, at.shift

    def _sizes(self):
        """Typical sizes of loads, lateral loads, rise and shift, so that no kind dominates the norm."""
        return [max(np.abs(one).max(initial=0.0), 1e-9) for one in self._split(self.at)[:3]] + [1e-3]

    def _margin(self, rate, opening, lifting):
        """Distance of the nearest patch or frustum from another state, in its rate."""
        balance, contact, at = self.balance, self.balance.contact, self.at
        gap, lifted = balance.gaps(at, contact.points.gap), -self._down.ravel() - at.rise
        distance = np.concatenate([np.where(contact.touching, at.force, np.maximum(gap, 0.0))[contact.possible],
                                   np.where(contact.standing, at.q, np.maximum(lifted, 0.0))])
        speed = np.abs(np.concatenate([np.where(contact.touching, rate.force, opening)[..., contact.possible],
                                       np.where(contact.standing, rate.q, lifting)], axis=-1))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(speed > 0, distance / speed, np.inf).min(axis=-1)
