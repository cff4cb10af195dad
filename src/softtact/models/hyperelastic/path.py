"""The path of an object on the body: load steps by force, or by a `Motion`, in adaptive increments.

A stage of the path leads from one load step to the next along a coordinate: the force of a press by force, else the share of
the motion's step. An increment that does not converge is halved, one that does is doubled.
"""

import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softtact.contact.height_field import MovedSurface
from softtact.contact.motion import Motion, MotionStep
from softtact.errors import ConvergenceError, HardPressWarning, InputError, TimeLimitError
from softtact.models.hyperelastic.body import LayeredBody
from softtact.models.hyperelastic.newton import (
    DEEP,
    NewtonSettings,
    augment,
    counted_iterations,
    first_touch,
    most_iterations,
    settle,
    tolerance_at,
)
from softtact.models.hyperelastic.states import BodyState, ObjectSurface

DEFAULT = NewtonSettings()
_CLEAR_MM = 0.1        # height over the surface from which no contact acts
# Factor of increments on the way to the shell without friction, where the result does not depend on the path. Under rounded edges
# the contact is so stiff that what a step's limit leaves of an increment would tear the cover out of its balance, with 3,000 N.
_LONGER_WITHOUT_FRICTION = 3.0
_PATIENCE = 4          # factor of the iterations on that way: a cover that slips off an edge took 65 of the largest length
_HARD = 2              # increments of a load step without a balance, not for folds, from which on it is told
_SMALLEST_SHARE = 1 / 64     # of the largest displacement in an increment; below it a motion's step fails


@dataclass(frozen=True)
class LoadStep:
    """One converged load step."""

    force_n: float
    """Normal force of the object, positive into the sensor."""
    state: BodyState
    """Displacements, contacts and their history."""
    iterations: int
    """Total number of Newton steps in its increments."""
    residual_n: float
    """Largest unbalanced nodal force."""
    penetration_mm: float
    """Deepest remaining overlap."""
    rough: bool = False
    """Whether it only satisfies the tolerance `NewtonSettings.rough_tolerance`."""
    elsewhere_n: float = 0.0
    """Part of the force that the shell carries instead of the body."""


@dataclass(frozen=True)
class Control:
    """Control of the object: its force (N) or, if that is None, its indentation (mm); its displacement (2,) along x, y in mm."""

    force: float | None
    indentation: float
    offset_mm: np.ndarray


@dataclass(frozen=True)
class ByForce:
    """A stage straight down up to a force; its coordinate is the force (N)."""

    end: float
    smallest: float
    deepest_mm: float = np.inf
    """Indentation at which the object rests on the shell; the stage ends with `_BelowShell` where it goes deeper."""

    def control(self, force: float) -> Control:
        return Control(force, 0.0, np.zeros(2))

    def reach(self, body: LayeredBody, start: float, settings: NewtonSettings) -> float:
        """The largest force at an increment's end: with friction the result depends on the path, so forces at most double.

        Under rounded edges they do, too: points slip around them one after the other, in longer increments many at a time.
        """
        if not (body.friction.active or body.slab.top.rounds_edges):
            return self.end
        growth = settings.force_growth
        return max(growth * start, self.end / growth**2)

    def growth(self, start: float, coordinate: float) -> float:
        return coordinate / start if start > 0 else 1.0

    def pressed(self, start: float, state: BodyState) -> bool:
        """Whether the object already presses at an increment's start; a first touch does not count."""
        return start > 0

    @property
    def target(self) -> str:
        return f"The load step of {self.end:g} N was not reached"

    def since(self, start: float, coordinate: float) -> str:
        return f"from {start:.4g} N on no step towards {coordinate:.4g} N found a balance"

    remedy = "Ask for smaller forces or for load steps nearer to each other"


