"""What holds a sensor's rim: a rigid shell around it, up to a stated height, and what an object wider than the sensor rests on.

    edge: {held: sides}                       the shell ends flush with the sensing surface: all of the side faces are held
    edge: {held: {sides_below_mm: 1.5}}       the shell ends 1.5 mm below it: side faces are held from there down, free above
    edge: {held: free}                        no shell: side faces are free

The shell is rigid and as wide as `shell_width_mm`. An object that reaches over it comes down until it meets the shell's top, which
carries whatever force is then added. So with `held: sides` a flat object wider than the sensor rests on the shell at first touch.
"""

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator

from softtact.sensors.fields import Length, Section, plain_value


class SidesBelow(Section):
    """A shell that holds the side faces from so far below the sensing surface on."""

    sides_below_mm: Length


def _held(value: Any) -> Any:
    """Refuse what is none of the three in one sentence, where a union's own errors would name each of its members."""
    if isinstance(value, SidesBelow) or value in ("sides", "free"):
        return value
    if not (isinstance(value, dict) and set(value) == {"sides_below_mm"}):
        raise ValueError(f"it is {value!r}; write sides, free, or {{sides_below_mm: h}} with h in mm")
    height = plain_value(value["sides_below_mm"])
    if isinstance(height, bool) or not isinstance(height, int | float) or not 0 < height < np.inf:
        raise ValueError(f"its sides_below_mm is {height!r}; give a height in mm above 0")
    return value


class Edge(Section):
    """What holds the rim; `held` as in this module's docstring, `sides_below_mm` and `free` in its place are short for it."""

    held: Annotated[Literal["sides", "free"] | SidesBelow, BeforeValidator(_held)] = "sides"
    shell_width_mm: Length = 2.0

    @property
    def held_below_mm(self) -> float:
        """Depth below the sensing surface from which side faces are held, which is that of the shell's top; infinite without."""
        if isinstance(self.held, SidesBelow):
            return self.held.sides_below_mm
        return 0.0 if self.held == "sides" else np.inf

    @property
    def in_words(self) -> str:
        """One clause for attributes of results."""
        if isinstance(self.held, SidesBelow):
            return f"sides held from {self.held.sides_below_mm:g} mm below the surface on"
        return "sides held up to the surface" if self.held == "sides" else "sides free"


def _short(value: Any) -> Any:
    """`sides`, `free` and `{sides_below_mm: h}` in place of a whole `edge`."""
    if isinstance(value, str):
        return {"held": value}
    if isinstance(value, dict) and "sides_below_mm" in value and "held" not in value:
        return {"held": {"sides_below_mm": value["sides_below_mm"]}} | {k: v for k, v in value.items() if k != "sides_below_mm"}
    return value


EdgeField = Annotated[Edge, BeforeValidator(_short)]
