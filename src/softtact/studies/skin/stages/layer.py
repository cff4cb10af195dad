"""The choice of elastomer, thickness and taxels by requirements, and the search over all designs."""

from itertools import product
from typing import Any

import pandas as pd

from softtact.files import read_json, write_csv, write_json
from softtact.skin.choice import (
    Needs,
    SearchSpace,
    front_confidence,
    main_effects,
    printed_criteria,
    ranked,
    search,
    thickness_table,
    thinnest,
    with_scatter,
)
from softtact.skin.design import Choice, needs_of
from softtact.studies.skin.settings import converter_of, design_of, elastomers_of


def choose_layer(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Evaluate the papers' criteria, and choose the thinnest layer that meets all requirements.

    outputs: choice_printed, front_confidence, thickness, choice (CSV), facts (JSON)
    settings: module, choice, elastomers, converter, known, bearable (names of elastomers whose curves reach the target pressure,
    and the whole range of pressures)
    """
    choice, layout = Choice.model_validate(settings["choice"]), design_of(settings).module.layout()
    elastomers = elastomers_of(settings)
    known, bearable = ([elastomers[name] for name in settings[which]] for which in ("known", "bearable"))
    target = 1e-3 * choice.target_kpa
    scatter = {"batch_scatter": choice.batch_scatter, "ageing_stiffening": choice.ageing_stiffening}
    confidence, same = front_confidence(known, stress_mpa=target, draws=choice.draws, strain_scatter=choice.strain_scatter,
                                        seed=choice.seed, **scatter)
    table = thickness_table(bearable, layout, needs=needs_of(choice), thicknesses_mm=choice.thicknesses_mm,
                            converter=converter_of(settings), weight_budget_g=choice.weight_budget_g)
    table = with_scatter(table, needs=needs_of(choice), **scatter)
    write_csv(outputs["choice_printed"], printed_criteria(known, stress_mpa=target, area_mm2=layout.area_mm2))
    write_csv(outputs["front_confidence"], confidence)
    write_csv(outputs["thickness"], table)
    write_csv(outputs["choice"], thinnest(table))
    left_out = [name for name in elastomers if name not in settings["known"] or name not in settings["bearable"]]
    remarks = [f"{', '.join(left_out)}: left out of the choice; their curves do not reach its pressures."] if left_out else []
    robust = thinnest(table.assign(meets_all=table.meets_all_at_worst))
    write_json(outputs["facts"], {"same_front": same, "left_out": left_out, "remarks": remarks,
                                  "chosen": _lightest(thinnest(table)), "chosen_at_worst": _lightest(robust)})


def search_cell(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Evaluate all elastomers and pitches at one thickness and radius.

    outputs: rows (JSON)
    settings: elastomers, thickness_mm, radius_mm, pitches_mm, gap_mm, side_mm, needs, converter
    """
    space = SearchSpace([settings["thickness_mm"]], [settings["radius_mm"]], settings["pitches_mm"], gap_mm=settings["gap_mm"],
                        side_mm=settings["side_mm"])
    needs = Needs(**settings["needs"] | {"range_mpa": tuple(settings["needs"]["range_mpa"])})
    table = search(elastomers_of(settings), space, needs=needs, converter=converter_of(settings))
    write_json(outputs["rows"], table.to_dict("records"))


def rank_designs(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Rank all designs of a search.

    inputs: rows (list of JSON);  outputs: search, main_effects (CSV)
    settings: weight_budget_g, elastomers (names), thicknesses_mm, radii_mm, pitches_mm, whose order decides between equal designs
    """
    rows = {(row["elastomer"], row["thickness_mm"], row["radius_mm"], row["pitch_mm"]): row
            for path in inputs["rows"] for row in read_json(path)}
    order = product(*(settings[name] for name in ("elastomers", "thicknesses_mm", "radii_mm", "pitches_mm")))
    table = ranked(pd.DataFrame([rows[key] for key in order]), settings["weight_budget_g"])
    write_csv(outputs["search"], table)
    write_csv(outputs["main_effects"], main_effects(table))


def _lightest(choice: pd.DataFrame) -> dict[str, Any] | None:
    """The first row of a choice, which is the lightest, as a record; None if no layer meets all requirements."""
    if not len(choice):
        return None
    best = choice.iloc[0]
    return {"elastomer": best.elastomer, "thickness_mm": float(best.thickness_mm), "weight_g_module": float(best.weight_g_module)}
