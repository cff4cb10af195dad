"""The networks: a deformation map in, 28 tactile counts out.

`printed`, the paper's section 3.3.2 layer by layer: three 2 x 2 convolutions (80, 95, 120 filters, no padding), each
followed by 2 x 2 max-pooling with stride 1; a hidden layer of 570 neurons with ReLU; 28 linear outputs. 94.3 million
weights, nearly all between the last pool and the hidden layer. The paper is silent on the convolutions' activation:
ReLU by default.

`compact`, structured like the sensor: a count is the mean, over one electrode, of an increasing function of the deformation (the
plates come closer), with a gain and an offset. So it has local features, their mean over each taxel, a convolution over
neighbouring taxels, and an affine map for each taxel. It has 60 thousand weights; except near the borders, which are padded with
zeros, only this affine map depends on the taxel's position.

Inside a network, maps and counts are divided by two constants of the training set, so that both are of order one. The constants
are stored with the weights; input and output are in mm and counts.
"""

import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from torch import nn

import softtact
from softtact.checksums import checked
from softtact.errors import InputError
from softtact.files import atomic_path
from softtact.inputs import check_input, check_limit


class Resumable(Protocol):
    """A training that goes on from the contents of a checkpoint."""

    def load_state(self, state: dict[str, Any]) -> None:
        """Continue from `state`."""


class TactileNetwork(nn.Module):
    """The printed network: deformation maps (n, y, x) in mm to tactile maps (n, row, column) in counts."""

    architecture = "printed"
    map_scale_mm: torch.Tensor
    count_scale: torch.Tensor

    def __init__(self, *, map_shape: Sequence[int], taxels: Sequence[int], filters: Sequence[int] = (80, 95, 120), dense: int = 570,
                 activation: str = "relu", map_scale_mm: float = 1.0, count_scale: float = 1.0) -> None:
        super().__init__()
        self.options = {"map_shape": list(map_shape), "taxels": list(taxels), "filters": list(filters),
                        "dense": dense, "activation": activation}
        channels = [1, *filters]
        self.features = nn.Sequential(*[
            layer for n_in, n_out in zip(channels, filters, strict=False) for layer in block(n_in, n_out, activation)])
        # Pooling in the other order takes four times as long on a CPU.
        self.features.to(memory_format=torch.channels_last)  # type: ignore[call-overload]    # its types leave it out
        lost = 2 * len(filters)  # a 2 x 2 convolution and a 2 x 2 pool with stride 1 each remove one row and one column
        height, width = (side - lost for side in map_shape)
        self.hidden = nn.Linear(filters[-1] * height * width, dense)
        self.output = nn.Linear(dense, taxels[0] * taxels[1])
        self.register_buffer("map_scale_mm", torch.tensor(float(map_scale_mm)))
        self.register_buffer("count_scale", torch.tensor(float(count_scale)))

    def forward(self, maps_mm: torch.Tensor) -> torch.Tensor:        # (n, 57, 33) mm
        x = self.features(maps_mm[:, None] / self.map_scale_mm)      # (n, 120, 51, 27)
        x = torch.relu(self.hidden(x.flatten(1)))                    # (n, 570)
        x = self.output(x) * self.count_scale                        # (n, 28) counts
        return x.unflatten(1, self.options["taxels"])                # (n, 7, 4) counts


def block(n_in: int, n_out: int, activation: str) -> tuple[nn.Module, nn.Module, nn.Module]:
    """Convolution, its activation, and a pool: each (n, c, h, w) loses two rows and two columns."""
    middle = {"relu": nn.ReLU, "linear": nn.Identity}[activation]
    return nn.Conv2d(n_in, n_out, kernel_size=2), middle(), nn.MaxPool2d(kernel_size=2, stride=1)


