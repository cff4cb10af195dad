"""The learning rate of one network, found by short trainings of it: the rate of another architecture does not carry over."""

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from softtact.errors import ConvergenceError, InputError
from softtact.learning.training import start_run, train_network
from softtact.progress import announce

if TYPE_CHECKING:
    import torch

    from softtact.learning.samples import Samples
    from softtact.learning.settings import Training

COLUMNS = ["learning_rate", "epochs", "train_loss", "validation_loss"]


def try_rates(train: "Samples", validation: "Samples", *, network: dict[str, Any], options: "Training", ssim: dict[str, Any],
              seed: int, device: "torch.device | str") -> pd.DataFrame:
    """A row with COLUMNS for each of the options' `rates`: the same first weights, `rate_epochs` along the options' schedule.

    The losses, in counts, are those of the last epoch: nan where the training ran away.
    """
    trial = options.model_copy(update={"epochs": options.rate_epochs, "patience": options.rate_epochs})
    rows = []
    for rate in options.rates:
        announce(f"learning rate for {train.model}: {rate:g}")
        run = start_run(train, network=network, learning_rate=rate, seed=seed, device=device)
        try:
            last = list(train_network(run, train, validation, options=trial, ssim=ssim, seed=seed, checkpoint=None,
                                      label=f"rate {rate:g}"))[-1]
        except ConvergenceError:     # too high a rate is a finding, not a failure of the trial
            last = {"train_loss": np.nan, "validation_loss": np.nan}
        rows.append({"learning_rate": rate, "epochs": run.epoch, "train_loss": last["train_loss"],
                     "validation_loss": last["validation_loss"]})
    return pd.DataFrame(rows, columns=COLUMNS)


def best_rate(table: pd.DataFrame) -> float:
    """The rate of `try_rates` with the smallest validation loss."""
    finite = table[np.isfinite(table.validation_loss)]
    if not len(finite):
        raise InputError(f"the learning rate: none of training.rates, {', '.join(f'{rate:g}' for rate in table.learning_rate)}, "
                         "reached a finite validation loss; give lower ones.")
    return float(finite.learning_rate[finite.validation_loss.idxmin()])
