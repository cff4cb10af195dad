"""Presses and readings made by a formula: enough for learning's mechanics, and no claim on the sensor's."""

import numpy as np
import pandas as pd
import xarray

from softtact.files import write_dataset
from softtact.learning.dataset import Samples

FORCES = np.array([10.0, 20.0, 30.0])
Y, X = np.linspace(-18, 18, 57), np.linspace(-10.5, 10.5, 33)
TINY = {"filters": (3, 4, 5), "dense": 24, "activation": "relu"}  # the printed network's form, a thousandth of its size


def bump(seed):
    """A deformation map (57, 33) in mm: one smooth dent, its place and width from the seed."""
    y0, x0, width = np.random.default_rng(seed).uniform([-12, -7, 4], [12, 7, 10])
    return 0.4 * np.exp(-((Y[:, None] - y0) ** 2 + (X - x0) ** 2) / width**2)


def counts_of(maps_mm):
    """Tactile maps (..., 7, 4): 3,000 counts per mm of a taxel's mean depth."""
    blocks = maps_mm[..., :56, :32].reshape(*maps_mm.shape[:-2], 7, 8, 4, 8)
    return 3000 * blocks.mean(axis=(-3, -1))


def make_press(set_name, item, model, *, seed, **flags):
    """A press file's data set; `flags` replaces converged or within_validity."""
    maps = bump(seed) * (FORCES / 30)[:, None, None] * {"elastic": 1.0, "hyperelastic": 0.8}[model]
    ones = np.ones(len(FORCES), dtype=np.int8)
    per_force = {"converged": ones, "within_validity": ones, "wall_time_s": 1.5 * FORCES, **flags}
    return xarray.Dataset(
        {"deformation_map_mm": (("step", "y", "x"), maps), "normal_force_n": ("step", FORCES.copy()),
         **{name: ("step", values) for name, values in per_force.items()}},
        coords={"y": Y, "x": X}, attrs={"model": model, "set": set_name, "item": item})


def make_reading(set_name, item, *, seed, trials=3):
    """A tactile file's data set with three noisy trials."""
    counts = counts_of(bump(seed) * (FORCES / 30)[:, None, None])
    noise = np.random.default_rng([seed, 7]).normal(0, 5, (trials, *counts.shape))
    return xarray.Dataset({"tactile_map": (("trial", "force", "row", "column"), counts + noise),
                           "force_n": ("force", FORCES.copy())},
                          attrs={"source": "virtual sensor", "set": set_name, "item": item})


ITEMS = [("indenters", f"form_{k}") for k in range(6)] + [("unseen", "hexagon"), ("grasps", "object_1")]
MODELS = ["elastic", "hyperelastic"]


class Study:
    """The inputs of `build_dataset`, to be changed by a test."""

    def __init__(self):
        self.presses = {(model, *key): make_press(*key, model, seed=seed)
                        for seed, key in enumerate(ITEMS) for model in MODELS}
        self.tactile = {key: make_reading(*key, seed=seed) for seed, key in enumerate(ITEMS)}
        self.settings = {"models": MODELS, "items": [{"set": s, "item": i} for s, i in ITEMS],
                         "train_fraction": 0.8, "seed": 3}

    def write(self, folder):
        """Inputs of the stage as files."""
        presses = [self._write(folder / f"presses/{s}/{i}/{m}.nc", data) for (m, s, i), data in self.presses.items()]
        tactile = [self._write(folder / f"tactile/{s}/{i}.nc", data) for (s, i), data in self.tactile.items()]
        return {"presses": presses, "tactile": tactile}

    @staticmethod
    def _write(path, data):
        write_dataset(path, data, seed=0, settings={})
        return path


def make_samples(count, *, first=0, split="train"):
    """Samples of one dent each, at 30 N."""
    maps = np.stack([bump(seed) for seed in range(first, first + count)])
    labels = pd.DataFrame({"set": "indenters", "item": [f"form_{k}" for k in range(count)], "trial": 0, "force_n": 30.0})
    return Samples(np.float32(maps), np.float32(counts_of(maps)), labels, "elastic", split, "virtual sensor")
