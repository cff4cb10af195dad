"""How well a network reads what it never saw, and how well the sensor repeats itself."""

import numpy as np
import pandas as pd
import xarray

from softtact.evaluation.ssim import leave_one_out_ssim, map_ssim, mean_absolute_counts
from softtact.learning.network import predict

SSIM_COLUMNS = ["model", "set", "item", "trial", "force_n", "ssim", "mae_counts"]
CEILING_COLUMNS = ["set", "item", "force_n", "ssim"]


def score_samples(network, samples, *, ssim):
    """A row per sample of `samples`: model, set, item, trial, force_n, ssim, mae_counts.

    The rows of the split `validation` carry set = "validation": its items are indenters that training saw at other
    forces.
    """
    predicted = predict(network, samples.maps_mm)
    frame = samples.labels.assign(model=samples.model, ssim=map_ssim(predicted, samples.counts, **ssim),
                                  mae_counts=mean_absolute_counts(predicted, samples.counts), set=samples.split)
    return frame[SSIM_COLUMNS].sort_values(SSIM_COLUMNS[1:5], ignore_index=True)


def score_sensor(samples, *, ssim):
    """A row per level with at least two trials: set, item, force_n, ssim.

    ssim: mean over the trials of each one's SSIM against the mean of the others. No network's scores can lie above it
    but by chance.
    """
    rows = []
    for (item, force), chosen in samples.labels.groupby(["item", "force_n"]).indices.items():
        if samples.labels.trial.iloc[chosen].nunique() > 1:     # one trial at the same force twice is no repetition
            rows.append((samples.split, item, force, leave_one_out_ssim(samples.counts[chosen], **ssim).mean()))
    return pd.DataFrame(rows, columns=CEILING_COLUMNS)


def predict_grasps(networks, grasps):
    """Predicted and measured maps of the grasped objects.

    networks, grasps: {model: network}, {model: samples}
    Returns a data set tactile_map (model, item, force, row, column) and sensor_map (item, force, row, column), the mean
    over the trials, in counts; nan where a level is outside a model's validity.
    """
    labels = next(iter(grasps.values())).labels
    items, forces = sorted(labels["item"].unique()), np.sort(labels.force_n.unique())
    tables = {model: level_means(samples, predict(networks[model], samples.maps_mm), items, forces)
              for model, samples in grasps.items()}
    some = next(iter(grasps.values()))
    dims = ("item", "force", "row", "column")
    return xarray.Dataset(
        {"tactile_map": (("model", *dims), np.stack(list(tables.values())), {"units": "counts"}),
         "sensor_map": (dims, level_means(some, some.counts, items, forces), {"units": "counts"}),
         "force_n": ("force", forces, {"units": "N"})},
        coords={"model": np.array(list(tables), dtype=object), "item": np.array(items, dtype=object)},
        attrs={"source": some.source})


def level_means(samples, maps, items, forces):
    """Mean over the trials of `maps` (n, row, column) per item and force: (item, force, row, column)."""
    means = np.full((len(items), len(forces), *maps.shape[1:]), np.nan, dtype=np.float32)
    for (item, force), chosen in samples.labels.groupby(["item", "force_n"]).indices.items():
        means[items.index(item), np.searchsorted(forces, force)] = maps[chosen].mean(axis=0)
    return means


def summarise_ssim(scores):
    """Mean, min, max and standard deviation of SSIM per model and set: model, set, maps, mean, min, max, sd."""
    return summarise(scores, by=["model", "set"], value="ssim")


def summarise(frame, *, by, value):
    """Count and mean, min, max, sd of the column `value` per group."""
    return frame.groupby(by, sort=False)[value].agg(
        maps="size", mean="mean", min="min", max="max", sd="std").reset_index()
