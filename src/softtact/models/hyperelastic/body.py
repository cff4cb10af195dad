"""The layered sensor as one body: slab (sheet and cover) tied to its `Support`, its friction, and one Newton step of it.

Between global Newton steps, each frustum is brought to local equilibrium with its root fixed (`balanced`). Frusta beside the object
rock on the rims of their tips, and those under it fold onto the board: a few change their contact state within a step and then
have the largest residuals. A global step costs a thousand times as much as a step of these, and one frustum whose energy increases
would halve it for all. Each local step decreases the frustum's energy, and so the total one.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.contact.friction import FrictionResponse, FrictionState
from softtact.errors import ConvergenceError
from softtact.fem import kernels
from softtact.linalg.multifrontal_solver import DissectedSolver
from softtact.linalg.workers import SERIAL, Workers, chunks
from softtact.models.hyperelastic.newton_step import ContactStepper, DissectedContact, StepContact
from softtact.models.hyperelastic.rigid_contact import TopContact
from softtact.models.hyperelastic.slab import Slab
from softtact.models.hyperelastic.states import BodyHistory, BodyState, BodyStep, ContactProjection, ObjectSurface, SupportState
from softtact.models.hyperelastic.support import NoCells, Support
from softtact.models.hyperelastic.unit_cells import SheetCells
from softtact.models.newton import line_search_each
from softtact.progress import Watch

if TYPE_CHECKING:
    from softtact.fem.kernels_warp import WarpKernels

_FRUSTUM_STEPS = 6               # Newton steps for a frustum; a remaining imbalance is left to the next global step
_FRUSTUM_HALVINGS = 5
_FARTHEST_MM = 0.05      # largest movement of a node in a step
_SHARE = 0.3             # of the tolerance: largest residual of a frustum, as a later movement of its root adds to it
_FRUSTA_AT_ONCE = 8             # frusta that a thread condenses at once
_DAMPINGS = 4         # steps that are tried with increasing damping of the cells that move too far


@dataclass(frozen=True)
class _Remedy:
    """How an indefinite tangent is made positive definite: shares of the negative modes of cells and cover that become positive
    (their absolute eigenvalues, element by element), and N/mm that are added on every free unknown of the slab."""

    cells: float = 0.0
    cover: float = 0.0
    shift: float = 0.0


# In turn, until the tangent is positive definite, so that every step decreases the energy. Modes that the whole body holds are
# negative in some element; made positive there, they are too stiff, and steps along them short. A tangent that is not finite never
# becomes positive definite, so there is an end.
_REMEDIES = [_Remedy(), _Remedy(cells=1.0), *(_Remedy(share, share) for share in (0.125, 0.25, 0.5)),
             *(_Remedy(1.0, 1.0, 0.001 * 4.0**number) for number in range(20))]
_EASED = 2     # by how many of them the search starts before the last one that served


def _first_remedy(last, damped_before):
    """The number of the remedy that a search tries first; damped_before: the last tangent differed only in the damping of cells."""
    return last if damped_before else max(0, last - _EASED)


def balanced(support: Support, state: SupportState, tolerance_n: float, *,
             workers: Workers = SERIAL) -> tuple[SupportState, np.ndarray]:
    """The `SupportState` with each frustum beyond the tolerance (N) in local equilibrium, and the numbers (k,) of these frusta.

    Their condensed tangents are those at the last step's start, not at the returned state.
    """
    loose, moved = _loose(support, state, tolerance_n), np.zeros(support.count, dtype=bool)
    for _ in range(_FRUSTUM_STEPS):
        if not len(loose):
            break
        moved[loose] = True
        state, lowered = _step(support, state, loose, workers)
        loose = np.intersect1d(loose[lowered], _loose(support, state, _SHARE * tolerance_n))
    return state, np.flatnonzero(moved)


def _loose(support, state, tolerance_n):
    """Numbers (k,) of the frusta with residuals above the tolerance."""
    return np.flatnonzero(np.abs(support.inner_residual(state)).max(axis=1, initial=0.0) > tolerance_n)


def _step(support, state, frusta, workers):
    """The state after a step of the frusta (k,), each halved until its energy decreases; and for which (k,) it did."""
    workers.map(lambda part: support.condense(state, part), chunks(frusta, _FRUSTA_AT_ONCE))
    step = support.local_step(state, frusta, workers=workers)
    step *= np.minimum(1.0, _FARTHEST_MM / np.maximum(np.abs(step).max(axis=(1, 2)), 1e-300))[:, None, None]
    displacement, (energies, forces) = state.displacement.copy(), tuple(part.copy() for part in state.elastic)
    before = support.potentials(displacement[frusta], (energies[frusta], None), frusta, state.history)

    def accept(waiting, share):
        here = frusta[waiting]
        trial = state.displacement[here] + share * step[waiting]
        elastic = support.rubber(trial, here, workers=workers)
        if elastic is None:     # an element is inverted
            return np.zeros(len(waiting), dtype=bool)
        lower = support.potentials(trial, elastic, here, state.history) < before[waiting]
        displacement[here[lower]], energies[here[lower]], forces[here[lower]] = trial[lower], elastic[0][lower], elastic[1][lower]
        return lower

    lowered = line_search_each(accept, len(frusta), halvings=_FRUSTUM_HALVINGS)
    return support.with_contact(displacement, (energies, forces), state.history), lowered


class BodyFriction:
    """Updates of the friction states between Newton's runs; without friction they do nothing."""

    def __init__(self, top: TopContact, support: Support) -> None:
        """top: the slab's `TopContact`;  support: below the slab."""
        self._top, self._support = top, support
        self.reset()

    def reset(self) -> None:
        """Discard the friction of the last tangent."""
        self._last: Sequence[FrictionResponse | None] = None, None             # friction on top and board at the last tangent

    @property
    def active(self) -> bool:
        return self._top.friction is not None or self._support.friction is not None

    def begin_step(self, state: BodyState, *, growth: float = 1.0) -> BodyHistory:
        """History at the start of a step from a `BodyState`; its pressures, scaled by `growth`, are a first guess."""
        top = self._top.first_friction_state(state.slab, state.indentation)
        support = self._support.first_friction_state(state.support)
        return self._history(state, *(part and replace(part, pressure=growth * part.pressure) for part in (top, support)))

    def renewed(self, state: BodyState, *, halfway: bool = False) -> BodyHistory:
        """History with friction updated to the pressures of a `BodyState`, or to halfway between the old and new ones."""
        parts: list[FrictionState | None] = []
        part: Any
        of_part: Any
        for part, of_part in ((self._top, state.slab), (self._support, state.support)):
            if part.friction is None:
                parts.append(None)
                continue
            renewed = part.renewed_friction_state(of_part)
            parts.append(of_part.history.friction.halfway(renewed) if halfway else renewed)
        return self._history(state, *parts)

    @staticmethod
    def _history(state, top, support):
        history = state.history
        return replace(history, top=history.top.held_by(top), support=history.support.held_by(support))

    def for_tangent(self, state: BodyState) -> BodyState:
        """The state whose friction is linearised from the last tangent (see `FrictionResponse.after`)."""
        if not self.active:
            return state
        now = state.slab.friction_response, state.support.friction_response
        self._last = top, support = [part and part.after(before) for part, before in zip(now, self._last, strict=True)]
        return replace(state, slab=replace(state.slab, friction_response=top),
                       support=replace(state.support, friction_response=support))


