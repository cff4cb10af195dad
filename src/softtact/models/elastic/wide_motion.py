"""A `Motion` of an object over a wide layer: its steps one after the other."""

from collections.abc import Iterator

from softtact.contact.motion import Motion
from softtact.errors import ConvergenceError
from softtact.models.elastic.sliding import check_motion, load_after
from softtact.models.elastic.wide_sliding import WideObject, WideStep

_REFUSED = "the elastic model of a gel prescribes x, y, z and rz and loads z only; leave {} out or take model='solid'."


def follow_motion(mover: WideObject, motion: Motion, *, deepest_mm: float) -> Iterator[WideStep]:
    """The `WideStep`s of a motion, one after the other.

    deepest_mm: the layer's thickness
    Raises InputError and ConvergenceError as `WideObject.follow`.
    """
    check_motion(motion, prescribed=("x", "y", "z", "rz"), refused=_REFUSED)
    load: float | None = None
    for number, step in enumerate(motion.steps, start=1):
        load = load_after(step, load)
        found = mover.follow(step, load)
        if found.position[2] > deepest_mm:
            raise ConvergenceError(f"Step {number} was not reached: the object would be {found.position[2]:.3g} mm deep in a gel "
                                   f"{deepest_mm:g} mm thick; press less deep or with less force.")
        yield found
