"""Scores of networks compared with simple predictors, by set and force, with their skill; and networks that are not trained.

Predictors without a network are the baselines:
trivial   `zeros`, `mean_reading` (of the training readings at that force), `nearest_map` (the reading of the nearest training map)
simple    `ridge` on the taxels' mean deformations, `quadratic` (three numbers for all taxels), `gap_formula` (untrained:
          parallel plates at the map's gap)
marks     `moved` and `halved`, the true reading shifted by one taxel and at half its counts: scores of errors of a known size
Skills:
skill           (score - best trivial) / (ceiling - best trivial) of mean SSIM: 0 equals the best trivial predictor, 1 the
                repeatability of the sensor
skill_simple    the same with the best simple predictor: below 0, a formula with a few numbers predicts better than the network
"""

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy.spatial.distance import cdist

from softtact.evaluation.scoring import score_predictions
from softtact.learning.dataset import object_of
from softtact.readout.capacitance import ideal_counts

if TYPE_CHECKING:
    from softtact.learning.dataset import Samples
    from softtact.sensors.specification import AnySpec

KINDS = {"zeros": "trivial", "mean_reading": "trivial", "nearest_map": "trivial", "ridge": "simple", "quadratic": "simple",
         "gap_formula": "simple", "moved": "mark", "halved": "mark"}
_FORCES = 20        # most groups of training forces; an archive's forces are all different
_PENALTY = 1e-3     # of the ridge regression, over the features' summed squares: enough against collinear taxels

Predictor = Callable[["Samples"], np.ndarray]     # samples to counts (n, row, column)
NETWORK, CEILING = "network", "sensor"
ALL_FORCES = "all"
FORCES, BINS = 25, 10     # an archive's forces are all different
COLUMNS = ["model", "set", "force", "predictor", "kind", "maps", "ssim", "ssim_own_range", "mae_counts", "mae_share", "overlap",
           "skill", "skill_simple"]
_OF_KIND = {"skill": "trivial", "skill_simple": "simple"}


def score_baselines(train: "Samples", tests: "dict[str, Samples]", *, spec: "AnySpec", counts_per_relative_change: float | None,
                    ssim: dict[str, Any]) -> pd.DataFrame:
    """The columns of `score_samples` and `predictor`: a row for each predictor and sample.

    tests: {set: samples};  counts_per_relative_change: of the readings, for the gap formula; None if unknown
    """
    predictors = make_predictors(train, spec=spec, counts_per_relative_change=counts_per_relative_change)
    frames = [score_predictions(predict(samples), samples, ssim=ssim).assign(predictor=name)
              for samples in tests.values() for name, predict in predictors.items()]
    return pd.concat(frames, ignore_index=True)


def taxel_table(indenters: "Sequence[Samples]") -> pd.DataFrame:
    """A row for each taxel, row by row: its largest_counts over the indenters' readings, and the number of indenters."""
    largest = np.max([samples.counts.max(axis=0) for samples in indenters], axis=0)
    names = {object_of(item) for samples in indenters for item in samples.labels["item"]}
    return pd.DataFrame({"taxel": np.arange(largest.size), "largest_counts": largest.ravel(), "indenters": len(names)})


def make_predictors(train: "Samples", *, spec: "AnySpec", counts_per_relative_change: float | None) -> dict[str, Predictor]:
    """{name: predictor} in the order of KINDS, those with parameters fitted to the training samples."""
    predictors: dict[str, Predictor] = {
        "zeros": lambda samples: np.zeros_like(samples.counts), "mean_reading": mean_reading_predictor(train),
        "nearest_map": _nearest_map(train),
        "ridge": _ridge(train), "quadratic": _quadratic(train), "moved": lambda samples: moved_by_a_taxel(samples.counts),
        "halved": lambda samples: 0.5 * samples.counts}
    if counts_per_relative_change is not None:
        predictors["gap_formula"] = lambda samples: ideal_counts(spec, samples.maps_mm,
                                                                 counts_per_relative_change=counts_per_relative_change)
    return {name: predictors[name] for name in KINDS if name in predictors}


def moved_by_a_taxel(counts: np.ndarray) -> np.ndarray:
    """Maps (n, row, column) shifted by one row along y; the first row is repeated."""
    return np.concatenate([counts[:, :1], counts[:, :-1]], axis=1)


