"""How the hyperelastic press's cost grows with the sensor: `python benchmarks/scaling.py` from the project's folder, some minutes.

Sensors of 4 x 4 to 30 x 50 frusta of the default pitch under the same flat punch. Each part of one Newton iteration is timed at
the pressed state, on one thread and on two; the least of three.
"""

import itertools
import resource
import time

import numpy as np
import record
import trimesh
from threadpoolctl import threadpool_limits

import softtact
from softtact.contact.height_field import HeightField
from softtact.geometry.meshes import place
from softtact.models.hyperelastic.path import press_load_steps
from softtact.press.sensor import Sensor

SENSORS = ((4, 4), (8, 8), (12, 16), (18, 30), (30, 50))
PUNCH = trimesh.creation.cylinder(radius=2.0, height=2.0, sections=48)
FORCE_N = 4.0


def sensor_of(counts):
    """The default sensor with so many frusta."""
    full = softtact.load_sensor("coro")
    side = tuple(count * full.spec.dielectric.frusta.pitch_mm for count in counts)
    return Sensor(full.spec.model_copy(update={"footprint_mm": side}), full.laws)


def least(function, repeats=3):
    """Least seconds of some calls."""
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def parts_of_iteration(counts, threads):
    """Seconds of each part of an iteration, with the number of unknowns."""
    start = time.perf_counter()
    body = sensor_of(counts).body(threads=threads, surface=HeightField(place(PUNCH, pose=None)))
    built = time.perf_counter() - start
    start = time.perf_counter()
    load_step, = press_load_steps(body, HeightField(place(PUNCH, pose=None)), [FORCE_N])
    pressed = time.perf_counter() - start
    state, cells, slab = load_step.state, body.cells, body.slab
    everyone = np.arange(cells.count)

    def condense():
        cells.forget()
        cells.refresh(state, workers=body.workers)

    matrix = slab.tangent(state.slab, cells.outer, workers=body.workers)
    right = np.ones(len(slab.unknowns))
    row = {"frusta": len(everyone), "threads": threads, "solver": body.solver.name, "iterations": load_step.iterations,
           "unknowns_global": len(slab.unknowns),
           "unknowns_all": len(slab.free) + cells.count * (len(body.support.inner)),
           "build_s": built, "press_s": pressed, "condense_s": least(condense),
           "assemble_s": least(lambda: slab.tangent(state.slab, cells.outer, workers=body.workers)),
           "factor_s": least(lambda: body.solver.factor(matrix)), "solve_s": least(lambda: body.solver.solve(right)),
           "residual_s": least(lambda: body.evaluate(state.slab.displacement, state.support.displacement, state.indentation,
                                                     state.slab.projection)),
           "memory_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6}
    body.close()
    return row


def main():
    """Print a row per sensor and number of threads, and write benchmarks/results/scaling.json."""
    rows = []
    names = ("frusta", "threads", "unknowns_all", "unknowns_global", "build_s", "press_s", "iterations", "condense_s", "assemble_s",
             "factor_s", "solve_s", "residual_s", "memory_gb")
    print("".join(f"{name:>16}" for name in names))
    with threadpool_limits(limits=1):
        for counts, threads in itertools.product(SENSORS, (1, 2)):
            row = parts_of_iteration(counts, threads)
            row = {name: round(value, 4) if isinstance(value, float) else value for name, value in row.items()}
            rows.append(row)
            print("".join(f"{row[name]:16}" for name in names), flush=True)
    print(record.write("scaling", rows=rows))


if __name__ == "__main__":
    main()
