"""What a score is worth: every predictor beside every other, by set and force, with its skill; and which network is not trained.

skill           (score - best trivial) / (ceiling - best trivial) of mean SSIM: 0 is no better than the best predictor that looks up
                a reading, 1 is the sensor's own repeatability
skill_simple    the same over the best simple predictor: below 0, a formula of a few numbers reads better than the network
The kinds of predictors are those of `baselines.KINDS`.
"""

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd

from softtact.evaluation.baselines import KINDS

NETWORK, CEILING = "network", "sensor"
ALL_FORCES = "all"
FORCES, BINS = 25, 10     # an archive's forces are all different
COLUMNS = ["model", "set", "force", "predictor", "kind", "maps", "ssim", "ssim_own_range", "mae_counts", "mae_share", "overlap",
           "skill", "skill_simple"]
_OF_KIND = {"skill": "trivial", "skill_simple": "simple"}


def score_table(networks: pd.DataFrame, baselines: pd.DataFrame, ceiling: pd.DataFrame) -> pd.DataFrame:
    """Frame with COLUMNS: a row for each model, set, predictor, and force: all together, each, in this order.

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
    """What the forces are called: their values or, where there are more than FORCES, the middle of one of BINS equal ranges."""
    if force_n.nunique() <= FORCES:
        return force_n.map("{:g}".format)
    width = force_n.max() / BINS
    middle = (np.ceil(force_n / width).clip(lower=1) - 0.5) * width
    return middle.map("{:.3g}".format)


def _with_skill(table):
    """The table with both skills; empty where the sensor was read once, or where nothing is left above a baseline."""
    place = ["model", "set", "force"]
    own = table[table.kind == CEILING].set_index(place).ssim
    for name, kind in _OF_KIND.items():
        best = table[table.kind == kind].groupby(place).ssim.max()
        left = (own - best).where(lambda values: values > 0)
        known = pd.DataFrame({"best": best, "left": left}).reindex(pd.MultiIndex.from_frame(table[place]))
        table[name] = (table.ssim.to_numpy() - known.best.to_numpy()) / known.left.to_numpy()
    return table


def forces_of(table: pd.DataFrame) -> list[str]:
    """The forces of a `score_table` in rising order, without the row of all."""
    return sorted(set(table.force) - {ALL_FORCES}, key=float)


def level_table(table: pd.DataFrame) -> pd.DataFrame:
    """A `score_table` with one row per predictor and set, and mean SSIM and mean absolute counts in a column for each force, N."""
    place, forces = ["set", "model", "predictor", "kind"], forces_of(table)
    wide = table[table.force != ALL_FORCES].pivot_table(index=place, columns="force", values=["ssim", "mae_counts"], sort=False)
    columns = [(value, force) for value in ("ssim", "mae_counts") for force in forces]
    wide = wide.reindex(columns=columns)
    wide.columns = [f"{value}_{force}_n" for value, force in columns]
    return wide.reset_index()


def untrained(table: pd.DataFrame, sets: Iterable[str] | None = None) -> pd.DataFrame:
    """Rows model, predictor, set, ssim, mean_reading of the networks that read worse than the mean reading at that force."""
    chosen = table[(table.force == ALL_FORCES) & (table["set"].isin(list(sets)) if sets is not None else True)]
    mean = chosen[chosen.predictor == "mean_reading"].set_index(["model", "set"]).ssim
    networks = chosen[chosen.kind == NETWORK]
    known = mean.reindex(pd.MultiIndex.from_frame(networks[["model", "set"]])).to_numpy()
    found = networks.assign(mean_reading=known)[["model", "predictor", "set", "ssim", "mean_reading"]]
    return found[found.ssim < found.mean_reading].reset_index(drop=True)


def verdicts(table: pd.DataFrame, *, own: str, sets: Sequence[str] = ("validation", "unseen", "grasps")) -> list[str]:
    """Sentences on the study's networks, for the head of the report: which are not trained, and what the others are worth.

    own: the architecture that the study's results rest on
    """
    bad = untrained(table, sets)
    said = []
    for (model, predictor), rows in bad.groupby(["model", "predictor"], sort=False):
        told = ", ".join(f"{row.set} {row.ssim:.3f} against {row.mean_reading:.3f}" for row in rows.itertuples())
        said.append(f"Not trained: the {predictor} network of the {model} model reads worse than the mean training reading at that "
                    f"force (SSIM on {told}); its scores say nothing about the model.")
    return said + [_worth(table, model, own) for model in table.model.unique()]


def _worth(table, model, own):
    """One sentence on what the study's network of a model has over predictors without a network, on grasps."""
    forces = forces_of(table)
    rows = table[(table.model == model) & (table["set"] == "grasps") & (table.force == forces[-1])]
    network = rows[rows.predictor == own].iloc[0]
    rest = rows[rows.kind.isin(["trivial", "simple"])]
    best = rest.loc[rest.ssim.idxmax()]
    skill = "" if np.isnan(network.skill) else f", skill {network.skill:.2f} over the best trivial one"
    return (f"At {forces[-1]} N on grasped objects the {own} network of the {model} model has SSIM {network.ssim:.3f} and errs by "
            f"{network.mae_share:.0%} of the mean reading{skill}; the best predictor without a network, {best.predictor}, has "
            f"{best.ssim:.3f} and {best.mae_share:.0%}.")