@dataclass(frozen=True)
class ByMotion:
    """A step of a motion; its coordinate is the completed share of the step."""

    before: Control
    after: Control
    pressed_n: float
    """Normal force at the step's start."""
    largest_way_mm: float
    number: int
    """Number of the step, from 1 on."""
    end: float = 1.0
    deepest_mm: float = np.inf

    @property
    def at_once(self) -> float:
        """The share of the step with the largest displacement that is allowed in an increment."""
        way = float(np.linalg.norm(self.after.offset_mm - self.before.offset_mm))
        if self.after.force is None:
            way = max(way, abs(self.after.indentation - self.before.indentation))
        return min(1.0, self.largest_way_mm / max(way, 1e-12))

    @property
    def smallest(self) -> float:
        return _SMALLEST_SHARE * self.at_once

    def control(self, share: float) -> Control:
        force = None if self.after.force is None else self.pressed_n + share * (self.after.force - self.pressed_n)
        return Control(force, self.before.indentation + share * (self.after.indentation - self.before.indentation),
                       self.before.offset_mm + share * (self.after.offset_mm - self.before.offset_mm))

    def reach(self, body: LayeredBody, start: float, settings: NewtonSettings) -> float:
        """The largest share at an increment's end, limited by the object's displacement and by the growth of its force."""
        reach, more = start + self.at_once, (self.after.force or 0.0) - self.pressed_n
        if self.after.force is None or more <= 0:
            return reach
        now: Any = self.control(start).force
        force = ByForce(self.after.force, 0.0).reach(body, now, settings)
        return min(reach, (force - self.pressed_n) / more)

    def pressed(self, start: float, state: BodyState) -> bool:
        return state.force > 0

    def growth(self, start: float, coordinate: float) -> float:
        """Growth of the force if it is prescribed: a first guess of the pressures that limit friction."""
        before, after = self.control(start).force, self.control(coordinate).force
        return after / before if before and after else 1.0

    @property
    def target(self) -> str:
        return f"Step {self.number} of the motion was not reached"

    def since(self, start: float, coordinate: float) -> str:
        return f"from {start:.0%} of it on no increment found a balance"

    remedy = "Make the step's displacement or load smaller"


class ToStop(ByMotion):
    """The stage down to the shell on which the object rests."""

    remedy = "Ask for smaller forces"

    def reach(self, body: LayeredBody, start: float, settings: NewtonSettings) -> float:
        short = body.friction.active or body.slab.top.rounds_edges
        return start + self.at_once * (1.0 if short else _LONGER_WITHOUT_FRICTION)

    @property
    def target(self) -> str:
        return f"The object did not reach the shell on which it rests, {self.after.indentation:.3g} mm below its pose"

    def since(self, start: float, coordinate: float) -> str:
        return f"from {start:.0%} of that on no increment found a balance"


class _BelowShell(ConvergenceError):
    """No balance of a force was found before the object was below the shell on which it rests, from a state on."""

    def __init__(self, message, state, reached):
        super().__init__(message)
        self.state, self.reached = state, reached


def press_load_steps(body: LayeredBody, surface: ObjectSurface, forces_n: Iterable[float], *, settings: NewtonSettings = DEFAULT,
                     touch_mm: float = 0.0, stop_mm: float = np.inf) -> Iterator[LoadStep]:
    """Yield a `LoadStep` for each force (N, increasing). Raises ConvergenceError naming the load step that was not reached.

    touch_mm: indentation at first touch;  stop_mm: indentation at which the object rests on the shell; load steps from there on
    share one state, with a constant force on the body
    """
    body.begin()
    if stop_mm <= touch_mm:
        rest = LoadStep(0.0, _untouched(body, surface, stop_mm), iterations=0, residual_n=0.0, penetration_mm=0.0)
        yield from (_stopped_at(rest, float(force)) for force in forces_n)
        return
    touch = first_touch(body, surface, settings)
    state, reached, stopped = touch, 0.0, None
    for force in map(float, forces_n):
        if stopped is None:
            load_step, stopped = _reached_or_anew(body, surface, touch, state, reached, force, stop_mm, settings)
            state, reached = load_step.state, load_step.force_n
        yield load_step if stopped is None else _stopped_at(stopped, force)


def _stopped_at(load_step, force):
    """The load step of a larger force after the object came to rest on the shell: the body's force is that of `load_step`."""
    return replace(load_step, force_n=force, elsewhere_n=force - load_step.state.force)


def _reached_or_anew(body, surface, touch, state, reached, force, stop_mm, settings):
    """What `_up_to` finds from a state, else, if that is one of sharp edges and those of now are rounded, from the first `touch`.

    A wall that slipped between the points of a coarse mesh is so deep in a cover of more points that it would cut through it.
    """
    try:
        return _up_to(body, surface, state, reached, force, stop_mm, settings)
    except TimeLimitError:
        raise
    except ConvergenceError:
        if body.has_points_of(state):
            raise
    return _up_to(body, surface, touch, 0.0, force, stop_mm, settings)