class CompactNetwork(nn.Module):
    """The compact network: deformation maps (n, y, x) in mm to tactile maps (n, row, column) in counts.

    filters: of the convolution on the map's grid, of the one that halves it, and of the one on the half grid
    """

    architecture = "compact"
    rows: torch.Tensor
    columns: torch.Tensor
    map_scale_mm: torch.Tensor
    count_scale: torch.Tensor

    def __init__(self, *, map_shape: Sequence[int], taxels: Sequence[int], filters: Sequence[int] = (16, 32, 64),
                 map_scale_mm: float = 1.0, count_scale: float = 1.0) -> None:
        super().__init__()
        if not all(side % 2 for side in map_shape):
            raise InputError(f"the compact network: a map of {map_shape[0]} x {map_shape[1]} points cannot be halved while "
                             "both borders are kept; give odd sides.")
        self.options = {"map_shape": list(map_shape), "taxels": list(taxels), "filters": list(filters)}
        fine, half, deep = filters
        self.features = nn.Sequential(                                       # zero padding 1: no row or column is lost
            nn.Conv2d(1, fine, kernel_size=3, padding=1), nn.ReLU(),
            nn.Conv2d(fine, half, kernel_size=3, padding=1, stride=2), nn.ReLU(),  # every second point, borders included
            nn.Conv2d(half, deep, kernel_size=3, padding=1), nn.ReLU())
        self.neighbours = nn.Conv2d(deep, deep, kernel_size=3, padding=1)
        self.reading = nn.Conv2d(deep, 1, kernel_size=1)
        self.gain, self.offset = nn.Parameter(torch.ones(*taxels)), nn.Parameter(torch.zeros(*taxels))
        for name, side, parts in zip(("rows", "columns"), map_shape, taxels, strict=True):
            weights = torch.tensor(taxel_weights(side // 2 + 1, parts), dtype=torch.float32)
            self.register_buffer(name, weights, persistent=False)
        self.register_buffer("map_scale_mm", torch.tensor(float(map_scale_mm)))
        self.register_buffer("count_scale", torch.tensor(float(count_scale)))

    def forward(self, maps_mm: torch.Tensor) -> torch.Tensor:        # (n, 57, 33) mm
        x = self.features(maps_mm[:, None] / self.map_scale_mm)      # (n, 64, 29, 17)
        x = self.rows @ x @ self.columns.T                           # (n, 64, 7, 4) means over each taxel
        x = self.reading(torch.relu(self.neighbours(x)))[:, 0]       # (n, 7, 4)
        return (self.gain * x + self.offset) * self.count_scale      # (n, 7, 4) counts


def taxel_weights(points: int, parts: int) -> np.ndarray:
    """Weights (parts, points) of the mean over `parts` equal parts of a side, linear between its `points`."""
    t = np.linspace(0, points - 1, parts + 1)[:, None] - np.arange(points)   # from each point to each part's ends
    left, right = np.clip(t + 1, 0, 1), np.clip(t, 0, 1)
    integral = 0.5 * left**2 + right - 0.5 * right**2                        # of each point's hat function
    return np.diff(integral, axis=0) * parts / (points - 1)


ARCHITECTURES = {network.architecture: network for network in (TactileNetwork, CompactNetwork)}


def summed_l1(predicted: torch.Tensor, measured: torch.Tensor) -> torch.Tensor:
    """The paper's equation 1: |difference| in counts summed over a map's taxels; the mean over the maps (n, 7, 4)."""
    return (predicted - measured).abs().sum(dim=(1, 2)).mean()


def predict(network: nn.Module, maps_mm: np.ndarray, *, batch: int = 64) -> np.ndarray:
    """Tactile maps (n, row, column) in counts, as numpy, of deformation maps (n, y, x) in mm.

    Equal maps, which are common among repeated trials, are evaluated once.
    """
    device = next(network.parameters()).device
    maps, inverse = np.unique(np.asarray(maps_mm, dtype=np.float32), axis=0, return_inverse=True)
    network.eval()
    with torch.inference_mode():
        tactile = torch.cat([network(part.to(device)).cpu() for part in torch.from_numpy(maps).split(batch)]).numpy()
    return tactile[inverse.ravel()]


def save_network(path: str | Path, network: nn.Module, *, facts: dict[str, Any]) -> None:
    """Write weights, options and `facts` (plain values: model, seed, epoch, ...); equal networks give equal bytes."""
    weights = {name: tensor.detach().cpu() for name, tensor in network.state_dict().items()}
    save(path, {"architecture": network.architecture, "options": network.options, "weights": weights,
                "facts": {**facts, "softtact_version": softtact.__version__}})


def load_network(path: str | Path) -> tuple[nn.Module, dict[str, Any]]:
    """(network, facts) of a file that `save_network` wrote, on the CPU; only tensors and plain values are accepted."""
    stored = load(path)
    try:
        network = ARCHITECTURES[stored.get("architecture", TactileNetwork.architecture)](**stored["options"])
        network.load_state_dict(stored["weights"])
        return network.eval(), stored["facts"]
    except (AttributeError, KeyError, TypeError, RuntimeError) as error:
        raise InputError(f"{path}: it holds no network of {', '.join(ARCHITECTURES)} ({_reason(error)}); "
                         "give a model.pt that a training wrote.") from None


def save(path: str | Path, stored: dict[str, Any]) -> None:
    """Write a dictionary of tensors and plain values, completely or not at all."""
    with atomic_path(path) as temporary, open(temporary, "wb") as file:
        torch.save(stored, file)  # into an open file: given a path, torch writes the file's name into the bytes


def load(path: str | Path) -> dict[str, Any]:
    """Read a file of `save`. Raises InputError for a file with anything but tensors and plain values."""
    check_input(path, "arrays", missing="there is no such file; train the network first.")
    try:
        with checked(path), zipfile.ZipFile(path) as parts:
            check_limit(path, "arrays", sum(one.file_size for one in parts.infolist()))
            return torch.load(path, map_location="cpu", weights_only=True)
    except InputError:
        raise
    except Exception:  # torch passes on any error of its unpickler, with advice to load the file although it may run code
        raise InputError(f"{path}: not a network's file: it is damaged, or holds more than tensors and plain values; take a copy "
                         "of it, or train again.") from None


def resume(run: Resumable, checkpoint: Path | None, owner: str) -> None:
    """Load `checkpoint` into `run` if it exists and belongs to the owner."""
    if checkpoint is not None and Path(checkpoint).exists():
        state = load(checkpoint)
        if state["owner"] == owner:
            run.load_state(state)


def _reason(error):
    """The first line of an exception's message."""
    return next(iter(str(error).splitlines()), type(error).__name__)
