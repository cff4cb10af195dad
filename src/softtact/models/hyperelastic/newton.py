"""Presses under force control: Newton's method with line search, adaptive steps."""

from dataclasses import dataclass, replace

import numpy as np

from softtact.errors import ConvergenceError
from softtact.models.hyperelastic.body import BodyState

_STILL_MM = 1e-3       # after a step of less no point faces another facet but those that slide to and fro past an edge
_DEEP = 0.55           # of a frustum's height: from here on elements of the default mesh may be unstable
_MOST_INCREMENTS = 100  # of the first touch's depth, until a point of the cover feels the object
# Pressing apart is in vain where so many passes that moved anything have not brought the overlap below this share of the least
# before. Passes that move nothing add up: the force of a single point at an edge is below the tolerance.
_WORTH_A_PASS, _PASSES_IN_VAIN = 0.8, 3


@dataclass(frozen=True)
class NewtonSettings:
    """When a load step counts as reached, and how Newton's method goes there.

    relative_tolerance: largest unbalanced nodal force as a share of the force, at least of smallest_scale_n
    largest_penetration_mm, max_augmentations: with deeper overlaps they are pressed apart and the load step is solved again, so
    often
    full_depth_mm: where the cover has come down by less, so much less may overlap: a micrometre is 4 % of a light press
    largest_step_mm: largest movement of a node in one iteration;  smallest_increment_n: force steps are halved down to this
    load_step_iterations: a load step ends where it took so many in all its steps: one that crawls would go on for hours
    first_touch_mm, first_touch_tolerance_n: overlap at which the press begins, and the residual that is good enough there
    projection_iterations: iterations that look anew which facet each point faces
    kept_tangent_mm: a cell that moved less since its last tangent keeps it
    With friction
    friction_tolerance: share of the tolerance;  friction_growth: how far a step's force may exceed the last one's
    friction_passes, whole_passes: how often it is brought up to date with its pressures, and how often with all of the difference
    """

    relative_tolerance: float = 3e-4   # of a nodal force; 1e-4 changes the indentation by 3e-4 of itself, the map by 0.03 % (rms)
    largest_penetration_mm: float = 1e-3
    full_depth_mm: float = 0.2
    max_augmentations: int = 20
    max_iterations: int = 40
    load_step_iterations: int = 300
    largest_step_mm: float = 0.12
    smallest_increment_n: float = 0.02
    smallest_scale_n: float = 10.0
    first_touch_mm: float = 0.01
    first_touch_tolerance_n: float = 0.1   # a start for the first load step, not a result
    projection_iterations: int = 6
    kept_tangent_mm: float = 0.016     # as many iterations as with 4 um, since frusta far from balance take steps of their own
    friction_tolerance: float = 0.3    # sliding is soft: with 1 the indentation is 0.4 % off at 1 N on 20 frusta, with this 0.01 %
    friction_growth: float = 2.0       # a single step to 4 N is 1.8 % off, two are less than 0.1 %
    friction_passes: int = 30
    whole_passes: int = 3

    @classmethod
    def draft(cls):
        """For `MeshSettings.draft()`, whose map is off by a tenth at edges: half the time, and the map changes by 0.1 % (rms)."""
        return cls(relative_tolerance=1e-3, largest_penetration_mm=4e-3, kept_tangent_mm=0.03)


@dataclass(frozen=True)
class LoadStep:
    """One converged load step; residual_n is the largest unbalanced nodal force."""

    force_n: float
    state: BodyState
    iterations: int
    residual_n: float
    penetration_mm: float


@dataclass(frozen=True)
class Reached:
    """The last converged force (N) along the path, and its state."""

    force: float
    state: BodyState


def press_load_steps(body, surface, forces_n, *, settings=NewtonSettings()):
    """Yield a `LoadStep` for each force (N, increasing). Raises ConvergenceError naming the load step that was not reached."""
    reached = Reached(0.0, _first_touch(body, surface, settings))
    for force in forces_n:
        load_step = _advance(body, surface, reached, float(force), settings)
        reached = Reached(load_step.force_n, load_step.state)
        yield load_step


