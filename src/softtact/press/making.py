"""How the models' presses make a `PressResult`: what all of them share."""

import time
import warnings
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.contact.shell import Shell
from softtact.errors import ConvergenceError, ShellWarning
from softtact.press.result import PressResult
from softtact.progress import progress
from softtact.readout.calibrated import counts_of

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor
    from softtact.sensors.specification import AnySpec

@dataclass(frozen=True)
class Course:
    """How a press goes about its work, apart from what it computes."""

    label: str = "press"
    """What its progress begins with; nothing is told where it is empty."""
    threads: int = 1
    """Of the linear algebra."""
    keep_body: bool = False
    """Whether the result holds the whole body's displacements at each load step, where the model has one."""
    time_limit_s: float | None = None
    """Wall-clock seconds, after which a press ends with what it has reached."""
    on_step: Callable[[PressResult], None] | None = None
    """Called with the result so far whenever a load step is reached."""


_HARDLY = 1e-6     # of a force: a share of the shell that is not worth a warning


def shell_of(sensor: "Sensor") -> Shell:
    """The shell that a sensor's `edge` states."""
    edge = sensor.spec.edge
    return Shell(sensor.spec.footprint_mm, edge.held_below_mm, edge.shell_width_mm)


def make_result(sensor: "Sensor", model: str, solver: str, maps: np.ndarray, forces: np.ndarray, times: np.ndarray,
                **numbers: Any) -> PressResult:
    """A `PressResult` of maps (l, points) or (l, ny, nx) and numbers by the result's names.

    lower_maps among these: of the lower side where it moves; capacitance follows the change of thickness
    """
    spec, maps = sensor.spec, maps.reshape(len(forces), *sensor.spec.map_shape)
    lower_maps = numbers.pop("lower_maps", None)
    thinning = maps if lower_maps is None else maps - lower_maps.reshape(maps.shape)
    flags: dict[str, Any] = {"converged": np.ones(len(forces), dtype=np.int8),
                             "within_validity": np.asarray(numbers.pop("within_validity"), dtype=np.int8)}
    arrays: dict[str, Any] = {name: np.asarray(values) for name, values in numbers.items()}
    warn_of_shell(spec, forces, arrays.get("pad_force_n", forces))
    return PressResult(deformation_map_mm=maps, tactile_map=counts_of(spec, thinning), normal_force_n=forces, wall_time_s=times,
                       x_mm=spec.map_x_mm, y_mm=spec.map_y_mm, model=model, sensor=spec.name, solver=solver,
                       largest_counts=spec.largest_counts,
                       attributes={"thickness_mm": spec.thickness_mm, "edge": spec.edge.in_words, **_friction(spec, model),
                                   **_calibration(spec), **sensor.attributes}, **flags, **arrays)


def _calibration(spec):
    """Attribute that states what a calibrated sensor's readings rest on."""
    return {} if spec.calibration is None else {"calibration": spec.calibration.source}


def warn_of_shell(spec: "AnySpec", forces: np.ndarray, on_pad: np.ndarray) -> None:
    """Warn of the first load step at which the shell carries a part of the forces (l,) in N, the pad the rest."""
    resting = np.flatnonzero(forces - on_pad > _HARDLY * forces)
    if len(resting):
        first = resting[0]
        warnings.warn(f"At {forces[first]:g} N the object rests on the shell beside the pad, which feels {on_pad[first]:.3g} N of "
                      f"it (`result.pad_force_n`; {spec.edge.in_words}): if your sensor's shell ends lower, say so by 'edge' in "
                      "its file.", ShellWarning, stacklevel=5)


def _friction(spec, model):
    """Attributes that state the friction of a result."""
    if model != "hyperelastic":
        return {"friction": f"none: the {model} model knows no friction"}
    return spec.support_facts


def timed(load_steps: Iterable[Any], count: int, course: Course, times: list[float], so_far: Callable[[], PressResult], *,
          start: float | None = None) -> None:
    """Go through load steps; into `times` go the seconds that each took, the solver's preparation counting to the first.

    so_far: makes the result of those that were reached. A ConvergenceError and an interruption of the keyboard take it with them
    as their `result`; it is None where none was reached.
    """
    last = start or time.perf_counter()
    try:
        for _ in progress(load_steps, label=course.label, total=count):
            now = time.perf_counter()
            times.append(now - last)
            last = now
            if course.on_step and len(times) < count:
                course.on_step(_quietly(so_far))
    except (ConvergenceError, KeyboardInterrupt) as error:
        error.result = so_far() if times else None     # type: ignore[union-attr]
        raise


def _quietly(make):
    """A result whose warnings are left to the last one."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return make()
