"""Predictors without a network: what a network's score is worth is what it has over them.

trivial   `zeros`, `mean_reading` (of the training readings at that force), `nearest_map` (the reading of the nearest training map)
simple    `ridge` on the taxels' mean deformations, `quadratic` (three numbers for all taxels), `gap_formula` (untrained:
          parallel plates at the map's gap)
marks     `moved` and `halved`, the true reading one taxel off and at half its counts: no predictors, but what such an error scores
"""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy.spatial.distance import cdist

from softtact.evaluation.scoring import score_predictions
from softtact.learning.network import taxel_weights
from softtact.learning.samples import object_of
from softtact.readout.capacitance import ideal_counts

if TYPE_CHECKING:
    from softtact.learning.samples import Samples
    from softtact.sensors.specification import AnySpec

KINDS = {"zeros": "trivial", "mean_reading": "trivial", "nearest_map": "trivial", "ridge": "simple", "quadratic": "simple",
         "gap_formula": "simple", "moved": "mark", "halved": "mark"}
_FORCES = 20        # groups of training forces at most; an archive's forces are all different
_PENALTY = 1e-3     # of the ridge: a share of the features' summed squares, enough against collinear taxels

Predictor = Callable[["Samples"], np.ndarray]     # samples to counts (n, row, column)


def score_baselines(train: "Samples", tests: "dict[str, Samples]", *, spec: "AnySpec", counts_per_relative_change: float | None,
                    ssim: dict[str, Any]) -> pd.DataFrame:
    """The columns of `score_samples` and `predictor`: a row for each predictor and sample.

    tests: {set: samples};  counts_per_relative_change: of the readings, for the gap formula; None where it is not known
    """
    predictors = make_predictors(train, spec=spec, counts_per_relative_change=counts_per_relative_change)
    frames = [score_predictions(predict(samples), samples, ssim=ssim).assign(predictor=name)
              for samples in tests.values() for name, predict in predictors.items()]
    return pd.concat(frames, ignore_index=True)


def taxel_table(indenters: "Sequence[Samples]") -> pd.DataFrame:
    """A row for each taxel, row by row: its largest_counts over the indenters' readings, and how many indenters there are."""
    largest = np.max([samples.counts.max(axis=0) for samples in indenters], axis=0)
    names = {object_of(item) for samples in indenters for item in samples.labels["item"]}
    return pd.DataFrame({"taxel": np.arange(largest.size), "largest_counts": largest.ravel(), "indenters": len(names)})


def make_predictors(train: "Samples", *, spec: "AnySpec", counts_per_relative_change: float | None) -> dict[str, Predictor]:
    """{name: predictor} in the order of KINDS, fitted to the training samples where there is something to fit."""
    predictors: dict[str, Predictor] = {
        "zeros": lambda samples: np.zeros_like(samples.counts), "mean_reading": _mean_reading(train),
        "nearest_map": _nearest_map(train),
        "ridge": _ridge(train), "quadratic": _quadratic(train), "moved": lambda samples: moved_by_a_taxel(samples.counts),
        "halved": lambda samples: 0.5 * samples.counts}
    if counts_per_relative_change is not None:
        predictors["gap_formula"] = lambda samples: ideal_counts(spec, samples.maps_mm,
                                                                 counts_per_relative_change=counts_per_relative_change)
    return {name: predictors[name] for name in KINDS if name in predictors}


def moved_by_a_taxel(counts: np.ndarray) -> np.ndarray:
    """Maps (n, row, column) one row further along y; the first row stands twice."""
    return np.concatenate([counts[:, :1], counts[:, :-1]], axis=1)


def _mean_reading(train):
    """The mean training reading at a force: linear between the forces of training, and as at the nearest beyond them."""
    force = train.labels.force_n.to_numpy()
    known = np.unique(force)
    edges = known if len(known) <= _FORCES else np.quantile(force, np.arange(_FORCES) / _FORCES)
    group = np.searchsorted(edges, force, side="right") - 1
    groups = np.unique(group)
    at = np.array([force[group == k].mean() for k in groups])
    means = np.array([train.counts[group == k].mean(axis=0, dtype=float) for k in groups])      # (group, row, column)

    def predict(samples):
        flat = means.reshape(len(at), -1)
        columns = [np.interp(samples.labels.force_n, at, column) for column in flat.T]
        return np.stack(columns, axis=1).reshape(-1, *means.shape[1:])

    return predict


def _nearest_map(train):
    """The mean reading of the training map that is nearest in the sum of squares."""
    maps, own = np.unique(train.maps_mm, axis=0, return_inverse=True)
    own = own.ravel()
    sums = np.zeros((len(maps), *train.counts.shape[1:]))
    np.add.at(sums, own, train.counts)
    readings = sums / np.bincount(own)[:, None, None]

    def predict(samples):
        asked, places = np.unique(samples.maps_mm, axis=0, return_inverse=True)
        distance = cdist(asked.reshape(len(asked), -1), maps.reshape(len(maps), -1), "sqeuclidean")
        return readings[distance.argmin(axis=1)][places.ravel()]

    return predict


def _ridge(train):
    """Each taxel's counts as a linear function of all taxels' mean deformations."""
    features, counts = _with_one(_flat(taxel_depths(train))), _flat(train.counts).astype(float)
    penalty = np.full(features.shape[1], _PENALTY * (features[:, 1:]**2).sum() / (features.shape[1] - 1))
    penalty[0] = 0.0      # the constant is free
    weights = np.linalg.lstsq(features.T @ features + np.diag(penalty), features.T @ counts, rcond=None)[0]
    return lambda samples: (_with_one(_flat(taxel_depths(samples))) @ weights).reshape(samples.counts.shape)


def _quadratic(train):
    """One quadratic of the mean deformation over the taxel, the same for all."""
    depth = taxel_depths(train)
    weights = np.linalg.lstsq(_powers(depth).reshape(-1, 3), train.counts.reshape(-1).astype(float), rcond=None)[0]
    return lambda samples: _powers(taxel_depths(samples)) @ weights


def taxel_depths(samples: "Samples") -> np.ndarray:
    """Mean deformation (n, row, column) in mm over each taxel."""
    rows, columns = (taxel_weights(points, parts)
                     for points, parts in zip(samples.maps_mm.shape[1:], samples.counts.shape[1:], strict=True))
    return rows @ samples.maps_mm.astype(float) @ columns.T


def _powers(depth):
    return np.stack([np.ones_like(depth), depth, depth**2], axis=-1)


def _flat(array):
    return array.reshape(len(array), -1)


def _with_one(features):
    return np.hstack([np.ones((len(features), 1)), features])
