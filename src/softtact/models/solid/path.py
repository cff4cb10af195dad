"""Load steps of a `SolidBody`: frames moved or loaded, pressures raised, increments divided where Newton's method does not end."""

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from softtact.contact.motion import FREEDOMS, Motion, MotionStep
from softtact.contact.pair import ContactPair
from softtact.errors import ConvergenceError, InputError, TimeLimitError
from softtact.materials.laws.stretches import stretch_range
from softtact.models.solid.body import SolidBody, SolidState
from softtact.models.solid.frames import step_vector
from softtact.models.solid.newton import LostContactError, SolidSettings, Target, balance

_WITHIN_REACH = 0.9  # of the distance at which points meet a surface: step of an object that is still farther away
_TOUCHES = 1e-3  # of the allowed overlap: surfaces that overlap by less only lie on each other
_OVERLAP_MM = 1e-3  # overlap of a loaded object with the surface before its load acts, so that contact resists it
_FAST = 8  # iterations of an increment up to which the next one may be larger
_RELAXED = 0.5  # of the shortest relaxation time, or of the time since the last change of rate: longest increment of what relaxes


@dataclass(frozen=True)
class SolidLoadStep:
    """A balanced load step."""

    state: SolidState
    """All bodies, with what the next step starts from."""
    loads: np.ndarray
    """(frames, 6) in N and N mm: each frame's force and torque on the bodies, about its reference point."""
    iterations: int
    """Newton steps."""
    increments: int
    """Parts that the step was divided into."""
    residual_n: float
    """Largest unbalanced force in N."""
    penetration_mm: float
    """Deepest overlap of surfaces in contact."""
    volume_ratio: tuple[float, float]
    """Least and largest J."""
    stretch: tuple[float, float]
    """Least and largest isochoric principal stretch."""
    extrapolated_volume_fraction: float
    """Share of a region's volume strained beyond the data of its law, the largest of the regions'; nan where no law states any."""
    dissipated_mj: float
    """Energy in mJ that friction took up to this step's end."""
    work_mj: float
    """Work in mJ of frames and pressures up to this step's end, by the trapezoidal rule over the increments."""
    wall_time_s: float
    """Wall time in s that solving the step took."""
    time_s: float
    """From the path's start to the step's end in s; nan where steps have no durations."""


