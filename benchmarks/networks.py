"""Printed against compact network: `python benchmarks/networks.py FOLDER [EPOCHS]` from the project's folder.

A training step of 32 maps and one map alone, each architecture in a process of its own, on one thread; then both trained on the
data of `stand_in.py` (made in FOLDER on first use), in equal steps and, the compact one, in equal time. Times depend on the
machine and on what else it does: compare the ratios of one run. benchmarks/results/networks.json.
"""

import json
import resource
import statistics
import subprocess
import sys
import time
from pathlib import Path

import record
import torch
from stand_in import SEED, SOURCE, stand_in

from softtact.evaluation.networks import count_weights, time_of_a_map
from softtact.evaluation.scoring import score_samples, score_sensor, summarise_scores
from softtact.learning.network import summed_l1
from softtact.learning.settings import Training
from softtact.learning.training import prepare_torch, start_run, train_network

SSIM = {"window": 3, "data_range": 2400.0}
NETWORKS = {"printed": {"filters": (80, 95, 120), "dense": 570, "activation": "relu"}, "compact": {"architecture": "compact"}}
RATES = {"printed": 3e-4, "compact": 3e-3}    # of the first epoch; the printed one's lies in the middle of the search's range
BATCH, STEPS = 32, 5
TESTS = ("validation", "unseen", "grasps")


def measure(name, folder):
    """Seconds of a training step and of a map, weights, and this process' peak memory."""
    device, data = prepare_torch(threads=1), stand_in(Path(folder))
    run = start_run(data["train"], network=NETWORKS[name], learning_rate=RATES[name], seed=SEED, device=device)
    maps, counts = (torch.from_numpy(array[:BATCH]) for array in (data["train"].maps_mm, data["train"].counts))
    times = [step(run, maps, counts) for _ in range(STEPS + 1)][1:]      # the first one allocates
    return {"network": name, "weights": count_weights(run.network), "step_s": statistics.median(times),
            "map_s": time_of_a_map(run.network.eval(), data["train"].maps_mm),
            "memory_gb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6}


def step(run, maps, counts):
    """Seconds of one training step."""
    start = time.perf_counter()
    run.optimiser.zero_grad()
    summed_l1(run.network(maps), counts).backward()
    run.optimiser.step()
    return time.perf_counter() - start


def train(name, data, *, epochs, label):
    """Rows of scores after a training of `epochs`, and its seconds; the best epoch on the validation maps counts."""
    run = start_run(data["train"], network=NETWORKS[name], learning_rate=RATES[name], seed=SEED, device=prepare_torch(threads=1))
    records = list(train_network(run, data["train"], data["validation"], options=Training(epochs=epochs, patience=epochs),
                                 ssim=SSIM, seed=SEED, checkpoint=None, label=f"{name}, {label}"))
    run.network.load_state_dict(run.best["weights"])
    seconds = sum(entry["wall_time_s"] for entry in records)
    return [{"network": name, "training": label, "epochs": epochs, "seconds": round(seconds, 1), **row}
            for row in scores(run.network, data)], seconds


def scores(network, data):
    """Plain rows of the scores on each test, with intervals and the sensor's ceiling."""
    rows = []
    for name in TESTS:
        found = score_samples(network, data[name], ssim=SSIM)
        rows += summarise_scores(found, score_sensor(data[name], ssim=SSIM), seed=SEED).round(4).to_dict("records")
    return rows


def main(folder, epochs):
    """Measure, train, print and write benchmarks/results/networks.json."""
    data = stand_in(Path(folder))
    costs = [json.loads(subprocess.run([sys.executable, __file__, "--one", name, folder], capture_output=True, text=True,
                                       env=record.threads_of(1), check=True).stdout) for name in NETWORKS]
    print(*costs, sep="\n", flush=True)
    rows, seconds = train("printed", data, epochs=epochs, label="equal steps")
    compact, compact_s = train("compact", data, epochs=epochs, label="equal steps")
    longer, _ = train("compact", data, epochs=max(epochs, int(epochs * seconds / compact_s)), label="equal time")
    rows += compact + longer
    for row in rows:
        print(f"{row['network']:9}{row['training']:13}{row['epochs']:5}{row['seconds']:8.1f} s  {row['set']:11}{row['ssim']:.3f} "
              f"({row['ssim_low']:.3f} to {row['ssim_high']:.3f}){row['mae_counts']:8.2f} counts{row['overlap']:7.3f}", flush=True)
    print(record.write("networks", readings=SOURCE, maps={name: len(samples) for name, samples in data.items()},
                       batch_of_a_step=BATCH, torch=torch.__version__, costs=costs, rows=rows))


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        print(json.dumps(measure(*sys.argv[2:4])))
    else:
        main(sys.argv[1], int(sys.argv[2]) if sys.argv[2:] else 4)
