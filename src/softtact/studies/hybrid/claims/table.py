"""The paper's claims, each with its number, ours, and a verdict computed by the rule that stands beside it.

`reproduced` is said of numbers of ours alone. Rows that hold the paper's numbers against each other are `consistent in print` or
`contradicts itself`. A rule on a number has two sides: too large is as wrong as too small.
"""

from collections.abc import Callable, Sequence
from typing import Any

import pandas as pd

from softtact.evaluation.claim_rows import ARCHIVE, COLUMNS, MEASUREMENTS, row, verdict_of
from softtact.evaluation.score_tables import untrained
from softtact.published.archive import SOURCE as PUBLISHED
from softtact.studies.hybrid.claims.in_print import Counts, Times, claims_in_print
from softtact.studies.hybrid.claims.of_choice import claims_of_choice
from softtact.studies.hybrid.claims.of_maps import claims_of_maps
from softtact.studies.hybrid.claims.of_materials import claims_of_materials
from softtact.studies.hybrid.claims.of_scores import VIRTUAL, claims_of_scores
from softtact.studies.hybrid.claims.of_study import claims_of_study
from softtact.studies.hybrid.claims.of_times import claims_of_times


def claims(*, cards: Sequence[dict[str, Any]], complexity: pd.DataFrame, ftir: dict[str, Any], ssim: pd.DataFrame,
           timing: pd.DataFrame, choose: Callable[..., str], printed_counts: dict[str, Counts], printed_times: dict[str, Times],
           source: str = VIRTUAL, sensor: str = "coro", summary: pd.DataFrame | None = None, per_item: pd.DataFrame | None = None,
           ceiling: pd.DataFrame | None = None, features: pd.DataFrame | None = None, scores: pd.DataFrame | None = None,
           searches: dict[str, dict[str, Any]] | None = None, repeated: dict[str, float] | None = None,
           taxels: pd.DataFrame | None = None) -> pd.DataFrame:
    """Data frame with `claim_rows.COLUMNS`; the arguments are what the study's files hold.

    source: of the readings; only against the published archive's is a verdict given on the paper's numbers
    sensor: its name;  searches: {model: best.json};  repeated: {model: difference of a press done twice, mm}
    summary, per_item, ceiling, features, scores, taxels: tables of the evaluation, without which their claims are left open
    """
    bad = None if scores is None else untrained(scores)
    rows = [*claims_of_materials(cards), _ftir(ftir), *_curve_shapes(ftir),
            *claims_of_choice(complexity, choose=choose, printed_counts=printed_counts, ssim=ssim, timing=timing, source=source),
            *claims_of_maps(features, complexity),
            *claims_of_scores(ssim, source=source, summary=summary, per_item=per_item, ceiling=ceiling, untrained=bad),
            *claims_of_times(timing, printed_times),
            *claims_of_study(searches=searches, repeated=repeated, taxels=taxels, sensor=sensor, untrained=bad, source=source),
            *claims_in_print(printed_counts=printed_counts, printed_times=printed_times)]
    frame = pd.DataFrame(rows, columns=COLUMNS)
    # The archive has maps and readings; stress-strain curves and camera frames of the paper are not in it.
    return frame.replace({"verdict": {ARCHIVE: MEASUREMENTS}}) if source == PUBLISHED else frame


def _ftir(ftir):
    rmse, virtual = ftir["rmse_mm2_per_frustum"], ftir["source"].startswith("virtual")
    verdict = ARCHIVE if virtual else verdict_of(rmse <= 0.008)
    return row("Simulated and measured contact area of the dielectric agree", "sec. 4.1, fig. 5", "RMSE 0.008 mm2",
                f"{rmse:.4f} mm2 per frustum against the {ftir['source']}", verdict,
                "RMSE per frustum <= 0.008 mm2 against a measured curve", "ftir/summary.json",
                uncertainty=f"of the disc detection: {ftir['rmse_image_mm2_per_frustum']:.4f} mm2 RMSE"
                if "rmse_image_mm2_per_frustum" in ftir else "not told")


def _curve_shapes(ftir):
    """A row per orientation of the printed frustum: does the area grow as the paper's words have it, with any law?"""
    for orientation in dict.fromkeys(record["orientation"] for record in ftir["orientations"]):
        records = [record for record in ftir["orientations"] if record["orientation"] == orientation]
        yield row(f"Frusta read as {orientation}: the contact area grows with the force, in discs", "sec. 4.1, fig. 5",
                   "increases, not necessarily linearly", " ".join(record["sentence"] for record in records),
                   verdict_of(any(record["allowed"] for record in records)),
                   "with one law at least: rises at every force, by 0.04 mm2 or more, discs two pixels apart, no step steeper than "
                   "four times the mean", "ftir/orientations.csv", uncertainty="none: one simulation of each law, without scatter")
