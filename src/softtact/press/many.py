"""Many presses at once: in parallel processes that share the sensor's prepared models, or as one batch on a GPU."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.underside import Underside
from softtact.contact.unilateral import not_settled
from softtact.devices import find_device
from softtact.errors import ConvergenceError, InputError, SofttactError
from softtact.geometry.meshes import check_over_sensor, place
from softtact.geometry.pose import Pose
from softtact.press.choice import models_to_prepare, with_expected_error
from softtact.press.fast import elastic_result, first_touch_mm, shell_stop_mm
from softtact.press.objects import SoftObject
from softtact.press.result import PressResult
from softtact.press.task import cores
from softtact.press.validity import flag_buried
from softtact.processes import map_in_processes
from softtact.progress import progress

if TYPE_CHECKING:
    from softtact.press.sensor import Sensor

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
    model, device = batch.model, batch.device
    if jobs and on_gpu(device, model) and sensor.spec.base_held and not sensor.spec.edge.far:   # no free lower side
        return press_batch(sensor, jobs, batch.force_n, device="cuda" if device == "auto" else device, workers=batch.workers,
                           label=batch.label)
    prepared = _PREPARED.get(model, ())
    if model == "auto" and sensor.spec.has_layers and sensor.spec.edge.far:
        prepared = ("elastic",)
    elif model == "auto":
        prepared = models_to_prepare(sensor, policy=batch.options.get("policy", "error"))
    for name in prepared:
        sensor.prepared(name)
    act = partial(_pressed, force_n=batch.force_n, model=model, options=batch.options)
    return list(progress(_each(sensor, act, jobs, batch.workers), label=batch.label, total=len(jobs)))


def on_gpu(device: str, model: str) -> bool:
    """Whether presses of a model run as one batch on a GPU, if one is requested or available; only the elastic model can."""
    if device == "cpu" or (device == "auto" and model != "elastic"):
        return False
    if model != "elastic":
        raise InputError(f"device={device!r}: only the elastic model presses on a GPU; leave it out for the model {model!r}.")
    return find_device(device) != "cpu"


def press_batch(sensor: "Sensor", jobs: list[tuple[trimesh.Trimesh, Pose | None]], force_n: np.ndarray, *, device: str,
                workers: int, label: str) -> list[Any]:
    """Presses of the elastic model as columns of one problem on a torch device; an error in the place of a press that fails.

    jobs: (mesh, pose) of each. Processes find their undersides.
    """
    from softtact.models.elastic.batch import press_layers

    compliance = sensor.prepared("elastic")
    undersides = list(_each(sensor, _underside, jobs, workers))
    results: list[Any] = [one if isinstance(one, SofttactError) else None for one in undersides]
    good = [number for number, one in enumerate(results) if one is None]
    start = time.perf_counter()
    presses = press_layers(compliance, [undersides[number].height for number in good], force_n, device=device)
    for number, press in zip(good, progress(presses, label=label, total=len(good)), strict=True):
        results[number] = _read(sensor, press, undersides[number], force_n, jobs[number])
    seconds = np.full(len(force_n), (time.perf_counter() - start) / max(1, len(good) * len(force_n)))
    return [one if isinstance(one, SofttactError) else replace(one, wall_time_s=seconds) for one in results]


@dataclass(frozen=True)
class _Underside:
    """An object over the sensor."""

    height: np.ndarray
    """(n,) in mm: over the grid's nodes."""
    touch_mm: float
    """Descent to first touch."""
    stop_mm: float
    """Descent until it rests on the shell."""
    top_mm: float
    """Height of its top over first touch."""


def _underside(sensor, job):
    mesh, pose = job
    try:
        placed = place(mesh, pose=pose)
        check_over_sensor(placed, sensor.spec.footprint_mm)
        grid = sensor.prepared_models["elastic"].grid
        surface, height = HeightField(placed), np.full(grid.count, NO_CONTACT_MM)
        points, touch = Underside(surface, grid).nodes(sensor.spec.thickness_mm), first_touch_mm(sensor, surface)
        height[points.nodes] = points.gap
        return _Underside(height=height, touch_mm=touch, stop_mm=shell_stop_mm(sensor, surface),
                          top_mm=placed.bounds[1, 2] - touch)
    except InputError as error:
        return error.with_traceback(None)


def _read(sensor, press, underside, force_n, job):
    if press.contact.depth[-1] > underside.stop_mm:     # rare: an object on the shell is pressed alone
        return _pressed(sensor, job, force_n=force_n, model="elastic", options={})
    settled = press.contact.settled
    if not settled.all():
        return ConvergenceError(not_settled(force_n[~settled][0]))
    result = elastic_result(sensor, press, force_n, np.zeros(len(force_n)), touch_mm=underside.touch_mm)
    return with_expected_error(sensor, flag_buried(result, underside.top_mm))


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
