"""A `Motion` of an object over a wide layer: which ones the model can follow, and its steps one after the other."""

from collections.abc import Callable

from softtact.contact.motion import Motion
from softtact.errors import ConvergenceError, InputError
from softtact.models.elastic.wide_sliding import WideObject, WideStep

_REFUSED = "the elastic model of a gel prescribes x, y, z and rz and loads z only; leave {} out or take model='solid'."


def check_wide_motion(motion: Motion) -> None:
    """Raise InputError for what the elastic model of a gel does not know."""
    if not motion.steps:
        raise InputError("The motion has no steps; add one, for example with Motion().press(force_n=5).")
    for number, step in enumerate(motion.steps, start=1):
        turned = [name for name in step.ways if name not in ("x", "y", "z", "rz")]
        loaded = [name for name in step.loads if name != "z"]
        if turned or loaded:
            what = f"the rotation {turned[0]}" if turned else f"the load on {loaded[0]}"
            raise InputError(f"Step {number} of the motion: {_REFUSED.format(what)}")
        if step.loads.get("z", -1.0) >= 0:
            raise InputError(f"Step {number} of the motion: a load of {step.loads['z']:g} N along z does not press; give one "
                             "below 0, or prescribe z.")


def follow_motion(mover: WideObject, motion: Motion, *, deepest_mm: float,
                  on_step: Callable[[WideStep], None] | None = None) -> list[WideStep]:
    """The `WideStep`s of a motion.

    deepest_mm: the layer's thickness;  on_step: called with each step
    Raises InputError and ConvergenceError as `WideObject.follow`, the latter with the steps before as its `result` (or None).
    """
    check_wide_motion(motion)
    steps: list[WideStep] = []
    load: float | None = None
    try:
        for number, step in enumerate(motion.steps, start=1):
            load = -step.loads["z"] if "z" in step.loads else None if "z" in step.ways else load
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
