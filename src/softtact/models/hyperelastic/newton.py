"""Equilibrium of the body under an object with prescribed force or indentation: Newton's method and augmentations."""

from dataclasses import replace
from typing import Any

import numpy as np

from softtact.contact.edges import OVERRUN_MM
from softtact.contact.lower_envelope import NO_CONTACT_MM
from softtact.errors import ConvergenceError
from softtact.models.hyperelastic.body import LayeredBody
from softtact.models.hyperelastic.mesh_settings import FULL_POCKET, NewtonSettings
from softtact.models.hyperelastic.states import BodyState, ObjectSurface
from softtact.models.newton import Solution, lowers_potential, solve

_STILL_MM = 1e-3       # after smaller steps only points that oscillate across an edge would change their facet
_MOST_INCREMENTS, _FAR = 100, 50  # of the first touch's depth, until a point of the cover touches the object; a gap that is far
# Augmentation stops after so many augmentations that took Newton steps without reducing the overlap below this share of the least
# one so far. Those without Newton steps do not count: the force of a single point at an edge is below the tolerance.
_WORTH_A_PASS, _PASSES_IN_VAIN = 0.8, 3
DEEP = 0.55        # of a frustum's height, or of the layers': beyond, elements of the default mesh may be unstable
_ROUGH_SOON = 8     # iterations after which the rough tolerance applies beyond `DEEP`, or if it applied before an augmentation
_ASTRAY = 4        # iterations in turn with a folded cover, or below the shell, that end a run; single ones may come back
# Under rounded edges: projections within the first steps, and how many times the iterations may be taken while residuals fall.
# Points slip around an edge one after the other along it: a step that follows them around it is long and no descent, one with
# their planes takes some of them, and half of the increment would begin with all of them again.
_FOLLOWED, _CREEPING = 2, 4
_NEARLY = 3.0      # factor of the allowed overlap if points are under an edge: their augmentation takes tens of steps


def first_touch(body: LayeredBody, surface: ObjectSurface, settings: NewtonSettings) -> BodyState:
    """Equilibrium at a small prescribed indentation: under force control a free object without contact has no stiffness."""
    slab, support = body.rest()
    projection = body.slab.project(slab, surface)
    start = _indented_until_contact(body, body.evaluate(slab, support, projection.anchors[:, 2].min(), projection),
                                    settings.first_touch_mm)
    if body.friction.active:
        before: Any = body.evaluate(slab, support, start.indentation - settings.first_touch_mm, projection)
        start = body.reevaluate_contact(start, body.friction.begin_step(before))
    found = settle(body, surface, start, None, settings.first_touch_tolerance_n, settings)
    if found.state is None:
        raise ConvergenceError("The first touch did not converge; check the pose, or use --mesh-quality stable.")
    return found.state


def _indented_until_contact(body, state, step_mm):
    """The state with the object lowered in steps until a point touches it: a tip may be between the contact points.

    From far above it is first lowered by the least gap: planes come nearer by no more than that.
    """
    for _ in range(_MOST_INCREMENTS):
        gap = float(body.slab.top.surface_gaps(state.slab).min())
        state = body.indented(state, gap if _FAR * step_mm < gap < NO_CONTACT_MM else step_mm)
        if state.force > 0:
            return state
    raise ConvergenceError(f"None of the cover's contact points touches the object, though it went down by "
                           f"{_MOST_INCREMENTS * step_mm:g} mm; press with a finer cover (cover_splits) or with a larger object.")


def augment(body: LayeredBody, surface: ObjectSurface, found: Solution, force: float | None, settings: NewtonSettings) -> Solution:
    """Repeat the load step with augmented contact as long as overlaps are deeper than allowed and decrease."""
    iterations, spent, least, in_vain = 0, 0, np.inf, 0
    for _ in range(settings.max_augmentations):
        overlap = body.contact_error(found.state) if found.state is not None else 0.0
        in_vain = in_vain + (spent > 0) if overlap > _WORTH_A_PASS * least else 0
        least = min(least, overlap)
        depth = body.descent(found.state) if found.state is not None else 0.0
        allowed = settings.largest_penetration_mm * min(1.0, depth / settings.full_depth_mm)
        nearly = found.state is not None and overlap <= _NEARLY * allowed and body.at_edge(found.state)
        if overlap <= allowed or nearly or in_vain == _PASSES_IN_VAIN or iterations >= most_iterations(body, settings):
            break
        start = body.augmented(found.state, allowed_mm=allowed)
        if force is not None:
            start = body.indented_to(start, force)
        tolerance = tolerance_at(force, settings)
        if found.residual_n > tolerance:     # the rough tolerance applied, and will apply again
            settings = replace(settings, rough_after=_ROUGH_SOON)
        found = settle(body, surface, start, force, tolerance, settings)
        spent = found.iterations
        iterations += spent
    return replace(found, iterations=iterations)


