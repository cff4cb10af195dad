"""The motion of an object on a sensor: steps, in each of which every one of its six degrees of freedom is prescribed or loaded.

    Motion().press(force_n=[5, 20])                        # straight down by force, two steps
    Motion().press(depth_mm=1.0).slide(x_mm=1.0, steps=10) # down by depth, then aside, ten steps
    Motion().press(force_n=10).turn(z_deg=15, steps=3)     # down by force, which stays, then about the vertical axis
    Motion.parse("z -1.0; x 1.0 in 10")                    # the same in one line
    Motion().press(force_n=10, over_s=0.5).hold(60)        # in half a second, then held, for a material that relaxes
    Motion.parse("fz -10 over 0.5; hold 60")               # the same

Freedoms: x, y, z in mm and rx, ry, rz in degrees of the object in the sensor's frame (z out of the surface, so down is negative).
A motion starts where the object just touches the surface at rest. A prescribed freedom moves by the given increment from the step's
start; a loaded one takes the position at which the sensor's surface carries the step's force (N) or torque (N mm). A freedom that a
step does not name keeps its state: a prescribed freedom its position, a loaded one its load.
Steps without durations are slow: a material that relaxes has relaxed at the end of each.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import Any

import numpy as np

from softtact.errors import InputError

FREEDOMS = ("x", "y", "z", "rx", "ry", "rz")
LOADS = ("fx", "fy", "fz", "mx", "my", "mz")     # the loads of the same freedoms, on the sensor's surface
_NUMBER = r"[-+]?[0-9.]+(?:e[-+]?[0-9]+)?"
_TERM = re.compile(rf"([a-z]{{1,2}})\s*=?\s*({_NUMBER})", re.IGNORECASE)
_OVER, _IN = rf"\s+over\s+({_NUMBER})\s*s?", r"\s+in\s+([0-9]+)"
_HOLD = re.compile(rf"hold\s+({_NUMBER})\s*s?", re.IGNORECASE)
_HINT = ('write steps like "z -1.0; x 1.0 in 10" (mm, degrees), "fz -20" (N) or "fz -20 over 0.5; hold 10" (s), with semicolons '
         "between steps")


@dataclass(frozen=True)
class MotionStep:
    """One step: displacements of prescribed freedoms, loads of loaded ones."""

    ways: dict[str, float] = field(default_factory=dict)
    """Freedom to displacement or rotation: mm or degrees, from where the step begins."""
    loads: dict[str, float] = field(default_factory=dict)
    """Freedom to load at the step's end: N or N mm on the sensor's surface; pressing down is a negative z."""
    seconds: float | None = None
    """How long it takes; None: so long that a material that relaxes has relaxed at its end."""

    def __post_init__(self) -> None:
        for kind, values in (("ways", self.ways), ("loads", self.loads)):
            if not isinstance(values, Mapping):
                raise InputError(f"Motion: {kind}={values!r} names no freedoms; give a dictionary, such as {{'z': -0.5}}.")
        for name, value in (*self.ways.items(), *self.loads.items()):
            if name not in FREEDOMS:
                raise InputError(f"Motion: the freedom {name!r} is unknown; use one of {', '.join(FREEDOMS)}.")
            _finite(name, value)
        if both := set(self.ways) & set(self.loads):
            raise InputError(f"Motion: the freedom {both.pop()!r} is prescribed and loaded in one step; choose one.")
        _share("step", self.seconds, 1)


@dataclass(frozen=True)
class Motion:
    """Steps of an object on a sensor; immutable: each method returns a longer motion."""

    steps: tuple[MotionStep, ...] = ()
    """The steps in their order; a result holds the state at the end of each."""

    def press(self, *, force_n: float | Sequence[float] | None = None, depth_mm: float | Sequence[float] | None = None,
              over_s: float | None = None) -> "Motion":
        """Press straight down, by force (N, positive) or to a depth (mm, from first touch), one step for each value.

        over_s: seconds for all of them together
        Raises InputError where both or none are given, or a value is not finite and positive.
        """
        if (force_n is None) == (depth_mm is None):
            raise InputError("Motion.press takes either force_n or depth_mm; give one of them.")
        name, given = ("force_n", force_n) if depth_mm is None else ("depth_mm", depth_mm)
        values = [_positive(name, value) for value in numbers_of(f"Motion.press: {name}", given)]      # type: ignore[arg-type]
        each = _share("press", over_s, len(values))
        if depth_mm is None:
            return Motion(self.steps + tuple(MotionStep(loads={"z": -force}, seconds=each) for force in values))
        reached = [self.depth_mm, *values]
        return Motion(self.steps + tuple(MotionStep(ways={"z": before - after}, seconds=each)
                                         for before, after in zip(reached, reached[1:], strict=False)))

    def slide(self, *, x_mm: float = 0.0, y_mm: float = 0.0, steps: int = 1, over_s: float | None = None) -> "Motion":
        """Move the object along x and y (mm) in equal steps at constant depth, or constant force; `over_s` seconds for all."""
        return self._in_steps("slide", {"x": _finite("x_mm", x_mm), "y": _finite("y_mm", y_mm)}, steps, over_s)

    def turn(self, *, x_deg: float = 0.0, y_deg: float = 0.0, z_deg: float = 0.0, steps: int = 1,
             over_s: float | None = None) -> "Motion":
        """Turn the object about the axes through its reference point by angles (degrees) in equal steps, `over_s` seconds for all;
        other freedoms keep their state."""
        return self._in_steps("turn", {"rx": _finite("x_deg", x_deg), "ry": _finite("y_deg", y_deg),
                                       "rz": _finite("z_deg", z_deg)}, steps, over_s)

    def hold(self, seconds: float, *, steps: int = 1) -> "Motion":
        """Keep all freedoms as they are, positions and loads, for so many seconds in equal steps."""
        return self._in_steps("hold", {}, steps, seconds)

    def _in_steps(self, name: str, ways: dict[str, float], steps: int, over_s: float | None) -> "Motion":
        if not (isinstance(steps, Real) and steps >= 1 and steps == steps // 1):
            raise InputError(f"Motion.{name}: steps={steps} is not possible; give a whole number from 1 on.")
        steps = int(steps)
        one = MotionStep({freedom: way / steps for freedom, way in ways.items() if way}, seconds=_share(name, over_s, steps))
        return Motion(self.steps + steps * (one,))

    def step(self, *, ways: dict[str, float] | None = None, loads: dict[str, float] | None = None,
             over_s: float | None = None) -> "Motion":
        """One step of any freedoms: displacements (`ways`; mm, degrees) from the step's start, loads (N, N mm) at its end."""
        return Motion((*self.steps, MotionStep(dict(ways or {}), dict(loads or {}), over_s)))

    @property
    def depth_mm(self) -> float:
        """Depth (mm) from first touch after the prescribed displacements; InputError after a step with a loaded z."""
        depth = 0.0
        for step in self.steps:
            depth = math.nan if "z" in step.loads else depth - step.ways.get("z", 0.0)
        if math.isnan(depth):
            raise InputError("Motion.press: a depth after a press by force is not known beforehand; use step(ways={'z': ...}).")
        return depth

    @property
    def forces_n(self) -> list[float] | None:
        """The normal forces (N, positive) of a motion that only presses straight down by force; None for other motions."""
        straight = all(set(step.loads) == {"z"} and not step.ways for step in self.steps)
        return [-step.loads["z"] for step in self.steps] if self.steps and straight else None

    @property
    def held_forces_n(self) -> np.ndarray | None:
        """The normal forces (k,) in N, positive, of a motion that presses straight down by force and holds; None for others."""
        straight = bool(self.steps) and set(self.steps[0].loads) == {"z"} and all(
            not step.ways and not step.loads.keys() - {"z"} for step in self.steps)
        if not straight:
            return None
        forces = [-step.loads.get("z", np.nan) for step in self.steps]
        last = np.maximum.accumulate(np.where(np.isnan(forces), 0, np.arange(len(forces))))
        return np.array(forces)[last]

    @property
    def times_s(self) -> np.ndarray | None:
        """(steps,) in s from the start to each step's end; None where no step has a duration.

        Raises InputError where some steps have one and others have none.
        """
        seconds = [step.seconds for step in self.steps]
        if all(one is None for one in seconds):
            return None
        if None in seconds:
            raise InputError(f"motion: step {seconds.index(None) + 1} of {len(seconds)} has no duration and others have; give one "
                             'to each, such as "z -1.0 over 0.5", or to none.')
        return np.cumsum(np.array(seconds, dtype=float))

    @property
    def straight(self) -> bool:
        """Whether the object only moves along z."""
        return not any(step.ways.keys() - {"z"} or step.loads.keys() - {"z"} for step in self.steps)

    @property
    def turns(self) -> bool:
        """Whether the object turns, or carries a torque."""
        return any({*step.ways, *step.loads} & set(FREEDOMS[3:]) for step in self.steps)

    @property
    def loaded_aside(self) -> bool:
        """Whether the object is loaded along x or y."""
        return any({*step.loads} & {"x", "y"} for step in self.steps)

    @property
    def aside_mm(self) -> np.ndarray:
        """Displacements (step, 2) in mm along x and y from the motion's start to each step's end."""
        return np.cumsum([[step.ways.get("x", 0.0), step.ways.get("y", 0.0)] for step in self.steps], axis=0)

    @property
    def turned_deg(self) -> np.ndarray:
        """Turns (step,) in degrees about the object's axis along z from the motion's start to each step's end."""
        return np.cumsum([step.ways.get("rz", 0.0) for step in self.steps])

    def offsets_mm(self, *, at_most_mm: float = 0.5) -> np.ndarray:
        """Displacements (k, 2) in mm along x and y from the motion's start, at every step's end and at most `at_most_mm` apart."""
        places = [np.zeros(2)]
        for end in self.aside_mm:
            count = max(1, math.ceil(np.linalg.norm(end - places[-1]) / at_most_mm))
            places += list(places[-1] + np.linspace(0, 1, count + 1)[1:, None] * (end - places[-1]))
        return np.array(places)

    @classmethod
    def parse(cls, text: str) -> "Motion":
        """A motion from one line: steps separated by semicolons, with terms like `x 1.0`, `fz -20`; `in 10`: in ten equal steps.

        Raises InputError that names a step it cannot parse.
        """
        if not isinstance(text, str):
            raise InputError(f"motion: {text!r} is no text; {_HINT}.")
        motion = cls()
        for part in filter(None, (part.strip() for part in text.split(";"))):
            terms, over = _cut(part, _OVER)
            terms, count = _cut(terms, _IN)
            if over is None:
                terms, over = _cut(terms, _OVER)
            held, found = _HOLD.fullmatch(terms), _TERM.findall(terms)
            if int(count or 1) == 0 or (over is not None if held else not found or _TERM.sub("", terms).strip(" ,")):
                raise InputError(f"motion: the step {part!r} is not understood; {_HINT}.")
            if held:
                motion = motion.hold(_read(part, held[1]), steps=int(count or 1))
                continue
            motion = motion._terms(part, [(name.lower(), _read(part, value)) for name, value in found], int(count or 1),
                                   None if over is None else _read(part, over))
        if not motion.steps:
            raise InputError(f"motion: there is no step in {text!r}; {_HINT}.")
        return motion

    def _terms(self, part: str, terms: list[tuple[str, float]], count: int, over_s: float | None) -> "Motion":
        if unknown := [name for name, _ in terms if name not in FREEDOMS + LOADS]:
            raise InputError(f"motion: {unknown[0]!r} in the step {part!r} is no freedom; use one of "
                             f"{', '.join(FREEDOMS)} for a displacement, {', '.join(LOADS)} for a load.")
        names = [name for name, _ in terms]
        if twice := [name for name in names if names.count(name) > 1]:
            raise InputError(f"motion: the step {part!r} names {twice[0]!r} twice; keep one, or put a semicolon between steps.")
        loads = {FREEDOMS[LOADS.index(name)]: value for name, value in terms if name in LOADS}
        ways, motion = {name: value / count for name, value in terms if name in FREEDOMS}, self
        each = _share("step", over_s, count)
        for _ in range(count):
            motion = motion.step(ways=ways, loads=loads, over_s=each)
        return motion


