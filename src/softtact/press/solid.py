"""Presses of a soft object: sensor and object as solids of finite strain that meet surface to surface.

The sensor's layers are meshed as a solid, its frusta are springs (`models/solid/springs`). The object is a body of tetrahedra, or
any `SolidMesh`, whose upper part a rigid holder carries: a finger that presses, or the bench that the sensor is pressed against.
"""

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from softtact.contact.motion import Motion
from softtact.errors import ConvergenceError
from softtact.geometry.pose import Pose
from softtact.models.solid.body import SolidBody
from softtact.models.solid.path import SolidLoadStep, SolidPath
from softtact.press.making import Course
from softtact.press.result import PressResult
from softtact.press.soft_object import OBJECT, SoftObject
from softtact.press.solid_pad import SolidPad
from softtact.progress import Watch, announce

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

Result = TypeVar("Result")


def press_soft(sensor: "Sensor", soft: SoftObject, pose: Pose | None, motion: Motion, course: Course) -> PressResult:
    """Press a soft object through a motion; its steps by force load the holder.

    Raises InputError where the object misses the sensor, ConvergenceError with the steps before as its `result`.
    """
    pad = SolidPad(sensor)
    placed = soft.placed(pose, pad.height_mm, pad.shell)
    body = pad.with_object(placed, soft, threads=course.threads)
    return pressed_solid(
        body,
        OBJECT,
        motion,
        partial(pad.result, body, keep_body=course.keep_body),
        label=course.label,
        time_limit_s=course.time_limit_s,
        on_step=course.on_step,
    )


def pressed_solid(
    body: SolidBody,
    frame: str,
    motion: Motion,
    gather: Callable[[list[SolidLoadStep]], Result],
    *,
    label: str = "",
    time_limit_s: float | None = None,
    on_step: Callable[[Result], None] | None = None,
) -> Result:
    """What `gather` makes of the load steps of a body whose one frame is moved; progress is told where there is a label.

    on_step: called with what is made of the steps so far, at each that is reached but the last
    A ConvergenceError, of which a time limit is one, and a KeyboardInterrupt hold what is made of the steps before as `result`.
    """

    def tell(text: str) -> None:
        if label:
            announce(f"{label}: {text}")

    count, steps = len(motion.steps), list[SolidLoadStep]()
    body.watch = Watch(label, limit_s=time_limit_s)
    tell(f"{len(body.free)} unknowns, {count} load steps of the solid model")
    try:
        for step in SolidPath(body, {frame: motion}, tell=tell).run():
            steps.append(step)
            force = float(np.linalg.norm(step.loads[0, :3]))
            tell(f"step {len(steps)} of {count}, {force:.4g} N, {step.iterations} iterations, {step.wall_time_s:.0f} s")
            if on_step and len(steps) < count:
                on_step(gather(steps))
    except (ConvergenceError, KeyboardInterrupt) as error:
        error.result = gather(steps) if steps else None  # type: ignore[union-attr]
        raise
    finally:
        body.watch.end()
    return gather(steps)
