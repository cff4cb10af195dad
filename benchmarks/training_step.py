"""A training step of each network beside the least time that arithmetic and memory allow: `python benchmarks/training_step.py`.

One thread, processor time, steps of 16 and of 32 maps, peak memory so far; half a minute. Floor of the printed network:
multiplications and additions of the forward pass, three times (values, gradients of values and of weights), at the rate of a large
matrix product here, and the traffic of Adam's four arrays (weights and two moments read and written, gradients read: 28 bytes a
weight) at that of a large sum here. Writes benchmarks/results/training_step.json.
"""

import resource
import statistics
import time
from functools import partial

import numpy as np
import record
import torch

from softtact.learning.network import ARCHITECTURES, predict, summed_l1
from softtact.learning.training import prepare_torch

MAP, TAXELS, BATCHES, STEPS = (57, 33), (7, 4), (16, 32), 6
BYTES_OF_A_WEIGHT = 28


def processor_s(work, repeats):
    """Median processor time of `work`, after a first call that allocates."""
    work()
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return statistics.median(times)


def costs(name, maps, counts):
    """Processor time per map in training steps, and read alone; peak memory of this process."""
    network = ARCHITECTURES[name](map_shape=MAP, taxels=TAXELS)
    optimiser = torch.optim.Adam(network.parameters(), lr=1e-4, fused=True)

    def step(batch):
        summed_l1(network(torch.from_numpy(maps[:batch])), torch.from_numpy(counts[:batch])).backward()
        optimiser.step()
        optimiser.zero_grad()

    train = {batch: processor_s(partial(step, batch), STEPS) / batch for batch in BATCHES}
    network.eval()
    return {"network": name, "train_map_s": train, "predict_map_s": processor_s(lambda: predict(network, maps), 3) / len(maps),
            "weights": sum(weights.numel() for weights in network.parameters()), "flop_of_a_map": flop(network),
            "peak_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)}


def flop(network):
    """Multiplications and additions of a forward pass of one map in its convolutions and linear layers."""
    found = []

    def count(layer, _, out):
        each = layer.weight[0].numel() if isinstance(layer, torch.nn.Conv2d) else layer.in_features
        found.append(2 * each * out[0].numel())

    hooks = [layer.register_forward_hook(count) for layer in network.modules()
             if isinstance(layer, torch.nn.Conv2d | torch.nn.Linear)]
    network(torch.zeros(1, *MAP))
    for hook in hooks:
        hook.remove()
    return sum(found)


def machine():
    """GFLOP/s of a matrix product in single precision, and GB/s of a sum of arrays, of one thread."""
    a, b = torch.rand(2, 2048, 2048)
    x, y = torch.rand(2, 50_000_000)
    return {"gflop_s": 2e-9 * len(a)**3 / processor_s(lambda: a @ b, 5),
            "gb_s": 3e-9 * x.nbytes / processor_s(lambda: x.add_(y), 5)}


def main():
    """Measure, print and write the record."""
    prepare_torch(threads=1)
    torch.manual_seed(0)
    rng = np.random.default_rng(0)
    maps = rng.random((256, *MAP)).astype(np.float32)
    counts = 1000 * rng.random((max(BATCHES), *TAXELS)).astype(np.float32)
    rates, rows = machine(), []
    for name in ARCHITECTURES:
        row = costs(name, maps, counts)
        arithmetic = 3e-9 * row["flop_of_a_map"] / rates["gflop_s"]
        traffic = 1e-9 * BYTES_OF_A_WEIGHT * row["weights"] / rates["gb_s"]
        floor = {batch: arithmetic + traffic / batch for batch in BATCHES}
        over = {batch: row["train_map_s"][batch] / floor[batch] for batch in BATCHES}
        rows.append(row | {"floor_map_s": floor, "over_floor": over})
        print(rows[-1])
    record.write("training_step", rates=rates, torch=torch.__version__, rows=rows)


if __name__ == "__main__":
    main()