def mean_reading_predictor(train: "Samples") -> Predictor:
    """The mean training reading at a force, interpolated linearly between the training forces and constant beyond them."""
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
    """The mean reading of the training map with the least sum of squared differences."""
    maps, map_of = np.unique(train.maps_mm, axis=0, return_inverse=True)
    map_of = map_of.ravel()
    sums = np.zeros((len(maps), *train.counts.shape[1:]))
    np.add.at(sums, map_of, train.counts)
    readings = sums / np.bincount(map_of)[:, None, None]

    def predict(samples):
        asked, places = np.unique(samples.maps_mm, axis=0, return_inverse=True)
        distance = cdist(asked.reshape(len(asked), -1), maps.reshape(len(maps), -1), "sqeuclidean")
        return readings[distance.argmin(axis=1)][places.ravel()]

    return predict


def _ridge(train):
    """Each taxel's counts as a linear function of all taxels' mean deformations."""
    features, counts = _with_one(_flat(taxel_depths(train))), _flat(train.counts).astype(float)
    penalty = np.full(features.shape[1], _PENALTY * (features[:, 1:]**2).sum() / (features.shape[1] - 1))
    penalty[0] = 0.0      # no penalty on the constant
    weights = np.linalg.lstsq(features.T @ features + np.diag(penalty), features.T @ counts, rcond=None)[0]
    return lambda samples: (_with_one(_flat(taxel_depths(samples))) @ weights).reshape(samples.counts.shape)


def _quadratic(train):
    """A quadratic function of the mean deformation over a taxel, the same for all taxels."""
    depth = taxel_depths(train)
    weights = np.linalg.lstsq(_powers(depth).reshape(-1, 3), train.counts.reshape(-1).astype(float), rcond=None)[0]
    return lambda samples: _powers(taxel_depths(samples)) @ weights


def taxel_depths(samples: "Samples") -> np.ndarray:
    """Mean deformation (n, row, column) in mm over each taxel."""
    from softtact.learning.network import taxel_weights  # torch, which those who read tables alone do without

    rows, columns = (taxel_weights(points, parts)
                     for points, parts in zip(samples.maps_mm.shape[1:], samples.counts.shape[1:], strict=True))
    return rows @ samples.maps_mm.astype(float) @ columns.T


def _powers(depth):
    return np.stack([np.ones_like(depth), depth, depth**2], axis=-1)


def _flat(array):
    return array.reshape(len(array), -1)


def _with_one(features):
    return np.hstack([np.ones((len(features), 1)), features])


def score_table(networks: pd.DataFrame, baselines: pd.DataFrame, ceiling: pd.DataFrame) -> pd.DataFrame:
    """Frame with COLUMNS: a row for each model, set, predictor and force, with one over all forces first.

    networks, baselines: rows as of `score_samples` with the column predictor (of a network, its architecture);  ceiling: of
    `score_sensor`
    mae_share: mean absolute counts over the mean reading
    """
    rows = pd.concat([networks.assign(kind=NETWORK), baselines.assign(kind=baselines.predictor.map(KINDS))])
    models = networks.model.unique()
    sensor = [ceiling.assign(predictor="sensor_repeated", kind=CEILING, model=model) for model in models]
    rows = pd.concat([rows[rows.model.isin(models)], *sensor], ignore_index=True)
    both = pd.concat([rows.assign(force=ALL_FORCES), rows.assign(force=force_labels(rows.force_n))], ignore_index=True)
    table = both.groupby(["model", "set", "force", "predictor", "kind"], sort=False, dropna=False).agg(
        maps=("ssim", "size"), ssim=("ssim", "mean"), ssim_own_range=("ssim_own_range", "mean"), mae_counts=("mae_counts", "mean"),
        mean_counts=("mean_counts", "mean"), overlap=("overlap", "mean")).reset_index()
    table["mae_share"] = table.mae_counts / table.mean_counts.where(table.mean_counts > 0)
    return _with_skill(table)[COLUMNS]


