"""How many maps does a network need? The same training on growing, nested subsets of the training maps."""

import math

import pandas as pd

from softtact.evaluation.scoring import score_samples
from softtact.learning.training import start_run, train_network

COLUMNS = ["maps", "epochs", "set", "ssim", "mae_counts", "overlap"]


def learning_curve(train, validation, tests, *, sizes, steps, network, options, ssim, seed, device):
    """Mean scores of networks trained on the first `sizes` maps of one shuffled order: a frame with COLUMNS, a row a size and set.

    tests {set: samples};  network, ssim as for `start_run` and `train_network`;  options: a `Training` with its learning rate
    steps: of the optimiser, as near as whole epochs allow, so that a large set is not also trained for longer
    """
    rows = []
    for size in sizes:
        part = train.subset(size, seed=seed)      # nested: each size's maps are among those of the next
        epochs = max(1, round(steps / math.ceil(len(part) / options.batch)))
        run = start_run(part, network=network, learning_rate=options.learning_rate, seed=seed, device=device)
        settings = options.model_copy(update={"epochs": epochs, "patience": epochs})
        for _ in train_network(run, part, validation, options=settings, ssim=ssim, seed=seed, checkpoint=None,
                               label=f"{len(part)} maps"):
            pass
        run.network.load_state_dict(run.best["weights"])
        for name, samples in tests.items():
            means = score_samples(run.network, samples, ssim=ssim)[COLUMNS[3:]].mean()
            rows.append({"maps": len(part), "epochs": epochs, "set": name, **means})
    return pd.DataFrame(rows, columns=COLUMNS)