class LayeredBody:
    """Slab on a `Support`, pressed from above by a rigid object. Lengths in mm, z = 0 at the top at rest."""

    def __init__(self, slab: Slab, support: Support, roots: np.ndarray | None = None, *, threads: int = 1) -> None:
        """roots (f, k): the slab's nodes that are the frusta's root nodes; None for a support without bodies."""
        self.slab, self.support = slab, support
        self.workers, self.watch = Workers(threads), Watch()
        self.friction = BodyFriction(slab.top, support)
        self.cells = SheetCells(slab, support, roots) if support.count else NoCells()     # type: ignore[arg-type]
        slab.build_pattern(self.cells.eliminated, self.cells.outer_dofs)
        self.solver = DissectedSolver(slab.points[slab.unknowns // 3, :2], workers=self.workers)
        self.stepper = ContactStepper(DissectedContact(self.solver, workers=self.workers))
        self._remedy = 0     # the number of the one that made the last tangent positive definite

    def sum_with(self, loops: "ModuleType | WarpKernels") -> None:
        """Use `loops` for the sums over elements: `kernels`, the default, or `WarpKernels`."""
        for block in self.slab.blocks + self.support.blocks:
            block.loops = loops

    @property
    def method(self) -> str:
        """Linear solver and device in words."""
        loops = self.slab.blocks[0].loops
        return self.solver.name if loops is kernels else f"{self.solver.name}; elements on {loops.device}"

    def close(self) -> None:
        """Free the factors and end the threads."""
        self.solver.close()
        self.workers.close()

    def rest(self) -> tuple[np.ndarray, np.ndarray]:
        """Displacements of slab (n, 3) and support (f, nodes, 3) at rest."""
        return np.zeros((self.slab.nodes, 3)), np.zeros((self.support.count, self.support.nodes, 3))

    def fresh_history(self) -> BodyHistory:
        """The contacts' history before the first touch."""
        return BodyHistory(self.slab.top.fresh_history(), self.support.fresh_history())

    def begin(self) -> None:
        """Discard all tangents and factors of an earlier press, since they would change the last digits of a result."""
        self.slab.resist_folding(0)
        self.slab.top.round_edges(False)
        self.cells.reset()
        self._forget_factors()
        self.friction.reset()

    def _forget_factors(self):
        self.stepper.reset()
        self._remedy = 0

    def folds(self, state: BodyState) -> bool:
        """Whether an element of the cover is folded, and the cover does not yet resist that."""
        return not self.slab.resists_folding and self._folded(state)

    def folds_between(self, state: BodyState) -> bool:
        """Whether an element of the cover is folded between the points at which it resists that, and it could have more points."""
        return self.slab.resists_folding == 1 and self._folded(state)

    def _folded(self, state):
        return self.slab.cover_mesh.least_volume_ratio(state.slab.displacement) <= 0

    def has_points_of(self, state: BodyState) -> bool:
        """Whether a state has the contact points that the cover has now."""
        return len(state.slab.gaps) == len(self.slab.top.area)

    def resisting_folding(self, state: BodyState, surface: ObjectSurface, *, between: bool = False) -> BodyState:
        """The state, at which no element is folded, with a cover that resists folding under an object with rounded edges, if its
        surface has them, until `begin`. The history of the contact with the object begins anew.

        between: whether it resists at all points, once it `folds_between` those that suffice nearly always
        """
        self.slab.resist_folding(max(2 if between else 1, self.slab.resists_folding))
        self.slab.top.round_edges(getattr(surface, "rounded", None) is not None)
        self._forget_factors()
        displacement, history = state.slab.displacement, BodyHistory(self.slab.top.fresh_history(), state.support.history)
        resisting = self.evaluate(displacement, state.support.displacement, state.indentation,
                                  self.slab.project(displacement, surface, state.indentation), history)
        if resisting is None:
            raise ConvergenceError("The cover is folded under an edge of the object; ask for load steps nearer to each other.")
        return resisting

    def resist_folding_at_corners(self) -> None:
        """Take back the points between, which `resisting_folding` has added."""
        self.slab.resist_folding(1)
        self._forget_factors()

    def evaluate(self, slab_displacement: np.ndarray, support_displacement: np.ndarray, indentation: float,
                 projection: ContactProjection, history: BodyHistory | None = None) -> BodyState | None:
        """State at given displacements, by default without a history of the contacts; None if an element is inverted."""
        history = history or self.fresh_history()
        slab = self.slab.evaluate(slab_displacement, projection, indentation, history.top, workers=self.workers)
        support = None if slab is None else self.support.evaluate(support_displacement, history.support, workers=self.workers)
        return None if slab is None or support is None else BodyState(slab=slab, support=support, indentation=indentation)

    def reevaluate_contact(self, state: BodyState, history: BodyHistory) -> BodyState:
        """The same displacements with another history of the contacts; the rubber is not evaluated again."""
        return BodyState(slab=self.slab.update_normals(state.slab, state.slab.projection, state.indentation, history.top),
                         support=self.support.reevaluate_contact(state.support, history.support), indentation=state.indentation)

    def balanced(self, state: BodyState, tolerance_n: float) -> BodyState:
        """The state with each frustum in local equilibrium, if only frusta are out of balance.

        A frustum that rocks, folds or slides takes separate steps, unless sheet or cover are out of balance too.
        """
        rest = max(tolerance_n, self._slab_residual(state))
        if self._support_residual(state) <= rest:
            return state
        support, moved = balanced(self.support, state.support, tolerance_n, workers=self.workers)
        self.cells.forget(moved)
        return replace(state, support=support)

    def update_normals(self, state: BodyState, projection: ContactProjection) -> BodyState:
        """The state with another contact projection on the object."""
        return replace(state, slab=self.slab.update_normals(state.slab, projection, state.indentation))

    def indented_to(self, state: BodyState, force_n: float) -> BodyState:
        """The state at the indentation that minimises the energy for fixed nodes: there the object's force is `force_n`."""
        return self.indented(state, self.slab.top.balanced(state.slab, state.indentation, force_n) - state.indentation)

    def indented(self, state: BodyState, by_mm: float) -> BodyState:
        """The state with the object lower by `by_mm`."""
        depth = state.indentation + by_mm
        return replace(state, slab=self.slab.update_normals(state.slab, state.slab.projection, depth), indentation=depth)

    def newton_step(self, state: BodyState, force_n: float | None, surface: ObjectSurface | None = None, *, turning: bool = True,
                    largest_mm: float = np.inf, kept_mm: float = 0.0) -> BodyStep:
        """The Newton step under a given force (N), or at constant indentation if `force_n` is None.

        turning: see `StepContact`;  largest_mm: largest descent of the object
        kept_mm: cells that moved less since their last tangent keep it

        With a surface, the step uses the contact projection at its end, otherwise that of the state. Without any contact a
        free object has no stiffness: the step is then not finite.
        """
        state = self.friction.for_tangent(state)
        for number in range(_DAMPINGS):
            self.cells.refresh(state, kept_mm=kept_mm, workers=self.workers)
            contact = StepContact(self.slab, state.slab, state.indentation, surface, turning=turning, largest_mm=largest_mm,
                                  workers=self.workers)
            step = self._newton_step(state, force_n, contact, largest_mm, damped_before=number > 0)
            if not (np.isfinite(step.largest()) and self.cells.damp(step.slab, step.support)):
                break
        return step

    def _newton_step(self, state, force_n, contact, largest_mm, *, damped_before):
        """The step with the present damping of the cells; damped_before: it was already computed with less damping."""
        residual, kept = self.cells.condensed_residual(state, workers=self.workers)
        step, indentation_increment = self._step_of_unknowns(state, residual.ravel()[self.slab.unknowns], contact, force_n,
                                                             largest_mm, damped_before=damped_before)
        whole = self._step_of_body(step, indentation_increment, kept, contact)
        if contact.straight is None:
            return whole
        return replace(whole, straight=cache(partial(self._step_of_body, *contact.straight, kept, contact)))

    def _step_of_body(self, step, indentation_increment, kept, contact):
        """The `BodyStep` of the unknowns' step (n,)."""
        full = np.zeros(3 * self.slab.nodes)
        full[self.slab.unknowns] = step
        slab, support = self.cells.recover(kept, full.reshape(-1, 3), workers=self.workers)
        return BodyStep(slab=slab, support=support, indentation=indentation_increment, projection=contact.projection)

    def _step_of_unknowns(self, state, residual, contact, force_n, largest_mm, *, damped_before):
        """Step of the global unknowns and of the object's indentation; an indefinite tangent is made positive definite.

        nan if that is impossible, so that Newton's method fails.
        """
        excess, border = None if force_n is None else state.force - force_n, self.slab.friction_border(state.slab)
        positive, first = None, _first_remedy(self._remedy, damped_before)
        for number, remedy in enumerate(_REMEDIES[first:], start=first):
            if number and positive is None:
                positive = self.cells.positive_outer(workers=self.workers)
            step = self.stepper.step(self._rubber_tangent(state, remedy, positive), residual, contact, friction_border=border,
                                     excess=excess, largest=largest_mm)
            if step is not None:
                self._remedy = number
                return step
        return np.full(len(residual), np.nan), np.nan

    def _rubber_tangent(self, state, remedy, positive):
        """The rubber's tangent with a `_Remedy`; positive: the cells' condensed matrices made positive definite."""
        cells = self.cells.outer
        if remedy.cells:
            cells = [own + remedy.cells * (other - own) for own, other in zip(cells, positive, strict=True)]
        rubber = self.slab.rubber_tangent(state.slab, cells, positive=remedy.cover, workers=self.workers)
        if remedy.shift:
            self.slab.add_to_diagonal(rubber, remedy.shift)
        return rubber

    def penetration(self, state: BodyState) -> float:
        """Deepest penetration in mm, of the object into the cover or of frusta into the board or each other."""
        return float(max(0.0, -self.slab.top.surface_gaps(state.slab).min(), -state.support.gaps.min(initial=np.inf)))

    def descent(self, state: BodyState) -> float:
        """Largest descent of the cover's top in mm."""
        return float(-state.slab.displacement[:, 2].min())

    def contact_error(self, state: BodyState) -> float:
        """Deepest overlap, or widest gap under pressure, in mm."""
        return max(self.slab.top.error(state.slab), self.support.contact_error(state.support))

    def at_edge(self, state: BodyState) -> bool:
        """Whether points of the cover are far under an edge of the object."""
        return bool(state.slab.projection.overrun.any())

    def augmented(self, state: BodyState, *, allowed_mm: float) -> BodyState:
        """The state after one augmentation of each contact with an overlap of more than `allowed_mm`."""
        top, support = state.slab.history, state.support.history
        if self.slab.top.error(state.slab) > allowed_mm:
            top = self.slab.top.augmented(state.slab)
        if self.support.contact_error(state.support) > allowed_mm:
            support = self.support.augmented(state.support)
        return self.reevaluate_contact(state, BodyHistory(top, support))

    def most_compressed(self, state: BodyState) -> tuple[float, str]:
        """Largest compression of a frustum relative to its height, or of the layers without frusta; and where, in words."""
        of_support = self.support.most_compressed(state.support)
        if of_support is not None:
            return of_support
        share = self.descent(state) / np.ptp(self.slab.points[:, 2])
        return share, f"the surface has come down by {share:.0%} of the layers' thickness"

    def share_outside_window(self, state: BodyState) -> float:
        """Share of a law's volume that is strained beyond the range of the law's fit, the largest over the laws.

        nan if no law states the range of its fit.
        """
        volumes: dict[int, tuple[float, float]] = {}
        for nodes, block in self.slab.solids:
            _add_volumes(volumes, block, state.slab.displacement[nodes])
        for block in self.support.blocks:
            _add_volumes(volumes, block, self.support.per_element(state.support.displacement))     # type: ignore[attr-defined]
        return max((outside / whole for outside, whole in volumes.values()), default=np.nan)

    def residual_norm(self, state: BodyState, force_n: float | None) -> float:
        """Largest unbalanced nodal force in N, over slab, frusta and the object."""
        parts = [self._slab_residual(state), self._support_residual(state)]
        if force_n is not None:
            parts.append(abs(state.force - force_n))
        return float(max(parts))

    def _slab_residual(self, state):
        return np.abs(self.slab_force(state).ravel()[self.slab.free]).max()

    def _support_residual(self, state):
        return np.abs(self.support.inner_residual(state.support)).max(initial=0.0)

    def slab_force(self, state: BodyState) -> np.ndarray:
        """Forces (n, 3) on the slab's nodes, including those of the frusta on their roots."""
        total = state.slab.force.copy()
        np.add.at(total, self.cells.roots.ravel(), state.support.force[:, self.support.root].reshape(-1, 3))
        return total


def _add_volumes(volumes, block, displacement):
    """Add a block's volume outside its law's range, and its total volume, to those of the same law."""
    if block.law.stretch_window is not None:
        outside, whole = volumes.get(id(block.law), (0.0, 0.0))
        volumes[id(block.law)] = outside + block.volume_outside(displacement, block.law.stretch_window), whole + block.volume
