"""Claims on the readings: SSIM by set, object and model, and how the sensor repeats itself.

All comparisons are of objects, by the rule of `evaluation.decisions`: maps of one object are one piece of evidence.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from softtact.evaluation.decisions import (
    ARCHIVE,
    CONTRADICTION,
    LEAST_OBJECTS,
    RULE,
    UNDECIDED,
    Estimate,
    above,
    all_of,
    below,
    difference_of_groups,
    inside,
    interval_inside,
    mean_over_objects,
    row,
    wider_spread,
)
from softtact.evaluation.score_tables import ALL_FORCES
from softtact.learning.dataset import object_of
from softtact.published.archive import PRINTED_SSIM
from softtact.published.archive import SOURCE as PUBLISHED

if TYPE_CHECKING:
    import pandas as pd

VIRTUAL = "virtual sensor"  # the usual source of readings; the paper's numbers are judged on the archive's alone
CLOSE = 0.05  # of mean SSIM: what trainings of one network from different seeds and searches may part by, assumed
SMOOTH, RELIEF, STEPPED = ["object_1", "object_2", "object_3"], ["object_4"], ["object_5", "object_6"]
REPEATABLE = 0.999  # SSIM of trials against each other from which on nothing scatters; assumed
_MODELS = ("hyperelastic", "elastic")
_SSIM, _FIGURE = "evaluation/ssim.csv", ("sec. 4.2, fig. 7", "by eye")


def claims_of_scores(
    ssim: "pd.DataFrame",
    *,
    source: str,
    summary: "pd.DataFrame | None",
    per_item: "pd.DataFrame | None",
    ceiling: "pd.DataFrame | None",
    untrained: "pd.DataFrame | None" = None,
    scores: "pd.DataFrame | None" = None,
) -> Iterator[dict[str, str]]:
    """A row for each; the tables as the evaluation writes them, None where they are not there.

    untrained: of `score_tables.untrained`, the networks on whose scores nothing can be based;  scores: a `score_table`
    """
    yield from _agreement(ssim, source)
    yield _smooth_read_better(ssim, source)
    yield from _scores(ssim, source, summary, per_item, untrained)
    yield _below_zero(ssim, source)
    yield _against_pixels(scores, source)
    yield _spread(ssim, source)
    yield _falls(ssim, source)
    yield _repeats(ceiling, source)


def _mean(ssim, model, set_name):
    return float(ssim[(ssim.model == model) & (ssim.set == set_name)].ssim.mean())


def _of_items(ssim, set_name, model, column="ssim"):
    """Means (n,) over the maps of each item of a set, a series by item; an error is over the item's mean reading."""
    rows = ssim[(ssim.set == set_name) & (ssim.model == model)]
    means = rows.groupby("item")[[column, *({"mean_counts"} & set(rows))]].mean()
    return means[column] / means.mean_counts if column == "mae_counts" and "mean_counts" in means else means[column]


def _advantage(ssim, items=None, *, set_name="grasps"):
    """SSIM of hyperelastic minus elastic, item by item, as an `Estimate`."""
    gain = _of_items(ssim, set_name, "hyperelastic") - _of_items(ssim, set_name, "elastic")
    return mean_over_objects(gain[gain.index.isin(items)] if items else gain)


def _agreement(ssim, source):
    for items, text, close in (
        (SMOOTH, "On smooth objects both models do alike", True),
        (RELIEF, "On object 4 both models have a similar SSIM", True),
        (STEPPED, "On objects 5 and 6 the elastic model loses detail", False),
    ):
        gain = _advantage(ssim, items)
        rule = f"SSIM differs by {'at most' if close else 'more than'} {CLOSE:g} of such objects; {RULE}"
        if not gain.objects:
            yield row(text, *_FIGURE, f"0 of {len(items)} objects are in this study", UNDECIDED, rule, _SSIM)
            continue
        yield row(
            text,
            *_FIGURE,
            f"SSIM of hyperelastic minus elastic: {gain.mean:+.3f}, {source}",
            inside(gain, -CLOSE, CLOSE) if close else above(gain, CLOSE),
            rule,
            _SSIM,
            uncertainty=gain.in_words(),
        )