def _up_to(body, surface, state, reached, force, stop_mm, settings):
    """The `LoadStep` of a force, and the load step at which the object rests on the shell, or None."""
    failed, stage = None, ByForce(force, settings.smallest_increment_n, stop_mm)
    try:
        load_step = _advance(body, surface, state, reached, stage, settings)
        if load_step.state.indentation <= stop_mm:
            return load_step, None
    except TimeLimitError:
        raise
    except _BelowShell as error:
        state, reached, failed = error.state, error.reached, error
    except ConvergenceError as error:      # the body alone may not carry the force
        if np.isinf(stop_mm):
            raise
        failed = error
    begin, end = (Control(None, depth, np.zeros(2)) for depth in (state.indentation, stop_mm))
    patient = replace(settings, max_iterations=_PATIENCE * settings.max_iterations)
    stopped = _advance(body, surface, state, 0.0, ToStop(begin, end, state.force, settings.largest_way_mm, 1), patient)
    if failed is None or stopped.state.force < force:
        return stopped, stopped
    if not isinstance(failed, _BelowShell):
        raise failed
    # The balance is above the shell, but the way to it is not.
    return _advance(body, surface, state, reached, replace(stage, deepest_mm=np.inf), settings), None


def _untouched(body, surface, indentation):
    """The undeformed body under an object without contact, at an indentation."""
    slab, support = body.rest()
    state = body.evaluate(slab, support, indentation - _CLEAR_MM, body.slab.project(slab, surface))
    return replace(state, indentation=indentation)


def press_motion(body: LayeredBody, surface: ObjectSurface, motion: Motion, touch_mm: float, *,
                 settings: NewtonSettings = DEFAULT) -> Iterator[LoadStep]:
    """Yield a `LoadStep` for each step of a `Motion`. Raises ConvergenceError naming the step that was not reached.

    touch_mm: the indentation at which the object just touches the surface at rest, the zero of depths
    """
    body.begin()
    control, state = Control(None, float(touch_mm), np.zeros(2)), None
    for number, step in enumerate(motion.steps, start=1):
        if state is None:
            state, control = _start(body, surface, step, control, settings)
        stage = ByMotion(control, _after(control, step), state.force, settings.largest_way_mm, number)
        load_step = _advance(body, surface, state, 0.0, stage, settings)
        state = load_step.state
        control = replace(stage.after, indentation=state.indentation)
        yield replace(load_step, force_n=state.force)


def check_motion(motion: Motion) -> None:
    """Refuse motions that the hyperelastic model does not support: rotations, and loads along x or y."""
    for number, step in enumerate(motion.steps, start=1):
        other = [name for name in step.ways if name not in "xyz"] + [name for name in step.loads if name != "z"]
        if other:
            raise InputError(f"Motion, step {number}: the hyperelastic model moves an object along x, y and z and loads it along "
                             f"z; it cannot prescribe or load {other[0]!r}; leave that out.")
        if step.loads.get("z", -1.0) >= 0:
            raise InputError(f"Motion, step {number}: the load z is {step.loads['z']:g} N, which does not press; give a negative "
                             "one.")


def _start(body, surface, step, control, settings):
    """State and `Control` at the start of the first step: at rest, or at first touch under a load."""
    if "z" in step.loads:
        state = first_touch(body, surface, settings)
        return state, replace(control, indentation=state.indentation)
    slab, support = body.rest()
    state = body.evaluate(slab, support, control.indentation, body.slab.project(slab, surface))
    return body.reevaluate_contact(state, body.friction.begin_step(state)), control


def _after(before: Control, step: MotionStep) -> Control:
    """The `Control` at a step's end."""
    way = np.array([step.ways.get("x", 0.0), step.ways.get("y", 0.0)])
    if "z" in step.loads:
        force: float | None = -step.loads["z"]
    else:
        force = None if "z" in step.ways else before.force
    return Control(force, before.indentation - step.ways.get("z", 0.0), before.offset_mm + way)


def _advance(body, surface, state, reached, stage, settings):
    """Reach the stage's end; again, if its balance is folded between the points at which a cover resists folding, with more.

    If that finds no balance the folded one is kept, which is flagged, and the press goes on as before.
    """
    load_step = _in_increments(body, surface, state, reached, stage, settings)
    if not body.folds_between(load_step.state):
        return load_step
    try:
        again = _in_increments(body, surface, state, reached, stage, settings, between=True)
    except TimeLimitError:
        raise
    except ConvergenceError:
        body.resist_folding_at_corners()
        return load_step
    return replace(again, iterations=load_step.iterations + again.iterations)


