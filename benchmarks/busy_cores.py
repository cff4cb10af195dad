"""What a second thread of BLAS does to presses of the elastic model and to gradients where others want the cores.

    python benchmarks/busy_cores.py      (two minutes; writes benchmarks/results/busy_cores.json)

Presses and gradients take one thread (`linalg.workers.on_one_thread`). Here they take one, or as many as there are cores, in turns,
on idle cores and beside one busy process for each core; medians by the clock. The busy ones only count, so they ask for no memory.
Expected: on idle cores alike, on busy ones several times as long with all threads.
"""

import multiprocessing
import statistics
import time
import warnings
from contextlib import contextmanager, nullcontext
from unittest.mock import patch

import numpy as np
import record
from calibration import PRESSES

import softtact
from softtact.calibration.ladder import LEVELS, placed_at
from softtact.linalg import workers
from softtact.linalg.workers import threads_of_blas
from softtact.press.ladder import even_in_root
from softtact.press.task import cores

TIMES = 5
NAMES = {1: "ball", 2: "bar", 3: "punch"}     # of PRESSES


def count():
    """Keep a core busy."""
    while True:
        pass


@contextmanager
def busy(number):
    """That many busy processes beside."""
    others = [multiprocessing.Process(target=count, daemon=True) for _ in range(number)]
    for one in others:
        one.start()
    try:
        yield
    finally:
        for one in others:
            one.terminate()


def seconds(function, threads):
    """By the clock, with this many threads of BLAS."""
    with patch.object(workers, "one_thread_each", nullcontext), threads_of_blas(threads):
        start = time.perf_counter()
        function()
        return time.perf_counter() - start


def rows_of(sensor, others):
    """Medians (s) of each object: a press of one force, and a gradient of nine load steps by the place."""
    for number, name in NAMES.items():
        mesh, (x, y, angle), forces = PRESSES[number]
        centred, pose = placed_at(mesh, (0.0, 0.0, 0.0)), [x, y, 0, 0, 0, angle]

        def press(force_n, centred=centred, pose=pose):
            return sensor.press(centred, pose=pose, force_n=force_n, model="elastic", label="")

        result = press(even_in_root(float(max(forces)), LEVELS))
        for what, function in (("press", lambda press=press: press([10.0])),
                               ("gradient", lambda result=result: result.gradient("deformation_map", ["x", "y", "rz"]))):
            function()     # compiles
            found = np.array([[seconds(function, threads) for threads in (1, cores())] for _ in range(TIMES)])
            one, all_threads = (round(statistics.median(column), 4) for column in found.T)
            yield {"what": what, "object": name, "others": others, "one_thread_s": one, "all_threads_s": all_threads}


def main():
    warnings.simplefilter("ignore")
    sensor, rows = softtact.load_sensor("coro"), []
    sensor.prepared("elastic")
    for others in (0, cores()):
        with busy(others):
            for row in rows_of(sensor, others):
                print(row, flush=True)
                rows.append(row)
    record.write("busy_cores", threads=cores(), rows=rows)


if __name__ == "__main__":
    main()