def force_labels(force_n: pd.Series) -> pd.Series:
    """Labels of forces: their values or, with more than FORCES different ones, the middle of one of BINS equal ranges."""
    if force_n.nunique() <= FORCES:
        return force_n.map("{:g}".format)
    width = force_n.max() / BINS
    middle = (np.ceil(force_n / width).clip(lower=1) - 0.5) * width
    return middle.map("{:.3g}".format)


def _with_skill(table):
    """The table with both skills; nan if the sensor was read once, or if a baseline is not below the ceiling."""
    place = ["model", "set", "force"]
    ceiling = table[table.kind == CEILING].set_index(place).ssim
    for name, kind in _OF_KIND.items():
        best = table[table.kind == kind].groupby(place).ssim.max()
        left = (ceiling - best).where(lambda values: values > 0)
        known = pd.DataFrame({"best": best, "left": left}).reindex(pd.MultiIndex.from_frame(table[place]))
        table[name] = (table.ssim.to_numpy() - known.best.to_numpy()) / known.left.to_numpy()
    return table


def forces_of(table: pd.DataFrame) -> list[str]:
    """The forces of a `score_table` in rising order, without the row over all forces."""
    return sorted(set(table.force) - {ALL_FORCES}, key=float)


def level_table(table: pd.DataFrame) -> pd.DataFrame:
    """A `score_table` with a row per predictor and set, and columns of mean SSIM and mean absolute counts for each force in N."""
    place, forces = ["set", "model", "predictor", "kind"], forces_of(table)
    wide = table[table.force != ALL_FORCES].pivot_table(index=place, columns="force", values=["ssim", "mae_counts"], sort=False)
    columns = [(value, force) for value in ("ssim", "mae_counts") for force in forces]
    wide = wide.reindex(columns=columns)
    wide.columns = [f"{value}_{force}_n" for value, force in columns]
    return wide.reset_index()


def untrained(table: pd.DataFrame, sets: Iterable[str] | None = None) -> pd.DataFrame:
    """Rows model, predictor, set, ssim, mean_reading of networks that score below the mean reading at that force."""
    chosen = table[(table.force == ALL_FORCES) & (table["set"].isin(list(sets)) if sets is not None else True)]
    mean = chosen[chosen.predictor == "mean_reading"].set_index(["model", "set"]).ssim
    networks = chosen[chosen.kind == NETWORK]
    known = mean.reindex(pd.MultiIndex.from_frame(networks[["model", "set"]])).to_numpy()
    found = networks.assign(mean_reading=known)[["model", "predictor", "set", "ssim", "mean_reading"]]
    return found[found.ssim < found.mean_reading].reset_index(drop=True)


def verdicts(table: pd.DataFrame, *, architecture: str, sets: Sequence[str] = ("validation", "unseen", "grasps")) -> list[str]:
    """Sentences on the study's networks for the head of the report: networks that are not trained, and scores of the study's.

    architecture: that of the networks of the study's results
    """
    bad = untrained(table, sets)
    sentences = []
    for (model, predictor), rows in bad.groupby(["model", "predictor"], sort=False):
        means = ", ".join(f"{row.set} {row.ssim:.3f} against {row.mean_reading:.3f}" for row in rows.itertuples())
        sentences.append(f"Not trained: the {predictor} network of the {model} model reads worse than the mean training reading at "
                         f"that force (SSIM on {means}); its scores say nothing about the model.")
    return sentences + [_score_sentence(table, model, architecture) for model in table.model.unique()]


def _score_sentence(table, model, architecture):
    """One sentence that compares the study's network of a model with predictors without a network, on grasps."""
    rows = table[(table.model == model) & (table["set"] == "grasps")]
    largest = forces_of(rows)[-1]      # that grasps reach, which may be less than other sets do
    rows = rows[rows.force == largest]
    network = rows[rows.predictor == architecture].iloc[0]
    rest = rows[rows.kind.isin(["trivial", "simple"])]
    best = rest.loc[rest.ssim.idxmax()]
    skill = "" if np.isnan(network.skill) else f", skill {network.skill:.2f} over the best trivial one"
    return (f"At {largest} N on grasped objects the {architecture} network of the {model} model has SSIM {network.ssim:.3f} "
            f"and errs by {network.mae_share:.0%} of the mean reading{skill}; the best predictor without a network, "
            f"{best.predictor}, has {best.ssim:.3f} and {best.mae_share:.0%}.")