def _smooth_read_better(ssim, source):
    """Are the errors on smooth objects lower, with both models? By the share of the reading that a network errs by."""
    claim = "Smooth objects have lower errors than detailed ones"
    rule = f"with both models, the mean error over the mean reading; in each group {RULE}"
    errors = {model: _of_items(ssim, "grasps", model, "mae_counts") for model in _MODELS}
    groups = {model: [error[error.index.isin(names)] for names in (SMOOTH, STEPPED)] for model, error in errors.items()}
    if not all(len(part) for pair in groups.values() for part in pair):
        return row(claim, "sec. 4.2", "by eye", "smooth or stepped objects are not in this study", UNDECIDED, rule, _SSIM)
    gaps = {model: difference_of_groups(*pair) for model, pair in groups.items()}
    shown = ", ".join(f"{model} {smooth.mean():.3g} against {stepped.mean():.3g}" for model, (smooth, stepped) in groups.items())
    return row(
        claim,
        "sec. 4.2",
        "by eye",
        f"mean error over the mean reading: {shown}, {source}",
        all_of([below(gap, 0.0) for gap in gaps.values()]),
        rule,
        _SSIM,
        uncertainty="; ".join(f"{model} {gap.in_words()} of the smaller group" for model, gap in gaps.items()),
    )


def _below_zero(ssim, source):
    """The printed range of SSIM is not that of its formula: the covariance in it can be negative."""
    return row(
        "SSIM lies between 0 and 1",
        "sec. 4.2",
        "0 to 1",
        f"least of {len(ssim)} maps {ssim.ssim.min():.3f}, {source}; by its "
        "formula SSIM is below 0 for maps of negative covariance",
        CONTRADICTION,
        "the printed formula keeps to the range",
        "evaluation/ssim.csv",
        uncertainty="none: the formula's own range is -1 to 1",
    )


def _against_pixels(scores, source):
    """What SSIM and the error in counts make of a reading that is halved, or off by a taxel. A measure has no truth to meet."""
    claim, printed = "SSIM judges a tactile map better than errors of its pixels do", "particularly well-suited"
    rule = "no verdict: which errors matter is the user's choice; how blind SSIM is to counts is shown"
    rows = None if scores is None else scores[(scores["set"] == "grasps") & (scores.force.astype(str) == ALL_FORCES)]
    marks = (
        []
        if rows is None
        else [(name, rows[rows.predictor == name].iloc[0]) for name in ("halved", "moved") if (rows.predictor == name).any()]
    )
    words = {"halved": "a reading halved in all taxels", "moved": "one moved by a taxel"}
    shown = "; ".join(
        f"{words[name]} has SSIM {mark.ssim:.2f} and errs by {mark.mae_share:.0%} of the mean reading"
        if "mae_share" in mark
        else f"{words[name]} has SSIM {mark.ssim:.2f}"
        for name, mark in marks
    )
    printed_grasps = " and ".join(f"{value:g}" for value in PRINTED_SSIM["grasps"].values())
    return row(
        claim,
        "sec. 4.2",
        printed,
        f"{shown}; the paper's networks have {printed_grasps}; {source}" if marks else f"no such scores, {source}",
        UNDECIDED,
        rule,
        "tables/scores.csv",
        uncertainty="none: means of all grasped objects' maps",
    )


def _against_print(estimate, printed, source):
    """Verdict and rule for a mean SSIM beside the paper's; nan: the archive has no simulation of that model."""
    if source != PUBLISHED:
        return ARCHIVE, "the paper's readings are not here: no verdict on its number"
    if not np.isfinite(estimate.mean):
        return UNDECIDED, "needs the archive's simulations of this model"
    return inside(estimate, printed - CLOSE, printed + CLOSE), f"within {CLOSE:g} of the paper's, on its readings; {RULE}"