@dataclass
class SolidPath:
    """Steps of frames {name: `Motion`} and pressures {name: MPa at each step's end}, all of as many steps.

    A loaded freedom is first moved along its load until surfaces touch. Steps take the durations of the motions, or `seconds`
    (steps,); without any, what relaxes has relaxed at each step's end.
    """

    body: SolidBody
    motions: Mapping[str, Motion] = field(default_factory=dict)
    pressures: Mapping[str, Sequence[float]] = field(default_factory=dict)
    settings: SolidSettings = SolidSettings()
    tell: Callable[[str], None] = lambda text: None
    seconds: Sequence[float] | None = None

    def __post_init__(self) -> None:
        self.steps = count_steps(self.body, self.motions, self.pressures)
        self._times = self._ends()

    def _ends(self) -> np.ndarray | None:
        """(steps,) in s: the end of each step; None without durations."""
        ends = [times for motion in self.motions.values() if (times := motion.times_s) is not None]
        if self.seconds is not None:
            if len(self.seconds) != self.steps or not np.min(self.seconds) > 0:
                raise InputError(f"The durations {list(self.seconds)} do not fit {self.steps} steps; give seconds above 0 for "
                                 "each.")
            ends.append(np.cumsum(self.seconds))
        if any(not np.allclose(other, ends[0]) for other in ends):
            raise InputError("The motions' steps take different times; give the same durations to all.")
        return ends[0] if ends else None

    def run(self, start: SolidState | None = None) -> Iterator[SolidLoadStep]:
        """Yield a `SolidLoadStep` for each step.

        Raises ConvergenceError that names the step that was not reached; the steps before were yielded.
        """
        state = self.body.rest() if start is None else start
        in_contact, work, dissipated = start is not None, 0.0, 0.0
        steps: dict[str, MotionStep] = {}
        for number in range(self.steps):
            began = time.perf_counter()
            steps = {name: still_loaded(steps.get(name), motion.steps[number]) for name, motion in self.motions.items()}
            if any(step.loads for step in steps.values()) and not (in_contact and self._bears(state, steps)):
                state = self._at_first_contact(state, steps)
            in_contact = True
            values = np.array([self.pressures[face.name][number] for face in self.body.pressures])
            try:
                state, counts, residual, done, lost = self._step(state, steps, values, number)
            except TimeLimitError:
                raise
            except ConvergenceError as error:
                remedy = "" if isinstance(error, _SlidOffError) else " Use smaller steps or a finer mesh where it folds."
                if remedy and any(step.loads for step in steps.values()):
                    remedy += " Where a loaded object slides off an edge, prescribe its depth (z) in place of its load."
                raise ConvergenceError(f"Step {number + 1} of {self.steps} was not reached: {error}{remedy}") from None
            work, dissipated = work + done, dissipated + lost
            yield self._described(state, counts, residual, work, dissipated, time.perf_counter() - began, number)

    def _step(self, state, steps, pressures, number):
        """A step in as many increments as it takes: state, (iterations, increments), residual, work and dissipation in mJ."""
        body, share, size, counts, work, lost = self.body, 0.0, 1.0, [0, 0], 0.0, 0.0
        name, seconds, held = f"step {number + 1} of {self.steps}", self._duration(number), self._held_before(number)
        first, lost_contact = (body.frame_loads(state), state.pressures), False
        while share < 1 - 1e-9:
            longest = self._longest(seconds, share * seconds + held)
            size = min(size, 1 - share, longest)
            start = self._increment_start(state, size * seconds)
            part = name if size == 1 else f"{name}, {100 * share:.3g} to {100 * (share + size):.3g} % of it"
            target = replace(self._target(first, steps, pressures, share, size), name=part)
            try:
                found, iterations, residual = balance(body, start, target, self.settings)
            except TimeLimitError:
                raise
            except ConvergenceError as error:
                size *= 0.5
                lost_contact = lost_contact or isinstance(error, LostContactError)
                self.tell(f"increment divided: {error}")
                if size < self.settings.smallest_increment * longest and lost_contact:
                    raise self._slid_off(steps, share) from None
                if size < self.settings.smallest_increment * longest:
                    raise
                continue
            done, dissipated = self._energies(start, found)
            work, lost = work + done, lost + dissipated
            state, share = found, share + size
            counts = [counts[0] + iterations, counts[1] + 1]
            if iterations <= _FAST:
                size *= 2
        return state, counts, residual, work, lost

    def _slid_off(self, steps, share):
        loads = "; ".join(f"f{name} {load:g} N" for step in steps.values() for name, load in step.loads.items())
        return _SlidOffError(f"at {100 * share:.3g} % of it the object leaves the surface, and nothing stands against its load of "
                             f"{loads}. End the motion before, or prescribe its depth (z) in place of its load.")

    def _duration(self, number):
        """How long a step takes in s; infinite without durations."""
        return np.inf if self._times is None else float(np.diff(self._times, prepend=0.0)[number])

    def _held_before(self, number):
        """For how long in s everything was held as a step begins that holds it on; 0 for a step that moves or loads."""
        held = 0.0
        while self._holds(number) and self._holds(number - 1):
            held, number = held + self._duration(number - 1), number - 1
        return held

    def _holds(self, number):
        steps = [motion.steps[number] for motion in self.motions.values()]
        pressed = [values[number] != ([0.0, *values])[number] for values in self.pressures.values()]
        return number > 0 and not any(step.ways or step.loads for step in steps) and not any(pressed)

    def _longest(self, seconds, since):
        """The largest share of a step of some duration that an increment may be, so long in s since the last change of rate."""
        shortest = self.body.shortest_relaxation_s
        return _RELAXED * max(shortest, since) / seconds if np.isfinite(seconds) and np.isfinite(shortest) else 1.0

    def _increment_start(self, state, seconds):
        """The state from which an increment of some duration starts, with all histories advanced to it."""
        x = self.body.points + state.displacement
        return self.body.with_histories(
            state,
            (item.begin_step(*both, x, self.body.points) for item, *both in self.body.item_states(state)),
            self.body.memories_after(state, seconds),
        )

    def _target(self, first, steps, pressures, share, size):
        loads_before, pressures_before = first
        frame_steps, loads = [], []
        for k, frame in enumerate(self.body.frames):
            step = steps.get(frame.name, MotionStep())
            frame_steps.append(size * step_vector(step.ways))
            wanted = {FREEDOMS.index(name): value for name, value in step.loads.items()}
            loads.append(
                {
                    freedom: loads_before[k, freedom] + (share + size) * (value - loads_before[k, freedom])
                    for freedom, value in wanted.items()
                }
            )
        return Target(frame_steps, loads, pressures_before + (share + size) * (pressures - pressures_before))

    def _energies(self, before, after):
        """Work of frames and pressures, and what friction took, within an increment in mJ."""
        body, work, lost = self.body, 0.0, 0.0
        loads = 0.5 * (body.frame_loads(before) + body.frame_loads(after))
        for k, (old, new) in enumerate(zip(before.poses, after.poses, strict=True)):
            work += float(loads[k] @ new.step_from(old))
        for face, one, two in zip(body.pressures, before.pressures, after.pressures, strict=True):
            force, mean = np.zeros_like(body.points), 0.5 * (one + two)
            x = body.points + 0.5 * (before.displacement + after.displacement)
            face.add_forces(mean, face.evaluate(mean, x), force)
            work -= float((force * (after.displacement - before.displacement)).sum())
        for item, *both in body.item_states(after):
            lost += item.dissipated_mj(*both)
        return work, lost

    def _bears(self, state, steps):
        """Whether surfaces press, or bodies hold every loaded frame: a load then finds what it acts against."""
        pressing = sum(item.totals(*both).size for item, *both in self.body.item_states(state) if isinstance(item, ContactPair))
        free = [frame for frame, one in enumerate(self.body.frames) if one.name in steps and steps[one.name].loads
                and self.body.is_free(frame)]
        return not free or pressing > _TOUCHES * self.body.unresolved_n(state, self.settings.penetration_mm)

    def _at_first_contact(self, state, steps):
        """The state with loaded frames moved along their forces until their surfaces just overlap."""
        directions = [np.zeros(6) for _ in self.body.frames]
        for k, frame in enumerate(self.body.frames):
            step = steps.get(frame.name, MotionStep())
            directions[k][:3] = [np.sign(step.loads.get(name, 0.0)) for name in FREEDOMS[:3]]
            directions[k][:3] /= max(np.linalg.norm(directions[k][:3]), 1.0)
        if not self.body.pairs or not any(direction.any() for direction in directions):
            return state
        for _ in range(200):
            gap = min(item.gap_mm(response) for item, _, response in self.body.item_states(state))
            if gap <= -0.5 * _OVERLAP_MM:
                return state
            if not np.isfinite(gap):      # no point is within reach: none can pass the surface in a step that is shorter
                gap = _WITHIN_REACH * min(pair.reach_mm for pair in self.body.pairs)
            nearer = [direction * (gap + _OVERLAP_MM) for direction in directions]
            moved = self.body.moved(state, sum(self.body.shifted_with(k, step[:3]) for k, step in enumerate(nearer)), nearer)
            assert moved is not None
            state = self._increment_start(moved, np.inf)
        raise InputError("The loaded object does not come to touch along its load; correct its pose or its load.")

    def _described(self, state, counts, residual, work, dissipated, seconds, number):
        least, largest, low, high, share = np.inf, 0.0, np.inf, 0.0, np.nan
        for _, nodes, block in self.body.blocks:
            deformed = block.loops.deformation(state.displacement[nodes], block.at_rest)
            stretches = stretch_range(deformed.C)
            least, largest = min(least, deformed.J.min()), max(largest, deformed.J.max())
            low, high = min(low, float(stretches[0].min())), max(high, float(stretches[1].max()))
            if block.law.stretch_window is not None:
                outside = block.volume_outside(state.displacement[nodes], block.law.stretch_window) / block.volume
                share = np.nanmax([share, outside])
        return SolidLoadStep(
            state,
            self.body.frame_loads(state),
            counts[0],
            counts[1],
            residual,
            max((item.penetration_mm(response) for item, _, response in self.body.item_states(state)), default=0.0),
            (float(least), float(largest)),
            (low, high),
            float(share),
            dissipated,
            work,
            seconds,
            np.nan if self._times is None else float(self._times[number]),
        )