def _in_increments(body, surface, state, reached, stage, settings, *, between=False):
    """Reach the stage's end in increments; one is halved where Newton's method fails and doubled where it succeeds.

    An increment starts from the last converged state. Extrapolated displacements start with worse contact states and took as many
    iterations or more, since the Newton step is exact in the contact (benchmarks/mesh_error.py's bodies, ten load steps).
    One that folds the cover, whether it converges or not, is repeated with a cover that resists, as in all increments after it.
    """
    iterations, counted, in_vain, increment, settled = 0, 0, 0, stage.end - reached, body.has_points_of(state) and not between
    if not settled:      # an earlier stage from this state folded the cover
        state = _resisting(body, surface, state, between=between)
    while True:
        at = min(stage.end, reached + increment, stage.reach(body, reached, settings))
        control = stage.control(at)
        if settings.max_augmentations and settled and stage.pressed(reached, state):
            start = body.augmented(state, allowed_mm=0.0)     # overlaps at the start would grow with the force
        else:
            start = state
        start, moved = _start_of_increment(body, surface, start, control, stage.growth(reached, at))
        found = settle(body, moved, start, control.force, tolerance_at(_force(control, state), settings), settings,
                       deepest_mm=stage.deepest_mm)
        iterations, counted = iterations + found.iterations, counted + counted_iterations(body, found, settings)
        if found.state is not None and at >= stage.end and not body.folds(found.state):
            found = augment(body, moved, found, control.force, settings)
            iterations, counted = iterations + found.iterations, counted + counted_iterations(body, found, settings)
        if body.folds(found.last):
            state = _resisting(body, surface, state)
            increment, counted, settled = at - reached, 0, False     # its overlaps are not those of its pressures
            continue
        if found.state is not None and at >= stage.end:
            return LoadStep(force_n=stage.control(at).force, state=found.state, iterations=iterations,
                            residual_n=found.residual_n, penetration_mm=body.penetration(found.state),
                            rough=found.residual_n > tolerance_at(max(_force(control, state), found.state.force), settings))
        if found.state is None and found.last.indentation > stage.deepest_mm:
            raise _BelowShell(_failure(body, state, stage, reached, at, found.residual_n, iterations), state, reached)
        increment = 2 * increment if found.state is not None else 0.5 * (at - reached)
        if found.state is None and (increment < stage.smallest or counted >= most_iterations(body, settings)):
            raise ConvergenceError(_failure(body, state, stage, reached, at, found.residual_n, iterations))
        if found.state is not None:
            reached, state, settled = at, found.state, True
            continue
        in_vain += 1
        if in_vain == _HARD:
            why = _failure(body, state, stage, reached, at, found.residual_n, iterations)
            warnings.warn(f"So far {why[0].lower()}{why[1:]} The press goes on in smaller increments, which may take minutes, and "
                          "may end there.", HardPressWarning, stacklevel=2)


def _resisting(body, surface, state, *, between=False):
    """The state with a cover that resists folding, under the object where it is."""
    return body.resisting_folding(state, MovedSurface(surface, state.slab.projection.offset_mm), between=between)


def _force(control, state):
    return state.force if control.force is None else control.force


def _start_of_increment(body, surface, state, control, growth):
    """The start state of an increment that ends at a `Control`, and the object's surface at its end."""
    state = body.reevaluate_contact(state, body.friction.begin_step(state, growth=growth))
    way = control.offset_mm - state.slab.projection.offset_mm
    if way.any():
        state = body.update_normals(state, state.slab.projection.moved(way))
    if control.force is None:
        state = body.indented(state, control.indentation - state.indentation)
    return state, MovedSurface(surface, control.offset_mm) if control.offset_mm.any() else surface


def _failure(body, state, stage, reached, at, residual, iterations):
    share, most_compressed = body.most_compressed(state)
    remedy = stage.remedy
    if share > DEEP:
        remedy += ", or press with MeshSettings.stable() (--mesh-quality stable)"
    return (f"{stage.target}: {stage.since(reached, at)} (unbalanced force {residual:.2g} N, {iterations} iterations in all); "
            f"{most_compressed}. {remedy}.")
