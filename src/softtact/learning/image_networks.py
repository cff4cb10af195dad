"""Networks from a sequence of depth images to a sequence of camera images with markers, as printed by Kim et al. (2023).

`ImageGenerator`: a UNet of 3-D convolutions whose bottom, one pixel a frame, goes through two LSTM layers of 512. It takes and
makes (n, 256, 256, 3) and has 58.6 million weights. `PatchDiscriminator`: PatchGAN of 3-D convolutions, (n, 256, 256, 6) to
(n, 30, 30, 1), with 2.8 million weights. The paper prints no kernel. These numbers are those of Pix2Pix, on which the networks are
based, with kernels of 4 x 4 pixels and of one frame: its UNet and PatchGAN have 54.4 and 2.8 million weights, and the LSTM layers
4.2. Kernels of three frames have 163 million. So only the LSTM sees other frames, and the printed "3D-UNet" without it treats each
frame alone. `temporal=3` is the true 3-D kernel, of a frame and the two before it.

Not printed, and as in Pix2Pix: batch normalisation, dropout of the three layers above the bottom, slopes, the non-saturating loss.
Images are float, -1 to 1, shape (sequence, frame, y, x, channel); inside, torch's (sequence, channel, frame, y, x).
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import torch
from torch import nn
from torch.nn import functional

import softtact
from softtact.errors import InputError
from softtact.learning.image_settings import NETWORKS
from softtact.learning.network import load, save

PRINTED_CHANNELS = (64, 128, 256, 512, 512, 512, 512, 512)
REDUCED_CHANNELS = (16, 32, 64, 128, 128, 128)
"""Of images of 64 pixels: 2.1 million weights."""
PRINTED_PATCHES, REDUCED_PATCHES = (64, 128, 256, 512), (16, 32, 64, 128)
_SLOPE = 0.2


class Down(nn.Module):
    """Half the pixels: convolution and normalisation, with a leaky slope before unless it is the first layer."""

    def __init__(self, n_in: int, n_out: int, *, temporal: int, first: bool, normalised: bool, stride: int = 2,
                 bias: bool = False) -> None:
        super().__init__()
        self.first, self.past = first, temporal - 1
        self.convolution = nn.Conv3d(n_in, n_out, (temporal, 4, 4), (1, stride, stride), (0, 1, 1), bias=bias)
        self.normalise = nn.BatchNorm3d(n_out) if normalised else nn.Identity()

    def forward(self, x: torch.Tensor) -> torch.Tensor:                            # (b, c, n, y, x)
        x = x if self.first else functional.leaky_relu(x, _SLOPE)
        return self.normalise(self.convolution(with_past(x, self.past)))           # (b, c', n, y/2, x/2)


class Up(nn.Module):
    """Twice the pixels: transposed convolution, normalisation, dropout where the layer has one; a slope before."""

    def __init__(self, n_in: int, n_out: int, *, temporal: int, last: bool, dropout: float) -> None:
        super().__init__()
        self.future = temporal - 1
        self.convolution = nn.ConvTranspose3d(n_in, n_out, (temporal, 4, 4), (1, 2, 2), (0, 1, 1), bias=last)
        self.normalise = nn.Identity() if last else nn.BatchNorm3d(n_out)
        self.dropout = nn.Dropout(dropout) if dropout else nn.Identity()

    def forward(self, x: torch.Tensor) -> torch.Tensor:                            # (b, c, n, y, x)
        frames = x.shape[2]
        x = self.convolution(torch.relu(x))[:, :, :frames]                         # frame k sees k, k - 1, ..., not the future
        return self.dropout(self.normalise(x))                                     # (b, c', n, 2 y, 2 x)


def with_past(x: torch.Tensor, frames: int) -> torch.Tensor:
    """(b, c, n, y, x) with the first frame repeated before it, so that a kernel in time sees the past only."""
    return torch.cat([x[:, :, :1].expand(-1, -1, frames, -1, -1), x], dim=2) if frames else x


class ImageGenerator(nn.Module):
    """Depth images to camera images: (b, n, y, x, 3) to (b, n, y, x, 3), both -1 to 1.

    pixels: of a side, 2 to the number of channels, so that the bottom is one pixel;  lstm_layers: at the bottom, 0 for none
    temporal: frames that a convolution's kernel spans;  dropout: of the three layers above the bottom but the innermost
    """

    architecture = "image_generator"

    def __init__(self, *, pixels: int = 256, channels: Sequence[int] = PRINTED_CHANNELS, lstm_layers: int = 2, temporal: int = 1,
                 dropout: float = 0.5) -> None:
        super().__init__()
        if pixels != 2 ** len(channels):
            raise InputError(f"the image generator: {len(channels)} layers take images of {2 ** len(channels)} pixels, not "
                             f"{pixels}; give as many channels as it takes halvings to one pixel.")
        self.options: dict[str, Any] = {"pixels": pixels, "channels": list(channels), "lstm_layers": lstm_layers,
                                        "temporal": temporal, "dropout": dropout}
        last = len(channels) - 1
        self.down = nn.ModuleList([Down(n_in, n_out, temporal=temporal, first=k == 0, normalised=0 < k < last)
                                   for k, (n_in, n_out) in enumerate(zip((3, *channels), channels, strict=False))])
        self.lstm = nn.LSTM(channels[-1], channels[-1], lstm_layers, batch_first=True) if lstm_layers else None
        outs, skips = [*reversed(channels[:-1]), 3], [0, *reversed(channels[:-1])]
        ins = [channels[-1], *outs[:-1]]
        self.up = nn.ModuleList([Up(n_in + skip, n_out, temporal=temporal, last=k == last, dropout=dropout * (1 <= k <= 3 < last))
                                 for k, (n_in, skip, n_out) in enumerate(zip(ins, skips, outs, strict=True))])

    def forward(self, depth: torch.Tensor) -> torch.Tensor:                        # (b, n, 256, 256, 3)
        x, skips = depth.permute(0, 4, 1, 2, 3), []                                # (b, 3, n, 256, 256)
        for down in self.down:
            x = down(x)                                                            # (b, 64, n, 128, 128) ... (b, 512, n, 1, 1)
            skips.append(x)
        if self.lstm is not None:
            x = self.lstm(x[..., 0, 0].transpose(1, 2))[0]                         # (b, n, 512)
            x = x.transpose(1, 2)[..., None, None]                                 # (b, 512, n, 1, 1)
        skips.pop()
        for up in self.up:
            x = up(x)                                                              # (b, 512, n, 2, 2) ... (b, 3, n, 256, 256)
            if skips:
                x = torch.cat([x, skips.pop()], dim=1)                             # (b, 1024, n, 2, 2) ... (b, 128, n, 128, 128)
        return torch.tanh(x).permute(0, 2, 3, 4, 1)                                # (b, n, 256, 256, 3)


class PatchDiscriminator(nn.Module):
    """Depth and camera images to one number for each patch of 70 x 70 pixels: (b, n, y, x, 6) to (b, n, y', x', 1).

    The numbers are logits z. The paper's output is tanh(z), which lies in -1 to 1 although the text states 0 to 1 and takes its
    logarithm; (1 + tanh z) / 2 lies in 0 to 1, and equals the logistic function of 2 z.
    """

    architecture = "patch_discriminator"

    def __init__(self, *, channels: Sequence[int] = PRINTED_PATCHES, temporal: int = 1) -> None:
        super().__init__()
        self.options: dict[str, Any] = {"channels": list(channels), "temporal": temporal}
        last = len(channels) - 1
        self.layers = nn.ModuleList([Down(n_in, n_out, temporal=temporal, first=k == 0, normalised=k > 0, bias=k == 0,
                                          stride=1 if k == last else 2)
                                     for k, (n_in, n_out) in enumerate(zip((6, *channels), channels, strict=False))])
        self.output = nn.Conv3d(channels[-1], 1, (temporal, 4, 4), 1, (0, 1, 1))

    def forward(self, depth: torch.Tensor, image: torch.Tensor) -> torch.Tensor:   # (b, n, 256, 256, 3) each
        x = torch.cat([depth, image], dim=-1).permute(0, 4, 1, 2, 3)               # (b, 6, n, 256, 256)
        for layer in self.layers:
            x = layer(x)                                                           # (b, 64, n, 128, 128) ... (b, 512, n, 31, 31)
        x = functional.leaky_relu(x, _SLOPE)
        return self.output(with_past(x, self.options["temporal"] - 1)).permute(0, 2, 3, 4, 1)      # (b, n, 30, 30, 1)


def patch_score(logits: torch.Tensor) -> torch.Tensor:
    """The printed output of the discriminator, tanh, from -1 (generated) to 1 (real)."""
    return torch.tanh(logits)


def adversarial_loss(logits: torch.Tensor, *, real: bool) -> torch.Tensor:
    """-log D (real) or -log(1 - D), in the mean over patches, for D = (1 + tanh z) / 2 in 0 to 1."""
    return functional.softplus(-2 * logits if real else 2 * logits).mean()


def count_weights(network: nn.Module) -> int:
    """Number of trained weights."""
    return sum(parameter.numel() for parameter in network.parameters())


def make_networks(name: str, *, size: str = "reduced", dropout: float | None = None) -> tuple[ImageGenerator, PatchDiscriminator]:
    """Generator and discriminator of a name of NETWORKS; size: printed (256 pixels) or reduced (64 pixels, no dropout)."""
    printed = size == "printed"
    channels, patches = (PRINTED_CHANNELS, PRINTED_PATCHES) if printed else (REDUCED_CHANNELS, REDUCED_PATCHES)
    dropped = dropout if dropout is not None else 0.5 if printed else 0.0
    generator = ImageGenerator(pixels=2 ** len(channels), channels=channels, dropout=dropped, **NETWORKS[name])
    return generator, PatchDiscriminator(channels=patches, temporal=NETWORKS[name]["temporal"])


def save_generator(path: str | Path, generator: ImageGenerator, *, facts: dict[str, Any]) -> None:
    """Write weights, options and `facts` (plain values: name, seed, epochs, ...); equal networks give equal bytes."""
    weights = {name: tensor.detach().cpu() for name, tensor in generator.state_dict().items()}
    save(path, {"architecture": generator.architecture, "options": generator.options, "weights": weights,
                "facts": {**facts, "softtact_version": softtact.__version__}})


def load_generator(path: str | Path) -> tuple[ImageGenerator, dict[str, Any]]:
    """(generator, facts) of a file that `save_generator` wrote, on the CPU; only tensors and plain values are accepted."""
    stored = load(path)
    if stored.get("architecture") != ImageGenerator.architecture:
        raise InputError(f"{path}: it holds no image generator; give a generator.pt that the study of markers trained.")
    generator = ImageGenerator(**stored["options"])
    generator.load_state_dict(stored["weights"])
    return generator.eval(), stored["facts"]
