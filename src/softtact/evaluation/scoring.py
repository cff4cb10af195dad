"""How well a network reads what it never saw, and how well the sensor repeats itself."""

from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
import xarray

from softtact.evaluation.bootstrap import interval_of_mean
from softtact.evaluation.overlap import contact_patch_overlap
from softtact.learning.network import predict
from softtact.learning.samples import Samples, object_of
from softtact.readout.ssim import map_ssim, mean_absolute_counts, others_mean, own_range_ssim

if TYPE_CHECKING:
    import torch

SSIM_COLUMNS = ["model", "set", "item", "trial", "force_n", "ssim", "ssim_own_range", "mae_counts", "mean_counts", "overlap"]
CEILING_COLUMNS = ["set", "item", "force_n", "ssim", "ssim_own_range", "mae_counts", "mean_counts"]


def score_samples(network: "torch.nn.Module", samples: Samples, *, ssim: dict[str, Any]) -> pd.DataFrame:
    """`score_predictions` of what a network gives for the samples' deformation maps."""
    return score_predictions(predict(network, samples.maps_mm), samples, ssim=ssim)


def score_predictions(predicted: np.ndarray, samples: Samples, *, ssim: dict[str, Any]) -> pd.DataFrame:
    """A row with SSIM_COLUMNS for each sample, of predicted counts (n, row, column) against the samples' own.

    ssim_own_range: SSIM whose data range is the measured map's largest count;  mean_counts: of the measured map
    The rows of the split `validation` carry set = "validation": its items are indenters that training saw at other
    forces.
    """
    measured = samples.counts
    frame = samples.labels.assign(model=samples.model, ssim=map_ssim(predicted, measured, **ssim),
                                  ssim_own_range=own_range_ssim(predicted, measured, window=ssim["window"]),
                                  mae_counts=mean_absolute_counts(predicted, measured), mean_counts=measured.mean(axis=(1, 2)),
                                  overlap=contact_patch_overlap(predicted, measured), set=samples.split)
    return frame[SSIM_COLUMNS].sort_values(SSIM_COLUMNS[1:5], ignore_index=True)


def score_sensor(samples: Samples, *, ssim: dict[str, Any]) -> pd.DataFrame:
    """A row with CEILING_COLUMNS per load step with at least two trials.

    Means over the trials of each one's scores against the mean of the others. A network's scores can
    lie above it by chance, and by the noise that is left in the mean of few trials.
    """
    rows = []
    for (item, force), chosen in samples.labels.groupby(["item", "force_n"]).indices.items():
        if samples.labels.trial.iloc[chosen].nunique() > 1:     # one trial at the same force twice is no repetition
            trials = samples.counts[chosen].astype(float)
            others = others_mean(trials)
            rows.append((samples.split, item, force, map_ssim(others, trials, **ssim).mean(),
                         own_range_ssim(others, trials, window=ssim["window"]).mean(),
                         mean_absolute_counts(others, trials).mean(), trials.mean()))
    return pd.DataFrame(rows, columns=CEILING_COLUMNS)


def predict_grasps(networks: "dict[str, torch.nn.Module]", grasps: dict[str, Samples]) -> xarray.Dataset:
    """Predicted and measured maps of the grasped objects.

    networks, grasps: {model: network}, {model: samples}
    Returns a data set tactile_map (model, item, force, row, column) and sensor_map (item, force, row, column), the mean
    over the trials, in counts; nan where a load step is outside a model's validity.
    """
    labels = next(iter(grasps.values())).labels
    items, forces = sorted(labels["item"].unique()), np.sort(labels.force_n.unique())
    tables = {model: load_step_means(samples, predict(networks[model], samples.maps_mm), items, forces)
              for model, samples in grasps.items()}
    some = next(iter(grasps.values()))
    dims = ("item", "force", "row", "column")
    return xarray.Dataset(
        {"tactile_map": (("model", *dims), np.stack(list(tables.values())), {"units": "counts"}),
         "sensor_map": (dims, load_step_means(some, some.counts, items, forces), {"units": "counts"}),
         "force_n": ("force", forces, {"units": "N"})},
        coords={"model": np.array(list(tables), dtype=object), "item": np.array(items, dtype=object)},
        attrs={"source": some.source})


def load_step_means(samples: Samples, maps: np.ndarray, items: list[str], forces: np.ndarray) -> np.ndarray:
    """Mean over the trials of `maps` (n, row, column) per item and force: (item, force, row, column)."""
    means = np.full((len(items), len(forces), *maps.shape[1:]), np.nan, dtype=np.float32)
    for (item, force), chosen in samples.labels.groupby(["item", "force_n"]).indices.items():
        means[items.index(item), np.searchsorted(forces, force)] = maps[chosen].mean(axis=0)
    return means


def summarise_scores(scores: pd.DataFrame, ceiling: pd.DataFrame, *, seed: int) -> pd.DataFrame:
    """Frame model, set, items, maps, ssim, ssim_low, ssim_high, mae_counts, overlap, sensor_ssim of a study's scores.

    ssim_low, ssim_high: 95 % interval of the mean, by bootstrap over objects, then presses and trials; nan where there is one
    object only
    sensor_ssim: mean of the ceiling, the sensor's trials against each other; nan where it was read once
    """
    own = ceiling.groupby("set").ssim.mean()
    rows = []
    for (model, set_name), group in scores.groupby(["model", "set"], sort=False):
        low, high = interval_over_objects(group, seed=seed)
        rows.append({"model": model, "set": set_name, "items": group["item"].nunique(), "maps": len(group),
                     "ssim": group.ssim.mean(), "ssim_low": low, "ssim_high": high, "mae_counts": group.mae_counts.mean(),
                     "overlap": group.overlap.mean(), "sensor_ssim": own.get(set_name, np.nan)})
    return pd.DataFrame(rows)


def interval_over_objects(scores: pd.DataFrame, *, seed: int) -> tuple[float, float]:
    """(low, high) of the mean SSIM of a set's scores: objects are drawn, then trials of each; a trial is one press read once."""
    trial = pd.factorize(scores["item"] + " " + scores.trial.astype(str))[0]
    return interval_of_mean(scores.ssim.to_numpy(), scores["item"].map(object_of), trial, seed=seed)


def score_items(scores: pd.DataFrame, *, seed: int) -> pd.DataFrame:
    """Frame model, set, item, maps, ssim, ssim_low, ssim_high, mae_counts, overlap: a row per item and model.

    ssim_low, ssim_high: 95 % interval of the item's mean, by bootstrap over its trials; nan with one
    """
    rows = []
    for (model, set_name, item), group in scores.groupby(["model", "set", "item"], sort=False):
        low, high = interval_of_mean(group.ssim.to_numpy(), group.trial, np.zeros(len(group), dtype=int), seed=seed)
        rows.append({"model": model, "set": set_name, "item": item, "maps": len(group), "ssim": group.ssim.mean(), "ssim_low": low,
                     "ssim_high": high, "mae_counts": group.mae_counts.mean(), "overlap": group.overlap.mean()})
    return pd.DataFrame(rows)