def most_iterations(body: LayeredBody, settings: NewtonSettings) -> int:
    """Largest number of iterations of a load step."""
    return settings.friction_iterations if body.friction.active else settings.load_step_iterations


def counted_iterations(body: LayeredBody, found: Solution, settings: NewtonSettings) -> int:
    """Iterations of a run as they count against `most_iterations`.

    Under rounded edges one that went on while residuals fell counts as one that did not: else a single one would use up all, and
    none of half of its increment would follow.
    """
    creeping = body.slab.top.rounds_edges and not body.friction.active
    return min(found.iterations, settings.max_iterations) if creeping else found.iterations


def tolerance_at(force: float | None, settings: NewtonSettings) -> float:
    """Tolerance (N) of the residual at a force (N)."""
    return settings.relative_tolerance * _scale(force, settings)


def _scale(force, settings):
    return max(force or 0.0, settings.smallest_scale_n)


def settle(body: LayeredBody, surface: ObjectSurface, state: BodyState, force: float | None, tolerance: float,
           settings: NewtonSettings, *, deepest_mm: float = np.inf) -> Solution:
    """The `Solution` under a force (N) or at the state's indentation; with friction until friction and pressures agree.

    deepest_mm: indentation below which no balance is wanted; a run that stays there ends
    """
    if not body.friction.active:
        return _newton(body, surface, state, force, tolerance, settings, deepest_mm)
    tolerance, iterations = settings.friction_tolerance * tolerance, 0
    for k in range(settings.friction_passes):
        if k == 1:     # otherwise the projection of a point at an edge would alternate between facets
            settings = replace(settings, projection_iterations=0)
        found = _newton(body, surface, state, force, tolerance, settings, deepest_mm)
        iterations += found.iterations
        if found.state is None:
            break
        own = body.reevaluate_contact(found.state, body.friction.renewed(found.state))
        residual = body.residual_norm(own, force)
        if residual <= tolerance:
            return Solution(own, iterations, residual, own)
        if k >= settings.whole_passes:     # a remaining change oscillates: more friction, less pressure, less friction
            own = body.reevaluate_contact(found.state, body.friction.renewed(found.state, halfway=True))
        state = own
    return Solution(None, iterations, found.residual_n, found.last)


def _newton(body, surface, state, force, tolerance, settings, deepest_mm):
    kind = _PressOfRounded if body.slab.top.rounds_edges else _Press
    creeping = body.slab.top.rounds_edges and force is not None      # the way to the shell, by depth, has a length of its own
    return solve(kind(body, surface, force, tolerance, settings, deepest_mm), state, max_iterations=settings.max_iterations,
                 nearly_n=settings.nearly_balanced * _scale(force, settings), patience=_CREEPING if creeping else 1)