def _scores(ssim, source, summary, per_item, untrained):
    for set_name, values in PRINTED_SSIM.items():
        for model, value in values.items():
            count = len(ssim[(ssim.model == model) & (ssim.set == set_name)])
            verdict, rule = _against_print(_by_maps(ssim, summary, set_name, model), value, source)
            yield row(
                f"SSIM of the {model} model on {set_name}",
                "sec. 4.2",
                value,
                f"{_mean(ssim, model, set_name):.2f} over {count} maps, {source}",
                verdict,
                rule,
                _SSIM,
                uncertainty=_interval(summary, model=model, set=set_name),
            )
    for model, value in (("hyperelastic", 0.97), ("elastic", 0.90)):
        yield _best_object(ssim, per_item, model, value, source)
    gain = _advantage(ssim)
    yield row(
        "On grasped objects the hyperelastic model reads better than the elastic one",
        "sec. 4.2, fig. 6",
        "0.72 > 0.63",
        f"SSIM of hyperelastic minus elastic: {gain.mean:+.3f}, {source}",
        above(gain, 0.0),
        f"object by object above 0; {RULE}",
        _SSIM,
        uncertainty=gain.in_words(),
    )
    yield _one_architecture(ssim, source, untrained)


def _by_maps(ssim, summary, set_name, model):
    """The mean over maps, as the paper takes it, with its interval over objects and trials where the evaluation has it."""
    items = _of_items(ssim, set_name, model)
    found = _row_of(summary, model=model, set=set_name)
    if found is None:
        return mean_over_objects(items)
    return Estimate(_mean(ssim, model, set_name), float(found.ssim_low), float(found.ssim_high), len(items))


def _best_object(ssim, per_item, model, printed, source):
    """The largest mean of an object, judged by the scatter of its trials; the largest of few is lower than that of many."""
    best = _of_items(ssim, "grasps", model)
    claim, place = f"Best object of the {model} model", "abstract"
    if not len(best):
        return row(
            claim,
            place,
            printed,
            f"no maps of this model, {source}",
            UNDECIDED if source == PUBLISHED else ARCHIVE,
            "needs the archive's simulations of this model",
            _SSIM,
        )
    name = best.idxmax()
    found, verdict = _row_of(per_item, model=model, set="grasps", item=name), ARCHIVE
    rule = "the paper's readings are not here: no verdict on its number"
    if source == PUBLISHED:
        rule = (
            f"the 95 % interval over its trials within {CLOSE:g} of the paper's; at least {LEAST_OBJECTS} objects to be the best of"
        )
        verdict = (
            interval_inside((found.ssim_low, found.ssim_high), printed - CLOSE, printed + CLOSE)
            if found is not None and len(best) >= LEAST_OBJECTS
            else UNDECIDED
        )
    return row(
        claim,
        place,
        printed,
        f"{best.max():.2f} ({name}), {source}",
        verdict,
        rule,
        _SSIM,
        uncertainty=_interval(per_item, model=model, set="grasps", item=name),
    )


def _one_architecture(ssim, source, untrained):
    """Judged on indenters that training never saw: of the validation maps' presses, others were trained on."""
    gain = _advantage(ssim, set_name="unseen")
    trained = untrained is None or not untrained["set"].isin(["validation", "unseen"]).any()
    both = {name: [_mean(ssim, model, name) for model in _MODELS] for name in ("validation", "unseen")}
    shown = "; ".join(f"{name} {values[0]:.2f} and {values[1]:.2f}" for name, values in both.items())
    return row(
        "One architecture serves both models alike",
        "sec. 3.3.2, 4.2",
        "validation 0.87 and 0.86",
        f"SSIM of hyperelastic and elastic: {shown}, {source}",
        inside(gain, -CLOSE, CLOSE) if trained else UNDECIDED,
        f"on unseen indenters SSIM differs by at most {CLOSE:g}; {RULE}; no network reads "
        "worse than the mean reading at that force",
        _SSIM,
        uncertainty=f"unseen: {gain.in_words()}",
    )


