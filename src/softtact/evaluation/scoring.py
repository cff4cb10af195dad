"""Scores of networks on test samples, the repeatability of the sensor, and the time per map.

Confidence intervals of a mean come from a hierarchical bootstrap, because maps of one object are alike, and so are maps of one
trial (one loading, one drift): objects are drawn with replacement, then trials of each drawn object, each with all its maps.
"""

import statistics
import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy.special import stdtrit

from softtact.evaluation.percentiles import expanded_interval
from softtact.learning.dataset import Samples, object_of
from softtact.readout.ssim import map_ssim, mean_absolute_counts, others_mean, own_range_ssim

if TYPE_CHECKING:
    import torch
    import xarray

SSIM_COLUMNS = ["model", "set", "item", "trial", "force_n", "ssim", "ssim_own_range", "mae_counts", "mean_counts", "overlap"]
CEILING_COLUMNS = ["set", "item", "force_n", "ssim", "ssim_own_range", "mae_counts", "mean_counts"]
LEVEL, REPEATS = 0.95, 2000
SHARE = 0.1             # of the reading's largest count, from which a taxel belongs to the contact patch
FLOOR_COUNTS = 30.0     # least threshold: about four standard deviations of the virtual sensor's offsets and noise together
TIMING_COLUMNS = ["model", "item", "set", "force_n", "solver_s", "network_s"]


def score_samples(network: "torch.nn.Module", samples: Samples, *, ssim: dict[str, Any]) -> pd.DataFrame:
    """`score_predictions` of a network's output for the samples' deformation maps."""
    from softtact.learning.network import predict  # torch, which those who read tables alone do without

    return score_predictions(predict(network, samples.maps_mm), samples, ssim=ssim)


def score_predictions(predicted: np.ndarray, samples: Samples, *, ssim: dict[str, Any]) -> pd.DataFrame:
    """A row with SSIM_COLUMNS for each sample, of predicted counts (n, row, column) against those of the samples.

    ssim_own_range: SSIM whose data range is the measured map's largest count;  mean_counts: of the measured map
    The rows of the split `validation` have set = "validation"; its items are indenters that the training includes at
    other forces.
    """
    measured = samples.counts
    frame = samples.labels.assign(model=samples.model, ssim=map_ssim(predicted, measured, **ssim),
                                  ssim_own_range=own_range_ssim(predicted, measured, window=ssim["window"]),
                                  mae_counts=mean_absolute_counts(predicted, measured), mean_counts=measured.mean(axis=(1, 2)),
                                  overlap=contact_patch_overlap(predicted, measured), set=samples.split)
    return frame[SSIM_COLUMNS].sort_values(SSIM_COLUMNS[1:5], ignore_index=True)


def score_sensor(samples: Samples, *, ssim: dict[str, Any]) -> pd.DataFrame:
    """A row with CEILING_COLUMNS per load step with at least two trials.

    Each trial is scored against the mean of the others; the row has the means over the trials. A network's score can be higher by
    chance, and because of the noise in the mean of few trials.
    """
    rows = []
    for (item, force), chosen in samples.labels.groupby(["item", "force_n"]).indices.items():
        if samples.labels.trial.iloc[chosen].nunique() > 1:     # the same trial twice at a force is not a repetition
            trials = samples.counts[chosen].astype(float)
            others = others_mean(trials)
            rows.append((samples.split, item, force, map_ssim(others, trials, **ssim).mean(),
                         own_range_ssim(others, trials, window=ssim["window"]).mean(),
                         mean_absolute_counts(others, trials).mean(), trials.mean()))
    return pd.DataFrame(rows, columns=CEILING_COLUMNS)