def _first_touch(body, surface, settings):
    """Equilibrium at a small given indentation: under force control alone the free object has no stiffness."""
    slab, support = body.rest()
    projection = body.slab.project(slab, surface)
    if body.friction.active:
        body.friction.release()
    start = _indented_until_contact(body, body.evaluate(slab, support, projection.anchors[:, 2].min(), projection),
                                    settings.first_touch_mm)
    if body.friction.active:
        body.friction.begin_step(body.evaluate(slab, support, start.indentation - settings.first_touch_mm, projection))
        start = body.reevaluate_contact(start)
    state, _, _ = _settle(body, surface, start, None, settings.first_touch_tolerance_n, settings)
    if state is None:
        raise ConvergenceError("The first touch of the object did not converge.")
    return state


def _indented_until_contact(body, state, step_mm):
    """The state with the object a step lower, or more steps: a tip may lie between the points that feel contact."""
    for _ in range(_MOST_INCREMENTS):
        state = body.indented(state, step_mm)
        if state.force > 0:
            return state
    raise ConvergenceError(f"None of the cover's contact points feels the object, though it was lowered by "
                           f"{_MOST_INCREMENTS * step_mm:g} mm; press with a finer cover (cover_splits) or with a larger object.")


def _advance(body, surface, reached, target, settings):
    """Reach `target`, halving the increment where Newton's method fails and growing it again where it succeeds.

    A step starts from the last state: displacements continued along the path, whole or in part, start in worse contact and took
    as many iterations or more, once the step itself is exact in the contact (benchmarks/mesh_error.py's bodies, ten load steps).
    """
    iterations, increment = 0, target - reached.force
    while True:
        force = min(target, reached.force + increment, _reach(body, reached.force, target, settings))
        if settings.max_augmentations and reached.force > 0:
            body.augment(reached.state, allowed_mm=0.0)     # what overlaps is no start: more of it comes with more force
        body.friction.begin_step(reached.state, growth=force / reached.force if reached.force > 0 else 1.0)
        state, spent, residual = _settle(body, surface, body.reevaluate_contact(reached.state), force, _tolerance(force, settings),
                                         settings)
        iterations += spent
        if state is not None and force >= target:
            state, spent, residual = _augment(body, surface, state, residual, force, settings)
            iterations += spent
        if state is not None and force >= target:
            return LoadStep(force_n=target, state=state, iterations=iterations, residual_n=residual,
                         penetration_mm=body.penetration(state))
        increment = 2 * increment if state is not None else 0.5 * (force - reached.force)
        if state is None and (increment < settings.smallest_increment_n or iterations >= settings.load_step_iterations):
            raise ConvergenceError(_failure(body, reached, force, target, residual, iterations))
        if state is not None:
            reached = Reached(force, state)


def _reach(body, force, target, settings):
    """The largest force (N) that one step may go to: friction depends on the way, so with it forces grow by doubling."""
    if not body.friction.active:
        return target
    growth = settings.friction_growth
    return max(growth * force, target / growth**2)


def _failure(body, reached, force, target, residual, iterations):
    x, y, share = body.most_compressed(reached.state)
    remedy = "Ask for smaller forces or for load steps nearer to each other"
    if share > _DEEP:
        remedy += ", or press with MeshSettings.stable() (--mesh-quality stable)"
    return (f"The load step of {target:g} N was not reached: from {reached.force:.4g} N on no step towards {force:.4g} N found a "
            f"balance (unbalanced force {residual:.2g} N, {iterations} iterations in all); the frustum at x {x:.1f}, y {y:.1f} mm "
            f"is compressed by {share:.0%} of its height. {remedy}.")


