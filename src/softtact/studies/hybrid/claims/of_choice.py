"""Claims on the choice of the model: the rule and its table, the hybrid against either model, and which model reads better."""

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from softtact.evaluation.decisions import (
    CONSISTENT,
    CONTRADICTION,
    LEAST_OBJECTS,
    NOT,
    REPRODUCED,
    RULE,
    UNDECIDED,
    above,
    all_of,
    below,
    inside,
    mean_over_objects,
    row,
    share_of_objects,
    verdict_of,
)
from softtact.learning.dataset import object_of

if TYPE_CHECKING:
    from softtact.studies.hybrid.tables import Counts

ALIKE = 0.1  # relative: counts of an object of ours that stands for a printed one
LEVEL = 0.01  # of mean SSIM: below, a difference is no more than another seed may make; assumed
_COUNTS = ("NPt", "CHt", "NPo", "CHo")
_MODELS = {"hyperelastic", "elastic"}
_FACETS_AT_A_POINT = 6  # of a closed mesh of triangles, in the mean: so a merged point stands for six stored ones


def claims_of_choice(
    complexity: pd.DataFrame,
    *,
    choose: Callable[..., str],
    printed_counts: "dict[str, Counts]",
    ssim: pd.DataFrame,
    timing: pd.DataFrame,
    source: str,
) -> Iterator[dict[str, str]]:
    """A row for each; the tables as the study's files hold them, source: of the readings."""
    any_rule, all_rule = (
        all(choose(*counts[:4], rule=rule) == counts[4] for counts in printed_counts.values()) for rule in ("any", "all")
    )
    yield row(
        "Hyperelastic where NPt >= 10 CHt and NPo >= 8 CHo",
        "sec. 3.3.1, table 2",
        "six choices",
        f"'and' gives all six: {all_rule}; 'or' gives all six: {any_rule}",
        CONSISTENT if all_rule else CONTRADICTION,
        "the rule as worded gives the six printed choices",
        "tables/table2_complexity.csv",
        uncertainty="none: counts",
    )
    yield _sent_to_the_printed_models(complexity, choose, printed_counts)
    chosen = complexity.set_index("object").model.to_dict()
    yield _hybrid(chosen, ssim, timing, source)
    yield _better_model(chosen, ssim, source)


def _sent_to_the_printed_models(complexity, choose, printed_counts):
    """Only objects whose counts are those of table 2 test the claim; others are objects of this study with the same names."""
    ours = complexity.set_index("object")
    known = [name for name in printed_counts if name in ours.index]
    counted = set(_COUNTS) <= set(ours)
    alike = [
        name
        for name in known
        if counted
        and np.allclose(ours.loc[name, list(_COUNTS)].to_numpy(dtype=float), printed_counts[name][:4], rtol=ALIKE, atol=0)
    ]
    agree = {name: ours.model[name] == printed_counts[name][4] for name in known}
    shown = (
        f"objects with the printed counts: {len(alike)}; of our own objects of the printed kinds, with other meshes, "
        f"{sum(agree.values())} of {len(known)} get the printed model"
    )
    if counted and known:
        merged = [
            name.replace("_", " ")
            for name in known
            if choose(*_merged(ours.loc[name])) != ours.model[name] == printed_counts[name][4]
        ]
        shown += f"; with merged points {', '.join(merged) or 'none of these'} would get the other one"
    verdict = verdict_of(all(agree[name] for name in alike)) if len(alike) >= LEAST_OBJECTS else UNDECIDED
    return row(
        "The objects of figure 7 are sent to the printed models",
        "table 2",
        "1-4 elastic, 5-6 hyperelastic",
        shown,
        verdict,
        f"at least {LEAST_OBJECTS} objects with table 2's four counts within {ALIKE:.0%}, all choices equal",
        "tables/table2_complexity.csv",
        uncertainty="none: counts; a merged point is taken for six stored ones",
    )


def _merged(counts):
    """The counts with each point counted once: V = NPt / 6 + 2 of a closed mesh without handles, and a sixth of the overlap."""
    return counts.NPt / _FACETS_AT_A_POINT + 2, counts.CHt, counts.NPo / _FACETS_AT_A_POINT, counts.CHo


