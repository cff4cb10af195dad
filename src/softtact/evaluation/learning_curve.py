"""How many maps does a network need? The same training on growing, nested subsets of the training maps."""

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import pandas as pd

from softtact.evaluation.scoring import interval_over_objects, score_samples
from softtact.learning.training import start_run, train_network

if TYPE_CHECKING:
    import torch

    from softtact.learning.samples import Samples
    from softtact.learning.settings import Training

COLUMNS = ["maps", "epochs", "set", "ssim", "ssim_low", "ssim_high", "mae_counts", "overlap"]


def learning_curve(train: "Samples", validation: "Samples", tests: "dict[str, Samples]", *, sizes: Iterable[int], steps: int,
                   network: dict[str, Any], options: "Training", ssim: dict[str, Any], seed: int,
                   device: "torch.device | str") -> pd.DataFrame:
    """Mean scores of networks trained on the first `sizes` maps of one shuffled order: a frame with COLUMNS, a row a size and set.

    tests {set: samples};  network, ssim as for `start_run` and `train_network`;  options: a `Training` with its learning rate
    ssim_low, ssim_high: 95 % interval of the mean over objects and trials, not over seeds of the training
    steps: of the optimiser, as near as whole epochs allow, so that a large set is not also trained for longer
    """
    rows = []
    for size in sizes:
        part = train.subset(size, seed=seed)      # nested: each size's maps are among those of the next
        epochs = max(1, round(steps / math.ceil(len(part) / options.batch)))
        run = start_run(part, network=network, learning_rate=options.learning_rate,     # type: ignore[arg-type]
                        seed=seed, device=device)
        settings = options.model_copy(update={"epochs": epochs, "patience": epochs})
        for _ in train_network(run, part, validation, options=settings, ssim=ssim, seed=seed, checkpoint=None,
                               label=f"{len(part)} maps"):
            pass
        run.network.load_state_dict(run.best["weights"])
        for name, samples in tests.items():
            scores = score_samples(run.network, samples, ssim=ssim)
            low, high = interval_over_objects(scores, seed=seed)
            rows.append({"maps": len(part), "epochs": epochs, "set": name, "ssim_low": low, "ssim_high": high,
                         **scores[["ssim", "mae_counts", "overlap"]].mean()})
    return pd.DataFrame(rows, columns=COLUMNS)
