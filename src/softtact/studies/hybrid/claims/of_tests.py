"""Claims on the materials, the dielectric's contact area, and the paper's printed numbers against each other."""

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.evaluation.claim_rows import ARCHIVE, CONSISTENT, CONTRADICTION, row, verdict_of
from softtact.materials.consistency import FACTOR, largest_parting_in_tension
from softtact.materials.laws.registry import make_law
from softtact.published.archive import ALL_MAPS, MAPS_OF_A_GRASP, MAPS_OF_SETS

if TYPE_CHECKING:
    from softtact.studies.hybrid.tables import Counts, Times

_SLOPE = 0.1      # relative: a slope read off the same curves
_CLOSE = 0.1      # relative: the text rounds


def claims_of_materials(cards: Sequence[dict[str, Any]]) -> Iterator[dict[str, str]]:
    """Rows for each material's card."""
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
        yield from _printed_constants(card)


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
    """Do the printed laws, and the printed modulus, belong to one tensile test? No row where nothing is printed."""
    printed, name = card.get("printed", {}), card["material"]
    laws = {law: make_law(law, entry["parameters"]) for law, entry in printed.items() if law != "linear"}
    evidence, arithmetic = f"materials/{name}.json", "none: arithmetic of printed numbers"
    if len(laws) > 1:
        ratio, words = largest_parting_in_tension(laws)
        yield row(f"{name}: the printed hyperelastic laws were fitted to the same test", "table 1", "one test, two laws", words,
                  CONSISTENT if ratio <= FACTOR else CONTRADICTION,
                  "initial shear moduli, and stresses in tension to stretch 2 (what an ISO 3167 specimen shows), within a factor "
                  f"{FACTOR:g}",
                  evidence, uncertainty=arithmetic)
    if laws and "linear" in printed:
        young = printed["linear"]["parameters"]["young_mpa"]
        slopes = {law: 3 * made.mu0 for law, made in laws.items()}
        near = min(abs(slope / young - 1) for slope in slopes.values())
        yield row(f"{name}: E is the slope of the same stress-strain curves", "sec. 4.1", f"{young:g} MPa",
                  "initial slopes 3 mu0 of the printed laws: " + ", ".join(f"{law} {slope:.3g} MPa" for law,
                                                                           slope in slopes.items()),
                  CONSISTENT if near <= _SLOPE else CONTRADICTION, f"the slope of one printed law within {_SLOPE:.0%}", evidence,
                  uncertainty="3 mu0 holds where the volume stays; D, and so K, is not printed")


def claims_of_dielectric(ftir: dict[str, Any]) -> Iterator[dict[str, str]]:
    """Rows for the contact area of the dielectric on glass; ftir: the summary that `validate_ftir` writes."""
    yield _contact_area(ftir)
    yield from _curve_shapes(ftir)


def _contact_area(ftir):
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


def claims_in_print(*, printed_counts: "dict[str, Counts]", printed_times: "dict[str, Times]") -> Iterator[dict[str, str]]:
    """Rows for the paper's numbers that others of its numbers decide: does what the text says follow from what its tables print?

    printed_counts: {object: (NPt, CHt, NPo, CHo, model)};  printed_times: {model: (mean, min, max, sd)} in s
    """
    hyper, elastic = printed_times["hyperelastic"], printed_times["elastic"]
    yield _follows("Hyperelastic maps take 3.5 times longer than elastic ones", "sec. 5", 3.5, hyper[0] / elastic[0] - 1,
                   f"{hyper[0]:g} s / {elastic[0]:g} s - 1 of table 3", "tables/table3_timing.csv")
    yield _follows("The longest elastic time is near the mean hyperelastic one", "sec. 4.2", hyper[0], elastic[2],
                   "s, both of table 3", "tables/table3_timing.csv")
    yield _follows("In complex cases the difference is up to 11 times", "sec. 5", 11, hyper[2] / elastic[2],
                   f"longest times, {hyper[2]:g} s / {elastic[2]:g} s of table 3", "tables/table3_timing.csv")
    for name, times, printed in (("elastic", elastic, 64), ("hyperelastic", hyper, 38)):
        yield _follows(f"The {name} model's longest time is {printed} times its shortest", "sec. 4.2", printed, times[2] / times[1],
                       f"{times[2]:g} s / {times[1]:g} s of table 3", "tables/table3_timing.csv")
    train, unseen, grasps = MAPS_OF_SETS
    yield _follows("The data set holds 53,400 maps", "abstract", ALL_MAPS, train + unseen + grasps * MAPS_OF_A_GRASP,
                   f"{train:,} + {unseen:,} + {grasps:,} grasps x {MAPS_OF_A_GRASP} maps from closing to held; that there are "
                   f"{MAPS_OF_A_GRASP} is our reading", "tables/claims.csv")
    for name, whole, overlap in (("object_3", 1.43, 0.6), ("object_6", 21, 9.6)):
        NPt, CHt, NPo, CHo, _ = printed_counts[name]
        yield _follows(f"{name.replace('_', ' ')}: NPt = {whole:g} CHt (figure 4)", "fig. 4", whole, NPt / CHt,
                       f"{NPt} / {CHt} of table 2", "tables/table2_complexity.csv")
        yield _follows(f"{name.replace('_', ' ')}: NPo = {overlap:g} CHo (figure 4)", "fig. 4", overlap, NPo / CHo,
                       f"{NPo} / {CHo} of table 2", "tables/table2_complexity.csv")


def _follows(claim, where, printed, ours, how, evidence):
    holds = abs(ours - printed) <= _CLOSE * printed
    return row(claim, where, f"{printed:,g}", f"{ours:,.3g} ({how})" if ours < 1000 else f"{ours:,.0f} ({how})",
               CONSISTENT if holds else CONTRADICTION, f"the paper's other numbers give it within {_CLOSE:.0%}", evidence,
               uncertainty="none: arithmetic of printed numbers")
