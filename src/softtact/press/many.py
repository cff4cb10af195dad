"""Many presses at once: in processes that share the sensor's prepared models; the elastic model's as batches, also on a GPU."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from softtact.contact.undersides import ObjectSurface
from softtact.errors import ConvergenceError, InputError, SofttactError
from softtact.geometry.pose import Pose
from softtact.press.batch import batch_device, press_together, together, warn_of_shells
from softtact.press.choice import models_to_prepare
from softtact.press.objects import SoftObject
from softtact.press.result import PressResult
from softtact.press.task import cores
from softtact.processes import map_in_processes
from softtact.progress import announce, progress

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

_COLUMNS = 32     # load steps at once in a process; a fixed number, so that results do not depend on the processes
_PREPARED: dict[str, tuple[str, ...]] = {"elastic": ("elastic",), "foundation": ("foundation",)}


@dataclass(frozen=True)
class Batch:
    """Settings of many presses."""

    force_n: np.ndarray
    """(l,) in N: of each press."""
    model: str
    """By its name, or auto."""
    workers: int
    """Processes."""
    device: str = "auto"
    """cpu, cuda or auto."""
    failures: str = "raise"
    """`raise` or `keep`."""
    label: str = "presses"
    """First words of the progress."""
    options: dict[str, Any] = field(default_factory=dict)
    """`policy` and `tolerance_mm`."""

    @classmethod
    def of(cls, force_n: np.ndarray, model: str, options: Mapping[str, Any]) -> "Batch":
        """A batch with the options of `Sensor.press_many`."""
        given = dict(options)
        policy = {name: given.pop(name) for name in ("policy", "tolerance_mm") if name in given}
        if given.get("failures", "raise") not in ("raise", "keep"):
            raise InputError(f"failures={given['failures']!r} is unknown; write 'raise' or 'keep'.")
        return cls(force_n, model, given.pop("workers", None) or cores(), options=policy, **given)      # type: ignore[arg-type]


def press_many(sensor: "Sensor", jobs: list[tuple[trimesh.Trimesh | SoftObject, Pose | None]], batch: Batch) -> list[PressResult]:
    """Presses of (mesh, pose); see `Sensor.press_many`."""
    results = _pressed_all(sensor, jobs, batch)
    return raise_first(results) if batch.failures == "raise" else results


def _pressed_all(sensor, jobs, batch):
    if not jobs:
        return []
    model, rigid = batch.model, not any(isinstance(mesh, SoftObject) for mesh, _ in jobs)
    device = batch_device(sensor, model, batch.device, rigid=rigid)
    if model == "elastic" and rigid and together(sensor):
        return _pressed_together(sensor, jobs, batch, device=device)
    prepared = _PREPARED.get(model, ())
    if model == "auto" and sensor.spec.has_layers and sensor.spec.edge.far:
        prepared = ("elastic",)
    elif model == "auto":
        prepared = models_to_prepare(sensor, policy=batch.options.get("policy", "error"))
    for name in prepared:
        sensor.prepared(name)
    if batch.label and model in ("auto", "hyperelastic"):
        _announce_time(sensor, batch)
    act = partial(_pressed, force_n=batch.force_n, model=model, options=batch.options)
    return list(progress(_each(sensor, act, jobs, batch.workers), label=batch.label, total=len(jobs)))


def _announce_time(sensor, batch):
    """State how long a press by the hyperelastic model takes, before one may begin."""
    from softtact.press.hyperelastic import time_in_words

    if sensor.spec.has_layers and (time := time_in_words(sensor, len(batch.force_n))):
        announce(f"{batch.label}: a press by the hyperelastic model{', where it is chosen,' if batch.model == 'auto' else ''} takes"
                 f"{time.removeprefix(':')}")


def _pressed_together(sensor, jobs, batch, *, device):
    """Presses of the elastic model in parts that share a problem: on the processor a few for each process."""
    surfaces: dict[int, ObjectSurface] = {}
    for mesh, _ in jobs:
        if id(mesh) not in surfaces:
            surfaces[id(mesh)] = ObjectSurface(mesh)
    pairs = [(surfaces[id(mesh)], pose) for mesh, pose in jobs]
    workers = batch.workers if device == "cpu" else 1
    size = max(1, _COLUMNS // len(batch.force_n)) if device == "cpu" else len(pairs)
    parts = [pairs[first:first + size] for first in range(0, len(pairs), size)]
    act = partial(_part_pressed, force_n=batch.force_n, device=device)
    results: list[Any] = []
    for part in progress(_each(sensor, act, parts, workers), label=f"{batch.label}, {size} at once" if batch.label else "",
                         total=len(parts)):
        results += part
    done = [one for one in results if isinstance(one, PressResult)]
    if done:
        warn_of_shells(sensor, *(np.array([getattr(one, name)[-1] for one in done]) for name in ("normal_force_n", "pad_force_n")))
    return results


def _part_pressed(sensor, pairs, *, force_n, device):
    surfaces, poses = zip(*pairs, strict=True)
    return press_together(sensor, surfaces, poses, force_n, device=device)


def _each(sensor, act, jobs, workers):
    """act(sensor, job) of each job, in their order, in processes."""
    workers = min(workers, len(jobs))
    return map_in_processes(partial(act, sensor), jobs, workers=workers) if workers > 1 else (act(sensor, job) for job in jobs)


def _pressed(sensor, job, *, force_n, model, options):
    """A result, or the error in its place, so that a press that fails does not affect the others."""
    mesh, pose = job
    try:
        return sensor.press(mesh, pose=pose, force_n=force_n, model=model, threads=1, label="", **options)
    except (ConvergenceError, InputError) as error:
        return error.with_traceback(None)     # the traceback holds the press' matrices


def raise_first(results: list[Any]) -> list[PressResult]:
    """The results, or the first error among them."""
    for number, result in enumerate(results):
        if isinstance(result, SofttactError):
            raise type(result)(f"press {number} of {len(results)}: {result}")
    return results
