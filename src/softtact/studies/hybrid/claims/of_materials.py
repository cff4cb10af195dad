"""Claims on the materials: stability and errors of the fits, and whether the printed constants are of one material."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from softtact.evaluation.claim_rows import ARCHIVE, CONSISTENT, CONTRADICTION, row, verdict_of
from softtact.materials.consistency import FACTOR, largest_parting_in_tension
from softtact.materials.laws.registry import make_law

_SLOPE = 0.1      # relative: a slope read off the same curves


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
