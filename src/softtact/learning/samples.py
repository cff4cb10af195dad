"""One split of a data set in memory: what a network is trained on, or scored with."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from softtact.errors import InputError
from softtact.files import read_dataset


@dataclass(frozen=True)
class Samples:
    """Deformation maps with the sensor's readings.

    maps_mm (n, y, x) float32;  counts (n, row, column) float32;  labels: a row each of set, item, trial, force_n
    model: what made the deformation maps;  split: train, validation, unseen or grasps
    source: what made the readings ("virtual sensor", "recording of a TSF-85", "published archive")
    """

    maps_mm: np.ndarray
    counts: np.ndarray
    labels: pd.DataFrame
    model: str
    split: str
    source: str

    def __len__(self) -> int:
        return len(self.maps_mm)

    def digest(self) -> str:
        """Tells contents apart: 16 hex digits over model, maps and counts."""
        content: Any = hashlib.sha256(self.model.encode())
        content.update(np.ascontiguousarray(self.maps_mm))
        content.update(np.ascontiguousarray(self.counts))
        return content.hexdigest()[:16]

    def range(self) -> dict[str, list[float]]:
        """Plain values of what the samples span: [least, greatest] of the maps' maxima in mm and of the forces in N."""
        deepest, forces = self.maps_mm.max(axis=(1, 2)), self.labels.force_n
        return {"map_max_mm": [float(deepest.min()), float(deepest.max())], "force_n": [float(forces.min()), float(forces.max())]}

    def subset(self, count: int | None, *, seed: int) -> "Samples":
        """At most `count` samples (None: all), drawn with the seed, in their order."""
        if count is None or count >= len(self):
            return self
        chosen = np.sort(np.random.default_rng(seed).permutation(len(self))[:count])
        return Samples(self.maps_mm[chosen], self.counts[chosen], self.labels.iloc[chosen].reset_index(drop=True),
                       self.model, self.split, self.source)


def object_of(item: str) -> str:
    """The object of an item's name: `square-1` is the square in its first drawn pose."""
    return item.partition("-")[0]


LABELS = ("set", "item", "trial", "force_n")


def read_samples(path: str | Path) -> Samples:
    """The samples of one file of `build_dataset`."""
    data = read_dataset(path)
    if "deformation_map_mm" not in data or "sample" not in data.dims:
        raise InputError(f"{path}: not a split of a data set; give a file that build_dataset wrote.")
    labels = pd.DataFrame({name: data[name].values for name in LABELS})
    return Samples(data.deformation_map_mm.values, data.tactile_map.values, labels,
                   data.attrs["model"], data.attrs["split"], data.attrs["source"])
