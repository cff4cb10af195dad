"""Presses of many poses as the arrays of one batch: `press_batch`, and the results of `Sensor.press_many` with the elastic model.

The elastic model presses all of them together: undersides, maps, readings, flags and expected errors are arrays with a row for each
press; contacts are solved in turn on the processor, and all at once on a GPU. The foundation model presses one after the other, and
so does the elastic model on sensors that its batch does not serve (`together`).
"""

import time
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from copy import copy
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.contact.undersides import ObjectSurface, PosedUnderside
from softtact.devices import find_device
from softtact.errors import ConvergenceError, InputError, ShellWarning, SofttactError
from softtact.geometry.pose import Pose
from softtact.models.elastic.batch import press_layers
from softtact.models.elastic.compliance import Compliance
from softtact.press.choice import with_expected_error
from softtact.press.fast import elastic_result
from softtact.press.making import RESTS
from softtact.press.objects import target_of
from softtact.press.result import PressResult
from softtact.press.task import checked_forces, cores
from softtact.press.validity import flag_buried

if TYPE_CHECKING:
    from softtact.press.gradient import Gradient
    from softtact.press.sensor import Sensor

_AT_ONCE = {"cpu": 128, "cuda": 4096}     # load steps

# The arrays of a `PressBatch`, which are those of a `PressResult` with a press in place of a load step.
_OF_RESULT = ("deformation_map_mm", "thinning_map_mm", "normal_force_n", "pad_force_n", "indentation_mm", "contact_area_mm2",
              "penetration_mm", "expected_error_mm", "converged", "within_validity", "validity_reason")


@dataclass(frozen=True, kw_only=True)
class PressBatch:
    """Presses n of one force each. The rows of presses that failed hold zeros, and `validity_reason` says why."""

    deformation_map_mm: np.ndarray
    """(n, ny, nx) in mm: how far the sensing surface moved towards the board."""
    thinning_map_mm: np.ndarray
    """(n, ny, nx) in mm: how much thinner the layer is, as its taxels read it."""
    tactile_map: np.ndarray | None
    """(n, row, column) in counts, without noise; None where the sensor has no taxels."""
    normal_force_n: np.ndarray
    """(n,) in N: how hard each object was pressed, pad and shell together."""
    pad_force_n: np.ndarray
    """(n,) in N: the part that the pad carries; less where the object rests on the shell beside it."""
    indentation_mm: np.ndarray
    """(n,) in mm: descent of each object from first touch."""
    contact_area_mm2: np.ndarray
    """(n,) in mm2: area under pressure."""
    penetration_mm: np.ndarray
    """(n,) in mm: deepest overlap that the solver left."""
    expected_error_mm: np.ndarray
    """(n,) in mm: expected root mean square error of the map against the hyperelastic model; nan where it is not known."""
    converged: np.ndarray
    """(n,) bool: which presses have a result."""
    within_validity: np.ndarray
    """(n,) bool: whose numbers can be relied on."""
    validity_reason: np.ndarray
    """(n,) texts: why not, several reasons joined by "; ", or the sentence of the error; empty where valid."""
    errors: Mapping[int, SofttactError]
    """By the number of each press that failed; the others are not affected."""
    origin: "BatchOrigin | None" = field(default=None, repr=False, compare=False)
    """The sensor, the objects and their poses, for `gradient`; not sent to other processes."""

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"origin": None}      # whose sensor holds hundreds of megabytes

    def gradient(self, of: str = "tactile_map", by: str | Sequence[str] = ("pose", "force")) -> "Gradient":
        """Derivatives of the settled contacts, as of `PressResult.gradient`: a `Gradient` with a row for each press.

        The rows of presses without a gradient (failed, on the shell) are nan, and its `errors` say why. Raises InputError for
        unknown names, and for a batch that comes from another process or was pressed on a gel.
        """
        from softtact.press import gradient

        return gradient.gradient_of_batch(self, of, by)


@dataclass(frozen=True)
class BatchOrigin:
    """What a batch was of, for its gradient."""

    sensor: "Sensor"
    model: str
    """elastic or foundation."""
    surfaces: Sequence[ObjectSurface]
    """An object for each press."""
    poses: Sequence[Any]
    """Its pose, as it was given."""


