"""The training of a generator of camera images against its discriminator: loss, schedule, steps, checkpoints.

Printed: L = L_adv + 100 L_L1, Adam with rate 2e-4 and momenta .5 and .999, 20 epochs, the rate constant for 10, then linear to 0.
A step takes one sequence; the network `pix2pix` takes as many frames of all sequences in random order. The order depends only on
seed and epoch, random numbers only on seed and step, and a checkpoint holds everything else, so an interrupted training ends with
the same weights as an uninterrupted one.
"""

import math
import os
import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from softtact.errors import ConvergenceError, InputError
from softtact.files import digest
from softtact.learning.image_data import ImageSequences, from_network, to_network
from softtact.learning.image_networks import ImageGenerator, PatchDiscriminator, adversarial_loss, count_weights
from softtact.learning.image_settings import ImageTraining
from softtact.learning.network import resume, save
from softtact.progress import Watch

# Measured: 0.20 GB of the reduced networks with 26 frames, 0.59 GB with 208, 1.52 GB of the printed ones with 2.
_BYTES_PER_WEIGHT = 20      # weight, gradient, two moments in float32, and what the optimiser needs for a while
_KEPT_COPIES = 2.5          # of each layer's output until the gradients are known
_ALWAYS_GB = 0.1


@dataclass
class ImageRun:
    """Two networks in training, i.e. the contents of a checkpoint."""

    generator: ImageGenerator
    discriminator: PatchDiscriminator
    optimisers: dict[str, torch.optim.Optimizer]
    """Of `generator` and `discriminator`."""
    steps: int = 0
    """Steps done."""
    sums: dict[str, float] = field(default_factory=dict)
    """Losses summed over the steps of the current epoch."""
    history: list[dict[str, float]] = field(default_factory=list)
    """A record per epoch: epoch, learning_rate, and the means of the losses before each step."""

    def state(self) -> dict[str, Any]:
        """Tensors and plain values of the run."""
        return {"generator": self.generator.state_dict(), "discriminator": self.discriminator.state_dict(),
                "optimisers": {name: one.state_dict() for name, one in self.optimisers.items()},
                "steps": self.steps, "sums": self.sums, "history": self.history}

    def load_state(self, state: dict[str, Any]) -> None:
        """Continue from `state`."""
        self.generator.load_state_dict(state["generator"])
        self.discriminator.load_state_dict(state["discriminator"])
        for name, one in self.optimisers.items():
            one.load_state_dict(state["optimisers"][name])
        self.steps, self.sums, self.history = state["steps"], state["sums"], state["history"]


def start_image_run(generator: ImageGenerator, discriminator: PatchDiscriminator, options: ImageTraining, *, seed: int,
                    device: torch.device | str = "cpu") -> ImageRun:
    """A run with weights drawn as in Pix2Pix from the seed: normal, standard deviation 0.02; the LSTM's as torch draws them."""
    torch.manual_seed(seed)
    for network in (generator, discriminator):
        network.apply(_draw_weights)
    networks = {"generator": generator.to(device), "discriminator": discriminator.to(device)}
    optimisers: dict[str, torch.optim.Optimizer] = {
        name: torch.optim.Adam(network.parameters(), lr=options.learning_rate, betas=options.momenta, fused=True)
        for name, network in networks.items()}
    return ImageRun(generator, discriminator, optimisers)


def _draw_weights(module: nn.Module) -> None:
    if isinstance(module, nn.Conv3d | nn.ConvTranspose3d):
        nn.init.normal_(module.weight, 0.0, 0.02)
        if module.bias is not None:
            nn.init.zeros_(module.bias)
    elif isinstance(module, nn.BatchNorm3d):
        nn.init.normal_(module.weight, 1.0, 0.02)
        nn.init.zeros_(module.bias)
    elif isinstance(module, nn.LSTM):
        module.reset_parameters()


def rate_at(options: ImageTraining, epochs_done: float) -> float:
    """The learning rate after so many epochs, a fraction of one included."""
    falling = max(options.epochs - options.constant_epochs, 1e-9)
    return options.learning_rate * min(1.0, max(0.0, (options.epochs - epochs_done) / falling))


def train_step(run: ImageRun, depth: torch.Tensor, image: torch.Tensor, options: ImageTraining) -> dict[str, float]:
    """One step of both networks on depth and camera images (b, n, y, x, 3); the losses before it.

    The discriminator's loss is halved, as in Pix2Pix, so that it learns more slowly than the generator.
    """
    run.generator.train(), run.discriminator.train()
    made = run.generator(depth)
    judged = 0.5 * (adversarial_loss(run.discriminator(depth, image), real=True) +
                    adversarial_loss(run.discriminator(depth, made.detach()), real=False))
    _descend(run.optimisers["discriminator"], judged)
    run.discriminator.requires_grad_(False)     # its gradients are not needed below
    fooled, l1 = adversarial_loss(run.discriminator(depth, made), real=True), (made - image).abs().mean()
    _descend(run.optimisers["generator"], fooled + options.l1_weight * l1)
    run.discriminator.requires_grad_(True)
    return {"discriminator": judged.item(), "adversarial": fooled.item(), "l1": l1.item()}


def _descend(optimiser: torch.optim.Optimizer, loss: torch.Tensor) -> None:
    optimiser.zero_grad()
    loss.backward()
    optimiser.step()