def _augment(body, surface, state, residual, force, settings):
    """The load step once more with its overlaps pressed apart, as long as they are deeper than allowed and become less."""
    iterations, spent, least, in_vain = 0, 0, np.inf, 0
    for _ in range(settings.max_augmentations):
        overlap = body.contact_error(state) if state is not None else 0.0
        in_vain = in_vain + (spent > 0) if overlap > _WORTH_A_PASS * least else 0
        least = min(least, overlap)
        depth = body.descent(state) if state is not None else 0.0
        allowed = settings.largest_penetration_mm * min(1.0, depth / settings.full_depth_mm)
        if overlap <= allowed or in_vain == _PASSES_IN_VAIN:
            break
        body.augment(state, allowed_mm=allowed)
        start = body.indented_to(body.reevaluate_contact(state), force)
        state, spent, residual = _settle(body, surface, start, force, _tolerance(force, settings), settings)
        iterations += spent
    return state, iterations, residual


def _tolerance(force, settings):
    return settings.relative_tolerance * max(force, settings.smallest_scale_n)


def _settle(body, surface, state, force, tolerance, settings):
    """`_newton`; with friction again and again, until the state is in balance under the friction of its own pressures."""
    if not body.friction.active:
        return _newton(body, surface, state, force, tolerance, settings)
    tolerance, iterations = settings.friction_tolerance * tolerance, 0
    for k in range(settings.friction_passes):
        if k == 1:     # a point at an edge would face now one facet, now the other, and no pass agree with the one before
            settings = replace(settings, projection_iterations=0)
        state, spent, residual = _newton(body, surface, state, force, tolerance, settings)
        iterations += spent
        if state is None:
            break
        body.friction.renew(state)
        own = body.reevaluate_contact(state)
        residual = body.residual_norm(own, force)
        if residual <= tolerance:
            return own, iterations, residual
        if k >= settings.whole_passes:     # what is left now swings: more friction, less pressure, less friction
            body.friction.renew(state, halfway=True)
            own = body.reevaluate_contact(state)
        state = own
    return None, iterations, residual


def _newton(body, surface, state, force, tolerance, settings):
    """Equilibrium state (None if not reached), iterations, and the last residual in N.

    The points' facing planes are found anew before and within each of the first steps. A point that slides to and fro past an
    edge sees the object's height jump each time; so the planes are kept later on, and where no step lowers the potential.
    """
    looking, fresh = True, False
    for iteration in range(settings.max_iterations):
        looks = surface if looking and iteration < settings.projection_iterations else None
        if looks is not None:
            state = body.update_normals(state, body.slab.project(state.slab.displacement, surface))
        residual = body.residual_norm(state, force)
        if residual <= tolerance:
            return state, iteration, residual
        step = body.newton_step(state, force, looks, largest_mm=settings.largest_step_mm, kept_mm=settings.kept_tangent_mm)
        if np.isnan(step.indentation) and not state.force > 0:     # a free object that lost its touch on the way
            state = _indented_until_contact(body, state, settings.first_touch_mm)
            continue
        state = body.update_normals(state, step.projection)
        trial = _line_search(body, state, step, force, residual, tolerance, settings) if np.isfinite(step.largest()) else None
        if trial is None and fresh and looks is None:
            return None, iteration, residual
        if trial is None:
            body.cells.forget()     # of cells that hardly moved the tangents were kept
            looking = False         # and a step that looks elsewhere need not lower the energy from here
        elif np.abs(trial.slab.displacement - state.slab.displacement).max() < _STILL_MM:
            looking = False
        fresh, state = trial is None, trial or state
    return None, settings.max_iterations, residual


def _potential(state, force):
    return state.energy - (force or 0.0) * state.indentation


def _line_search(body, state, step, force, residual, tolerance, settings):
    """The first of the shares 1, 1/2, 1/4 ... of the step that lowers the potential.

    Close to equilibrium the potential no longer resolves the difference; there a smaller residual decides.
    """
    share = min(1.0, settings.largest_step_mm / max(step.largest(), 1e-30))
    before = _potential(state, force)
    resolution = 1e-11 * (abs(state.energy) + abs(before))
    for _ in range(10):
        trial = body.evaluate(state.slab.displacement + share * step.slab, state.support.displacement + share * step.support,
                              state.indentation + share * step.indentation, step.projection)
        if trial is not None:
            trial = body.balanced(trial, tolerance)
            change = _potential(trial, force) - before
            if change < -resolution or (change <= resolution and body.residual_norm(trial, force) < residual):
                return trial
        share *= 0.5
    return None