class _Press:
    """Equilibrium of the body under a force (N), or at its indentation if that is None, as a `Problem`.

    The contact projection is updated before and within each of the first steps. For a point that oscillates across an edge the
    object's height would jump each time; so the projection is kept later on, and where no step decreases the potential.
    """

    def __init__(self, body, surface, force, tolerance, settings, deepest_mm=np.inf):
        self.body, self.surface, self.force, self.tolerance, self.settings = body, surface, force, tolerance, settings
        self.deepest_mm = deepest_mm
        self.projecting, self.fresh, self.projected, self.iterations, self.astray = True, False, False, 0, 0

    def prepared(self, state, iteration):
        self.projected = self.projecting and iteration < self.settings.projection_iterations
        anew = self.body.slab.project(state.slab.displacement, self.surface, state.indentation)
        if self.projected:
            return self.body.update_normals(state, anew)
        return self._turned_back(state, anew)

    def _turned_back(self, state, anew):
        """The state with updated planes for points that are far under an edge but kept the planes beside it."""
        gaps = self.body.slab.top.gaps(state.slab.displacement, anew, state.indentation)
        far = anew.overrun & (np.abs(gaps - state.slab.gaps) > OVERRUN_MM)
        return self.body.update_normals(state, state.slab.projection.taking(anew, far)) if far.any() else state

    def residual(self, state):
        return self.body.residual_norm(state, self.force)

    def balanced(self, state, residual):
        return residual <= self.tolerance or self._roughly(state, residual)

    def _roughly(self, state, residual):
        settings = self.settings
        if self.iterations < _ROUGH_SOON or self.body.friction.active:
            return False
        share = self.body.most_compressed(state)[0]
        late = self.iterations >= self._rough_after() or share > FULL_POCKET
        return late and share > DEEP and residual <= settings.rough_tolerance * _scale(self.force, settings)

    def _rough_after(self):
        return self.settings.rough_after

    def step(self, state):
        if self.astray >= _ASTRAY:
            return state, None
        step = self._newton_step(state)
        if np.isnan(step.indentation) and not state.force > 0:     # a free object that lost contact
            state = _indented_until_contact(self.body, state, self.settings.first_touch_mm)
            step = self._newton_step(state)
        return self._facing(state, step), step if np.isfinite(step.largest()) else None

    def _facing(self, state, step):
        """The state whose potential a step lowers: with the planes at the step's end."""
        return self.body.update_normals(state, step.projection)

    def _newton_step(self, state):
        surface, turning = self._followed()
        return self.body.newton_step(state, self.force, surface, turning=turning, largest_mm=self.settings.largest_step_mm,
                                     kept_mm=self.settings.kept_tangent_mm)

    def _followed(self):
        """The surface that points follow within a step, or None, and whether their planes turn."""
        return (self.surface if self.projected else None), True

    def first_share(self, step):
        return min(1.0, self.settings.largest_step_mm / max(step.largest(), 1e-30))

    def moved(self, state, step, share):
        slab, support, lowered = step.share(share)
        slab, indentation = state.slab.displacement + slab, state.indentation + lowered
        trial = self.body.evaluate(slab, state.support.displacement + support, indentation,
                                   self._projection_at(slab, indentation, step), state.history)
        return None if trial is None else self.body.balanced(trial, self.tolerance)

    def _projection_at(self, slab, indentation, step):
        """The contact projection of a trial: the step's, so that each step decreases one potential."""
        return step.projection

    def better(self, trial, state, residual):
        """Whether the potential decreases or, where rounding hides the difference near equilibrium, the residual."""
        before = self._potential(state)
        lower = lowers_potential(before, self._potential(trial), abs(state.energy) + abs(before))
        return self.residual(trial) < residual if lower is None else lower

    def _potential(self, state):
        return state.energy - (self.force or 0.0) * state.indentation

    def accepted(self, state, trial):
        self.iterations += 1
        target = f"on the way to {self.force:.4g} N" if self.force is not None else f"{trial.indentation:.3f} mm down"
        self.body.watch.report(f"{target}, now {trial.force:.4g} N, iteration {self.iterations}, largest unbalanced force "
                             f"{self.residual(trial):.2g} N")
        if np.abs(trial.slab.displacement - state.slab.displacement).max() < _STILL_MM:
            self.projecting = False
        self.fresh = False
        self.astray = self.astray + 1 if trial.indentation > self.deepest_mm or self.body.folds(trial) else 0

    def recovered(self, state):
        """Retry with new tangents of all cells and a constant contact projection, for which a step decreases the energy."""
        if (self.fresh and not self.projected) or self.astray >= _ASTRAY:
            return False
        self.body.cells.forget()
        self.projecting, self.fresh = False, True
        return True


class _PressOfRounded(_Press):
    """The same with an object with rounded edges, whose contact is a continuous function of the points' places.

    So each trial is projected anew, and all steps decrease the same potential.
    """

    def prepared(self, state, iteration):
        self.projected = self.projecting and iteration < _FOLLOWED
        return self.body.update_normals(state, self._projection_at(state.slab.displacement, state.indentation, None))

    def _facing(self, state, step):
        return state

    def _followed(self):
        return self.surface, self.projected

    def _rough_after(self):
        """Twice as many as else: what is left may be of points that still slip around an edge, not of frusta that fold."""
        return 2 * self.settings.rough_after

    def _projection_at(self, slab, indentation, step):
        return self.body.slab.project(slab, self.surface, indentation)
