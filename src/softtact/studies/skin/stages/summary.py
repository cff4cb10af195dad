"""The papers' claims, and the report of all results of a skin's study."""

from pathlib import Path
from typing import Any

import yaml

from softtact.files import read_csv, read_json, write_csv, write_json
from softtact.skin.design import SkinDesign

_CAPTIONS = {
    "probes": "Rise of the pressed taxel under cylindrical probes, for Young's modulus as measured and off by the legend's shares. "
    "Dotted: the elastomer's curve is extrapolated. (First paper, figure 6.)",
    "front": "Left: sensitivity against weight of each elastomer at its printed t_min; red squares: Pareto optimal. (Later "
    "paper, figure 7.) Right: how often each stays on the front where strains scatter from test to test, from batch to batch and "
    "with age.",
    "thickness": "What a layer does against its thickness, by finite elements of one taxel. Dashed: what is asked for.",
    "maps": "Where a finger is felt: smallest detectable force, standard error of the place read from taxels, and how crosstalk "
    "and that error depend on the pitch. White circles: taxels. A place nearer to a side than the finger's radius is left out.",
    "link": "The modules on the link from two sides, with their taxels. Red: bent more than the boards bear, and not exported.",
}
_TITLES = {
    "loads": "Loads",
    "choice": "The thinnest layer that meets all needs, by elastomer, the lightest first",
    "choice_printed": "The papers' criteria at the target pressure",
    "front_confidence": "Shares of draws in which an elastomer is on the front",
    "crosstalk": "Crosstalk and localisation against pitch",
    "modules": "Modules on the link",
    "main_effects": "Which share of each output's variance a factor explains alone (Sobol, over the search)",
    "search": "Search over elastomer, thickness, radius and pitch",
    "convergence": "The authors' case on finer and finer meshes",
}
_MOST_ROWS = 20