def predict_grasps(networks: "dict[str, torch.nn.Module]", grasps: dict[str, Samples]) -> "xarray.Dataset":
    """Predicted and measured maps of the grasped objects.

    networks, grasps: {model: network}, {model: samples}
    Returns a data set tactile_map (model, item, force, row, column) and sensor_map (item, force, row, column), the mean
    over the trials, in counts; nan for load steps outside a model's validity.
    """
    import xarray

    from softtact.learning.network import predict

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

    ssim_low, ssim_high: 95 % interval of the mean, by bootstrap over objects, then presses and trials; nan with one object
    sensor_ssim: mean SSIM between the sensor's trials; nan with one trial
    """
    repeatability = ceiling.groupby("set").ssim.mean()
    rows = []
    for (model, set_name), group in scores.groupby(["model", "set"], sort=False):
        low, high = interval_over_objects(group, seed=seed)
        rows.append({"model": model, "set": set_name, "items": group["item"].nunique(), "maps": len(group),
                     "ssim": group.ssim.mean(), "ssim_low": low, "ssim_high": high, "mae_counts": group.mae_counts.mean(),
                     "overlap": group.overlap.mean(), "sensor_ssim": repeatability.get(set_name, np.nan)})
    return pd.DataFrame(rows)


def interval_over_objects(scores: pd.DataFrame, *, seed: int) -> tuple[float, float]:
    """95 % interval (low, high) of the mean SSIM of a set, by bootstrap over objects, then trials (a press read once)."""
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


def interval_of_mean(values: np.ndarray, items: "np.ndarray | pd.Series", trials: "np.ndarray | pd.Series", *, seed: int,
                     level: float = LEVEL, repeats: int = REPEATS) -> tuple[float, float]:
    """(low, high) of the mean of `values` (n,), from percentiles over `repeats` draws; items, trials (n,) group the values.

    With one item the scatter between items is unknown: (nan, nan). With few, percentiles are expanded (`expanded_interval`).
    """
    sums, counts, n_trials = by_trial(values, items, trials)     # (item, trial) each, and (item,)
    if len(n_trials) < 2:
        return np.nan, np.nan
    rng = np.random.default_rng(seed)
    drawn = rng.integers(len(n_trials), size=(repeats, len(n_trials)))                          # (repeats, item)
    picks = np.floor(rng.random((*drawn.shape, sums.shape[1])) * n_trials[drawn, None]).astype(int)   # (repeats, item, trial)
    taken = np.arange(sums.shape[1]) < n_trials[drawn, None]     # as many trials as the item has
    total, count = ((table[drawn[..., None], picks] * taken).sum(axis=(1, 2)) for table in (sums, counts))
    n = len(n_trials)
    return expanded_interval(total / count, np.sqrt(n / (n - 1)) * stdtrit(n - 1, 0.5 * (1 + level)))


def by_trial(values: np.ndarray, items: "np.ndarray | pd.Series",
             trials: "np.ndarray | pd.Series") -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sums and counts of `values` (item, trial), and the number of trials (item,); trials are numbered within an item."""
    _, item = np.unique(np.asarray(items).astype(str), return_inverse=True)
    pairs, pair = np.unique(np.stack([item, np.asarray(trials)]), axis=1, return_inverse=True)
    n_trials = np.bincount(pairs[0])
    column = np.arange(pairs.shape[1]) - (np.cumsum(n_trials) - n_trials)[pairs[0]]
    sums, counts = np.zeros((2, len(n_trials), n_trials.max()))
    sums[pairs[0], column] = np.bincount(pair.ravel(), weights=values)
    counts[pairs[0], column] = np.bincount(pair.ravel())
    return sums, counts, n_trials


def contact_patch_overlap(predicted: np.ndarray, measured: np.ndarray, *, share: float = SHARE,
                          floor_counts: float = FLOOR_COUNTS) -> np.ndarray:
    """Intersection over union (n,) of the contact patches of tactile maps (n, row, column) in counts.

    A patch is the taxels above a threshold: `share` of the *measured* map's maximum, at least `floor_counts`. Both maps have the
    same threshold, so a prediction of the right shape that is much too faint has no patch. Two empty patches give 1.
    """
    threshold = np.maximum(share * measured.max(axis=(1, 2), keepdims=True), floor_counts)
    ours, theirs = predicted > threshold, measured > threshold
    both, either = ((ours & theirs).sum(axis=(1, 2)), (ours | theirs).sum(axis=(1, 2)))
    return np.where(either == 0, 1.0, both / np.maximum(either, 1))


def time_presses(presses: "Iterable[xarray.Dataset]", networks: "dict[str, torch.nn.Module]", *,
                 predict: "Callable[[torch.nn.Module, np.ndarray], np.ndarray]", repeats: int = 3) -> pd.DataFrame:
    """A row per map: model, item, set, force_n, solver_s, network_s.

    presses: data sets of `simulate_press`;  networks {model: network};  predict(network, maps (1, y, x))
    network_s: median over `repeats` of the time of one map, as for one press
    """
    from softtact.press.result import wall_time_s

    rows = []
    for press in presses:
        names = [press.attrs[name] for name in ("model", "item", "set")]
        network = networks[names[0]]
        predict(network, press.deformation_map_mm.values[:1])  # the first call allocates memory and is not counted
        for load_step, force in enumerate(press.normal_force_n.values):
            one = press.deformation_map_mm.values[load_step:load_step + 1]
            network_s = statistics.median(seconds(predict, network, one) for _ in range(repeats))
            rows.append((*names, float(force), float(wall_time_s(press)[load_step]), network_s))
    return pd.DataFrame(rows, columns=TIMING_COLUMNS)


def seconds(call: Callable[..., object], *arguments: object) -> float:
    """Wall time of one call in s."""
    start = time.perf_counter()
    call(*arguments)
    return time.perf_counter() - start
