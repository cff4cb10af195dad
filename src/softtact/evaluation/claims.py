"""The paper's claims, each with its number, ours, and a verdict computed by the rule that stands beside it."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from softtact.evaluation.claim_rows import (
    ARCHIVE,
    COLUMNS,
    CONTRADICTION,
    MEASUREMENTS,
    REPRODUCED,
    UNDECIDED,
    row,
    verdict_of,
)
from softtact.evaluation.claims_in_print import claims_in_print
from softtact.evaluation.claims_of_maps import claims_of_maps
from softtact.evaluation.claims_of_scores import VIRTUAL, claims_of_scores
from softtact.materials.consistency import PRINTED


def claims(*, cards: Sequence[dict[str, Any]], complexity: pd.DataFrame, ftir: dict[str, Any], ssim: pd.DataFrame,
           timing: pd.DataFrame, choose: Callable[..., str], printed_counts: dict[str, tuple[int, int, int, int, str]],
           printed_times: dict[str, tuple[float, float, float, float]], source: str = VIRTUAL, summary: pd.DataFrame | None = None,
           per_item: pd.DataFrame | None = None, ceiling: pd.DataFrame | None = None,
           features: pd.DataFrame | None = None) -> pd.DataFrame:
    """Data frame with `claim_rows.COLUMNS`; the arguments are what the study's files hold.

    source: of the readings; against the virtual sensor's no verdict is given on the paper's numbers
    summary, per_item, ceiling, features: tables of the evaluation, without which intervals and their claims are left open
    """
    rows = [*_materials(cards), _ftir(ftir), *_curve_shapes(ftir), *_complexity(complexity, choose, printed_counts),
            *claims_of_maps(features, complexity),
            *claims_of_scores(ssim, source=source, summary=summary, per_item=per_item, ceiling=ceiling),
            *_times(timing, printed_times), *claims_in_print(printed_counts=printed_counts, printed_times=printed_times)]
    frame = pd.DataFrame(rows, columns=COLUMNS)
    # The archive has maps and readings; stress-strain curves and camera frames of the paper are not in it.
    return frame if source == VIRTUAL else frame.replace({"verdict": {ARCHIVE: MEASUREMENTS}})


def _materials(cards):
    for card in cards:
        measured, name = card["kind"] == "measured", card["material"]
        stable = sorted(law for law, fit in card["laws"].items() if fit.get("stable_over_data"))
        only = {law.rstrip("123") for law in stable} <= {"ogden", "mooney_rivlin"}
        yield row(f"For {name} only Ogden and Mooney-Rivlin were stable", "sec. 4.1", "Ogden, Mooney-Rivlin",
                   f"stable over the {card['kind']} curves: {', '.join(stable)}", verdict_of(only) if measured else ARCHIVE,
                   "on measured curves, no other law of the family is stable over their range", "tables/table1_materials.csv",
                  uncertainty="none: yes or no for each law")
        chosen = card["laws"][card["chosen"]]
        yield row(f"{name}: the fit's RMSE is below 0.01 (unit read as MPa)", "table 1", "0.0077 to 0.0091",
                   f"{chosen['rmse_mpa']:.4f} MPa ({card['chosen']}, {card['kind']} curves)",
                   verdict_of(chosen["rmse_mpa"] < 0.01) if measured else ARCHIVE,
                   "on measured curves, RMSE < 0.01 MPa", "tables/table1_materials.csv", uncertainty=_fit_error(card, chosen))
        yield from _printed_errors(card, measured)
        yield _printed_constants(card)


def _fit_error(card, fit):
    """How well a fit's RMSE is known by the number n of its points: its relative standard error is 1 / sqrt(2 n)."""
    points = sum(curve["points"] for curve in card.get("curves", ()))
    return f"standard error {fit['rmse_mpa'] / np.sqrt(2 * points):.4f} MPa, {points} points" if points else "points not told"


def _printed_errors(card, measured):
    """A row for each law whose RMSE is printed."""
    for law, printed in card.get("printed", {}).items():
        if printed.get("rmse_mpa") is not None and law in card["laws"]:
            fit = card["laws"][law]
            holds = abs(fit["rmse_mpa"] - printed["rmse_mpa"]) <= 0.5 * printed["rmse_mpa"]
            yield row(f"{card['material']}: RMSE of {law}", "table 1", f"{printed['rmse_mpa']:g}",
                      f"{fit['rmse_mpa']:.4f} MPa ({card['kind']} curves)", verdict_of(holds) if measured else ARCHIVE,
                      "on measured curves, within half of the printed one", "tables/table1_materials.csv",
                      uncertainty=_fit_error(card, fit))


