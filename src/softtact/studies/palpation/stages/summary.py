"""The report of a palpation sensor, and all facts of its study in one file."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml

from softtact.files import digest, read_csv, read_json, write_json
from softtact.probe.design import PalpationDesign
from softtact.studies.palpation.claims import NOT_JUDGED

if TYPE_CHECKING:
    from softtact.reporting.page import Page

_CAPTIONS = {
    "fig2_shapes": "Mesh and deformed shapes (the paper's figure 2); displacements are to scale.",
    "fig3_fig4_curves": "Beam deflection under load (figure 3); force against deflection, trend lines (figure 4).",
    "films": "Forces on the films as shares of the jaw's force. They need not add up to 1: films do not cover all.",
    "hardness": "Left: the paper's relative hardness F/d. Right: our index, the apparent modulus at rest. Each point uses a sweep "
                "up to its force.",
    "lump": "Left: least stiffness ratio of a lump that the films tell from plain tissue with 95 % probability. Right: lumps that "
            "the solver hid, found again from noisy films, with their 95 % intervals.",
}
_TITLES = {"slopes": "Slopes", "hardness": "Hardness over load and height", "variants": "Slopes under other assumptions",
           "lump_detection": "Least stiffness ratio of a lump that is seen",
           "lump_recovery": "Hidden lumps and what the films told of them"}
_MEASURES = {"relative_hardness_n_mm": "The paper's relative hardness F/d", "apparent_modulus_mpa": "Our apparent modulus"}


def report(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Write the page, and all facts in one file.

    inputs: tables, figures, facts, fields, sweeps (lists);  outputs: page, summary (JSON);  settings: design (all values)
    """
    from softtact.reporting.page import CONFIGURATION, Page

    design = PalpationDesign.model_validate(settings["design"])
    facts: dict[str, Any] = {"lump": {}} | {name: value for path in inputs["facts"] for name, value in read_json(path).items()}
    files = {path.stem: path for path in inputs["tables"]}
    page = Page("Palpation sensor", design.name, folder=outputs["page"].parent)
    page.opening(
        asked=["Do the forces on the films tell how hard a tissue is, and where a lump hides in it?",
               (_conditions(design), CONFIGURATION)],
        found=[*((sentence, files.get("hardness")) for sentence in _on_hardness(facts["hardness"])),
               *((sentence, files.get("lump_recovery")) for sentence in _on_lumps(facts))],
        sure=[*((sentence, outputs["summary"]) for sentence in _beyond_data(facts)), *_on_claims(files["claims"]),
              *([("Slopes under other assumptions show what each of these is worth.", files["variants"])] if "variants" in files
                else [])],
        synthetic=["All forces and deflections are computed; no sensor and no tissue was measured.",
                   *((f"Assumed: {sentence}.", CONFIGURATION) for sentence in _assumptions(design))])
    page.figures((path, _CAPTIONS[path.stem]) for path in inputs["figures"])
    page.tables(_TITLES, files)
    _show_claims(page, files["claims"])
    page.section("Files")
    page.text("", links=[(label, [(Path(path).name, page.link(path)) for path in paths]) for label, paths in (
        ("Curves", [files["curves"], *inputs["sweeps"]]), ("Fields for ParaView", inputs["fields"]))])
    page.configuration(yaml.safe_dump(design.model_dump(mode="json"), sort_keys=False))
    page.write(outputs["page"])
    write_json(outputs["summary"], facts | {"design": design.name, "config_digest": digest(design.model_dump(mode="json"))})


def _show_claims(page: "Page", file: Path) -> None:
    """The section of the paper's claims; of a user's tissues a sentence that none is judged."""
    claims = read_csv(file, keep_default_na=False)
    if len(claims):
        page.claims(claims, file=file)
        return
    page.section("The paper's claims", anchor="claims")
    page.text(NOT_JUDGED)


def _on_claims(file):
    """A sentence on the verdicts, if the study judges claims."""
    from softtact.reporting.page import counted

    claims = read_csv(file, keep_default_na=False)
    return [(f"Beside the paper, by rules with intervals: {counted(claims)}", file)] if len(claims) else []


def _beyond_data(facts):
    """A sentence on regions strained beyond the data of their law, if there are any facts on it."""
    beyond = facts["extrapolated_volume_fraction"]
    return [] if beyond is None else [f"At worst {beyond:.0%} of a region is strained beyond its law's data."]


def _conditions(design: PalpationDesign) -> str:
    """Model, interfaces and loads in sentences."""
    model = design.model.replace("_", " ")
    return (f"{model[0].upper()}{model[1:]}, depth {design.geometry.depth:g} mm. Jaw {design.jaw}; tissue on beam: "
            f"{design.tissue_on_beam}; beam on base: {design.beam_on_base} (a number: friction of a unilateral interface). Loads "
            f"to {design.load_n.to:g} N by {design.load_n.by:g} N, jaw to {design.displacement_mm.to:g} mm by "
            f"{design.displacement_mm.by:g} mm.")


def _assumptions(design: PalpationDesign) -> list[str]:
    """The assumptions of a design, one sentence each."""
    materials = {"supports": design.supports, "filler": design.filler, "beam": design.beam} | design.tissues
    marked = [f"{name}: {material.source}" for name, material in materials.items() if material.assumed]
    marked += [f"film {name}: {film.source}" for name, film in design.films.items() if film.assumed]
    return [*marked, "jaw and interfaces: bonded or not as stated above; the paper prints neither"]


def _on_hardness(verdicts):
    for column in sorted(verdicts, reverse=True):     # puts the paper's measure first
        found = verdicts[column]
        heights = found["heights"]
        by_height = (f"with the tissue's height by up to {found['change_with_height']:.1%}" if heights > 1 else
                     "and was measured at one height of the tissue, which says nothing of others")
        yield (f"{_MEASURES[column]}: changes with load by up to {found['change_with_load']:.1%}, {by_height}; hardest over "
               f"softest tissue {found['contrast']:.2f} or more; tissues {'are' if found['apart'] else 'are not'} told apart at "
               f"the loads and the {f'{heights} heights' if heights > 1 else 'one height'} that were tried.")


def _on_lumps(facts):
    if not facts["lump"]:
        return
    lump, presses, within = facts["lump"], facts["presses"], facts["lump"]["within_interval"]
    least, largest = lump["least_ratio_seen"]
    yield (f"Hidden lumps: median error {_errors(lump['median_error'])}, with {facts['noise_n']:g} N of noise on each film, in "
           f"{presses} press{'es' if presses > 1 else ''} each (in the first alone: {_errors(lump['median_error_in_one_press'])}; "
           f"the same guess for every lump: {_errors(lump['median_error_of_one_guess'])}); in their 95 % intervals lie "
           f"{within['x_mm']:.0%} of x, {within['depth_mm']:.0%} of depth, {within['log_ratio']:.0%} of the ratio; half of the "
           f"intervals of depth are wider than {lump['median_depth_interval_mm']:.1f} mm. A lump is seen from a ratio of "
           f"{least:.2f} to {largest:.2f}, by its place, where the plain tissue is known.")


def _errors(error):
    """Median errors of a lump in words."""
    return f"{error['x_mm']:.2f} mm in x, {error['depth_mm']:.2f} mm in depth, {error['stiffness_ratio']:.2f} in the ratio"
