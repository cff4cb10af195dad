"""Seconds of a press to 50 N on each mesh: `python benchmarks/press.py [--device cuda] [OBJECT.stl ...]` from the project's folder.

With `--device cuda` elements are summed up on a GPU and beside it, in turns, on the processor (benchmarks/results/press_cuda.json).

Preparation that is done once per process (compiled kernels) is made before the clock starts; building the body belongs to it.
Each press runs in a process of its own, whose peak memory is told. Times depend on the machine and on what else it does:
compare the ratios of one run.
"""

import argparse
import itertools
import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import record

import softtact
from softtact.devices import find_device
from softtact.geometry.meshes import read_mesh
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.newton import NewtonSettings

OBJECTS = ["config/objects/indenters/circle_m.stl"]
MESHES = {"production": MeshSettings(), "draft": MeshSettings.draft(), "fine": MeshSettings.fine()}
CASES = [("draft", 20, 2, "cpu"), ("production", 5, 2, "cpu"), ("production", 20, 2, "cpu"), ("fine", 5, 2, "cpu"),
         ("fine", 20, 2, "cpu"), ("production", 20, 1, "cpu")]
BESIDE_GPU = [(mesh, 20, 2, device) for mesh in ("draft", "production", "fine") for device in ("cpu", "cuda")]
LARGEST_N = 50.0


def measure(file, mesh, load_steps, threads, device):
    """One press in this process: seconds, iterations, memory, and where it went."""
    sensor, body = softtact.load_sensor("coro"), read_mesh(file, unit="mm")
    sensor.device = device
    sensor.mesh, sensor.solver = MESHES[mesh], NewtonSettings.draft() if mesh == "draft" else NewtonSettings()
    sensor.press(body, force_n=[0.5], model="hyperelastic", threads=threads)
    start = time.perf_counter()
    result = sensor.press(body, force_n=np.linspace(LARGEST_N / load_steps, LARGEST_N, load_steps), model="hyperelastic",
                          threads=threads)
    return {"object": Path(file).stem, "mesh": mesh, "levels": load_steps, "threads": threads, "device": device,
            "solver": result.solver, "seconds": round(time.perf_counter() - start, 2), "iterations": int(result.iterations.sum()),
            "indentation_mm": round(float(result.indentation_mm[-1]), 5), "residual_n": float(result.residual_n.max()),
            "overlap_um": round(1e3 * float(result.penetration_mm.max()), 3),
            "memory_gb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6, 2)}


def main(files, device):
    """Print a row per object and case (mesh, load steps, threads, device), and write the record after each."""
    rows, path = [], "No press was made."
    cases, name, head = CASES, "press", {}
    if device != "cpu":
        import torch
        cases, name, head = BESIDE_GPU, "press_cuda", {"device": torch.cuda.get_device_name()}
    print(f"{'object':12}{'mesh':12}{'levels':>7}{'threads':>8}{'device':>8}{'seconds':>9}", "iterations memory, GB")
    for file, case in itertools.product(files, cases):
        run = subprocess.run([sys.executable, __file__, "--one", file, *map(str, case)], capture_output=True, text=True,
                             env=record.threads_of(1), check=False)
        if run.returncode:
            print(file, *case, run.stderr.strip().splitlines()[-1], flush=True)
            continue
        row = json.loads(run.stdout)
        rows.append(row)
        print(f"{row['object']:12}{row['mesh']:12}{row['levels']:7}{row['threads']:8}{row['device']:>8}{row['seconds']:9.1f}"
              f"{row['iterations']:11}{row['memory_gb']:11.2f}", flush=True)
        path = record.write(name, **head, rows=rows)
    print(path)


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        file, mesh, load_steps, threads, device = sys.argv[2:]
        print(json.dumps(measure(file, mesh, int(load_steps), int(threads), device)))
    else:
        parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
        parser.add_argument("objects", nargs="*", default=OBJECTS, metavar="OBJECT.stl")
        parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu")
        given = parser.parse_args()
        main(given.objects, find_device(given.device, library="warp"))
