"""How a kind of sensor is pressed on the page: a `Bench` each, in `on_layers`, `on_skin` and `on_solid`."""

from dataclasses import dataclass, replace
from typing import Literal, Protocol

import numpy as np

from softtact.geometry.repair import Mended
from softtact.play.state import Press, State
from softtact.press.result import PressResult

LEAST_FORCE_N = 0.1     # of the page, where the sensor does not begin with less
_KEPT = 50     # results of long models, the latest


@dataclass(frozen=True)
class Pressed:
    """A press as a bench made it."""

    press: Press
    """The same press for the command line."""
    result: PressResult
    """What is drawn: maps of a plane surface or the mesh of a body, and readings."""
    end: tuple[np.ndarray, np.ndarray]
    """Where the object's mesh is at the end: translation (3,) in mm with its depth, and quaternion (4,) w, x, y, z."""
    clearance_mm: np.ndarray | None = None
    """(y, x) in mm at the map's points: negative where object and surface touch, cut off a little beside them."""
    stage: Literal["touching", "coarse", "whole"] = "whole"
    """touching: the sensor has a long model alone, and it has not run."""

    @property
    def draft(self) -> bool:
        """Whether it is the coarse one."""
        return self.stage == "coarse"

    @property
    def done(self) -> bool:
        """Whether the object presses."""
        return self.stage != "touching"


class Results:
    """The latest results of long models by their presses."""

    def __init__(self) -> None:
        self._of: dict[Press, PressResult] = {}

    def get(self, press: Press) -> PressResult | None:
        """The result of a press, by whichever model, if it is here."""
        return self._of.get(replace(press, model=""))

    def take(self, press: Press, result: PressResult) -> None:
        """Take a result in."""
        if len(self._of) >= _KEPT:
            del self._of[next(iter(self._of))]
        self._of[replace(press, model="")] = result


class Bench(Protocol):
    """A sensor and how it is pressed."""

    @property
    def middle_mm(self) -> np.ndarray:
        """(3,) of the sensing surface in the sensor's frame: an object at x = y = 0 is above it."""

    @property
    def size_mm(self) -> np.ndarray:
        """(3,): width, length and height of the sensor."""

    @property
    def force_range_n(self) -> tuple[float, float]:
        """Least and largest force."""

    @property
    def models(self) -> tuple[str, ...]:
        """Long models, that of choice first."""

    @property
    def long_on_release(self) -> bool:
        """Whether a long model runs by itself where the object rests."""

    @property
    def first_force_n(self) -> float:
        """Largest force with which the page begins on this sensor."""

    @property
    def refines(self) -> bool:
        """Whether a whole press follows a coarse one as soon as the object rests."""

    @property
    def is_ready(self) -> bool:
        """Whether a whole press needs no preparation."""

    def prepare(self) -> None:
        """Prepare a whole press."""

    def press(self, state: State, mended: Mended, *, draft: bool) -> Pressed:
        """The press of a state. Raises SofttactError in one sentence where there is none."""

    def take(self, press: Press, result: PressResult) -> None:
        """Take the result of a long model, which is shown where the bench has no fast one."""

    def follows(self, model: str) -> bool:
        """Whether a long model follows slide and twist."""


def force_span_n(bench: Bench) -> tuple[float, float]:
    """Least and largest force in N that the page offers; the force that it begins with lies between them."""
    return min(LEAST_FORCE_N, float(bench.first_force_n)), float(bench.force_range_n[1])
