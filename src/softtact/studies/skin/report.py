"""report.html of a skin: what was asked, what came out, figures, tables, the papers' claims."""

import base64
from pathlib import Path
from typing import Any

import pandas as pd
import yaml
from jinja2 import Environment
from markupsafe import Markup

import softtact
from softtact.files import atomic_path
from softtact.reporting.page_template import STYLE
from softtact.reporting.run_record import machine
from softtact.reporting.words import header
from softtact.skin.design import SkinDesign

CAPTIONS = {
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
TITLES = {
    "loads": "Loads",
    "choice": "The thinnest layer that meets all needs, by elastomer, the lightest first",
    "choice_printed": "The papers' criteria at the target pressure",
    "front_confidence": "Shares of draws in which an elastomer is on the front",
    "crosstalk": "Crosstalk and localisation against pitch",
    "modules": "Modules on the link",
    "main_effects": "Which share of each output's variance a factor explains alone (Sobol, over the search)",
    "search": "Search over elastomer, thickness, radius and pitch (first 20 rows)",
    "convergence": "The authors' case on finer and finer meshes",
}
DRAWN_FROM = {"probes": "probes", "front": "choice_printed", "thickness": "thickness", "maps": "detection", "link": "modules"}
_MOST_ROWS = 20

PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>softtact: skin {{ design.skin }}</title>
<meta name="viewport" content="width=device-width"><style>{{ style }}</style></head><body>
<h1>Robot skin <i>{{ design.skin }}</i></h1>
<p>{{ facts }}</p>
{% if remarks %}<div class="box"><b>Read with care.</b><ul>
{% for said in remarks %}<li>{{ said }}</li>{% endfor %}</ul></div>{% endif %}
{% if result %}<p class="box">{{ result }}</p>{% endif %}
<nav><a href="#figures">Figures</a><a href="#tables">Tables</a>{% if claims %}<a href="#claims">Claims</a>{% endif %}
<a href="#files">Files</a><a href="#design">Design</a></nav>
<h2 id="figures">Figures</h2>{% for name, caption, image in figures %}<figure id="{{ name }}">
<img alt="{{ caption }}" src="data:image/png;base64,{{ image }}"><figcaption>{{ caption }}</figcaption></figure>{% endfor %}
<h2 id="tables">Tables</h2>{% for name, title, html in tables %}<h3>{{ title }}</h3>{{ html }}
<p class="links"><a href="tables/{{ name }}.csv">CSV</a></p>{% endfor %}
{% if claims %}<h2 id="claims">The papers' claims</h2><p>Each verdict is computed by the rule beside it.
<a href="tables/claims.csv">CSV</a></p><table><tr>{% for c in claim_columns %}<th>{{ header(c) }}</th>{% endfor %}</tr>
{% for row in claims %}<tr class="{{ row.verdict.split()[0] }}">{% for c in claim_columns %}<td>{{ row[c] }}</td>{% endfor %}</tr>
{% endfor %}</table>{% endif %}
<h2 id="files">Files</h2><p>Arrays with units: <a href="readings.nc">readings.nc</a>. Taxels for other programs:
{% for file in exports %}
<a href="exports/{{ file }}">{{ file }}</a>{{ ", " if not loop.last }}{% endfor %}.</p>
<h2 id="design">Design</h2><p>With all defaults.</p><pre>{{ yaml }}</pre>
<p>softtact {{ version }}; {{ machine }}.</p></body></html>
"""


def write_page(out: Path, design: SkinDesign, tables: dict[str, pd.DataFrame], said: dict[str, Any], *, figures: list[str]) -> None:
    """Write report.html into `out`, from the tables by name and the figures of these names below figures/."""
    page = (
        Environment(autoescape=True)
        .from_string(PAGE)
        .render(
            design=design,
            style=Markup(STYLE),
            facts=_facts(design),
            remarks=said["remarks"],
            result=_result(design, said),
            figures=[_figure(out / f"figures/{name}.png", tables) for name in figures],
            tables=[
                (name, title, Markup(_html(tables[name].head(_MOST_ROWS)))) for name, title in TITLES.items() if name in tables
            ],
            claims=tables["claims"].to_dict("records") if "claims" in tables else [],
            claim_columns=list(tables["claims"].columns) if "claims" in tables else [],
            header=header,
            exports=sorted(path.name for path in (out / "exports").iterdir()),
            yaml=yaml.safe_dump(design.model_dump(mode="json"), sort_keys=False),
            version=softtact.__version__,
            machine=machine(),
        )
    )
    with atomic_path(out / "report.html") as temporary:
        temporary.write_text(page, encoding="utf-8")


def _facts(design):
    module = design.module
    patch = "Six modules around a corner, under one piece of elastomer" if design.patch == "hexagon" else "One module"
    return (
        f"{patch}: side {module.side_mm:g} mm, taxels of radius {module.radius_mm:g} mm at a pitch of {module.pitch_mm:g} mm, "
        f"{module.thickness_mm:g} mm of {design.elastomer}, converter {design.converter.name!r} with a stray of "
        f"{design.converter.stray_pf:g} pF (assumed). Small strains, with the secant modulus at the pressure as in the papers; "
        "floor "
        "bonded, sides free; Laplace's equation on the deformed mesh."
    )


def _result(design, said):
    """The answers in sentences."""
    return " ".join(sentence for sentence in (_chosen(design, said), _felt(said), _laid(said)) if sentence)


def _felt(said):
    if "maps" not in said:
        return ""
    maps = said["maps"]
    return (
        f"A finger is felt from {maps['least_force_n']:.3g} N on at best and {maps['worst_force_n']:.3g} N at worst; "
        f"{maps['asked_n']:g} N is missed on {maps['share_not_felt']:.0%} of the places."
    )


def _laid(said):
    if "link" not in said:
        return ""
    link = said["link"]
    return (
        f"On the link lie {link['modules']} modules with {link['elastomer_g']:.3g} g of elastomer; {link['bent_too_much']} more "
        f"would bend too much, {link['without_place']} found no place. The least bend radius is "
        f"{link['least_bend_radius_mm']:.3g} mm; gaps reach {link['widest_gap_mm']:.2g} mm, "
        f"overlaps {link['widest_overlap_mm']:.2g} mm."
    )


def _chosen(design, said):
    if "chosen" not in said:
        return ""
    choice, same = design.choice, said["same_front"]
    front = (
        f"The papers' front at {choice.target_kpa:g} kPa is the same in {same['strain_scatter']:.0%} of draws where strains "
        "scatter "
        f"by {choice.strain_scatter:.0%}, and in {same['all']:.0%} with batches and age."
    )
    if said["chosen"] is None:
        return f"No elastomer and thickness on the list meets all needs. {front}"
    at_end = said["chosen"]["thickness_mm"] == min(choice.thicknesses_mm)
    ends = " (the thinnest on the list; a thinner one may do)" if at_end else ""
    robust = said["chosen_at_worst"]
    worst = f"The lightest whose worst batch does so, too: {_layer(robust)}." if robust else "No one's worst batch does."
    return (
        f"Lightest layer that tells {choice.smallest_force_n:g} N from noise, stays below a strain of {choice.strain_limit:g} at "
        f"{choice.range_kpa[1]:g} kPa and in the converter's range: {_layer(said['chosen'])}{ends}. {worst} {front}"
    )


def _layer(best):
    return f"{best['thickness_mm']:g} mm of {best['elastomer']}, {best['weight_g_module']:.3g} g a module"


def _figure(path, tables):
    number = path.stem.removeprefix("load_")
    caption = CAPTIONS.get(path.stem)
    if caption is None:
        row = tables["loads"].iloc[int(number) - 1]
        caption = (
            f"{row.load}: {row.what}. Left the displacement of the upper side, right the taxels from yellow, unaffected, to red. "
            "(Both papers, displacement fields and taxel activation.)"
        )
    return path.stem, caption, base64.b64encode(path.read_bytes()).decode()


def _html(frame):
    return frame.rename(columns=header).to_html(index=False, na_rep="", float_format=lambda value: f"{value:.4g}", border=0)