def press_batch(sensor: "Sensor", surfaces: ObjectSurface | Sequence[ObjectSurface], poses: np.ndarray | Sequence[Any],
                force_n: np.ndarray | float, *, model: str = "elastic", device: str = "auto") -> PressBatch:
    """Press objects in poses (n, 6), each by one force; return the arrays of a `PressBatch`.

    surfaces: one object for all poses, or n of them;  poses: x, y, z in mm and rx, ry, rz in degrees, as `Pose.of` takes them
    force_n: one for all, or (n,), in N;  model: elastic or foundation;  device: cpu, cuda, or auto: a GPU where there is one
    An object that misses the sensor, a pose that is no pose, or a press that does not settle is an error in its place. One warning
    at most, with a count, says that objects rest on the shell. Raises InputError for other faults, such as a force out of range.
    """
    if isinstance(sensor, str | Path):
        raise InputError(f"press_batch: {str(sensor)!r} is a name; give softtact.load_sensor({str(sensor)!r}), loaded once.")
    sensor.spec.need_layers()
    listed = _listed(poses)
    every = _objects(surfaces, len(listed))
    forces = _forces(force_n, len(listed))
    checked_forces(np.unique(forces).tolist(), sensor.spec.force_range_n, sensor.spec.name)
    press: Callable[..., Iterator[Any]]
    if model == "elastic" and together(sensor):
        press = _pressed_together
    elif model in ("elastic", "foundation"):
        press = _pressed_in_turn
    else:
        raise InputError(f"model={model!r}: a batch is pressed by the elastic or the foundation model; use Sensor.press_many.")
    batch = _Batch(sensor, len(listed))
    for numbers, found in press(sensor, every, listed, forces[:, None], model=model, device=device):
        batch.take(numbers, found)
    warn_of_shells(sensor, batch.arrays["normal_force_n"], batch.arrays["pad_force_n"])
    return batch.finished(None if sensor.spec.edge.far else BatchOrigin(sensor, model, every, listed))


def _listed(poses):
    """The poses as a sequence, which later changes of an array leave as it is."""
    if isinstance(poses, np.ndarray) and poses.shape[1:] != (6,):
        raise InputError(f"press_batch: the poses have the shape {poses.shape}; give an array (n, 6) of x, y, z in mm and rx, ry, "
                         "rz in degrees.")
    poses = [copy(pose) for pose in poses] if isinstance(poses, Iterable) and not isinstance(poses, str) else [0.0]
    if any(np.isscalar(pose) for pose in poses):
        raise InputError("press_batch: the poses are not a list of poses; give an array (n, 6) of x, y, z in mm and rx, ry, rz in "
                         "degrees, also for one press.")
    return poses


def _objects(surfaces, count):
    """An `ObjectSurface` for each of `count` poses."""
    every = list(surfaces) if isinstance(surfaces, Iterable) else [surfaces] * count
    for one in every:
        if not isinstance(one, ObjectSurface):
            raise InputError(f"press_batch: an object is a {type(one).__name__}; give ObjectSurface(mesh), made once for a mesh.")
    if len(every) != count:
        raise InputError(f"There are {len(every)} objects and {count} poses; give one object for each pose, or one object.")
    return every


def _forces(force_n, count):
    """Forces (count,) in N."""
    try:
        forces = np.asarray(force_n, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"press_batch: force_n={force_n!r} is no number, nor one for each pose; give forces in N.") from None
    if forces.shape not in ((), (count,)):
        shown = f"There are {forces.size} forces" if forces.ndim == 1 else f"The forces have the shape {forces.shape}"
        raise InputError(f"{shown} and {count} poses; give one force for each pose, or one force.")
    return np.broadcast_to(forces, count)


def together(sensor: "Sensor") -> bool:
    """Whether the elastic model presses a sensor's batch together: its lower side is held, and all its readouts are ours,
    which read each load step by itself.
    """
    spec = sensor.spec
    if not (spec.has_layers and spec.base_held) or spec.edge.far:
        return False
    ours = all(type(readout).__module__.startswith("softtact.") for readout in sensor.readouts.values())
    return ours and type(sensor.prepared("elastic")) is Compliance


def batch_device(sensor: "Sensor", model: str, device: str, *, rigid: bool = True) -> str:
    """Where presses of a model run that were asked for on a device by its name: the processor alone, but in batches (`together`).

    rigid: whether all objects are.  Raises InputError for a GPU that would not be used; `auto` then is the processor.
    """
    if device != "cpu" and model == "elastic" and rigid and together(sensor):
        return find_device(device)
    if device not in ("cpu", "auto"):
        raise InputError(f"device={device!r}: only the elastic model presses on a GPU, rigid objects on sensors whose lower side "
                         f"and sides are held and whose readouts are softtact's; leave it out for the model {model!r} on "
                         f"{sensor.spec.name}.")
    return "cpu"


def press_together(sensor: "Sensor", surfaces: Sequence[ObjectSurface], poses: Sequence[Any], forces_n: np.ndarray, *,
                   device: str = "cpu") -> list[Any]:
    """The `PressResult` of each press through forces (l,) in N with the elastic model, or the error in its place."""
    results: list[Any] = [None] * len(surfaces)
    forces = np.tile(forces_n, (len(surfaces), 1))
    for numbers, found in _pressed_together(sensor, surfaces, poses, forces, device=device):
        for place, number in enumerate(numbers):
            results[number] = (found if isinstance(found, SofttactError)
                               else _part(found, slice(place * len(forces_n), (place + 1) * len(forces_n))))
    return results


def warn_of_shells(sensor: "Sensor", forces_n: np.ndarray, on_pad_n: np.ndarray) -> None:
    """One warning that counts the presses (n,) that rest on the shell, if any."""
    resting = int((forces_n - on_pad_n > RESTS * forces_n).sum())
    if resting:
        warnings.warn(f"In {resting} of {len(forces_n)} presses the object rests on the shell beside the pad, which carries a part "
                      f"of the force (`pad_force_n` is what the pad carries; {sensor.spec.edge.in_words}); if your sensor's shell "
                      "ends lower, state 'edge' in its file.", ShellWarning, stacklevel=3)