def _row_of(table, **where):
    """The one row of a table of scores with these values and a known interval, or None."""
    if table is None:
        return None
    chosen = table[np.logical_and.reduce([table[key] == value for key, value in where.items()])]
    return chosen.iloc[0] if len(chosen) == 1 and np.isfinite(chosen.ssim_low.iloc[0]) else None


def _interval(table, **where):
    """The 95 % interval of a mean in one row of a table of scores."""
    if table is None:
        return "not told"
    found = _row_of(table, **where)
    return "one item or trial: no interval" if found is None else f"95 % interval {found.ssim_low:.3f} to {found.ssim_high:.3f}"


def _spread(ssim, source):
    """Does the elastic model's score vary more from object to object?"""
    claim = "The elastic model's SSIM varies more from object to object"
    rule = f"correlation of the models' sum and difference over objects (Pitman and Morgan) above 0; {RULE}"
    elastic, hyper = _of_items(ssim, "grasps", "elastic").align(_of_items(ssim, "grasps", "hyperelastic"), join="inner")
    found = wider_spread(elastic, hyper)
    if len(elastic) < 2:
        return row(
            claim,
            "sec. 4.2",
            "by eye",
            f"fewer than two objects with both models, {source}",
            UNDECIDED,
            rule,
            "evaluation/items.csv",
        )
    return row(
        claim,
        "sec. 4.2",
        "by eye",
        f"standard deviation of objects: elastic {elastic.std(ddof=1):.3f}, hyperelastic {hyper.std(ddof=1):.3f}, {source}",
        above(found, 0.0),
        rule,
        "evaluation/items.csv",
        uncertainty=f"correlation: {found.in_words('+.2f')}",
    )


def _falls(ssim, source):
    """Do both models read validation maps best and grasped objects worst?"""
    claim = "Both models read validation maps best, then unseen indenters, then grasped objects"
    printed, rule = "0.87, 0.81, 0.72 and 0.86, 0.82, 0.63", f"both steps down, with both models; in each set {RULE}"
    sets = ("validation", "unseen", "grasps")
    items = {model: [_of_items(ssim, name, model) for name in sets] for model in _MODELS}
    steps = {
        f"{model}, {sets[k]} to {sets[k + 1]}": difference_of_groups(parts[k], parts[k + 1])
        for model, parts in items.items()
        for k in range(2)
    }
    shown = "; ".join(f"{model} {', '.join(f'{_mean(ssim, model, name):.2f}' for name in sets)}" for model in _MODELS)
    return row(
        claim,
        "sec. 4.2",
        printed,
        f"{shown}, {source}",
        all_of([above(step, 0.0) for step in steps.values()]),
        rule,
        "evaluation/summary.csv",
        uncertainty="; ".join(f"{name}: {step.in_words()}" for name, step in steps.items()),
    )


def _repeats(ceiling, source):
    """Do readings of the same press scatter, as hysteresis makes the real sensor's?"""
    claim, printed = "Readings of the same press scatter from trial to trial (hysteresis)", "50 trials at 50 N"
    rule = f"on the paper's readings, the sensor's SSIM against itself is below {REPEATABLE:g}; {RULE}"
    if ceiling is None or not len(ceiling):
        return row(claim, "sec. 4.2", printed, f"no press was read twice, {source}", UNDECIDED, rule, "evaluation/ceiling.csv")
    mean = mean_over_objects(ceiling.ssim.groupby(ceiling["item"].map(object_of)).mean())
    return row(
        claim,
        "sec. 4.2",
        printed,
        f"SSIM of trials against each other {mean.mean:.4f}, {source}",
        below(mean, REPEATABLE) if source == PUBLISHED else ARCHIVE,
        rule,
        "evaluation/ceiling.csv",
        uncertainty=mean.in_words(".4f"),
    )
