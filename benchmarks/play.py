"""Rates of `softtact play`: coarse and whole maps with all that a page is sent, and the time to the first map without any cache.

    python benchmarks/play.py
"""

import os
import subprocess
import sys
import time
from dataclasses import replace
from tempfile import TemporaryDirectory

import numpy as np
from record import write

from softtact.play import pictures
from softtact.play.solver import Solver
from softtact.play.state import Object, State
from softtact.studies.configuration import SHIPPED

OBJECTS = ("indenters/sphere", "indenters/bar", "unseen/s_form", "grasped/egg", "grasped/key")
FIRST = """
import time
start = time.perf_counter()
from pathlib import Path
from softtact.play.solver import Solver
from softtact.play.state import Object, State
Solver().solve(State({sensor!r}, Object(Path({file!r}), "mm")), draft=True)
print(time.perf_counter() - start)
"""


def rates(sensor, name, *, draft, count=30):
    """Milliseconds (median) while the object moves in small steps: of a map, of map and pictures, and of the latter the processor's
    time, which other programs on the machine do not lengthen."""
    solver, file = Solver(), SHIPPED / "objects" / f"{name}.stl"
    state = State(sensor, Object(file, "mm"))
    spent = []
    for number in range(-3, count):     # the first ones warm up
        start, used = time.perf_counter(), time.process_time()
        shown = solver.solve(replace(state, x_mm=0.05 * number, rotation_deg=(0.0, 0.0, float(number))), draft=draft)
        solved = time.perf_counter()
        pictures.board(shown.result, shown.clearance_mm)
        pictures.surface_mesh(shown.result).export(file_type="glb")
        if (tiles := pictures.taxel_mesh(shown.result)) is not None:
            tiles.export(file_type="glb")
        spent.append((solved - start, time.perf_counter() - start, time.process_time() - used))
    return (1e3 * np.median(spent[3:], axis=0)).tolist()


def first_map_s(sensor):
    """Seconds from the start of Python to the first map with an empty cache of sensors."""
    with TemporaryDirectory() as cache:
        script = FIRST.format(sensor=sensor, file=str(SHIPPED / "objects/indenters/sphere.stl"))
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", script], check=True, env=os.environ | {"XDG_CACHE_HOME": cache}, capture_output=True)
        return time.perf_counter() - start


def main():
    """Measure and record."""
    maps = {}
    for name in OBJECTS:
        for draft in (True, False):
            solved, shown, processor = rates("coro", name, draft=draft)
            maps[f"{name}, {'coarse' if draft else 'whole'}"] = {
                "map_ms": solved, "with_pictures_ms": shown, "processor_ms": processor, "per_s_of_one_core": 1e3 / processor}
            print(f"{name}, {'coarse' if draft else 'whole'}: {solved:.1f} ms, with pictures {shown:.1f} ms, "
                  f"of the processor {processor:.1f} ms")
    first = {sensor: first_map_s(sensor) for sensor in ("coro", "pad4x4")}
    print("first map, s:", first)
    write("play", maps=maps, first_map_s=first)


if __name__ == "__main__":
    main()