class _Batch:
    """The arrays of a batch while its presses end."""

    def __init__(self, sensor, count):
        self.count, self.errors, shape = count, {}, (count, *sensor.spec.map_shape)
        self.arrays = {name: np.zeros(shape if name.endswith("map_mm") else count) for name in _OF_RESULT}
        self.arrays["validity_reason"], self.arrays["expected_error_mm"] = np.full(count, "", dtype=object), np.full(count, np.nan)
        taxels = sensor.spec.taxels if "taxels" in sensor.readouts else None
        self.counts = None if taxels is None else np.zeros((count, taxels.rows, taxels.columns))

    def take(self, numbers, found):
        """Keep the result of the presses `numbers`, whose load steps they are, or the error of one of them."""
        if isinstance(found, SofttactError):
            self.errors[int(numbers[0])] = found
            self.arrays["validity_reason"][numbers] = str(found)
            return
        for name, array in self.arrays.items():
            array[numbers] = getattr(found, name)
        if self.counts is not None:
            self.counts[numbers] = found.tactile_map

    def finished(self, origin):
        flags = {name: self.arrays[name] > 0 for name in ("converged", "within_validity")}
        reasons = np.array(self.arrays["validity_reason"].tolist(), dtype=str)
        return PressBatch(**self.arrays | flags | {"validity_reason": reasons}, tactile_map=self.counts, errors=self.errors,
                          origin=origin)


def _pressed_in_turn(sensor, surfaces, poses, forces_n, *, model, device):
    """([number], its result or error) of each press."""
    batch_device(sensor, model, device)
    for number, (surface, pose, force) in enumerate(zip(surfaces, poses, forces_n, strict=True)):
        with warnings.catch_warnings():      # the batch counts them
            warnings.simplefilter("ignore", ShellWarning)
            try:
                found: Any = sensor.press(surface.mesh, pose=pose, force_n=force, model=model, threads=1, label="")
            except (ConvergenceError, InputError) as error:
                found = error.with_traceback(None)
        yield [number], found


def _pressed_together(sensor, surfaces, poses, forces_n, *, device, model="elastic"):
    """(numbers of presses, their result, with all their load steps in turn) or ([number], its error), in parts."""
    device = find_device(device)
    compliance = sensor.prepared("elastic")
    target = target_of(sensor, compliance.grid)
    at_once = max(1, _AT_ONCE["cpu" if device == "cpu" else "cuda"] // forces_n.shape[1])
    for first in range(0, len(surfaces), at_once):
        start, some = time.perf_counter(), range(first, min(first + at_once, len(surfaces)))
        undersides = _undersides(surfaces, poses, some, target, threads=1 if device == "cpu" else cores())
        yield from (([number], one) for number, one in zip(some, undersides, strict=True) if isinstance(one, InputError))
        good = [number for number, one in zip(some, undersides, strict=True) if isinstance(one, PosedUnderside)]
        if good:
            objects = [one for one in undersides if isinstance(one, PosedUnderside)]
            yield from _read(sensor, compliance, good, objects, forces_n[good], device, start)


def _undersides(surfaces, poses, some, target, *, threads):
    """The underside of each of some presses, or its error; threads serve, as the compiled function runs without Python's lock."""
    def of(number):
        try:
            return surfaces[number].over(target, Pose.of(poses[number]))
        except InputError as error:
            return error.with_traceback(None)

    if threads == 1:
        return [of(number) for number in some]
    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(of, some))


def _read(sensor, compliance, numbers, objects, forces_n, device, start):
    """(numbers, their result), and the errors of those that did not settle, of presses through forces (p, l)."""
    load_steps = forces_n.shape[1]
    press, errors = press_layers(compliance, objects, forces_n, device=device)
    yield from (([numbers[k]], error) for k, error in errors.items())
    good = np.setdiff1d(np.arange(len(numbers)), list(errors))
    if not len(good):
        return
    columns = (good[:, None] * load_steps + np.arange(load_steps)).ravel()
    touch, top = (np.repeat([getattr(objects[k], name) for k in good], load_steps) for name in ("touch_mm", "top_mm"))
    seconds = np.full(len(columns), (time.perf_counter() - start) / len(columns))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ShellWarning)
        result = elastic_result(sensor, press.columns(columns), forces_n[good].ravel(), seconds, touch_mm=touch, presses=len(good))
    yield [numbers[k] for k in good], with_expected_error(sensor, flag_buried(result, top))


def _part(result: PressResult, steps: slice) -> PressResult:
    """A result of some of its load steps."""
    arrays = {one.name: getattr(result, one.name)[steps] for one in fields(result)
              if one.metadata.get("dimensions", ())[:1] == ("step",) and getattr(result, one.name) is not None}
    readings = {name: values.isel(step=steps) for name, values in result.readings.items()}
    return replace(result, **arrays, readings=readings, wall_time_s=result.wall_time_s[steps])
