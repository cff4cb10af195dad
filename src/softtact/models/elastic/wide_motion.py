"""A `Motion` of an object over a wide layer: its steps one after the other."""

from collections.abc import Callable

from softtact.contact.motion import Motion
from softtact.errors import ConvergenceError
from softtact.models.elastic.sliding import check_motion, load_after
from softtact.models.elastic.wide_sliding import WideObject, WideStep

_REFUSED = "the elastic model of a gel prescribes x, y, z and rz and loads z only; leave {} out or take model='solid'."


def follow_motion(mover: WideObject, motion: Motion, *, deepest_mm: float,
                  on_step: Callable[[WideStep], None] | None = None) -> list[WideStep]:
    """The `WideStep`s of a motion.

    deepest_mm: the layer's thickness;  on_step: called with each step
    Raises InputError and ConvergenceError as `WideObject.follow`, the latter with the steps before as its `result` (or None).
    """
    check_motion(motion, prescribed=("x", "y", "z", "rz"), refused=_REFUSED)
    steps: list[WideStep] = []
    load: float | None = None
    try:
        for number, step in enumerate(motion.steps, start=1):
            load = load_after(step, load)
            steps.append(mover.follow(step, load))
            if steps[-1].position[2] > deepest_mm:
                deep = steps.pop().position[2]
                raise ConvergenceError(f"Step {number} was not reached: the object would be {deep:.3g} mm deep in a gel "
                                       f"{deepest_mm:g} mm thick; press less deep or with less force.")
            if on_step:
                on_step(steps[-1])
    except ConvergenceError as error:
        error.result = steps or None
        raise
    return steps
