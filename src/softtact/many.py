"""Many presses at once, over processes: each core presses on its own, on what the sensor prepared once."""

import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from itertools import repeat

from softtact.errors import ConvergenceError, InputError, SofttactError
from softtact.progress import progress

_PREPARED = {"elastic": ("elastic",), "foundation": ("foundation",), "hyperelastic": (), "auto": ("elastic", "foundation")}


def press_many(sensor, meshes, poses, force_n, *, model, workers, label, options):
    """See `Sensor.press_many`."""
    jobs = list(zip(meshes, poses, strict=True))
    for name in _PREPARED.get(model, ()):
        sensor.prepared(name)
    workers = min(workers, len(jobs))
    if workers <= 1:
        return list(progress((_one(sensor, job, force_n, model, options) for job in jobs), label=label, total=len(jobs)))
    # A forked process shares the prepared arrays; where there is no fork each gets its copy.
    context = multiprocessing.get_context("fork" if "fork" in multiprocessing.get_all_start_methods() else "spawn")
    with ProcessPoolExecutor(workers, mp_context=context, initializer=_begin, initargs=(sensor,)) as pool:
        results = pool.map(_in_process, jobs, repeat(force_n), repeat(model), repeat(options),
                           chunksize=max(1, len(jobs) // (8 * workers)))
        return list(progress(results, label=label, total=len(jobs)))


def _begin(sensor):
    global _sensor     # one for each process, which presses with nothing else
    _sensor = sensor


def _in_process(job, force_n, model, options):
    return _one(_sensor, job, force_n, model, options)


def _one(sensor, job, force_n, model, options):
    """A result, or the error in its place: one press that fails does not lose the others."""
    mesh, pose = job
    try:
        return sensor.press(mesh, pose=pose, force_n=force_n, model=model, threads=1, label="", **options)
    except (ConvergenceError, InputError) as error:
        return error.with_traceback(None)     # its frames hold the press' matrices


def raise_first(results):
    """The results, or the first error among them."""
    for number, result in enumerate(results):
        if isinstance(result, SofttactError):
            raise type(result)(f"press {number} of {len(results)}: {result}")
    return results
