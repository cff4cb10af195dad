"""Claims on the readings: SSIM by set, object and model, how the sensor repeats itself; and what the study as a whole decides."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.evaluation.claim_rows import ARCHIVE, CONTRADICTION, UNDECIDED, row, verdict_of
from softtact.published.archive import PRINTED_SSIM
from softtact.published.archive import SOURCE as PUBLISHED

if TYPE_CHECKING:
    import pandas as pd

VIRTUAL = "virtual sensor"      # the usual source of readings; the paper's numbers are judged on the archive's alone
CLOSE = 0.05                    # of mean SSIM: what trainings of one network from different seeds and searches may part by, assumed
FEW = 3                         # items below which a comparison of sets or networks says nothing
SMOOTH, RELIEF, STEPPED = ["object_1", "object_2", "object_3"], ["object_4"], ["object_5", "object_6"]

RANDOM_TRIALS = 10        # of a search, before Optuna's sampler looks at what it has found; searches of one seed share them
LIKE = 2.0                # factor within which widths found by two searches are of a "similar range"; assumed
PAPERS_SENSOR = "coro"
INDENTERS = 49


def claims_of_scores(ssim: "pd.DataFrame", *, source: str, summary: "pd.DataFrame | None", per_item: "pd.DataFrame | None",
                     ceiling: "pd.DataFrame | None", untrained: "pd.DataFrame | None" = None) -> Iterator[dict[str, str]]:
    """A row for each; the tables as the evaluation writes them, None where they are not there.

    untrained: of `score_tables.untrained`, the networks on whose scores nothing can be based
    """
    yield from _agreement(ssim, source)
    yield _smooth_read_better(ssim, source)
    yield from _scores(ssim, source, summary, per_item, untrained)
    yield _below_zero(ssim, source)
    yield _spread(ssim, source)
    yield _falls(ssim, source, summary)
    yield _repeats(ceiling, source)


def _mean(ssim, model, set_name):
    return float(ssim[(ssim.model == model) & (ssim.set == set_name)].ssim.mean())


def _items(ssim, set_name):
    return ssim[ssim.set == set_name].item.nunique()


def _advantage(ssim, items=None):
    """SSIM of hyperelastic minus elastic on the grasped objects: mean, its standard error over objects (nan for one), objects.

    Maps of one object are not independent, so the objects are the sample.
    """
    rows = ssim[(ssim.set == "grasps") & (ssim.item.isin(items) if items else True)]
    means = rows.groupby(["item", "model"]).ssim.mean().unstack()
    if not {"hyperelastic", "elastic"} <= set(ssim.model):
        return np.nan, np.nan, 0
    gain = (means["hyperelastic"] - means["elastic"]) if len(means) else means.sum(axis=1)
    return float(gain.mean()), float(gain.std(ddof=1) / np.sqrt(max(len(gain), 1))), len(gain)


def _agreement(ssim, source):
    for items, text, close in ((SMOOTH, "On smooth objects both models do alike", True),
                               (RELIEF, "On object 4 both models have a similar SSIM", True),
                               (STEPPED, "On objects 5 and 6 the elastic model loses detail", False)):
        gain, error, count = _advantage(ssim, items)
        if count < len(items):
            yield row(text, "sec. 4.2, fig. 7", "by eye", f"{count} of {len(items)} objects are in this study", UNDECIDED,
                       "needs presses of these objects", "evaluation/ssim.csv")
            continue
        holds = abs(gain) <= 0.05 if close else gain > 0.05
        yield row(text, "sec. 4.2, fig. 7", "by eye",
                   f"SSIM of hyperelastic minus elastic: {gain:+.3f}, {source}", verdict_of(holds),
                   f"mean SSIM differs by {'at most' if close else 'more than'} 0.05", "evaluation/ssim.csv",
                   uncertainty=_error(error, count))


def _smooth_read_better(ssim, source):
    """Are the errors on smooth objects lower, with both models? By the share of the reading that a network errs by."""
    claim, rule = "Smooth objects have lower errors than detailed ones", "with both models, over objects 1 to 3 against 5 and 6"
    error = ssim.mae_counts / ssim.mean_counts if "mean_counts" in ssim else ssim.mae_counts
    rows = ssim.assign(error=error)[(ssim.set == "grasps") & ssim.item.isin([*SMOOTH, *STEPPED])]
    means = rows.groupby(["item", "model"]).error.mean().unstack()
    if set(means.index) != {*SMOOTH, *STEPPED} or not {"hyperelastic", "elastic"} <= set(means):
        return row(claim, "sec. 4.2", "by eye", f"{len(means)} of 5 objects are in this study", UNDECIDED, rule,
                   "evaluation/ssim.csv")
    smooth, stepped = means.loc[SMOOTH], means.loc[STEPPED]
    shown = ", ".join(f"{model} {smooth[model].mean():.3g} against {stepped[model].mean():.3g}" for model in ("hyperelastic",
                                                                                                             "elastic"))
    return row(claim, "sec. 4.2", "by eye", f"mean error over the mean reading: {shown}, {source}",
               verdict_of(all(smooth[model].mean() < stepped[model].mean() for model in ("hyperelastic", "elastic"))), rule,
               "evaluation/ssim.csv", uncertainty=f"largest of the smooth ones {smooth.to_numpy().max():.3g}, least of the others "
               f"{stepped.to_numpy().min():.3g}; 5 objects")


def _below_zero(ssim, source):
    """The printed range of SSIM is not that of its formula: the covariance in it can be negative."""
    return row("SSIM lies between 0 and 1", "sec. 4.2", "0 to 1",
               f"least of {len(ssim)} maps {ssim.ssim.min():.3f}, {source}; by its "
               "formula SSIM is below 0 for maps of negative covariance", CONTRADICTION, "the printed formula keeps to the range",
               "evaluation/ssim.csv", uncertainty="none: the formula's own range is -1 to 1")


def _error(error, count):
    return f"standard error {error:.3f}, {count} objects"


def _against_print(ours, printed, source):
    """Verdict and rule for a mean SSIM beside the paper's; nan: the archive has no simulation of that model."""
    if source != PUBLISHED:
        return ARCHIVE, "the paper's readings are not here: no verdict on its number"
    if not np.isfinite(ours):
        return UNDECIDED, "needs the archive's simulations of this model"
    return verdict_of(abs(ours - printed) <= CLOSE), f"within {CLOSE:g} of the paper's, on its readings"


