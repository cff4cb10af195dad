"""Seconds of twenty load steps to 50 N with the fast models, and presses per second: `python benchmarks/fast_models.py` from the
project's folder; `--many N` presses as many random poses of ten indenters (default 1000, of one load step each), over one and two
processes; 0 keeps what the record holds of them. With `--device cuda` only these presses are made, by the elastic model: in one
process, in one for each core, and as one batch on the GPU (benchmarks/results/fast_models_cuda.json).

Preparation that is made once per sensor, and compiled kernels, are made before the clock starts. Times depend on the machine and on
what else it does: compare the ratios of one run.
"""

import argparse
import resource
import time
from pathlib import Path

import numpy as np
import record
import torch

import softtact
from softtact.errors import ConvergenceError
from softtact.geometry.meshes import default_pose, read_mesh
from softtact.geometry.pose import Pose
from softtact.press.task import cores

MODELS = ("elastic", "foundation")
FORCES = np.linspace(2.5, 50.0, 20)
MANY = ("circle_m", "circle_xs", "square", "star", "cruz", "donut_m", "triangle", "sphere", "bordes_h", "echo_x")


def twenty_load_steps(sensor, files):
    """Seconds of each model and object; the better of two, since the first may wait for others."""
    rows = []
    for file in files:
        mesh, row = read_mesh(file, unit="mm"), {"object": file.stem}
        for model in MODELS:
            try:
                row[model] = round(min(_seconds(sensor, mesh, model) for _ in range(2)), 3)
            except ConvergenceError as error:
                row |= {model: None, "stopped": str(error)}
        rows.append(row)
        seconds = "".join(f"{row[model] or np.nan:12.3f}" for model in MODELS)
        print(f"{row['object']:16}{seconds} {row.get('stopped', '')}", flush=True)
    return rows


def _seconds(sensor, mesh, model):
    start = time.perf_counter()
    sensor.press(mesh, force_n=FORCES, model=model, label="")
    return time.perf_counter() - start


def many(sensor, count, ways):
    """Presses per second of random poses, for each way: (model, device, processes)."""
    meshes, poses = random_presses(count)
    rows, maps = [], {}
    for model, device, workers in ways:
        for batch in sorted({min(batch, count) for batch in (10, 100, count)}):
            start = time.perf_counter()
            results = sensor.press_many(meshes[:batch], poses[:batch], force_n=[20.0], model=model, workers=workers, device=device,
                                        failures="keep", label="")
            seconds = time.perf_counter() - start
            failed = sum(isinstance(result, Exception) for result in results)
            rows.append({"model": model, "device": device, "workers": workers, "batch": batch,
                         "per_second": round(batch / seconds, 2), "failed": failed, "memory_gb": _memory_gb(),
                         "gpu_memory_gb": round(torch.cuda.max_memory_allocated() / 1e9, 2) if device == "cuda" else None})
            print(rows[-1], flush=True)
        maps[device] = {k: result.deformation_map_mm for k, result in enumerate(results) if not isinstance(result, Exception)}
    return rows, maps


def random_presses(count, *, seed=1):
    """(meshes, poses): ten indenters in turns, each in a pose of its own."""
    rng = np.random.default_rng(seed)
    named = [read_mesh(f"config/objects/indenters/{name}.stl", unit="mm") for name in MANY]
    meshes = [named[k % len(named)] for k in range(count)]
    return meshes, [_random_pose(mesh, rng) for mesh in meshes]


def on_gpu(sensor, count):
    """The elastic model's presses on the processor and on the GPU, and how far their maps lie apart."""
    meshes, poses = random_presses(2)
    sensor.press_many(meshes, poses, force_n=[20.0], model="elastic", device="cuda", label="")     # starts CUDA
    processes = cores()
    rows, maps = many(sensor, count, [("elastic", "cpu", 1), ("elastic", "cpu", processes), ("elastic", "cuda", processes)])
    apart = max(float(np.abs(maps["cuda"][k] - maps["cpu"][k]).max()) for k in maps["cuda"].keys() & maps["cpu"].keys())
    print(record.write("fast_models_cuda", device=torch.cuda.get_device_name(), many=rows, largest_difference_mm=apart))


def _random_pose(mesh, rng):
    """Tilted by up to 5 degrees, turned about z, and moved by up to 4 mm; its lowest point touches."""
    angles = (*rng.uniform(-5, 5, 2), rng.uniform(-180, 180))
    turned = mesh.copy()
    turned.vertices = Pose.from_values((0, 0, 0, *angles)).apply(mesh.vertices)
    move = default_pose(turned).translation_mm + np.array([*rng.uniform(-4, 4, 2), 0.0])
    return Pose.from_values((*move, *angles))


def _memory_gb():
    """Largest resident memory of this process and of the largest of those it started."""
    return round(sum(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)) / 1e6, 2)


def main():
    """Measure, print, and write benchmarks/results/fast_models.json, or with `--device cuda` fast_models_cuda.json."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--many", type=int, default=1000, metavar="N", help="random poses (default: 1000; 0: as recorded)")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help="cuda: many presses on a GPU and beside it")
    options = parser.parse_args()
    sensor, prepared = softtact.load_sensor("coro"), {}
    if options.device == "cuda":
        on_gpu(sensor, options.many)
        return
    for model in MODELS:
        start = time.perf_counter()
        sensor.prepared(model)
        prepared[model] = round(time.perf_counter() - start, 1)
    files = sorted(Path("config/objects/indenters").glob("*.stl"))
    _seconds(sensor, read_mesh(files[0], unit="mm"), "foundation"), _seconds(sensor, read_mesh(files[0], unit="mm"), "elastic")
    rows = twenty_load_steps(sensor, files)
    median = {model: float(np.median([row[model] for row in rows if row[model]])) for model in MODELS}
    print("median", median)
    ways = [(model, "cpu", workers) for model in MODELS for workers in (1, 2)]
    record.write("fast_models", prepared_or_loaded_s=prepared, load_steps=len(FORCES), seconds=rows, median_s=median,
                 many=many(sensor, options.many, ways)[0] if options.many else record.read("fast_models")["many"])


if __name__ == "__main__":
    main()
