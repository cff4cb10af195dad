"""Claims on the time that a map takes. Seconds of another machine, solver and mesh are not comparable, so none is judged here.

What can be judged is which of our models takes longer, object by object on one machine. How many times as long, how a longest time
lies to a mean, and minutes or seconds belong to the solver; those rows show our numbers beside the printed ones, without a verdict.
"""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from softtact.evaluation.decisions import RULE, UNDECIDED, above, mean_over_objects, row
from softtact.learning.dataset import object_of

if TYPE_CHECKING:
    from softtact.studies.hybrid.tables import Times

_EVIDENCE = "tables/table3_timing.csv"
_LONGER = "A hyperelastic map takes longer than an elastic one"
_COSTS = "The hyperelastic model costs several times the elastic one"
_MINUTES = "A hyperelastic map takes minutes"
_HARDEST = "The hardest maps take many times the mean"
NOT_JUDGED = (_COSTS, _MINUTES, _HARDEST)
_NOT_COMPARABLE = "no verdict: times of another machine, solver and mesh are not comparable"


def claims_of_times(timing: pd.DataFrame, printed: "dict[str, Times]") -> Iterator[dict[str, str]]:
    """A row for each; timing: rows of `time_presses`;  printed: {model: (mean, min, max, sd)} in s."""
    hyper, elastic = (printed[model] for model in ("hyperelastic", "elastic"))
    values = {
        _LONGER: f"{hyper[0]:g} s and {elastic[0]:g} s",
        _COSTS: f"{hyper[0]:g} s / {elastic[0]:g} s = {hyper[0] / elastic[0]:.1f}",
        _MINUTES: f"{hyper[0]:g} s",
        _HARDEST: "4 times (elastic), 11 times (hyperelastic)",
    }
    if not {"hyperelastic", "elastic"} <= set(timing.model):
        for claim, value in values.items():
            yield row(
                claim,
                "table 3",
                value,
                "no press of both models in this study",
                UNDECIDED,
                "needs presses of both models",
                _EVIDENCE,
            )
        return
    table = timing.assign(total=timing.solver_s + timing.network_s, object=timing["item"].map(object_of))
    yield _longer(table, values[_LONGER])
    yield from _not_judged(table, values)


def _not_judged(table, values):
    """Our times beside the printed ones."""
    total = table.groupby("model").total
    mean, error, count, longest = total.mean(), total.sem(), total.count(), total.max()
    ratio = mean["hyperelastic"] / mean["elastic"]
    relative = float(np.hypot(*(error[model] / mean[model] for model in ("hyperelastic", "elastic"))))
    yield row(
        _COSTS,
        "table 3",
        values[_COSTS],
        f"{mean['hyperelastic']:.2f} s / {mean['elastic']:.3f} s = {ratio:.0f}",
        UNDECIDED,
        _NOT_COMPARABLE,
        _EVIDENCE,
        uncertainty=f"standard error {ratio * relative:.0f}",
    )
    yield row(
        _MINUTES,
        "table 3",
        values[_MINUTES],
        f"{mean['hyperelastic']:.2f} s",
        UNDECIDED,
        _NOT_COMPARABLE,
        _EVIDENCE,
        uncertainty=f"standard error {error['hyperelastic']:.2f} s, {count['hyperelastic']} maps",
    )
    ours = longest / mean
    yield row(
        _HARDEST,
        "sec. 4.2, table 3",
        values[_HARDEST],
        f"{ours['elastic']:.1f} times (elastic), {ours['hyperelastic']:.1f} times (hyperelastic)",
        UNDECIDED,
        f"{_NOT_COMPARABLE}, and the longest of a sample grows with its size",
        _EVIDENCE,
        uncertainty=f"longest of {count['elastic']} and {count['hyperelastic']} maps; the paper's of 2,000",
    )


def _longer(table, printed):
    """By the logarithm of the ratio of both models' times, paired by object."""
    means = table.groupby(["object", "model"]).total.mean().unstack()
    ratio = mean_over_objects(np.log(means["hyperelastic"] / means["elastic"]))
    low, middle, high = np.exp([ratio.low, ratio.mean, ratio.high])
    known = "no interval" if np.isnan(low) else f"95 % interval {low:.3g} to {high:.3g}"
    return row(
        _LONGER,
        "sec. 3.3, table 3",
        printed,
        f"{middle:.3g} times as long, geometric mean over objects",
        above(ratio, 0.0),
        f"the ratio of both models' times on one machine, object by object, above 1; {RULE}",
        _EVIDENCE,
        uncertainty=f"{known} over {ratio.objects} objects",
    )
