"""The motion of an object on a sensor: steps, in each of which every one of its six degrees of freedom is prescribed or loaded.

    Motion().press(force_n=[5, 20])                        # straight down by force, two steps
    Motion().press(depth_mm=1.0).slide(x_mm=1.0, steps=10) # down by depth, then aside, ten steps
    Motion().press(force_n=10).turn(z_deg=15, steps=3)     # down by force, which stays, then about the vertical axis
    Motion.parse("z -1.0; x 1.0 in 10")                    # the same in one line

Freedoms: x, y, z in mm and rx, ry, rz in degrees of the object in the sensor's frame (z out of the surface, so down is negative).
A motion starts where the object just touches the surface at rest. A prescribed freedom moves by the given increment from the step's
start; a loaded one takes the position at which the sensor's surface carries the step's force (N) or torque (N mm). A freedom that a
step does not name keeps its state: a prescribed freedom its position, a loaded one its load.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from softtact.errors import InputError

FREEDOMS = ("x", "y", "z", "rx", "ry", "rz")
LOADS = ("fx", "fy", "fz", "mx", "my", "mz")     # the loads of the same freedoms, on the sensor's surface
_TERM = re.compile(r"([a-z]{1,2})\s*=?\s*([-+]?[0-9.]+(?:e[-+]?[0-9]+)?)", re.IGNORECASE)
_HINT = 'write steps like "z -1.0; x 1.0 in 10" (mm, degrees) or "fz -20" (N), with semicolons between steps'


@dataclass(frozen=True)
class MotionStep:
    """One step: displacements of prescribed freedoms, loads of loaded ones."""

    ways: dict[str, float] = field(default_factory=dict)
    """Freedom to displacement or rotation: mm or degrees, from where the step begins."""
    loads: dict[str, float] = field(default_factory=dict)
    """Freedom to load at the step's end: N or N mm on the sensor's surface; pressing down is a negative z."""


@dataclass(frozen=True)
class Motion:
    """Steps of an object on a sensor; immutable: each method returns a longer motion."""

    steps: tuple[MotionStep, ...] = ()
    """The steps in their order; a result holds the state at the end of each."""

    def press(self, *, force_n: float | Sequence[float] | None = None, depth_mm: float | Sequence[float] | None = None) -> "Motion":
        """Press straight down, by force (N, positive) or to a depth (mm, from first touch), one step for each value.

        Raises InputError where both or none are given, or a value is not finite and positive.
        """
        if (force_n is None) == (depth_mm is None):
            raise InputError("Motion.press takes either force_n or depth_mm; give one of them.")
        name, given = ("force_n", force_n) if depth_mm is None else ("depth_mm", depth_mm)
        values = [_positive(name, value) for value in np.atleast_1d(np.asarray(given, dtype=float))]
        if depth_mm is None:
            return Motion(self.steps + tuple(MotionStep(loads={"z": -force}) for force in values))
        reached = [self.depth_mm, *values]
        return Motion(self.steps + tuple(MotionStep(ways={"z": before - after})
                                         for before, after in zip(reached, reached[1:], strict=False)))

    def slide(self, *, x_mm: float = 0.0, y_mm: float = 0.0, steps: int = 1) -> "Motion":
        """Move the object along x and y (mm) in equal steps at constant depth, or constant force."""
        return self._in_steps("slide", {"x": _finite("x_mm", x_mm), "y": _finite("y_mm", y_mm)}, steps)

    def turn(self, *, x_deg: float = 0.0, y_deg: float = 0.0, z_deg: float = 0.0, steps: int = 1) -> "Motion":
        """Turn the object about the axes through its reference point by angles (degrees) in equal steps; other freedoms keep
        their state."""
        return self._in_steps("turn", {"rx": _finite("x_deg", x_deg), "ry": _finite("y_deg", y_deg),
                                       "rz": _finite("z_deg", z_deg)}, steps)

    def _in_steps(self, name: str, ways: dict[str, float], steps: int) -> "Motion":
        if steps < 1:
            raise InputError(f"Motion.{name}: steps={steps} is not possible; give 1 or more.")
        return Motion(self.steps + steps * (MotionStep({freedom: way / steps for freedom, way in ways.items() if way}),))

    def step(self, *, ways: dict[str, float] | None = None, loads: dict[str, float] | None = None) -> "Motion":
        """One step of any freedoms: displacements (`ways`; mm, degrees) from the step's start, loads (N, N mm) at its end."""
        return self._with(MotionStep(dict(ways or {}), dict(loads or {})))

    def _with(self, step: MotionStep) -> "Motion":
        for name in (*step.ways, *step.loads):
            if name not in FREEDOMS:
                raise InputError(f"Motion: the freedom {name!r} is unknown; use one of {', '.join(FREEDOMS)}.")
        if both := set(step.ways) & set(step.loads):
            raise InputError(f"Motion: the freedom {both.pop()!r} is prescribed and loaded in one step; choose one.")
        return Motion((*self.steps, step))

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
        motion = cls()
        for part in filter(None, (part.strip() for part in text.split(";"))):
            terms, _, count = part.partition(" in ")
            found = _TERM.findall(terms)
            if not found or _TERM.sub("", terms).strip(" ,") or (count and not count.strip().isdigit()) or count.strip() == "0":
                raise InputError(f"motion: the step {part!r} is not understood; {_HINT}.")
            motion = motion._terms(part, [(name.lower(), float(value)) for name, value in found], int(count or 1))
        if not motion.steps:
            raise InputError(f"motion: there is no step in {text!r}; {_HINT}.")
        return motion

    def _terms(self, part: str, terms: list[tuple[str, float]], count: int) -> "Motion":
        if unknown := [name for name, _ in terms if name not in FREEDOMS + LOADS]:
            raise InputError(f"motion: {unknown[0]!r} in the step {part!r} is no freedom; use one of "
                             f"{', '.join(FREEDOMS)} for a displacement, {', '.join(LOADS)} for a load.")
        loads = {FREEDOMS[LOADS.index(name)]: value for name, value in terms if name in LOADS}
        ways, motion = {name: value / count for name, value in terms if name in FREEDOMS}, self
        for _ in range(count):
            motion = motion.step(ways=ways, loads=loads)
        return motion


def _finite(name: str, value: float) -> float:
    if not math.isfinite(value):
        raise InputError(f"Motion: {name}={value} is no number; give a finite one.")
    return float(value)


def _positive(name: str, value: float) -> float:
    if not _finite(name, value) > 0:
        raise InputError(f"Motion.press: {name}={value:g} does not press; give a value above 0.")
    return float(value)
