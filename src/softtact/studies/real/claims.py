"""Verdicts of the study: our goals on measured data, judged on presses or points that were not fitted where there are any."""

from collections.abc import Mapping

import pandas as pd

from softtact.evaluation.decisions import COLUMNS, UNDECIDED, below, mean_over_objects, row, verdict_of
from softtact.studies.real.labelled import AROUND_SCORED, SHADOWS, SMALL, WHEEL
from softtact.studies.real.stages.force import ELASTIC
from softtact.studies.real.stages.markers import FORMULAS, LAYER, PHYSICS, SPLINE

DEPTH_ERROR, MARKERS_ERROR, SHEARED_ERROR = 0.05, 0.48, 0.25
SAME_LEVELS = 0.05      # grey levels: a smaller change of the error is none
MADE = "made data: nothing was measured"


def claims_of_real(tables: Mapping[str, pd.DataFrame], *, limits: Mapping[str, float | None], made: Mapping[str, bool],
                   stated: Mapping[str, float | None], markers_made: bool, sheared: list[str],
                   judged: str) -> pd.DataFrame:
    """Data frame with `decisions.COLUMNS`.

    limits: MAE in grey levels by set;  made: sets that the study drew itself;  stated: radius of the ball in px where it is known
    judged: variant of the gel's force that decides
    """
    rows = [*_force(tables["gel_force"], judged), *_markers(tables["markers"], tables["other_markers"], markers_made, sheared)]
    for name, limit in limits.items():
        rows += _shading(name, tables["shading"], limit, made[name])
        rows += _shadows(name, tables["shading"], made[name])
    rows += [_labels(name, own, made[name]) for name, own in tables["circles"].groupby("set", sort=False)]
    rows += [_size(name, own, made[name], stated[name]) for name, own in tables["ball_size"].groupby("set", sort=False)]
    return pd.DataFrame(rows, columns=COLUMNS)


def _force(table, judged):
    points = table.depth_mm.nunique()
    for to, words in (("all", "One modulus gives the depth of every measured force"),
                      ("one", "A modulus fitted to one measured force gives the depth of another")):
        with_all = table.fitted_to == "all"
        own = table[(table.variant == judged) & (with_all if to == "all" else ~table.fitted & ~with_all)]
        worst, layer = (one.depth_error.abs().max(skipna=False) for one in (own, table[(table.variant == ELASTIC) & with_all]))
        how = "fitted, or predicted with it" if to == "all" else "predicted"
        yield row(words, "force on a GelSight Mini", f"within {DEPTH_ERROR:.0%}",
                  f"largest error {_depth_error(worst)} ({how}); layer {_depth_error(layer)}, fitted, or predicted with it",
                  verdict_of(bool(worst <= DEPTH_ERROR)), f"depth at the measured force, variant {judged}", "tables/gel_force.csv",
                  uncertainty=f"{points} points; variants of contact and compressibility in the table")


def _depth_error(worst):
    """A largest error in words; nan where the depth of a measured force is beyond the path."""
    return "beyond the computed depths" if pd.isna(worst) else f"{worst:.1%}"


def _markers(table, others, made, sheared):
    own = table[table.camera == "shift"].set_index("model").components
    spline = table[table.model == SPLINE].components.iloc[0]
    ours = f"{own[PHYSICS]:.3f}; formulas {own[FORMULAS]:.3f}, linear layer {own[LAYER]:.3f}, spline left out {spline:.3f}"
    yield row("The motion of markers under a ball is explained to the tracking's noise", "FOTS, marker image",
              f"at most {MARKERS_ERROR:g}",
              MADE if made else ours, UNDECIDED if made else verdict_of(bool(own[PHYSICS] <= MARKERS_ERROR)),
              "sum |predicted - measured| / sum |measured|; camera's shift and parameters fitted to this image",
              "tables/markers.csv", uncertainty="one image, motion in whole px")
    for name, rows in others[others.camera == "shift"].groupby("image", sort=False):
        error, limit = rows.set_index("model").components, SHEARED_ERROR if name in sheared else MARKERS_ERROR
        yield row(f"The gel found on the first image explains {name}", "marker image", f"at most {limit:g}",
                  f"{error[PHYSICS]:.3f}; formulas {error[FORMULAS]:.3f}, linear layer {error[LAYER]:.3f}",
                  UNDECIDED if made else verdict_of(bool(error[PHYSICS] <= limit)),
                  "place, depth, motion aside and camera's shift fitted", "tables/other_markers.csv", uncertainty="one image")


