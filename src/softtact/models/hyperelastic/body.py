"""The layered sensor as one body: slab (sheet and cover) tied to its `Support`, and one Newton step of it."""

from dataclasses import dataclass, replace
from types import ModuleType
from typing import TYPE_CHECKING

import numpy as np

from softtact.contact.history import ContactHistory
from softtact.fem import kernels
from softtact.linalg.multifrontal_solver import DissectedSolver
from softtact.linalg.workers import Workers
from softtact.models.hyperelastic.friction import BodyFriction
from softtact.models.hyperelastic.linearised_contact import StepContact
from softtact.models.hyperelastic.local_equilibrium import balanced
from softtact.models.hyperelastic.newton_step import ContactStepper
from softtact.models.hyperelastic.preconditioner import DissectedContact
from softtact.models.hyperelastic.rigid_contact import ContactProjection, Surface
from softtact.models.hyperelastic.slab import Slab, SlabState
from softtact.models.hyperelastic.support import NoCells, Support, SupportState
from softtact.models.hyperelastic.unit_cells import SheetCells
from softtact.progress import Watch

if TYPE_CHECKING:
    from softtact.fem.kernels_torch import DeviceKernels

_DAMPINGS = 4         # steps that are tried with ever more damping of the cells that they throw too far
_FIRST_SHIFT = 0.001   # N/mm on every free unknown of the slab, then more until the tangent is positive definite ...
_MORE, _LESS = 4.0, 0.25   # of the shift before: the next that is tried, and from where a later search begins
_MOST_SHIFTS = 20     # ... but a tangent that is not even finite will never be


@dataclass(frozen=True)
class BodyHistory:
    """The `ContactHistory` of the object on the slab's top, and of the support on the board."""

    top: ContactHistory
    support: ContactHistory


@dataclass(frozen=True)
class BodyState:
    """Slab and support at one displacement, and the potential energy (mJ) of both with their contacts and friction."""

    slab: SlabState
    support: SupportState
    indentation: float

    @property
    def energy(self) -> float:
        return self.slab.energy + self.support.energy

    @property
    def history(self) -> BodyHistory:
        """What the contacts remember, `BodyHistory`."""
        return BodyHistory(self.slab.history, self.support.history)

    @property
    def force(self) -> float:
        """Force (N) that the object exerts downwards."""
        return self.slab.indentation_force


@dataclass(frozen=True)
class Step:
    """A Newton step: slab (n, 3), support (f, nodes, 3) in mm, indentation in mm, and what the object's contact faces in it."""

    slab: np.ndarray
    support: np.ndarray
    indentation: float
    projection: ContactProjection

    def largest(self) -> float:
        return max(np.abs(self.slab).max(), np.abs(self.support).max(initial=0.0), abs(self.indentation))


def _shifts(last, again):
    """What is tried, one after the other, until a tangent is positive definite, so that every step lowers the energy.

    None: nothing;  0: the cells' modes of negative stiffness are made positive;  more: the cover's, too, and so many N/mm added
    last: what was enough for the tangent before, None where nothing was needed; where it was much, less of it is tried at once
    again: the tangent before was the same but for damped cells; what was enough for it is where to begin
    """
    first = max(_FIRST_SHIFT, (1.0 if again else _LESS) * (last or 0.0))
    if first == _FIRST_SHIFT and not (again and last is not None):
        yield None
    if first == _FIRST_SHIFT and not (again and last):
        yield 0.0
    for number in range(_MOST_SHIFTS):
        yield first * _MORE**number


