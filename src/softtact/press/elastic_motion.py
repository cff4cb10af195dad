"""A `Motion` of a placed object with the elastic model, from a sensor: its surface compliance, friction and first touch."""

import time
from typing import TYPE_CHECKING

from trimesh import Trimesh

from softtact.contact.height_field import HeightField
from softtact.contact.motion import Motion
from softtact.models.elastic.sliding import ElasticMotion, SlidingState, check_motion, move_on_layer
from softtact.press.cache import cached_surface_compliance
from softtact.press.making import shell_of
from softtact.progress import Watch

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor


def press_motion(sensor: "Sensor", placed: Trimesh, motion: Motion, seconds: list[float], *, label: str = "press",
                 threads: int = 1, limit_s: float | None = None) -> ElasticMotion:
    """The `ElasticMotion` of a mesh placed in the sensor's frame; into `seconds` goes the time that each step took.

    Raises InputError for rotations, lateral loads, and an object that misses the sensor; ConvergenceError, with the steps before as
    its `result`, where one is not reached.
    """
    check_motion(motion)
    if "elastic_surface" not in sensor.prepared_models:
        sensor.prepared_models["elastic_surface"] = cached_surface_compliance(sensor.spec, threads=threads)
    compliance, spec = sensor.prepared_models["elastic_surface"], sensor.spec
    shell, field, start = shell_of(sensor), HeightField(placed), time.perf_counter()
    watch = Watch(label, limit_s=limit_s)

    def note(state: SlidingState) -> None:
        shell.refuse_motion(field, state.position[:2], state.position[2] + lowest, lowest, step=len(seconds) + 1)
        watch.beat(f"step {len(seconds) + 1} of {len(motion.steps)}, {state.position[2]:.3f} mm deep")
        seconds.append(time.perf_counter() - start - sum(seconds))

    lowest = field.first_touch_mm(spec.map_x_mm, spec.map_y_mm)
    return move_on_layer(compliance, field, motion, first_touch_mm=lowest, friction=spec.friction.object,
                         deepest_mm=spec.thickness_mm, on_step=note)
