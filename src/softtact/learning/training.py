"""The training loop of one network, and the search for its learning rate.

The order of the maps depends only on the seed and the epoch, and a checkpoint holds everything else, so an interrupted training
ends with the same weights as an uninterrupted one. On a CPU, the same seed and number of threads give the same bytes. The learning
rate is found by short trainings, since the rate of another architecture does not carry over.
"""

import contextlib
import ctypes
import math
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import torch

from softtact.errors import ConvergenceError, InputError
from softtact.files import digest
from softtact.learning.network import ARCHITECTURES, predict, resume, save, summed_l1
from softtact.progress import announce, progress
from softtact.readout.ssim import map_ssim

if TYPE_CHECKING:

    from softtact.learning.dataset import Samples
    from softtact.learning.settings import Training

COLUMNS = ["learning_rate", "epochs", "train_loss", "validation_loss"]
_M_MMAP_MAX, _M_TRIM_THRESHOLD = -4, -1     # options of mallopt in the C library's malloc.h


@dataclass
class Run:
    """A network in training, i.e. the contents of a checkpoint.

    history: a record per epoch;  best: epoch, validation_loss and weights of the best one so far
    """

    network: torch.nn.Module
    optimiser: torch.optim.Optimizer
    history: list = field(default_factory=list)
    best: dict = field(default_factory=lambda: {"epoch": 0, "validation_loss": math.inf, "weights": {}})

    @property
    def epoch(self) -> int:
        """Epochs done."""
        return len(self.history)

    def state(self) -> dict[str, Any]:
        """Tensors and plain values of the run."""
        return {"network": self.network.state_dict(), "optimiser": self.optimiser.state_dict(),
                "history": self.history, "best": self.best}

    def load_state(self, state: dict[str, Any]) -> None:
        """Continue from `state`."""
        self.network.load_state_dict(state["network"])
        self.optimiser.load_state_dict(state["optimiser"])
        self.history, self.best = state["history"], state["best"]


def prepare_torch(*, threads: int, device: str = "cpu") -> torch.device:
    """Set the number of threads, request deterministic kernels, and let freed memory stay at hand; return the torch device."""
    torch.set_num_threads(threads)
    _keep_freed_memory()
    name = device if device != "auto" else "cuda" if torch.cuda.is_available() else "cpu"
    os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")  # required for deterministic matrix products in CUDA
    # Not every version has a deterministic kernel for the gradient of pooling on a GPU: a warning there, an error on a CPU.
    torch.use_deterministic_algorithms(True, warn_only=name == "cuda")
    # A help in debugging only: it writes every new tensor once more.
    torch.utils.deterministic.fill_uninitialized_memory = False     # type: ignore[attr-defined]
    return torch.device(name)


def _keep_freed_memory():
    """Keep the memory of freed tensors in the process, in large pages, where the C library is GNU's.

    In each step the printed network's gradient, 377 MB, is allocated anew: to return and clear its pages took a third of the step.
    """
    os.environ.setdefault("THP_MEM_ALLOC_ENABLE", "1")     # torch's own switch, read at the first allocation
    with contextlib.suppress(AttributeError, OSError):     # another C library has no mallopt
        mallopt = ctypes.CDLL(None).mallopt
        mallopt(_M_MMAP_MAX, 0)
        mallopt(_M_TRIM_THRESHOLD, 2**31 - 1)


def start_run(train: "Samples", *, network: dict[str, Any], learning_rate: float, seed: int, device: torch.device | str) -> Run:
    """A `Run` with initial weights; the greatest deformation and count of the training set become the network's scales.

    network: dict of the architecture (default: printed) and its options: filters, for the printed one also dense and activation
    """
    torch.manual_seed(seed)
    options = dict(network)
    make = ARCHITECTURES[options.pop("architecture", "printed")]
    model = make(map_shape=train.maps_mm.shape[1:], taxels=train.counts.shape[1:], **options,
                 map_scale_mm=_largest(train.maps_mm), count_scale=_largest(train.counts)).to(device)
    # The fused update makes one pass over the 94 million weights; the plain one takes as long as the gradients.
    return Run(model, torch.optim.Adam(model.parameters(), lr=learning_rate, fused=True))


def train_network(run: Run, train: "Samples", validation: "Samples", *, options: "Training", ssim: dict[str, Any], seed: int,
                  checkpoint: Path | None, label: str = "training") -> Iterator[dict[str, Any]]:
    """Train `run` for the epochs of `options` (a `Training`), or until patience ends; yield a record per epoch.

    checkpoint: file to resume from, if it belongs to this training, and to write to; None for no file
    ssim: window and data_range of the SSIM in the records
    Raises ConvergenceError if a loss is not finite.
    """
    data = _tensors(train, run)
    rate = run.optimiser.param_groups[0]["lr"]
    owner = training_digest(run, train, validation, options, ssim, seed)
    resume(run, checkpoint, owner)
    saved = time.monotonic()
    while run.epoch < options.epochs and not out_of_patience(run, options.patience):
        start = time.monotonic()
        record = {"epoch": run.epoch + 1, "learning_rate": scheduled_rate(rate, run.epoch, options)}
        record["train_loss"] = train_epoch(run, *data, rate=record["learning_rate"], batch=options.batch, seed=seed,
                                           label=epoch_label(label, run, options))
        record |= validate(run.network, validation, ssim)
        if not math.isfinite(record["validation_loss"]):
            raise ConvergenceError(f"{label}, epoch {record['epoch']}: the validation loss is not finite at learning rate "
                                   f"{rate:g}; lower the learning rate.")
        record["wall_time_s"] = time.monotonic() - start
        keep_best(run, record)
        run.history.append(record)
        if checkpoint is not None and time.monotonic() - saved >= options.checkpoint_every_s:
            save(checkpoint, {"owner": owner, **run.state()})
            saved = time.monotonic()
        yield record