def _printed_constants(card):
    found = [text.removeprefix(PRINTED) for text in card.get("warnings", ()) if text.startswith(PRINTED)]
    return row(f"{card['material']}: the printed laws were fitted to the same test", "table 1", "one test, three models",
                " ".join(found) or "no two laws part by more than half", CONTRADICTION if found else REPRODUCED,
                "no two printed laws part by more than a factor of 1.5 in modulus or stress",
                f"materials/{card['material']}.json", uncertainty="none: arithmetic of printed numbers")


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


def _complexity(complexity, choose, printed):
    any_rule = all(choose(*counts[:4], rule="any") == counts[4] for counts in printed.values())
    all_rule = all(choose(*counts[:4], rule="all") == counts[4] for counts in printed.values())
    yield row("Hyperelastic where NPt >= 10 CHt and NPo >= 8 CHo", "sec. 3.3.1, table 2", "six choices",
               f"'and' gives all six: {all_rule}; 'or' gives all six: {any_rule}",
               REPRODUCED if all_rule else CONTRADICTION, "the rule as worded gives the six printed choices",
               "tables/table2_complexity.csv", uncertainty="none: counts")
    ours = complexity.set_index("object").model
    known = [name for name in printed if name in ours.index]
    agree = [ours[name] == printed[name][4] for name in known]
    yield row("The objects of figure 7 are sent to the printed models", "table 2", "1-4 elastic, 5-6 hyperelastic",
               f"{sum(agree)} of {len(known)} (our own objects of the printed kinds)", verdict_of(all(agree)),
               "all choices equal", "tables/table2_complexity.csv", uncertainty="none: counts")


def _times(timing, printed):
    total = timing.assign(total=timing.solver_s + timing.network_s).groupby("model").total
    both = {"hyperelastic", "elastic"} <= set(timing.model)
    evidence = "tables/table3_timing.csv"
    if not both:
        for claim, value in (("The hyperelastic model costs several times the elastic one", "162.1 s / 37.4 s = 4.3"),
                             ("A hyperelastic map takes minutes", "162.1 s"),
                             ("The hardest maps take many times the mean", "4 times (elastic), 11 times (hyperelastic)")):
            yield row(claim, "table 3", value, "no press of both models in this study", UNDECIDED, "needs presses of both models",
                      evidence)
        return
    mean, error, count, longest = total.mean(), total.sem(), total.count(), total.max()
    ratio = mean["hyperelastic"] / mean["elastic"]
    relative = float(np.hypot(*(error[model] / mean[model] for model in ("hyperelastic", "elastic"))))
    yield row("The hyperelastic model costs several times the elastic one", "table 3", "162.1 s / 37.4 s = 4.3",
              f"{mean['hyperelastic']:.2f} s / {mean['elastic']:.3f} s = {ratio:.0f}", verdict_of(ratio > 2),
              "ratio of mean times per map > 2", evidence, uncertainty=f"standard error {ratio * relative:.0f}")
    yield row("A hyperelastic map takes minutes", "table 3", "162.1 s", f"{mean['hyperelastic']:.2f} s",
              verdict_of(mean["hyperelastic"] > 60), "mean time per map > 60 s", evidence,
              uncertainty=f"standard error {error['hyperelastic']:.2f} s, {count['hyperelastic']} maps; another machine and solver")
    ours, theirs = ({model: times[model] for model in ("elastic", "hyperelastic")}
                    for times in (longest / mean, {name: value[2] / value[0] for name, value in printed.items()}))
    yield row("The hardest maps take many times the mean", "sec. 4.2, table 3", "4 times (elastic), 11 times (hyperelastic)",
              f"{ours['elastic']:.1f} times (elastic), {ours['hyperelastic']:.1f} times (hyperelastic)",
              verdict_of(all(0.5 < ours[model] / theirs[model] < 2 for model in ours)),
              "both ratios of longest to mean within a factor of two of table 3's", evidence,
              uncertainty=f"longest of {count['elastic']} and {count['hyperelastic']} maps")