def numbers_of(name: str, given: float | Sequence[float]) -> list[float]:
    """One number, or some, as a list.  name: what they are. Raises InputError for none, text, rows, and what is not finite."""
    values = list(given) if np.iterable(given) and not isinstance(given, str) else [given]
    if not values:
        raise InputError(f"{name} is empty; give at least one number.")
    numbers = [_number(value) for value in values]
    for value, number in zip(values, numbers, strict=True):
        if not math.isfinite(number):
            raise InputError(f"{name}={repr(value) if isinstance(value, str) else value} is no number; give a finite one.")
    return numbers


def _number(value: Any) -> float:
    """A value as a float; nan where it is text, a row or nothing of the kind."""
    try:
        return math.nan if isinstance(value, str) or np.ndim(value) else float(value)
    except (TypeError, ValueError):
        return math.nan


def _finite(name: str, value: float) -> float:
    return numbers_of(f"Motion: {name}", [value])[0]


def _positive(name: str, value: float) -> float:
    if not value > 0:
        raise InputError(f"Motion.press: {name}={value:g} does not press; give a value above 0.")
    return value


def _share(name: str, over_s: float | None, steps: int) -> float | None:
    """The duration in s of each of some steps of a method's name that take `over_s` together."""
    if over_s is None:
        return None
    if not _finite("over_s", over_s) > 0:
        raise InputError(f"Motion.{name}: a duration of {over_s:g} s is not possible; give seconds above 0.")
    return over_s / steps


def _cut(part: str, end: str) -> tuple[str, str | None]:
    """A step without such an end, and the end's number; None where it does not end so."""
    found = re.search(end + "$", part, re.IGNORECASE)
    return (part[:found.start()], found[1]) if found else (part, None)


def _read(part: str, number: str) -> float:
    try:
        return float(number)
    except ValueError:
        raise InputError(f"motion: {number!r} in the step {part!r} is no number; {_HINT}.") from None