def _hybrid(chosen, ssim, timing, source):
    """The title's claim, on accuracy and on time: the model that the rule chooses for each object, against either alone."""
    claim, place, printed = "The hybrid of both models balances accuracy and time", "title, sec. 5", "a trade-off"
    rule = (
        f"SSIM on grasps, object by object: less than {LEVEL:g} below the better model alone, more than {LEVEL:g} above the worse "
        f"one; faster than the hyperelastic model; {RULE}, of objects sent to each model; undecided where both models read alike"
    )
    scores = _of_objects(ssim[ssim.set == "grasps"], chosen, "ssim")
    times = _of_objects(timing[timing.set == "grasps"].assign(total=lambda rows: rows.solver_s + rows.network_s), chosen, "total")
    if scores is None or times is None:
        return row(claim, place, printed, f"no press of both models, {source}", UNDECIDED, rule, "evaluation/ssim.csv")
    shown = ", ".join(
        f"{name} SSIM {scores[name].mean():.3f} in {times[name].mean():.2f} s a map"
        for name in ("hybrid", "hyperelastic", "elastic")
    )
    better, worse = ("hyperelastic", "elastic")[:: 1 if scores.hyperelastic.mean() >= scores.elastic.mean() else -1]
    loss, gain = (mean_over_objects(scores.hybrid - scores[name]) for name in (better, worse))
    slower = mean_over_objects(times.hybrid - times.hyperelastic)
    sent = [int((scores.sent == model).sum()) for model in ("elastic", "hyperelastic")]
    verdict = all_of([above(loss, -LEVEL), above(gain, LEVEL), below(slower, 0.0)])
    alike = inside(mean_over_objects(scores[better] - scores[worse]), -LEVEL, LEVEL) == REPRODUCED
    if alike and not (above(loss, -LEVEL) == NOT or below(slower, 0.0) == NOT):
        verdict, shown = UNDECIDED, f"{shown}. Both models read alike here, so that accuracy decides nothing"
    return row(
        claim,
        place,
        printed,
        f"{shown}, {source}",
        verdict if min(sent) >= LEAST_OBJECTS else UNDECIDED,
        rule,
        "evaluation/ssim.csv",
        uncertainty=f"hybrid minus the {better} model {loss.in_words()}, minus the {worse} one {gain.in_words()}; "
        f"{sent[0]} sent to the elastic, {sent[1]} to the hyperelastic model",
    )


def _better_model(chosen, ssim, source):
    """Is the chosen model the better one, for more objects than by chance? Objects that both models read alike are left out."""
    claim = "The rule sends an object to the model that reads it better"
    rule = (
        f"share of objects whose chosen model has the larger mean SSIM above one half, of those where the models part by more than "
        f"{LEVEL:g}; {RULE}"
    )
    scores = _of_objects(ssim[ssim.set == "grasps"], chosen, "ssim")
    if scores is None:
        return row(
            claim, "sec. 3.3.1, 4.2", "described", f"no press of both models, {source}", UNDECIDED, rule, "evaluation/ssim.csv"
        )
    other = np.where(scores.sent == "hyperelastic", scores.elastic, scores.hyperelastic)
    gain = scores.hybrid - other
    apart = gain[gain.abs() > LEVEL]
    share = share_of_objects(int((apart > 0).sum()), len(apart))
    listed = ", ".join(f"{name.replace('_', ' ')} {value:+.3f}" for name, value in gain.items())
    return row(
        claim,
        "sec. 3.3.1, 4.2",
        "described",
        f"{int((apart > 0).sum())} of {len(apart)} objects (chosen minus other model: {listed}), {source}",
        above(share, 0.5),
        rule,
        "evaluation/ssim.csv",
        uncertainty=share.in_words(".2f"),
    )


def _of_objects(rows, chosen, quantity):
    """Frame hybrid, hyperelastic, elastic, sent: a row for each object, means of a quantity; None without both models."""
    if not set(rows.model) >= _MODELS or "item" not in rows:
        return None
    means = rows.assign(item=rows["item"].map(object_of)).groupby(["item", "model"])[quantity].mean().unstack()
    means = means[[item in chosen for item in means.index]].dropna(subset=sorted(_MODELS))
    if not len(means):
        return None
    sent = [chosen[item] for item in means.index]
    hybrid = [means.loc[item, model] for item, model in zip(means.index, sent, strict=True)]
    return means[sorted(_MODELS)].assign(sent=sent, hybrid=hybrid)
