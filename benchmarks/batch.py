"""Presses per second of batches (`press_batch`), and their ratio to presses one by one: `python benchmarks/batch.py` from the
project's folder, within five minutes; on the processor, and on a GPU where torch finds one.

Random poses and forces (1 to 20 N) of ten indenters. Before each batch some of its presses are made one by one, so that both meet
the same machine: compare the ratios. On the processor a process' own time counts, of one core; on a GPU the time that passes.
Batches that do not fit into the five minutes are left out. `parts_s`: where the time of a batch of 256 goes.
"""

import argparse
import cProfile
import pstats
import time
import warnings

import numpy as np
import record
import torch
from fast_models import random_presses

import softtact
from softtact.contact.undersides import ObjectSurface
from softtact.errors import ShellWarning
from softtact.linalg.workers import threads_of_blas
from softtact.press.batch import press_batch

SIZES, IN_TURN = (1, 64, 256, 1024, 4096), 4     # presses of a batch; presses one by one before it
LONGEST_S = {"elastic": 75.0, "foundation": 20.0}     # of one batch
READ = "readings, flags and expected errors"
PARTS = {"undersides": "_undersides", "contact and fields": "press_layers", "of it the compliance among points": "among",
         "of it products in double precision": "double", "of it products in single precision": "single",
         "of it the stencil": "apply_stencil", READ: "_read"}      # `_read` calls the contact, too; products of the processor


def rows_of(sensor, model, device, clock, sizes):
    """A row for each size of batch: presses per second one by one and in the batch, and the ratio."""
    rows, meshes, poses, forces = [], *random_presses(max(sizes)), np.random.default_rng(2).uniform(1, 20, max(sizes))
    surfaces = prepared(meshes)
    press_batch(sensor, surfaces[:2], poses[:2], forces[:2], model=model, device=device)     # compiles, and starts CUDA
    for size in sizes:
        start = clock()
        for mesh, pose, force in list(zip(meshes, poses, forces, strict=True))[:IN_TURN]:
            sensor.press(mesh, pose=pose, force_n=force, model=model, threads=1, label="")
        middle = clock()
        alone = IN_TURN / (middle - start)
        if size / (rows[-1]["per_second"] if rows else alone) > LONGEST_S[model]:
            break
        batch = press_batch(sensor, surfaces[:size], poses[:size], forces[:size], model=model, device=device)
        per_second = size / (clock() - middle)
        rows.append({"model": model, "device": device, "batch": size, "per_second": round(per_second, 2),
                     "alone_per_second": round(alone, 2), "ratio": round(per_second / alone, 2), "failed": len(batch.errors)})
        print(rows[-1], flush=True)
    return rows


def prepared(meshes):
    """The `ObjectSurface` of each press; presses of one mesh share it."""
    found = {id(mesh): ObjectSurface(mesh) for mesh in meshes}
    return [found[id(mesh)] for mesh in meshes]


def parts_of(sensor, device, size=256):
    """Seconds of the parts of an elastic batch, each with what it calls, and of the whole."""
    meshes, poses = random_presses(size)
    surfaces, profile = prepared(meshes), cProfile.Profile()
    profile.runcall(press_batch, sensor, surfaces, poses, 10.0, device=device)
    spent = {name: cumulative for (_, _, name), (_, _, _, cumulative, _) in pstats.Stats(profile).stats.items()}
    seconds = {part: round(spent.get(name, 0.0), 3) for part, name in PARTS.items()}
    return seconds | {READ: round(seconds[READ] - seconds["contact and fields"], 3), "whole": round(spent["press_batch"], 3)}


def main():
    """Measure, print, and write benchmarks/results/batch.json, or batch_cuda.json where there is a GPU."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--largest", type=int, default=max(SIZES), metavar="N",
                        help="largest batch; smaller on a busy machine (default: %(default)s)")
    largest = parser.parse_args().largest
    sizes = [size for size in SIZES if size <= largest]
    sensor, gpu = softtact.load_sensor("coro"), torch.cuda.is_available()
    torch.set_num_threads(1)
    warnings.simplefilter("ignore", ShellWarning)
    with threads_of_blas(1):
        rows = [row for model in LONGEST_S for row in rows_of(sensor, model, "cpu", time.process_time, sizes)]
        parts = {"cpu": parts_of(sensor, "cpu")}
    if gpu:
        rows += rows_of(sensor, "elastic", "cuda", time.perf_counter, sizes)
        parts["cuda"] = parts_of(sensor, "cuda")
    print(parts)
    print(record.write("batch_cuda" if gpu else "batch", device=torch.cuda.get_device_name() if gpu else None, rows=rows,
                       parts_s=parts))


if __name__ == "__main__":
    main()