class _SlidOffError(ConvergenceError):
    """A loaded frame left what it pressed on."""


def count_steps(body: SolidBody, motions: Mapping[str, Motion], pressures: Mapping[str, Sequence[float]]) -> int:
    """How many steps motions and pressures of a body have, both by name. A frame without a motion stays where it is.

    Raises InputError for names that the body does not have, a face without its pressures, and different numbers of steps.
    """
    names, faces = [frame.name for frame in body.frames], [face.name for face in body.pressures]
    for kind, given, known in (("frame", motions, names), ("pressure", pressures, faces)):
        if unknown := [name for name in given if name not in known]:
            raise InputError(f"There is no {kind} {unknown[0]!r}; there are {', '.join(known) or 'none'}.")
    if missing := [name for name in faces if name not in pressures]:
        raise InputError(f"The pressure {missing[0]!r} has no values; give one in MPa for each step, 0 where it does not act.")
    counts = {len(motion.steps) for motion in motions.values()} | {len(values) for values in pressures.values()}
    if len(counts) != 1:
        raise InputError(f"Motions and pressures have {' and '.join(map(str, sorted(counts))) or 'no'} steps; give all as many.")
    return counts.pop()


def still_loaded(before: MotionStep | None, step: MotionStep) -> MotionStep:
    """A step with the loads of the one before on the freedoms that it does not name."""
    kept = {} if before is None else {name: load for name, load in before.loads.items() if name not in step.ways}
    return MotionStep(step.ways, kept | step.loads, step.seconds)


def times_of(steps: Sequence[SolidLoadStep]) -> np.ndarray | None:
    """(steps,) ends in s; None where the steps have no durations."""
    times = np.array([step.time_s for step in steps])
    return times if np.isfinite(times).all() and len(times) else None


def last(steps: Iterator[SolidLoadStep]) -> SolidLoadStep:
    """The last of some load steps."""
    reached = list(steps)
    if not reached:
        raise InputError("There is no step.")
    return reached[-1]
