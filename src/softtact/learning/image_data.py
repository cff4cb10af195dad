"""Sequences of depth and camera images, in memory or read from files frame by frame.

A file of sequences (NetCDF, dimension `frame`) has the variables `depth_grey` (frame, y, x) uint8, 255 for the gel's thickness,
and `image` (frame, y, x, channel) uint8, with the labels `sequence`, `split` and others for each frame. Frames of a sequence stand
together, in their order in time.
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from softtact.checksums import checked
from softtact.errors import InputError
from softtact.files import digest
from softtact.inputs import check_input, in_one_sentence

_IN_MEMORY_BYTES = 2e9      # above that, frames are read from their files when they are needed
_VARIABLES = ("depth_grey", "image")


@dataclass(frozen=True)
class ImageSequences:
    """Sequences of frames, numbered through all files."""

    grey: Sequence[Any]
    """Of each file an array (frame, y, x) uint8, in memory or of an open file."""
    image: Sequence[Any]
    """Of each file an array (frame, y, x, 3) uint8."""
    first: np.ndarray
    """(sequence,) number of the first frame of each sequence; numbers run through all files."""
    length: np.ndarray
    """(sequence,) frames of each sequence."""
    origin: str
    """What the digest of a training takes for the contents: a hash of the files' bytes."""

    def __len__(self) -> int:
        return len(self.first)

    def frames_of(self, number: int) -> np.ndarray:
        """Numbers (n,) of the frames of a sequence."""
        return self.first[number] + np.arange(self.length[number])

    def arrays(self, frames: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Grey depth images (n, y, x) and camera images (n, y, x, 3) of frames, uint8."""
        sizes = np.cumsum([0, *(len(part) for part in self.grey)])
        files = np.searchsorted(sizes, frames, side="right") - 1
        return tuple(np.stack([part[int(file)][int(frame - sizes[file])] for file, frame in zip(files, frames, strict=True)])
                     for part in (self.grey, self.image))     # type: ignore[return-value]

    def tensors(self, frames: np.ndarray) -> tuple[torch.Tensor, torch.Tensor]:
        """Both as a network takes them: (1, n, y, x, 3), -1 to 1."""
        grey, image = self.arrays(frames)
        return to_network(grey)[None], to_network(image)[None]

    def digest(self) -> str:
        """Hash that differs for other sequences."""
        return digest([self.origin, self.first.tolist(), self.length.tolist()])


def open_sequences(paths: Sequence[str | Path], *, split: str, longest_only: bool = False) -> ImageSequences:
    """The sequences of a split in some files.

    longest_only: only those with the largest number of frames, whose parts the shorter ones are
    Raises InputError for a file without sequences, and if none is of the split.
    """
    import h5py

    grey, image, first, length, offset = [], [], [], [], 0
    whole = sum(_bytes_of(path) for path in paths) < _IN_MEMORY_BYTES
    for path in paths:
        with checked(path), in_one_sentence(path, "not a file of image sequences", "press the objects again"):
            file = h5py.File(path, "r")
            parts = [file[name] for name in _VARIABLES]
            numbers, splits = file["sequence"][:], file["split"].asstr()[:]
        grey.append(parts[0][:] if whole else parts[0])
        image.append(parts[1][:] if whole else parts[1])
        for number in np.unique(numbers[splits == split]):
            rows = np.flatnonzero(numbers == number)
            first.append(offset + rows[0])
            length.append(len(rows))
        offset += len(numbers)
    if not first:
        raise InputError(f"the data set: no sequence is of the split {split!r}; press more poses.")
    kept = np.array(length) == max(length) if longest_only else np.ones(len(first), dtype=bool)
    return ImageSequences(grey, image, np.array(first)[kept], np.array(length)[kept], digest([_hash_of(path) for path in paths]))


def _hash_of(path):
    """SHA-256 of a file's bytes, read in pieces: a file pressed anew with other settings may have the same name and size."""
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _bytes_of(path):
    """Size of a file, after a check that it can be read."""
    check_input(path, "movie")
    return Path(path).stat().st_size


def to_network(images: np.ndarray) -> torch.Tensor:
    """uint8 images (n, y, x, 3), or grey ones (n, y, x), as float32 (n, y, x, 3) from -1 to 1."""
    values = torch.from_numpy(np.ascontiguousarray(images)).to(torch.float32) / 127.5 - 1.0
    return values if values.ndim == 4 else values[..., None].expand(-1, -1, -1, 3)


def from_network(images: torch.Tensor) -> np.ndarray:
    """The reverse of `to_network` of images (n, y, x, 3), rounded."""
    return ((images.detach().cpu() + 1.0) * 127.5).round().clamp(0, 255).to(torch.uint8).numpy()
