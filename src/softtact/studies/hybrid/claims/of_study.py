"""Claims on the study as a whole: the searches' results, presses done twice, taxels that are reached, another sensor."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from softtact.evaluation.decisions import LEAST_OBJECTS, UNDECIDED, row, verdict_of

if TYPE_CHECKING:
    import pandas as pd

PAPERS_SENSOR = "coro"
INDENTERS = 49
_REACHED_COUNTS = 30.0


def claims_of_study(
    *,
    searches: dict[str, dict[str, Any]] | None,
    repeated: dict[str, float] | None,
    taxels: "pd.DataFrame | None",
    sensor: str,
    source: str,
    untrained: "pd.DataFrame | None",
) -> Iterator[dict[str, str]]:
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
    rule = (
        f"at least {LEAST_OBJECTS} searches of each model from different seeds, as one search of a model says nothing of how its "
        "results scatter; a study makes one"
    )
    if not searches or not {"hyperelastic", "elastic"} <= set(searches):
        return row(claim, where, "consistently", "no search of both models", UNDECIDED, rule, "learning/")
    widths = {model: [*searches[model]["filters"], searches[model]["dense"]] for model in ("hyperelastic", "elastic")}
    trials = min(searches[model].get("trials", 0) for model in widths)
    shown = "; ".join(
        f"{model} {', '.join(map(str, values[:-1]))} filters and {values[-1]} neurons" for model, values in widths.items()
    )
    return row(
        claim,
        where,
        "consistently",
        shown,
        UNDECIDED,
        rule,
        "learning/",
        uncertainty=f"one search of {trials} trials each; their losses are in search.csv",
    )


def _repeated(repeated):
    claim, where = "Synthetic maps are deterministic", "sec. 4.2"
    rule = "a press done twice gives the same map to the last bit, with each model"
    if not repeated:
        return row(claim, where, "deterministic", "no press was done twice", UNDECIDED, rule, "repeated/")
    shown = ", ".join(f"{model} {value:.3g} mm" for model, value in repeated.items())
    return row(
        claim,
        where,
        "deterministic",
        f"largest difference of one object's maps: {shown}",
        verdict_of(not any(repeated.values())),
        rule,
        "repeated/",
        uncertainty="none: one object pressed twice on one machine",
    )


def _taxels(taxels, source):
    claim, where = "The indenters engage all taxels", "sec. 3.3.2"
    rule = (
        f"every taxel reads more than {_REACHED_COUNTS:g} counts under an indenter; undecided where fewer than {INDENTERS} "
        "do not engage all"
    )
    if taxels is None:
        return row(claim, where, f"{INDENTERS} indenters", "no readings", UNDECIDED, rule, "evaluation/taxels.csv")
    reached = int((taxels.largest_counts > _REACHED_COUNTS).sum())
    verdict = UNDECIDED if reached < len(taxels) and taxels.indenters.iloc[0] < INDENTERS else verdict_of(reached == len(taxels))
    return row(
        claim,
        where,
        f"{INDENTERS} indenters",
        f"{reached} of {len(taxels)} taxels, by {taxels.indenters.iloc[0]} indenters; the faintest one's largest reading is "
        f"{taxels.largest_counts.min():.0f} counts, {source}",
        verdict,
        rule,
        "evaluation/taxels.csv",
        uncertainty="none: largest reading of each taxel",
    )


def _second_sensor(sensor, untrained, source):
    claim, where, rule = (
        "The pipeline transfers to another sensor",
        "sec. 5",
        "on a sensor that is not the paper's, every network reads better than the mean reading at that force",
    )
    if sensor == PAPERS_SENSOR or untrained is None:
        return row(
            claim,
            where,
            "future work",
            f"this study is of the paper's sensor ({sensor}); config/second_sensor.yaml is of another",
            UNDECIDED,
            rule,
            "evaluation/verdicts.json",
        )
    bad = ", ".join(sorted({f"{one.predictor} of {one.model}" for one in untrained.itertuples()}))
    shown = f"{bad} do not" if bad else "all networks do"
    return row(
        claim,
        where,
        "future work",
        f"sensor {sensor}: {shown}, {source}",
        verdict_of(untrained.empty),
        rule,
        "evaluation/verdicts.json",
        uncertainty="one seed",
    )