def _scores(ssim, source, summary, per_item, untrained):
    for set_name, values in PRINTED_SSIM.items():
        for model, value in values.items():
            count = len(ssim[(ssim.model == model) & (ssim.set == set_name)])
            mean = _mean(ssim, model, set_name)
            yield row(f"SSIM of the {model} model on {set_name}", "sec. 4.2", value, f"{mean:.2f} over {count} maps, {source}",
                      *_against_print(mean, value, source), "evaluation/ssim.csv",
                      uncertainty=_interval(summary, model=model, set=set_name))
    for model, value in (("hyperelastic", 0.97), ("elastic", 0.90)):
        best = ssim[(ssim.set == "grasps") & (ssim.model == model)].groupby("item").ssim.mean()
        ours = f"{best.max():.2f} ({best.idxmax()}), {source}" if len(best) else f"no maps of this model, {source}"
        yield row(f"Best object of the {model} model", "abstract", value, ours, *_against_print(best.max(), value, source),
                  "evaluation/ssim.csv",
                  uncertainty=_interval(per_item, model=model, set="grasps", item=best.idxmax()) if len(best) else "not told")
    gain, error, count = _advantage(ssim)
    clear = count >= 3 and abs(gain) > 2 * error
    yield row("On grasped objects the hyperelastic model reads better than the elastic one", "sec. 4.2, fig. 6", "0.72 > 0.63",
              f"SSIM of hyperelastic minus elastic: {gain:+.3f}, {source}", verdict_of(gain > 0) if clear else UNDECIDED,
              "at least three objects, and the mean difference exceeds twice its standard error", "evaluation/ssim.csv",
              uncertainty=_error(error, count))
    both = [_mean(ssim, model, "validation") for model in ("hyperelastic", "elastic")]
    trained = untrained is None or not (untrained["set"] == "validation").any()
    reads = np.isfinite(both).all() and trained and _items(ssim, "validation") >= FEW
    yield row("One architecture serves both models alike", "sec. 3.3.2, 4.2", "validation 0.87 and 0.86",
              f"validation SSIM {both[0]:.2f} and {both[1]:.2f}, {source}",
              verdict_of(abs(both[0] - both[1]) <= CLOSE) if reads else UNDECIDED,
              f"mean SSIM on validation differs by at most {CLOSE:g}, over {FEW} items at least; no network reads worse than the "
              "mean reading at that force",
              "evaluation/summary.csv",
              uncertainty=" and ".join(_interval(summary, model=model, set="validation") for model in ("hyperelastic", "elastic")))


