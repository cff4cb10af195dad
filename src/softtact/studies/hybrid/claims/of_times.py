"""Claims on the time that a map takes; rules have two sides."""

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from softtact.evaluation.claim_rows import FACTOR, UNDECIDED, row, verdict_of, within

if TYPE_CHECKING:
    import pandas as pd

    from softtact.studies.hybrid.claims.in_print import Times

_EVIDENCE = "tables/table3_timing.csv"
_COSTS = "The hyperelastic model costs several times the elastic one"
_MINUTES = "A hyperelastic map takes minutes"
_HARDEST = "The hardest maps take many times the mean"
_LONGEST = "Our longest elastic time is near our mean hyperelastic one"


def claims_of_times(timing: "pd.DataFrame", printed: "dict[str, Times]") -> Iterator[dict[str, str]]:
    """A row for each; timing: rows of `time_presses`;  printed: {model: (mean, min, max, sd)} in s."""
    hyper, elastic = (printed[model] for model in ("hyperelastic", "elastic"))
    values = {_COSTS: f"{hyper[0]:g} s / {elastic[0]:g} s = {hyper[0] / elastic[0]:.1f}", _MINUTES: f"{hyper[0]:g} s",
              _HARDEST: "4 times (elastic), 11 times (hyperelastic)", _LONGEST: f"{elastic[2]:g} s and {hyper[0]:g} s"}
    total = timing.assign(total=timing.solver_s + timing.network_s).groupby("model").total
    if not {"hyperelastic", "elastic"} <= set(timing.model):
        for claim, value in values.items():
            yield row(claim, "table 3", value, "no press of both models in this study", UNDECIDED, "needs presses of both models",
                      _EVIDENCE)
        return
    mean, error, count, longest = total.mean(), total.sem(), total.count(), total.max()
    ratio = mean["hyperelastic"] / mean["elastic"]
    relative = float(np.hypot(*(error[model] / mean[model] for model in ("hyperelastic", "elastic"))))
    yield row(_COSTS, "table 3", values[_COSTS], f"{mean['hyperelastic']:.2f} s / {mean['elastic']:.3f} s = {ratio:.0f}",
              verdict_of(within(ratio,
                                hyper[0] / elastic[0])), f"ratio of mean times per map within a factor of {FACTOR:g} of table 3's",
              _EVIDENCE, uncertainty=f"standard error {ratio * relative:.0f}")
    yield row(_MINUTES, "table 3", values[_MINUTES], f"{mean['hyperelastic']:.2f} s", verdict_of(within(mean["hyperelastic"],
                                                                                                        hyper[0])),
              f"mean time per map within a factor of {FACTOR:g} of table 3's", _EVIDENCE,
              uncertainty=f"standard error {error['hyperelastic']:.2f} s, {count['hyperelastic']} maps; another machine and solver")
    ours = longest / mean
    yield row(_HARDEST, "sec. 4.2, table 3", values[_HARDEST],
              f"{ours['elastic']:.1f} times (elastic), {ours['hyperelastic']:.1f} times (hyperelastic)",
              verdict_of(all(within(ours[model], times[2] / times[0]) for model, times in (("elastic", elastic), ("hyperelastic",
                                                                                                                  hyper)))),
              f"both ratios of longest to mean within a factor of {FACTOR:g} of table 3's", _EVIDENCE,
              uncertainty=f"longest of {count['elastic']} and {count['hyperelastic']} maps")
    yield row(_LONGEST, "sec. 4.2", values[_LONGEST], f"{longest['elastic']:.2f} s and {mean['hyperelastic']:.2f} s",
              verdict_of(within(longest["elastic"],
                                mean["hyperelastic"])), f"within a factor of {FACTOR:g} of each other", _EVIDENCE,
              uncertainty=f"longest of {count['elastic']} maps")
