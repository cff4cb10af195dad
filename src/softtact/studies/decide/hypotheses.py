"""The hypotheses, each tested for every truth, readout and primary score; what is said of them in one row.

More is better in every difference: the error enters with a minus. Each test has a verdict alone, at the level itself, and one by
Holm's rule with the others of its family: a claim for which all have to hold needs each alone, one that a single test can refute
needs Holm's. Families:
detail         hyperelastic minus elastic on stepped objects is above 0
detail_more    it is larger on stepped than on smooth objects
not_stiffness  hyperelastic minus matched elastic on stepped objects is above 0: more than stiffness. Undecided where the matched
               layer scores less than the printed one: then it is no control of stiffness
balance        hybrid minus hyperelastic, on all objects, is above minus the margin
choice         the rule's choice scores more than one by chance of the same share (permutation, all meshes of each object)
cost           the hybrid takes at most a share of the hyperelastic model's time
collapse       at equal step over indentation the model shows more of the lower feature than the elastic layer, where the object
               comes down by more than the step; elsewhere nothing touches there, and the cover rises between the raised features
Controls are tested alike and share no level with others.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from softtact.evaluation.decisions import UNDECIDED
from softtact.evaluation.paired import Comparison, compare, compare_groups, holm, permutation_p, verdict
from softtact.studies.decide.config import CONTROLS, ELASTIC, HYPERELASTIC, MATCHED, NETWORKS
from softtact.studies.decide.policies import HYBRID, remeshed_choices
from softtact.studies.decide.scoring import PRIMARY

COLUMNS = ["claim", "truth", "readout", "score", "objects", "seeds", "mean", "low", "high", "bound", "p_above", "p_below", "p_holm",
           "p_holm_below", "power", "alone", "verdict", "remark"]
FAMILIES = ("detail", "detail_more", "not_stiffness", "balance", "choice", "cost", "collapse")
OF_DETAIL = ("detail", "detail_more", "not_stiffness")
_BUSY = 1.25     # load per core above which a machine was not idle; two jobs on two cores give 1
_REACHED = 1.0   # step over indentation, below which the lower feature touches
_WORSE = "no control of stiffness, as the matched layer scores less than the printed one"
_SAME = 1e-6     # of a force that a press reached and one that was asked for
_POINTS = 2      # of a curve at least, between which it is interpolated


@dataclass(frozen=True)
class Tables:
    """What the hypotheses are tested on."""

    scores: pd.DataFrame
    """Rows of scores.csv."""
    choices: pd.DataFrame
    """Rows of choices.csv."""
    collapse: pd.DataFrame
    """Rows of collapse.csv."""
    power: pd.DataFrame
    """Rows of power.csv."""


def hypothesis_table(tables: Tables, *, statistics: Mapping[str, Any], truths: list[str], seed: int) -> pd.DataFrame:
    """Data frame with COLUMNS; truths: those that are no controls."""
    rows = [*_of_scores(tables, statistics, seed), _cost(tables.choices, statistics, seed),
            *_collapse(tables.collapse, [*truths, HYPERELASTIC], seed)]
    table = pd.DataFrame(rows).reindex(columns=COLUMNS)
    return _judged(table, tables, statistics, truths)


def _of_scores(tables, statistics, seed):
    """The rows of each truth, readout and primary score."""
    tests: dict[str, Callable[..., Comparison]] = {
        "detail": lambda of: compare(of(HYPERELASTIC, "stepped") - of(ELASTIC, "stepped"), seed=seed),
        "detail_more": lambda of: compare_groups(*(of(HYPERELASTIC, kind) - of(ELASTIC, kind) for kind in ("stepped", "smooth")),
                                                 seed=seed),
        "not_stiffness": lambda of: compare(of(HYPERELASTIC, "stepped") - of(MATCHED, "stepped"), seed=seed),
        "balance": lambda of: compare(of(HYBRID) - of(HYPERELASTIC), bound=-statistics["margin"], seed=seed)}
    for (truth, readout), own in tables.scores.groupby(["truth", "readout"], sort=False):
        for score, sign in PRIMARY.items():
            names = {"truth": truth, "readout": readout, "score": score}
            values = _Values(own, score, sign)
            for claim, test in tests.items():
                bound = -statistics["margin"] if claim == "balance" else 0.0
                yield {"claim": claim, **names, **_numbers(test(values)), "bound": bound,
                       "remark": _no_control(values, seed) if claim == "not_stiffness" else ""}
            yield {"claim": "choice", **names, **_choice(values, tables.choices, seed)}


class _Values:
    """Of one truth, readout and score: (model, kind of object) to a table (object, seed), more being better."""

    def __init__(self, rows, score, sign):
        self._rows, self._score, self._sign = rows, score, sign

    def __call__(self, model, kind=None):
        rows = self._rows[self._rows.model == model]
        rows = rows if kind is None else rows[rows.kind == kind]
        return self._sign * rows.pivot(index="object", columns="seed", values=self._score).to_numpy()

    def objects(self):
        """Names in the tables' order."""
        return sorted(self._rows.object.unique())


def _no_control(values, seed):
    """A sentence where the layer of matched stiffness clearly scores less on stepped objects than the printed one, else none."""
    found = compare(values(MATCHED, "stepped") - values(ELASTIC, "stepped"), seed=seed)
    return f"{_WORSE}: {found.mean:+.3f} ({found.low:+.3f} to {found.high:+.3f})" if found.high < 0 else ""


