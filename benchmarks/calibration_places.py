"""How maps change with an object's place: the differences of presses that `calibrate` takes, against the adjoint's derivatives.

    python benchmarks/calibration_places.py      (some minutes; writes benchmarks/results/calibration_places.json)

The objects and forces of benchmarks/calibration.py, nine load steps each. Both ways give the change of the maps per mm along x and
y and per degree. They are judged by what a fit needs: the map at a place drawn beside (0.4 mm, 0.4 mm, 1.5 degrees), predicted from
the map at the stated one. The error of a prediction is over that of no prediction at all, so 1 is useless. Times are the
processor's, one way after the other. Expected: a gradient of the foundation model costs more than three presses, and its
derivative, with the points under pressure held, predicts sharp edges worse than differences over half a millimetre.
"""

import time
import warnings

import numpy as np
import record
from calibration import PRESSES

import softtact
from softtact.calibration.ladder import LEVELS, placed_at
from softtact.calibration.problem import _OFF
from softtact.press.ladder import even_in_root

MOVED = (0.4, 0.4, 1.5)     # mm, mm and degrees: standard deviations of a place, as in benchmarks/calibration.py
NAMES = ("plate", "ball", "bar", "punch")


def timed(function):
    """A function's result and its seconds of the processor."""
    start = time.process_time()
    return function(), time.process_time() - start


def compared(sensor, model, number):
    """The row of one object."""
    mesh, place, levels = PRESSES[number]
    centred, place = placed_at(mesh, (0.0, 0.0, 0.0)), np.array(place, dtype=float)
    forces = even_in_root(float(max(levels)), LEVELS)

    def press(at, force_n=forces):
        x, y, angle = at
        return sensor.press(centred, pose=[x, y, 0, 0, 0, angle], force_n=force_n, model=model, threads=1, label="")

    here = press(place)

    def by_differences():
        return np.stack([(press(place + step * axis).deformation_map_mm - here.deformation_map_mm) / step
                         for step, axis in zip(_OFF, np.eye(3), strict=True)])

    def by_gradient():
        return np.moveaxis(here.gradient(of="deformation_map", by=["x", "y", "rz"]).values, -1, 0)

    away = np.random.default_rng([number, 7]).normal(0, MOVED, (3, 3))
    there = [press(place + one).deformation_map_mm - here.deformation_map_mm for one in away]
    row = {"model": model, "object": NAMES[number]}
    press(place, forces[:1]).gradient(of="deformation_map", by=["x", "y", "rz"])     # compiles
    for way, function in (("differences", by_differences), ("gradient", by_gradient)):
        rates, seconds = timed(function)
        left = [np.linalg.norm(change - np.tensordot(one, rates, 1)) / np.linalg.norm(change)
                for one, change in zip(away, there, strict=True) if change.any()]      # a plate over the whole pad changes nothing
        row |= {f"{way}_s": round(seconds, 3), f"{way}_left": round(float(np.mean(left)), 3) if left else None}
    return row


def main():
    warnings.simplefilter("ignore")
    sensor, rows = softtact.load_sensor("coro"), []
    for model in ("elastic", "foundation"):
        sensor.prepared(model)
        for number in range(len(PRESSES)):
            rows.append(compared(sensor, model, number))
            print(rows[-1], flush=True)
    record.write("calibration_places", rows=rows)


if __name__ == "__main__":
    main()