def _shading(name, table, limit, made):
    own = table[(table.set == name)]

    def per_press(model, circles):
        return own[(own.model == model) & (own.circles == circles)].groupby("press").mae.mean()

    for circles in ("labelled", "found"):
        best = per_press("table", circles)
        beside = {model: per_press(model, circles).mean() for model in (SMALL, "phong", WHEEL) if (own.model == model).any()}
        estimate = mean_over_objects(best)
        seen = {WHEEL: " (which has seen them)"}
        others = ", ".join(f"{model}{seen.get(model, '')} {value:.2f}" for model, value in beside.items())
        verdict = UNDECIDED if made or limit is None else below(estimate, limit)
        yield row(f"The table predicts the colours of held-out presses of {name}, {circles} circles", "shading",
                  "no limit" if limit is None else f"at most {limit:g} grey levels",
                  MADE if made else f"MAE {estimate.mean:.2f}; {others}", verdict,
                  "mean absolute error in the labelled circle", "tables/shading.csv",
                  uncertainty=f"{estimate.in_words('.2f')}; {_of_seeds(own, 'table', circles)}")


def _of_seeds(own, model, circles, score="mae"):
    """The least and the largest mean over the splits, in words."""
    means = own[(own.model == model) & (own.circles == circles)].groupby("seed")[score].mean()
    return f"{len(means)} splits, {means.min():.2f} to {means.max():.2f}"


def _shadows(name, table, made):
    """Against the same table without shadows, press by press: less error around the circle, and none more inside."""
    own = table[(table.set == name) & (table.circles == "found")]
    means = own[own.model.isin(["table", SHADOWS])].groupby(["model", "press"])[["mae", "around_mae"]].mean()
    plain, shaded = means.loc["table"], means.loc[SHADOWS]
    gain = mean_over_objects((shaded - plain).around_mae)
    more = float((shaded - plain).mae.mean())
    none = bool((shaded == plain).all(axis=None))
    verdict = UNDECIDED if made or none or more > SAME_LEVELS else below(gain, 0.0)
    words = "no shadows are seen in the presses" if none else (
        f"MAE around {shaded.around_mae.mean():.2f}, without {plain.around_mae.mean():.2f}; "
        f"in the circle {shaded.mae.mean():.2f} and {plain.mae.mean():.2f}")
    yield row(f"Cast shadows explain held-out presses of {name}", "shading", "less error around, none more in the circle",
              MADE if made else words, verdict, f"mean absolute error from 1 to {AROUND_SCORED:g} labelled radii, found circles",
              "tables/shading.csv", uncertainty=f"change {gain.in_words('.2f')}; {_of_seeds(own, SHADOWS, 'found', 'around_mae')}")


def _labels(name, own, made):
    """Whether two ways of finding a contact's middle agree with its label, or with each other only."""
    label, odd, both = (own[f"{one}_px"].median() for one in ("found_minus_label", "odd_minus_label", "odd_minus_found"))
    off = both < 0.5 * min(label, odd)
    return row(f"The labelled circles of {name} lie where the images show them", "shading", "not stated",
               MADE if made else f"found to label {label:.1f} px, most odd to label {odd:.1f} px, most odd to found {both:.1f} px",
               UNDECIDED if made else verdict_of(not off), "not so where the two middles that are found lie less than half "
               "as far from each other as each from the label; medians", "tables/circles.csv", uncertainty=f"{len(own)} presses")


def _size(name, own, made, stated):
    """Against the stated size where there is one; else found only if the intervals of all models agree."""
    each = own.drop_duplicates("model")
    words = [f"{one.model} {one.best_px:.0f} px ({one.best_low_px:.0f} to {one.best_high_px:.0f})" for one in each.itertuples()]
    best = own[own.model == own.model[own.mae.idxmin()]].iloc[0]
    if stated is not None:
        verdict = verdict_of(bool(best.best_low_px <= stated <= best.best_high_px))
    else:
        verdict = verdict_of(True) if each.best_low_px.max() <= each.best_high_px.min() else UNDECIDED
    return row(f"The ball's size of {name} follows from its colours", "shading",
               "not stated" if stated is None else f"{stated:g} px",
               MADE if made else "; ".join(words), UNDECIDED if made else verdict,
               "stated: in the 95 % interval of the model with the least error; not stated: the models' intervals agree",
               "tables/ball_size.csv", uncertainty="presses drawn with replacement")