def train_images(run: ImageRun, data: ImageSequences, *, options: ImageTraining, seed: int, checkpoint: Path | None = None,
                 label: str = "training") -> Iterator[dict[str, float]]:
    """Train for the epochs of `options` on sequences; yield a record per epoch.

    checkpoint: file to resume from, if it belongs to this training, and to write to; None for no file
    Raises ConvergenceError if a loss is not finite.
    """
    device = next(run.generator.parameters()).device
    owner = _training_digest(run, data, options, seed)
    resume(run, checkpoint, owner)
    watch, saved = Watch(label), time.monotonic()
    for _ in range(len(run.history), options.epochs):
        batches = _batches(data, options, seed=seed, epoch=len(run.history))
        for number in range(run.steps - len(run.history) * len(batches), len(batches)):
            rate = rate_at(options, run.steps / len(batches))
            for optimiser in run.optimisers.values():
                optimiser.param_groups[0]["lr"] = rate
            torch.manual_seed(seed + 1_000_003 * (run.steps + 1))      # of dropout; a resumed run draws the same
            depth, image = data.tensors(batches[number])
            losses = train_step(run, depth.to(device), image.to(device), options)
            if not all(map(math.isfinite, losses.values())):
                raise ConvergenceError(f"{label}: a loss is not finite after {run.steps} steps; lower learning_rate.")
            run.steps += 1
            run.sums = {name: run.sums.get(name, 0.0) + value for name, value in losses.items()}
            watch.report(f"epoch {len(run.history) + 1} of {options.epochs}, step {number + 1} of {len(batches)}, "
                         f"L1 {losses['l1']:.4f}")
            if checkpoint is not None and time.monotonic() - saved >= options.checkpoint_every_s:
                save(checkpoint, {"owner": owner, **run.state()})
                saved = time.monotonic()
        run.history.append({"epoch": len(run.history) + 1, "learning_rate": rate_at(options, len(run.history)),
                            **{name: value / len(batches) for name, value in run.sums.items()}})
        run.sums = {}
        yield run.history[-1]
    watch.end()


def _batches(data: ImageSequences, options: ImageTraining, *, seed: int, epoch: int) -> list[np.ndarray]:
    """The frames (k,) of each step of an epoch: of one sequence in their order or, shuffled, of all."""
    rng = np.random.default_rng([seed, epoch])
    if not options.shuffle_frames:
        return [data.frames_of(int(number)) for number in rng.permutation(len(data))]
    frames = rng.permutation(np.concatenate([data.frames_of(number) for number in range(len(data))]))
    return np.array_split(frames, max(1, round(len(frames) / options.frames)))


def _training_digest(run: ImageRun, data: ImageSequences, options: ImageTraining, seed: int) -> str:
    """Hash of data and settings, so that a training does not resume from the checkpoint of another."""
    networks = [run.generator.options, run.discriminator.options]
    return digest([options.model_dump(exclude={"checkpoint_every_s"}), seed, networks, data.digest(), torch.__version__])


def generate(generator: ImageGenerator, grey: np.ndarray) -> np.ndarray:
    """Camera images (n, y, x, 3) uint8 of a sequence of grey depth images (n, y, x) uint8."""
    device = next(generator.parameters()).device
    generator.eval()
    with torch.inference_mode():
        made = generator(to_network(grey)[None].to(device))[0]
    return from_network(made)


def step_memory_gb(generator: ImageGenerator, discriminator: PatchDiscriminator, *, frames: int) -> float:
    """About how much memory a step takes, from the sizes of all layers' outputs; nothing is computed."""
    side: int = generator.options["pixels"]
    made = sum(_numbers(layer, side // 2**(k + 1)) for k, layer in enumerate(generator.down))
    made += sum(_numbers(layer, 2**(k + 1)) for k, layer in enumerate(generator.up))
    layers: Any = discriminator.layers
    judged = 0
    for layer in layers:
        side = (side - 2) // layer.convolution.stride[-1] + 1
        judged += _numbers(layer, side)
    kept = _KEPT_COPIES * frames * (made + 2 * judged)     # of a real and of a generated sequence
    return _ALWAYS_GB + (4 * kept + _BYTES_PER_WEIGHT * (count_weights(generator) + count_weights(discriminator))) / 1e9


def _numbers(layer: Any, side: int) -> int:
    """How many numbers a layer makes of a frame, its normalisation included."""
    return layer.convolution.out_channels * side**2 * (1 + isinstance(layer.normalise, nn.BatchNorm3d))


def check_memory(generator: ImageGenerator, discriminator: PatchDiscriminator, *, frames: int, device: torch.device) -> None:
    """Refuse a training whose steps do not fit into the memory that is free."""
    needed, free = step_memory_gb(generator, discriminator, frames=frames), _free_gb(device)
    if needed > free:
        raise InputError(f"networks.size: a step of {frames} frames takes about {needed:.1f} GB on {device}, where {free:.1f} GB "
                         "are free; write size: reduced, or use a machine with more memory.")


def _free_gb(device: torch.device) -> float:
    if device.type == "cuda":
        return torch.cuda.mem_get_info(device)[0] / 1e9
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE") / 1e9 + _cached_gb()
    except (ValueError, OSError):      # not on every system
        return math.inf


def _cached_gb() -> float:
    """Memory that holds files and is given back when needed."""
    try:
        lines = Path("/proc/meminfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return 0.0
    return sum(int(line.split()[1]) for line in lines if line.startswith("Cached:")) * 1024 / 1e9