def judge_claims(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Judge the papers' claims.  outputs: claims, convergence (CSV);  settings: elastomers (fields of each)."""
    from softtact.studies.skin.claims import claims_of_skin
    from softtact.studies.skin.settings import elastomers_of

    for name, table in zip(("claims", "convergence"), claims_of_skin(elastomers_of(settings), threads=threads), strict=True):
        write_csv(outputs[name], table)


def report(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the page, and all facts in one file.

    inputs: tables, figures, facts, exports (lists), readings;  outputs: page, summary (JSON);  settings: design (all values)
    """
    from softtact.reporting.page import CONFIGURATION, Page

    design = SkinDesign.model_validate(settings["design"])
    files = {path.stem: path for path in inputs["tables"]}
    facts = _all_facts(inputs["facts"])
    write_json(outputs["summary"], {"skin": design.skin} | facts)
    page = Page("Robot skin", design.skin, folder=outputs["page"].parent)
    page.opening(
        asked=["What does this robot skin feel, which layer suits it best, and what does it weigh?",
               (_facts(design), CONFIGURATION)],
        found=[(sentence, files.get(table)) for sentence, table in
               ((_chosen(design, facts), "choice"), (_mapped(facts), "detection"), (_laid(facts), "modules"))],
        sure=[*((remark, outputs["summary"]) for remark in facts["remarks"]), *_on_claims(files)],
        synthetic="All readings are computed; no skin was built. Elastomers are as the papers measured them, the converter's stray "
                  "is assumed.")
    loads = read_csv(files["loads"])
    page.figures((path, _caption(path, loads)) for path in inputs["figures"])
    page.tables(_TITLES, files, most_rows=_MOST_ROWS)
    if "claims" in files:
        page.claims(read_csv(files["claims"], keep_default_na=False), title="The papers' claims", file=files["claims"])
    page.section("Files")
    page.text("Arrays with units, and the taxels for other programs.",
              links=[("", [(path.name, page.link(path)) for path in (inputs["readings"], *inputs["exports"])])])
    page.configuration(yaml.safe_dump(design.model_dump(mode="json"), sort_keys=False))
    page.write(outputs["page"])


def _all_facts(paths: list[Path]) -> dict[str, Any]:
    """The facts of all sections; their remarks are joined."""
    parts = [read_json(path) for path in paths]
    facts = {name: value for part in parts for name, value in part.items()}
    return facts | {"remarks": [remark for part in parts for remark in part.get("remarks", [])]}


def _caption(path, loads):
    if path.stem in _CAPTIONS:
        return _CAPTIONS[path.stem]
    row = loads.iloc[int(path.stem.removeprefix("load_")) - 1]
    return (f"{row.load}: {row.what}. Left the displacement of the upper side, right the taxels from yellow, unaffected, to red. "
            "(Both papers, displacement fields and taxel activation.)")


def _facts(design: SkinDesign) -> str:
    """The skin and its model in sentences."""
    module = design.module
    patch = "Six modules around a corner, under one piece of elastomer" if design.patch == "hexagon" else "One module"
    places = f"at a pitch of {module.pitch_mm:g} mm" if module.centres_mm is None else "at places of their own"
    return (f"{patch}: side {module.side_mm:g} mm, taxels of radius {module.radius_mm:g} mm {places}, "
            f"{module.thickness_mm:g} mm of {design.elastomer}, converter {design.converter.name!r} with a stray of "
            f"{design.converter.stray_pf:g} pF (assumed). {_strains(design)}; floor bonded, sides free; Laplace's equation on the "
            "deformed mesh.")


def _strains(design: SkinDesign) -> str:
    """How the loads are solved, in words."""
    finite = [load.name for load in design.loads if load.strains == "finite"]
    small = "Small strains, with the secant modulus at the pressure as in the papers"
    by_law = "finite strains, with the law of a foam that is fitted to the elastomer's curve"
    if not finite:
        return small
    return by_law.capitalize() if len(finite) == len(design.loads) else f"{small}; of {', '.join(finite)} {by_law}"


def _on_claims(files):
    """A sentence on the verdicts, if the study judges claims."""
    from softtact.reporting.page import counted

    return [(f"Beside the papers, by rules: {counted(read_csv(files['claims'], keep_default_na=False))}",
             files["claims"])] if "claims" in files else []


def _chosen(design, facts):
    if "chosen" not in facts:
        return ""
    choice, same = design.choice, facts["same_front"]
    front = (f"The papers' front at {choice.target_kpa:g} kPa is the same in {same['strain_scatter']:.0%} of draws where strains "
             f"scatter by {choice.strain_scatter:.0%}, and in {same['all']:.0%} with batches and age.")
    if facts["chosen"] is None:
        return f"No elastomer and thickness on the list meets all needs. {front}"
    at_end = facts["chosen"]["thickness_mm"] == min(choice.thicknesses_mm)
    ends = " (the thinnest on the list; a thinner one may do)" if at_end else ""
    robust = facts["chosen_at_worst"]
    worst = f"The lightest whose worst batch does so, too: {_layer(robust)}." if robust else "No one's worst batch does."
    return (f"Lightest layer that tells {choice.smallest_force_n:g} N from noise, stays below a strain of {choice.strain_limit:g} "
            f"at {choice.range_kpa[1]:g} kPa and in the converter's range: {_layer(facts['chosen'])}{ends}. {worst} {front}")


def _layer(best):
    return f"{best['thickness_mm']:g} mm of {best['elastomer']}, {best['weight_g_module']:.3g} g a module"


def _mapped(facts):
    if "maps" not in facts:
        return ""
    maps = facts["maps"]
    return (f"A finger is felt from {maps['least_force_n']:.3g} N on at best and {maps['worst_force_n']:.3g} N at worst; "
            f"{maps['asked_n']:g} N is missed on {maps['share_not_felt']:.0%} of the places.")


def _laid(facts):
    if "link" not in facts:
        return ""
    link = facts["link"]
    return (f"On the link lie {link['modules']} modules with {link['elastomer_g']:.3g} g of elastomer; {link['bent_too_much']} "
            f"more would bend too much, {link['without_place']} found no place. The least bend radius is "
            f"{link['least_bend_radius_mm']:.3g} mm; gaps reach {link['widest_gap_mm']:.2g} mm, overlaps "
            f"{link['widest_overlap_mm']:.2g} mm.")
