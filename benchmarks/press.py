"""Seconds per press of each model, on one core: `python benchmarks/press.py [OBJECT.stl ...]` from the project's folder.

Preparation that is done once per sensor (the elastic layer's flexibility) or once per process (compiled kernels) is made
before the clock starts. Times depend on the machine and on what else it does: compare the ratios of one run.
"""

import sys
import time
from pathlib import Path

import softtact
from softtact.geometry.meshes import read_mesh

FORCES_N = [5, 10, 20, 35, 50]
OBJECTS = ["config/objects/indenters/circle_m.stl", "config/objects/grasped/object_5.stl"]


def main(files):
    """Print a row per object and model."""
    sensor = softtact.load_sensor("coro")
    for model in ("elastic", "hyperelastic"):   # compile and fill the cache
        sensor.press(read_mesh(files[0], unit="mm"), force_n=[1.0], model=model)
    print(f"{'object':20}{'model':15}{'levels':>8}{'seconds':>10}{'iterations':>12}")
    for file in files:
        mesh = read_mesh(file, unit="mm")
        for model in ("elastic", "hyperelastic"):
            start = time.perf_counter()
            result = sensor.press(mesh, force_n=FORCES_N, model=model)
            seconds = time.perf_counter() - start
            print(f"{Path(file).stem:20}{model:15}{len(FORCES_N):8}{seconds:10.2f}{result.iterations.sum():12}", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or OBJECTS)
