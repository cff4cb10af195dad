"""Claims on the materials and on the dielectric's contact area."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from softtact.evaluation.decisions import (
    ARCHIVE,
    CONSISTENT,
    CONTRADICTION,
    UNDECIDED,
    interval_inside,
    known_within,
    row,
    verdict_of,
)
from softtact.materials.consistency import FACTOR, largest_parting_in_tension, longest_common_test
from softtact.materials.laws.registry import make_law
from softtact.materials.linear import LinearConstants

AS_PRINTED = "as_printed"    # the orientation that has the printed diameters where the text has them
_SLOPE = 0.1      # relative: a slope read off the same curves
_SHORTEST, _LONGEST = 1.1, 2.0    # stretches: a rubber is pulled beyond the first, and hardly a test ends below; assumed
_NUMBERS = "none: arithmetic of printed numbers"


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
                   _judged_fit(card, chosen, 0.0, 0.01) if measured else ARCHIVE,
                   "on measured curves, the 95 % interval of the RMSE below 0.01 MPa", "tables/table1_materials.csv",
                   uncertainty=_fit_error(card, chosen))
        yield from _printed_errors(card, measured)
        yield from claims_of_constants(card)


def _standard_error(card, fit):
    """(error, points): an RMSE in MPa is known by the number n of its points, to 1 / sqrt(2 n) of itself; nan without points."""
    points = sum(curve["points"] for curve in card.get("curves", ()))
    return (fit["rmse_mpa"] / np.sqrt(2 * points) if points else np.nan), points


def _fit_error(card, fit):
    error, points = _standard_error(card, fit)
    return f"standard error {error:.4f} MPa, {points} points" if points else "points not told"


def _judged_fit(card, fit, low, high):
    """The verdict on an RMSE (MPa) between two limits, by its interval; undecided where the number of points is not known."""
    return interval_inside(known_within(fit["rmse_mpa"], _standard_error(card, fit)[0]), low, high)


def _printed_errors(card, measured):
    """A row for each law whose RMSE is printed."""
    for law, printed in card.get("printed", {}).items():
        if printed.get("rmse_mpa") is not None and law in card["laws"]:
            fit, value = card["laws"][law], printed["rmse_mpa"]
            yield row(f"{card['material']}: RMSE of {law}", "table 1", f"{value:g}",
                      f"{fit['rmse_mpa']:.4f} MPa ({card['kind']} curves)",
                      _judged_fit(card, fit, 0.5 * value, 1.5 * value) if measured else ARCHIVE,
                      "on measured curves, its 95 % interval within half of the printed one", "tables/table1_materials.csv",
                      uncertainty=_fit_error(card, fit))


def claims_of_constants(card: dict[str, Any]) -> Iterator[dict[str, str]]:
    """Do the printed laws and moduli of a card {material, printed} belong to one tensile test? No row where nothing is printed."""
    printed, name = card.get("printed", {}), card["material"]
    laws = {law: make_law(law, entry["parameters"]) for law, entry in printed.items() if law != "linear"}
    evidence = f"materials/{name}.json"
    if len(laws) > 1:
        yield _one_test(name, laws, [printed[law].get("rmse_mpa") for law in laws], evidence)
    if laws and "linear" in printed:
        young = printed["linear"]["parameters"]["young_mpa"]
        slopes = {law: 3 * made.mu0 for law, made in laws.items()}
        near = min(abs(slope / young - 1) for slope in slopes.values())
        yield row(f"{name}: E is the slope of the same stress-strain curves", "sec. 4.1", f"{young:g} MPa",
                  "initial slopes 3 mu0 of the printed laws: " + ", ".join(f"{law} {slope:.3g} MPa" for law,
                                                                           slope in slopes.items()),
                  CONSISTENT if near <= _SLOPE else CONTRADICTION, f"the slope of one printed law within {_SLOPE:.0%}", evidence,
                  uncertainty="3 mu0 holds where the volume stays; D, and so K, is not printed")
        yield from _poisson(name, laws, printed["linear"]["parameters"], evidence)


def _one_test(name, laws, rmse_mpa, evidence):
    """Can both printed laws be fits of one tensile test? By their printed errors, where those are printed."""
    claim, place, paper = f"{name}: the printed hyperelastic laws were fitted to the same test", "table 1", "one test, two laws"
    ratio, words = largest_parting_in_tension(laws)
    if len(laws) != 2 or None in rmse_mpa:
        return row(claim, place, paper, words, CONSISTENT if ratio <= FACTOR else CONTRADICTION,
                   "initial shear moduli, and stresses in tension to stretch 2 (what an ISO 3167 specimen shows), within a factor "
                   f"{FACTOR:g}", evidence, uncertainty=_NUMBERS)
    reach = longest_common_test(laws, allowed_mpa=sum(rmse_mpa))
    verdict = CONTRADICTION if reach < _SHORTEST else CONSISTENT if reach >= _LONGEST else UNDECIDED
    up_to = "all tests to stretch 2 or more" if reach >= _LONGEST else f"tests that end below stretch {reach:.2f}"
    return row(claim, place, paper,
               f"errors of {' and '.join(f'{value:g}' for value in rmse_mpa)} MPa allow {up_to}; {words}; the test's range is not "
               "printed, and what the laws do in compression, where the sensor works, no such test shows", verdict,
               "over a common test both laws part by the sum of their printed RMSE at most (in the root mean square); "
               f"undecided where that holds for tests to a stretch between {_SHORTEST:g} and {_LONGEST:g}", evidence,
               uncertainty=f"{_NUMBERS}; RMSE read as MPa, points evenly spaced in stretch")


def _poisson(name, laws, linear, evidence):
    """Is the printed Poisson's ratio, with E, of the material that the printed laws describe?"""
    if "poisson" not in linear:
        return
    constants = LinearConstants(young_mpa=linear["young_mpa"], poisson=linear["poisson"])
    near = min(abs(law.mu0 / constants.mu_mpa - 1) for law in laws.values())
    moduli = ", ".join(f"{law} {made.mu0:.3g} MPa" for law, made in laws.items())
    yield row(f"{name}: nu {constants.poisson:g} is that of the specimens that gave the laws", "sec. 4.1", f"{constants.poisson:g}",
              f"with E a shear modulus of {constants.mu_mpa:.3g} MPa, and K {constants.bulk_modulus_mpa:.3g} MPa, "
              f"{constants.bulk_modulus_mpa / constants.mu_mpa:.2g} times it; the printed laws have {moduli}, and "
              "hybrid elements are for rubber that hardly changes its volume", CONSISTENT if near <= _SLOPE else CONTRADICTION,
              f"the shear modulus of one printed law within {_SLOPE:.0%}", evidence, uncertainty=f"{_NUMBERS}; D is not printed")


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
    """A row per orientation of the printed frustum: does the area grow as the paper's words have it, with any law?

    As printed (base 0.6, tip 1.2 mm) the wide end is on the glass. Where that cannot give the printed discs, the paper's numbers
    contradict its words; its claim that the area grows is judged on the other orientation.
    """
    for orientation in dict.fromkeys(record["orientation"] for record in ftir["orientations"]):
        records = [record for record in ftir["orientations"] if record["orientation"] == orientation]
        allowed = any(record["allowed"] for record in records)
        yield row(f"Frusta read as {orientation}: the contact area grows with the force, in discs", "sec. 4.1, fig. 5",
                   "increases, not necessarily linearly", " ".join(record["sentence"] for record in records),
                   CONTRADICTION if orientation == AS_PRINTED and not allowed else verdict_of(allowed),
                   "with one law at least: rises at every force, by 0.04 mm2 or more, discs two pixels apart, no step steeper than "
                   "four times the mean", "ftir/orientations.csv", uncertainty="none: one simulation of each law, without scatter")