def train_epoch(run: Run, maps_mm: torch.Tensor, counts: torch.Tensor, *, rate: float, batch: int, seed: int, label: str) -> float:
    """One pass over the maps in the order of seed and epoch; returns the mean loss in counts before each step."""
    run.network.train()
    run.optimiser.param_groups[0]["lr"] = rate
    order = torch.from_numpy(np.random.default_rng([seed, run.epoch]).permutation(len(maps_mm))).to(maps_mm.device)
    total = 0.0
    for chosen in progress(order.split(batch), label=label):
        loss = summed_l1(run.network(maps_mm[chosen]), counts[chosen])
        run.optimiser.zero_grad()
        loss.backward()
        run.optimiser.step()
        total += loss.item() * len(chosen)
    if not math.isfinite(total):
        raise ConvergenceError(f"{label}: the loss is not finite at learning rate {rate:g}; lower the learning rate.")
    return total / len(maps_mm)


def epoch_label(label: str, run: Run, options: "Training") -> str:
    """A line of progress for the current epoch."""
    so_far = f", validation loss {run.history[-1]['validation_loss']:.0f} counts" if run.history else ""
    return f"{label}, epoch {run.epoch + 1} of {options.epochs}{so_far}"


def validate(network: torch.nn.Module, samples: "Samples", ssim: dict[str, Any]) -> dict[str, float]:
    """Loss in counts and mean SSIM of a network on `samples`."""
    predicted = predict(network, samples.maps_mm)
    loss = summed_l1(torch.from_numpy(predicted), torch.from_numpy(samples.counts)).item()
    return {"validation_loss": loss, "validation_ssim": float(map_ssim(predicted, samples.counts, **ssim).mean())}


def scheduled_rate(rate: float, epoch: int, options: "Training") -> float:
    """Learning rate of an epoch, counted from 0: constant, or half a cosine from `rate` towards 0."""
    return rate if options.schedule == "constant" else rate * 0.5 * (1 + math.cos(math.pi * epoch / options.epochs))


def keep_best(run: Run, record: dict[str, float]) -> None:
    """Copy the weights if the epoch's validation loss is the smallest so far."""
    if record["validation_loss"] < run.best["validation_loss"]:
        weights = {name: tensor.detach().to("cpu", copy=True) for name, tensor in run.network.state_dict().items()}
        run.best = {"epoch": record["epoch"], "validation_loss": record["validation_loss"], "weights": weights}


def out_of_patience(run: Run, patience: int) -> bool:
    """Whether the last `patience` epochs did not improve the validation loss."""
    return run.epoch - run.best["epoch"] >= patience


def training_digest(run: Run, train: "Samples", validation: "Samples", options: "Training", ssim: dict[str, Any], seed: int) -> str:
    """Hash of data and settings, so that a training does not resume from the checkpoint of another."""
    choices = options.model_dump(exclude={"checkpoint_every_s", "threads"})
    rate = run.optimiser.param_groups[0]["lr"]
    network = [run.network.architecture, run.network.options]
    return digest([choices, rate, ssim, seed, network, train.digest(), validation.digest(), torch.__version__])


def _tensors(samples, run):
    device = next(run.network.parameters()).device
    return torch.from_numpy(samples.maps_mm).to(device), torch.from_numpy(samples.counts).to(device)


def _largest(array):
    """Largest magnitude, or 1 for an array of zeros."""
    return float(np.abs(array).max()) or 1.0


def try_rates(train: "Samples", validation: "Samples", *, network: dict[str, Any], options: "Training", ssim: dict[str, Any],
              seed: int, device: "torch.device | str") -> pd.DataFrame:
    """A row with COLUMNS for each of the options' `rates`: a training of `rate_epochs` epochs from the same initial weights.

    The losses in counts are those of the last epoch; nan if the training diverged.
    """
    trial = options.model_copy(update={"epochs": options.rate_epochs, "patience": options.rate_epochs})
    rows = []
    for rate in options.rates:
        announce(f"learning rate for {train.model}: {rate:g}")
        run = start_run(train, network=network, learning_rate=rate, seed=seed, device=device)
        try:
            last = list(train_network(run, train, validation, options=trial, ssim=ssim, seed=seed, checkpoint=None,
                                      label=f"rate {rate:g}"))[-1]
        except ConvergenceError:     # a learning rate that is too high is a result, not a failure of the trial
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