def _interval(table, **where):
    """The 95 % interval of a mean in one row of a table of scores."""
    if table is None:
        return "not told"
    chosen = table[np.logical_and.reduce([table[key] == value for key, value in where.items()])]
    if len(chosen) != 1 or not np.isfinite(chosen.ssim_low.iloc[0]):
        return "one item or trial: no interval"
    return f"95 % interval {chosen.ssim_low.iloc[0]:.3f} to {chosen.ssim_high.iloc[0]:.3f}"


def _spread(ssim, source):
    """Does the elastic model's score vary more from object to object?"""
    means = ssim[ssim.set == "grasps"].groupby(["model", "item"]).ssim.mean()
    spread = {model: means[model] for model in ("hyperelastic", "elastic") if model in means.index.get_level_values(0)}
    claim = "The elastic model's SSIM varies more from object to object"
    rule = "at least three objects, and the standard deviations part by more than twice their standard error"
    if len(spread) < 2 or len(spread["elastic"]) < 3:
        return row(claim, "sec. 4.2", "by eye", f"fewer than three objects with both models, {source}", UNDECIDED, rule,
                   "evaluation/items.csv")
    count = len(spread["elastic"])
    elastic, hyper = spread["elastic"].std(ddof=1), spread["hyperelastic"].std(ddof=1)
    error = float(np.hypot(elastic, hyper) / np.sqrt(2 * (count - 1)))
    return row(claim, "sec. 4.2", "by eye",
               f"standard deviation of objects: elastic {elastic:.3f}, hyperelastic {hyper:.3f}, {source}",
               verdict_of(elastic > hyper) if abs(elastic - hyper) > 2 * error else UNDECIDED, rule, "evaluation/items.csv",
               uncertainty=f"standard error of the difference {error:.3f}, {count} objects")


def _falls(ssim, source, summary):
    """Do both models read validation maps best and grasped objects worst?"""
    claim = "Both models read validation maps best, then unseen indenters, then grasped objects"
    printed, rule = "0.87, 0.81, 0.72 and 0.86, 0.82, 0.63", f"the means of both models fall, over {FEW} items of each set at least"
    sets = ("validation", "unseen", "grasps")
    means = {model: [_mean(ssim, model, name) for name in sets] for model in ("hyperelastic", "elastic")}
    if not np.isfinite(list(means.values())).all() or min(_items(ssim, name) for name in sets) < FEW:
        return row(claim, "sec. 4.2", printed, f"a model, or a set of {FEW} items, is missing, {source}", UNDECIDED, rule,
                   "evaluation/summary.csv")
    shown = "; ".join(f"{model} {', '.join(f'{value:.2f}' for value in values)}" for model, values in means.items())
    return row(claim, "sec. 4.2", printed, f"{shown}, {source}",
               verdict_of(all(first > second > third for first, second, third in means.values())), rule, "evaluation/summary.csv",
               uncertainty="grasps: " + " and ".join(_interval(summary, model=model, set="grasps") for model in means))


def _repeats(ceiling, source):
    """Do readings of the same press scatter, as hysteresis makes the real sensor's?"""
    claim, printed = "Readings of the same press scatter from trial to trial (hysteresis)", "50 trials at 50 N"
    rule, evidence = "on the paper's readings, the sensor's SSIM against itself is below 0.999", "evaluation/ceiling.csv"
    if ceiling is None or not len(ceiling):
        return row(claim, "sec. 4.2", printed, f"no press was read twice, {source}", UNDECIDED, rule, evidence)
    mean, error = ceiling.ssim.mean(), ceiling.ssim.std(ddof=1) / np.sqrt(len(ceiling))
    return row(claim, "sec. 4.2", printed, f"SSIM of trials against each other {mean:.4f}, {source}",
               verdict_of(mean < 0.999) if source == PUBLISHED else ARCHIVE, rule, evidence,
               uncertainty=f"standard error {error:.4f} over {len(ceiling)} load steps")