class LayeredBody:
    """Slab on a `Support`, pressed from above by a rigid object. Lengths in mm, z = 0 at the top at rest."""

    def __init__(self, slab: Slab, support: Support, roots: np.ndarray | None = None, *, threads: int = 1) -> None:
        """`roots` (f, k): the slab's nodes that are the frusta's root nodes; none for a support without bodies."""
        self.slab, self.support = slab, support
        self.workers, self.watch = Workers(threads), Watch()
        self.friction = BodyFriction(slab.top, support)
        self.cells = SheetCells(slab, support, roots) if support.count else NoCells()     # type: ignore[arg-type]
        slab.build_pattern(self.cells.eliminated, self.cells.outer_dofs)
        self.solver = DissectedSolver(slab.points[slab.unknowns // 3, :2], workers=self.workers)
        self.stepper = ContactStepper(DissectedContact(self.solver, workers=self.workers))
        self._shift: float | None = None     # that made the last tangent positive definite

    def sum_with(self, loops: "ModuleType | DeviceKernels") -> None:
        """Let elements be summed by `loops`: `kernels`, as from the start, or `device_kernels`."""
        for block in self.slab.blocks + self.support.blocks:
            block.loops = loops

    @property
    def method(self) -> str:
        """Linear solver and device in words."""
        loops = self.slab.blocks[0].loops
        return self.solver.name if loops is kernels else f"{self.solver.name}; elements on {loops.device}"

    def close(self) -> None:
        """Free the factors, and end the threads."""
        self.solver.close()
        self.workers.close()

    def rest(self) -> tuple[np.ndarray, np.ndarray]:
        """Displacements of slab (n, 3) and support (f, nodes, 3) at rest."""
        return np.zeros((self.slab.nodes, 3)), np.zeros((self.support.count, self.support.nodes, 3))

    def fresh_history(self) -> BodyHistory:
        """The contacts' history before the first touch."""
        return BodyHistory(self.slab.top.fresh_history(), self.support.fresh_history())

    def begin(self) -> None:
        """Forget all tangents and factors of an earlier press: what is kept decides the last digits of a result."""
        self.cells.reset()
        self.stepper.reset()
        self._shift = None
        self.friction.reset()

    def evaluate(self, slab_displacement: np.ndarray, support_displacement: np.ndarray, indentation: float,
                 projection: ContactProjection, history: BodyHistory | None = None) -> BodyState | None:
        """State at given displacements, by default without a history of the contacts; None where an element is inside out."""
        history = history or self.fresh_history()
        slab = self.slab.evaluate(slab_displacement, projection, indentation, history.top, workers=self.workers)
        support = None if slab is None else self.support.evaluate(support_displacement, history.support, workers=self.workers)
        return None if slab is None or support is None else BodyState(slab=slab, support=support, indentation=indentation)

    def reevaluate_contact(self, state: BodyState, history: BodyHistory) -> BodyState:
        """The same displacements with another history of the contacts: the rubber is not evaluated anew."""
        return BodyState(slab=self.slab.update_normals(state.slab, state.slab.projection, state.indentation, history.top),
                         support=self.support.reevaluate_contact(state.support, history.support), indentation=state.indentation)

    def balanced(self, state: BodyState, tolerance_n: float) -> BodyState:
        """The state with each frustum in balance over its root, where nothing else keeps the body from it.

        A frustum that rocks or folds needs steps of its own; as long as sheet or cover do, too, it takes them with these. With
        friction on the board frusta wait for the steps of all: what holds them does not see one alone.
        """
        rest = max(tolerance_n, self._slab_residual(state))
        if self.support.friction is not None or self._support_residual(state) <= rest:
            return state
        support, moved = balanced(self.support, state.support, tolerance_n, workers=self.workers)
        self.cells.forget(moved)
        return replace(state, support=support)

    def update_normals(self, state: BodyState, projection: ContactProjection) -> BodyState:
        """The same state with the object's contact on other planes."""
        return replace(state, slab=self.slab.update_normals(state.slab, projection, state.indentation))

    def indented_to(self, state: BodyState, force_n: float) -> BodyState:
        """The state with the object at the depth where its force is `force_n`: the least energy over the indentation."""
        return self.indented(state, self.slab.top.balanced(state.slab, state.indentation, force_n) - state.indentation)

    def indented(self, state: BodyState, by_mm: float) -> BodyState:
        """The state with the object lower by so much."""
        depth = state.indentation + by_mm
        return replace(state, slab=self.slab.update_normals(state.slab, state.slab.projection, depth), indentation=depth)

    def newton_step(self, state: BodyState, force_n: float | None, surface: Surface | None = None, *, largest_mm: float = np.inf,
                    kept_mm: float = 0.0) -> Step:
        """The Newton step under a given force (N), or with the indentation kept where `force_n` is None.

        largest_mm: by which the object goes down at most;  kept_mm: cells that moved less since their last tangent keep it

        With a surface the step's contact is with the facets that the points face where it leads, else with those of the state.
        Where nothing touches, a force finds no stiffness: the step is then not finite.
        """
        state = self.friction.for_tangent(state)
        for number in range(_DAMPINGS):
            step = self._newton_step(state, force_n, surface, largest_mm, kept_mm, again=number > 0)
            if not (np.isfinite(step.largest()) and self.cells.damp(step.slab, step.support)):
                break
        return step

    def _newton_step(self, state, force_n, surface, largest_mm, kept_mm, *, again):
        """The step with the cells as they are damped now; again: it was found before with less damping."""
        self.cells.refresh(state, kept_mm=kept_mm, workers=self.workers)
        residual, kept = self.cells.condensed_residual(state, workers=self.workers)
        contact = StepContact(self.slab, state.slab, state.indentation, surface, largest_mm=largest_mm, workers=self.workers)
        step, indentation_increment = self._step_of_unknowns(state, residual.ravel()[self.slab.unknowns], contact, force_n,
                                                             largest_mm, again=again)
        full = np.zeros(3 * self.slab.nodes)
        full[self.slab.unknowns] = step
        slab, support = self.cells.recover(kept, full.reshape(-1, 3), workers=self.workers)
        return Step(slab=slab, support=support, indentation=indentation_increment, projection=contact.projection)

    def _step_of_unknowns(self, state, residual, contact, force_n, largest_mm, *, again):
        """Step of the global unknowns, and how far the object goes down; the tangent is made positive definite where it is not.

        Not a number where that cannot be done, which fails Newton's method there.
        """
        excess, border = None if force_n is None else state.force - force_n, self.slab.friction_border(state.slab)
        positive = None
        for shift in _shifts(self._shift, again):
            if shift is not None and positive is None:
                positive = self.cells.positive_outer(workers=self.workers)
            step = self.stepper.step(self._rubber_tangent(state, shift, positive), residual, contact, friction_border=border,
                                     excess=excess, largest=largest_mm)
            if step is not None:
                self._shift = shift
                return step
        return np.full(len(residual), np.nan), np.nan

    def _rubber_tangent(self, state, shift, positive):
        """The rubber's tangent with a shift, see `_shifts`; positive: what the cells leave with their modes made positive."""
        if shift is None:
            return self.slab.rubber_tangent(state.slab, self.cells.outer, workers=self.workers)
        rubber = self.slab.rubber_tangent(state.slab, positive, positive=shift > 0, workers=self.workers)
        self.slab.add_to_diagonal(rubber, shift)
        return rubber

    def penetration(self, state: BodyState) -> float:
        """Deepest penetration in mm, of the object into the cover or of frusta into the board or each other."""
        return float(max(0.0, -self.slab.top.own_gaps(state.slab).min(), -state.support.gaps.min(initial=np.inf)))

    def descent(self, state: BodyState) -> float:
        """How far the cover has come down where it did most, in mm."""
        return float(-state.slab.displacement[:, 2].min())

    def contact_error(self, state: BodyState) -> float:
        """Deepest overlap, or widest gap under pressure, in mm."""
        return max(self.slab.top.error(state.slab), self.support.contact_error(state.support))

    def at_edge(self, state: BodyState) -> bool:
        """Whether points of the cover have run far under an edge of the object."""
        return bool(state.slab.projection.overrun.any())

    def augmented(self, state: BodyState, *, allowed_mm: float) -> BodyState:
        """The state with the points that overlap held where their surfaces just touch, wherever an overlap is more than allowed."""
        top, support = state.slab.history, state.support.history
        if self.slab.top.error(state.slab) > allowed_mm:
            top = self.slab.top.augmented(state.slab)
        if self.support.contact_error(state.support) > allowed_mm:
            support = self.support.augmented(state.support)
        return self.reevaluate_contact(state, BodyHistory(top, support))

    def most_compressed(self, state: BodyState) -> tuple[float, str]:
        """The largest share of its height by which a frustum, or without any the layers, are shortened; and which in words."""
        of_support = self.support.most_compressed(state.support)
        if of_support is not None:
            return of_support
        share = self.descent(state) / np.ptp(self.slab.points[:, 2])
        return share, f"the surface has come down by {share:.0%} of the layers' thickness"

    def share_outside_window(self, state: BodyState) -> float:
        """Share of a law's volume that is strained beyond what the law was fitted to, the largest over the laws.

        nan where no law knows what it was fitted to.
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
        """Forces (n, 3) on the slab's nodes, those of the frusta's roots among them."""
        total = state.slab.force.copy()
        np.add.at(total, self.cells.roots.ravel(), state.support.force[:, self.support.root].reshape(-1, 3))
        return total


def _add_volumes(volumes, block, displacement):
    """Add a block's volume outside its law's window, and its whole volume, to those of the same law."""
    if block.law.stretch_window is not None:
        outside, whole = volumes.get(id(block.law), (0.0, 0.0))
        volumes[id(block.law)] = outside + block.volume_outside(displacement, block.law.stretch_window), whole + block.volume