def _numbers(found: Comparison) -> dict[str, Any]:
    return {name: getattr(found, name) for name in ("objects", "seeds", "mean", "low", "high", "p_above", "p_below")}


def _choice(values, choices, seed):
    """The rule's gain over chance, with all meshes of each object, and its p-value in each mesh alone."""
    gains = (values(HYPERELASTIC) - values(ELASTIC)).mean(axis=1)
    named = choices.set_index("object").loc[values.objects()].reset_index()
    shares = named.share_hyperelastic.to_numpy()
    each = [permutation_p(gains, taken, seed=seed) for taken in remeshed_choices(named)]
    mean = float((gains * (shares - shares.mean())).mean())
    return {"objects": len(gains), "seeds": values(HYPERELASTIC).shape[1], "mean": mean, "low": np.nan, "high": np.nan,
            "bound": 0.0, "p_above": permutation_p(gains, shares, seed=seed),
            "p_below": permutation_p(-gains, shares, seed=seed),
            "remark": f"p in each mesh alone: {', '.join(f'{p:.2g}' for p in each)}"}


def _cost(choices, statistics, seed):
    """How much less than its share of the hyperelastic model's time the hybrid takes, in s an object, over all meshes."""
    share = choices.share_hyperelastic
    hybrid = share * choices.time_hyperelastic_s + (1 - share) * choices.time_elastic_s
    saved = statistics["cost_share"] * choices.time_hyperelastic_s - hybrid
    ratio, load = float(hybrid.sum() / choices.time_hyperelastic_s.sum()), float(choices.load_per_core.median())
    remark = f"{ratio:.2f} of the hyperelastic model's time; load per core {load:.1f}" + (": busy" if load > _BUSY else "")
    return {"claim": "cost", "score": "saved_s", **_numbers(compare(saved.to_numpy(), seed=seed)), "bound": 0.0, "remark": remark}


def _collapse(table, models, seed) -> Iterator[dict[str, Any]]:
    """What a model shows more of the lower feature than the elastic layer of any modulus at equal step over indentation."""
    for model in models:
        differences = [apart for _, own in table.groupby("object") if (apart := _apart(own, model)) is not None]
        if differences:
            found = compare(np.array(differences), seed=seed)
            yield {"claim": "collapse", "truth": model, "score": "lower_share", **_numbers(found), "bound": 0.0,
                   "remark": "elastic layers of all moduli are the other curve"}


def _apart(own, model):
    """The mean difference of an object's shares from the elastic curve at the same step over indentation, below 1; or None."""
    elastic = own[own.family == ELASTIC].sort_values("ratio")
    rows = own[(own.model == model) & (own.ratio < _REACHED)]
    rows = rows[rows.ratio.between(elastic.ratio.min(), elastic.ratio.max())]
    if len(elastic) < _POINTS or not len(rows):
        return None
    return float((rows.lower_share - np.interp(rows.ratio, elastic.ratio, elastic.lower_share)).mean())


def _judged(table, tables, statistics, truths):
    """The table with Holm's p-values, the stated power and both verdicts."""
    table = table.assign(p_holm=table.p_above, p_holm_below=table.p_below)
    control = table.truth.isin(list(CONTROLS))
    for claim in FAMILIES:
        own = (table.claim == claim) & ~control
        table.loc[own, "p_holm"], table.loc[own, "p_holm_below"] = holm(table.p_above[own]), holm(table.p_below[own])
    of_each = tables.power.set_index(["claim", "readout"]).power
    table["power"] = of_each.reindex(pd.MultiIndex.from_frame(table[["claim", "readout"]])).to_numpy()
    shown = shown_in_scored(tables.scores, tables.collapse, share=statistics["shown_share"])
    rows = list(table.itertuples())
    table["alone"] = [_verdict(row, (row.p_above, row.p_below), statistics, shown, truths) for row in rows]
    table["verdict"] = [_verdict(row, (row.p_holm, row.p_holm_below), statistics, shown, truths) for row in rows]
    return table


def _verdict(row, p_values, statistics, shown, truths):
    """The verdict of a row; details need a truth with them, stiffness a control, a cost no load of others, networks seeds."""
    if row.readout in NETWORKS and row.seeds < 2:      # how much another training differs is not known
        return UNDECIDED
    if row.claim in OF_DETAIL and row.truth in truths and shown.get(row.truth, 0) < statistics["least_shown"]:
        return UNDECIDED
    if str(row.remark).startswith(_WORSE):
        return UNDECIDED
    if row.claim == "cost" and str(row.remark).endswith("busy"):
        return UNDECIDED
    return verdict(*p_values, objects=row.objects, least_objects=statistics["least_objects"], level=statistics["level"])


def shown_in_scored(scores: pd.DataFrame, collapse: pd.DataFrame, *, share: float) -> dict[str, int]:
    """{truth: how many objects' maps show the lower feature by more than a share of the raised ones' where they are scored}.

    That is at the largest force at which they are: of larger ones no score tells.
    """
    largest = scores.groupby(["truth", "object"]).largest_force_n.max().rename_axis(["model", "object"])
    scored = collapse.join(largest, on=["model", "object"], how="inner")
    return shown_objects(scored[scored.force_n <= scored.largest_force_n * (1 + _SAME)], share=share)


def shown_objects(collapse: pd.DataFrame, *, share: float) -> dict[str, int]:
    """{model: how many objects' maps show the lower feature by more than a share of the raised ones' at the largest force}."""
    last = collapse.sort_values("force_n").groupby(["model", "object"]).last()
    return {str(model): int((own.lower_share > share).sum()) for model, own in last.groupby("model")}