def claims_of_study(*, searches: dict[str, dict[str, Any]] | None, repeated: dict[str, float] | None, taxels: "pd.DataFrame | None",
                    sensor: str, source: str, untrained: "pd.DataFrame | None") -> Iterator[dict[str, str]]:
    """A row for each.

    searches: {model: best.json};  repeated: {model: largest difference of a press done twice, mm};  taxels: of `taxel_table`
    untrained: of `score_tables.untrained`
    """
    yield _like_searches(searches)
    yield _repeated(repeated)
    yield _taxels(taxels, source)
    yield _second_sensor(sensor, untrained, source)


def _like_searches(searches):
    claim, where = "The searches of both simulators converge to a like architecture", "sec. 3.3.2"
    rule = (f"as many convolutions, and widths within a factor of {LIKE:g}, in the best trial of each; undecided up to "
            f"{RANDOM_TRIALS} trials, which are the same random draws for both")
    if not searches or not {"hyperelastic", "elastic"} <= set(searches):
        return row(claim, where, "consistently", "no search of both models", UNDECIDED, rule, "learning/")
    widths = {model: [*searches[model]["filters"], searches[model]["dense"]] for model in ("hyperelastic", "elastic")}
    one, other = (np.array(values, dtype=float) for values in widths.values())
    trials = min(searches[model].get("trials", 0) for model in widths)
    holds = len(one) == len(other) and bool((np.maximum(one / other, other / one) <= LIKE).all())
    shown = "; ".join(f"{model} {', '.join(map(str, values[:-1]))} filters and {values[-1]} neurons" for model,
                     values in widths.items())
    return row(claim, where, "consistently", shown,
               verdict_of(holds) if trials > RANDOM_TRIALS else UNDECIDED, rule, "learning/",
               uncertainty=f"one search of {trials} trials each; their losses are in search.csv")


def _repeated(repeated):
    claim, where = "Synthetic maps are deterministic", "sec. 4.2"
    rule = "a press done twice gives the same map to the last bit, with each model"
    if not repeated:
        return row(claim, where, "deterministic", "no press was done twice", UNDECIDED, rule, "repeated/")
    shown = ", ".join(f"{model} {value:.3g} mm" for model, value in repeated.items())
    return row(claim, where, "deterministic", f"largest difference of one object's maps: {shown}",
               verdict_of(not any(repeated.values())),
               rule, "repeated/", uncertainty="none: one object pressed twice on one machine")


def _taxels(taxels, source):
    claim, where = "The indenters engage all taxels", "sec. 3.3.2"
    rule = f"every taxel reads more than 30 counts under an indenter; undecided where fewer than {INDENTERS} do not engage all"
    if taxels is None:
        return row(claim, where, f"{INDENTERS} indenters", "no readings", UNDECIDED, rule, "evaluation/taxels.csv")
    reached = int((taxels.largest_counts > 30).sum())
    verdict = UNDECIDED if reached < len(taxels) and taxels.indenters.iloc[0] < INDENTERS else verdict_of(reached == len(taxels))
    return row(claim, where, f"{INDENTERS} indenters",
               f"{reached} of {len(taxels)} taxels, by {taxels.indenters.iloc[0]} indenters; the faintest one's largest reading is "
               f"{taxels.largest_counts.min():.0f} counts, {source}", verdict, rule,
               "evaluation/taxels.csv",
               uncertainty="none: largest reading of each taxel")


def _second_sensor(sensor, untrained, source):
    claim, where, rule = ("The pipeline transfers to another sensor", "sec. 5",
                          "on a sensor that is not the paper's, every network reads better than the mean reading at that force")
    if sensor == PAPERS_SENSOR or untrained is None:
        return row(claim, where, "future work",
                   f"this study is of the paper's sensor ({sensor}); config/second_sensor.yaml is of another",
                   UNDECIDED, rule, "evaluation/verdicts.json")
    bad = ", ".join(sorted({f"{one.predictor} of {one.model}" for one in untrained.itertuples()}))
    shown = f"{bad} do not" if bad else "all networks do"
    return row(claim, where, "future work", f"sensor {sensor}: {shown}, {source}", verdict_of(untrained.empty), rule,
               "evaluation/verdicts.json", uncertainty="one seed")
