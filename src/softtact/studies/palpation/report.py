"""What `softtact palpate` writes: tables, pictures, fields, claims and one page that shows them."""

import base64
from collections.abc import Callable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd
from jinja2 import Environment
from markupsafe import Markup

import softtact
from softtact.files import atomic_path, digest, write_csv, write_dataset, write_json
from softtact.probe.design import PalpationDesign
from softtact.probe.lump import PARAMETERS, detection_map, lump_table, recovery
from softtact.probe.sweep import hardness_table, palpate, slope, verdict
from softtact.reporting.page_template import STYLE
from softtact.reporting.run_record import machine
from softtact.studies.palpation import figures
from softtact.studies.palpation.claims import claims_of_probe

_MEASURES = ("relative_hardness_n_mm", "apparent_modulus_mpa")
_COARSER = 2.0      # times the mesh's sizes: the second mesh that tells the mesh error
_PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>softtact: {{ design.name }}</title>
<meta name="viewport" content="width=device-width"><style>{{ style }}</style></head><body>
<h1>Palpation sensor <i>{{ design.name }}</i></h1>
<p>{{ facts }}</p>
<div class="box"><b>What is assumed.</b><ul>{% for text in assumed %}<li>{{ text }}</li>{% endfor %}</ul></div>
{% for text in said %}<p>{{ text }}</p>{% endfor %}
{% for picture in pictures %}<figure><img alt="{{ picture.caption }}" src="data:image/png;base64,{{ picture.image }}">
<figcaption>{{ picture.caption }}</figcaption><div class="links"><a href="{{ picture.file }}">PNG</a></div></figure>{% endfor %}
{% for table in tables %}<h2>{{ table.title }}</h2>{{ table.html }}
<p class="links"><a href="{{ table.file }}">CSV</a></p>{% endfor %}
<p>softtact {{ version }}; {{ machine }}. Fields for ParaView: {% for name in fields %}<a href="{{ name }}">{{ name }}</a>
{{- ", " if not loop.last }}{% endfor %}.</p></body></html>
"""


@dataclass
class _Report:
    """What is written into a folder, and shown on its page."""

    out: Path
    tables: list[dict[str, Any]] = field(default_factory=list)
    pictures: list[dict[str, str]] = field(default_factory=list)
    fields: list[str] = field(default_factory=list)
    said: list[str] = field(default_factory=list)

    def table(self, name: str, title: str, frame: pd.DataFrame, *, shown: bool = True) -> None:
        write_csv(self.out / "tables" / name, frame)
        if shown:
            html = frame.rename(columns=lambda text: text.replace("_", " ")).to_html(
                index=False, border=0, na_rep="", float_format=lambda value: f"{value:.4g}")
            self.tables.append({"title": title, "html": Markup(html), "file": f"tables/{name}"})

    def picture(self, name: str, caption: str, draw: Callable[[list[Path]], None]) -> None:
        path = self.out / f"{name}.png"
        draw([path, path.with_suffix(".svg")])
        self.pictures.append({"file": path.name, "caption": caption, "image": base64.b64encode(path.read_bytes()).decode()})


def palpation_study(design: PalpationDesign, out: Path, *, threads: int = 1,
                    tell: Callable[[str], None] = lambda text: None) -> dict[str, Any]:
    """Run a design's sweeps and studies, write them to the folder `out`; returns the summary (also `summary.json`).

    Raises ConvergenceError where a step is not reached; what was written before stays, the page is written last.
    """
    report = _Report(out)
    sweeps = [palpate(design, tissue, scenario, threads=threads, tell=tell)
              for scenario in ("displacement", "load") for tissue in design.tissues]
    slopes = _sweeps(report, design, sweeps)
    spread = _mesh_error(design, slopes, threads=threads, tell=tell)
    hardness = _hardness(report, design, threads=threads, tell=tell)
    if design.variants:
        report.table("variants.csv", "Slopes under other assumptions", _variants(design, threads=threads, tell=tell))
    hidden = _lump(report, design, threads=threads, tell=tell)
    summary = {"design": design.name, "config_digest": digest(design.model_dump(mode="json")), "slopes": slopes.to_dict("records"),
               "mesh_error": spread, "sweep_seconds": {f"{s.tissue}, {s.scenario}": round(s.wall_time_s, 2) for s in sweeps},
               "hardness": hardness[1], "lump": hidden}
    curves = pd.concat([sweep.table() for sweep in sweeps])
    claims = claims_of_probe(curves, slopes, hardness[0], mesh_error=f"{spread:.1%} between this mesh and one half as fine")
    report.table("claims.csv", "The paper's claims", claims)
    write_json(out / "summary.json", summary)
    _write_page(report, design, sweeps)
    return summary | {"claims": claims[["claim", "ours", "verdict"]].to_dict("records")}


def _sweeps(report, design, sweeps):
    """Curves, slopes, pictures and fields; returns the slopes."""
    rows = []
    for sweep in sweeps:
        own = asdict(slope(sweep.force_n, sweep.beam_deflection_mm))
        least, largest = own.pop("secant_n_mm")
        rows.append({"tissue": sweep.tissue, "scenario": sweep.scenario} | own | {
            "secant_least_n_mm": least, "secant_largest_n_mm": largest, "force_n": sweep.force_n[-1],
            "beam_deflection_mm": sweep.beam_deflection_mm[-1], "sweep_s": sweep.wall_time_s})
        write_dataset(report.out / f"{sweep.tissue}_{sweep.scenario}.nc", sweep.dataset(), seed=None,
                      settings=design.model_dump(mode="json"))
    slopes = pd.DataFrame(rows)
    report.table("curves.csv", "", pd.concat([sweep.table() for sweep in sweeps]), shown=False)
    moved = [sweep for sweep in sweeps if sweep.scenario == "displacement"]
    report.picture("fig2_shapes", "Mesh and deformed shapes (the paper's figure 2); displacements are to scale.",
                   lambda paths: figures.draw_shapes(moved, paths))
    report.picture("fig3_fig4_curves", "Beam deflection under load (figure 3); force against deflection, trend lines (figure 4).",
                   lambda paths: figures.draw_curves(sweeps, slopes, paths))
    report.picture("films", "Forces on the films as shares of the jaw's force. They need not add up to 1: films do not cover all.",
                   lambda paths: figures.draw_films(sweeps, paths))
    for sweep in moved:
        name = f"fields_{sweep.tissue}.vtu"
        figures.write_fields(sweep, report.out / name)
        report.fields.append(name)
    report.table("slopes.csv", "Slopes", slopes)
    return slopes


def _mesh_error(design, slopes, *, threads, tell):
    """Largest change of a slope, as a share, on a mesh with elements twice as large."""
    sizes = design.mesh
    coarse = design.with_(mesh={name: _COARSER * getattr(sizes, name) for name in ("along", "tissue", "base")})
    worst = 0.0
    for own in slopes[slopes.scenario == "displacement"].itertuples():
        sweep = palpate(coarse, own.tissue, "displacement", threads=threads, tell=tell)
        worst = max(worst, abs(slope(sweep.force_n, sweep.beam_deflection_mm).line_n_mm / own.line_n_mm - 1))
    return worst


def _hardness(report, design, *, threads, tell):
    """(table or None, verdicts as plain values) of the study of hardness."""
    if design.hardness is None:
        return None, {}
    table = hardness_table(design, design.hardness, threads=threads, tell=tell)
    report.table("hardness.csv", "Hardness over load and height", table)
    verdicts = {column: verdict(table, column) for column in _MEASURES}
    report.picture("hardness", "Left: the paper's relative hardness F/d. Right: our index, the apparent modulus at rest. Each "
                   "point uses a sweep up to its force.", lambda paths: figures.draw_hardness(table, verdicts, paths))
    for column, own in verdicts.items():
        report.said.append(f"{column}: changes with load by up to {own.change_with_load:.1%}, with the tissue's height by up to "
                           f"{own.change_with_height:.1%}; hardest over softest tissue {own.contrast:.2f} or more; tissues "
                           f"{'are' if own.apart else 'are not'} told apart whatever load and height.")
    return table, {column: asdict(own) for column, own in verdicts.items()}


def _lump(report, design, *, threads, tell):
    """The search for a hidden lump: plain values for the summary, empty where there is none."""
    if design.search is None:
        return {}
    search = design.search
    table = lump_table(design, search, threads=threads, tell=tell)
    seen, found = detection_map(table), recovery(design, search, table, threads=threads, tell=tell)
    report.table("lump_detection.csv", "Least stiffness ratio of a lump that is seen", seen)
    report.table("lump_recovery.csv", "Hidden lumps and what the films told of them", found)
    report.picture("lump", "Left: least stiffness ratio of a lump that the films tell from plain tissue with 95 % probability. "
                   "Right: lumps that the solver hid, found again from noisy films, with their 95 % intervals.",
                   lambda paths: figures.draw_detection(seen, found, paths))
    names = ("x_mm", "depth_mm", "stiffness_ratio")
    off, alone = ({name: float((found[f"{how}_{name}"] - found[name]).abs().median()) for name in names}
                  for how in ("found", "alone"))
    blind = {name: float((found[name] - found[name].median()).abs().median()) for name in names}     # the best constant guess
    inside = {name: float(found[f"{name}_within"].mean()) for name in PARAMETERS}
    depths = (found.depth_mm_high - found.depth_mm_low).median()
    least = seen.least_stiffness_ratio
    report.said.append(f"Hidden lumps: median error {_told(off)}, with {search.noise_n:g} N of noise on each film, in "
                       f"{len(search.moves)} press{'es' if len(search.moves) > 1 else ''} each (in the first alone: "
                       f"{_told(alone)}; the same guess for every lump: {_told(blind)}); "
                       f"in their 95 % intervals lie {inside['x_mm']:.0%} of x, {inside['depth_mm']:.0%} of depth, "
                       f"{inside['log_ratio']:.0%} of the ratio; half of the intervals of depth are wider than "
                       f"{depths:.1f} mm. A lump is seen "
                       f"from a ratio of {least.min():.2f} to {least.max():.2f}, by its place, where the "
                       "plain tissue is known.")
    return {"median_error": off, "median_error_in_one_press": alone, "median_error_of_one_guess": blind, "within_interval": inside,
            "least_ratio_seen": [float(least.min()), float(least.max())],
            "median_depth_interval_mm": float(depths),
            "largest_table_error_n": float(found.table_error_n.max())}


def _told(error):
    """Median errors of a lump in words."""
    return f"{error['x_mm']:.2f} mm in x, {error['depth_mm']:.2f} mm in depth, {error['stiffness_ratio']:.2f} in the ratio"


def _variants(design, *, threads, tell):
    """Slopes of all tissues under each variant's assumptions, and under the design's own, by fewer steps."""
    rows = []
    for name, own in {"as designed": design, **{name: design.variant(name) for name in design.variants}}.items():
        ways = own.displacement_mm.to * (1 + pd.RangeIndex(design.variant_steps).to_numpy()) / design.variant_steps
        for tissue in own.tissues:
            sweep = palpate(own, tissue, "displacement", values=ways, threads=threads, tell=tell)
            found = slope(sweep.force_n, sweep.beam_deflection_mm)
            rows.append({"variant": name, "tissue": tissue, "line_n_mm": found.line_n_mm, "initial_n_mm": found.initial_n_mm,
                         "force_n": sweep.force_n[-1]})
    return pd.DataFrame(rows)


def _write_page(report, design, sweeps):
    model = "plane strain" if design.model == "plane_strain" else "a solid"
    extrapolated = max(float(sweep.extrapolated_volume_fraction.max()) for sweep in sweeps)
    facts = (f"{model[0].upper()}{model[1:]}, depth {design.geometry.depth:g} mm. Jaw {design.jaw}; tissue on beam: "
             f"{design.tissue_on_beam}; beam on base: {design.beam_on_base} (a number: friction of a unilateral interface). Loads "
             f"to {design.load_n.to:g} N by {design.load_n.by:g} N, jaw to {design.displacement_mm.to:g} mm by "
             f"{design.displacement_mm.by:g} mm. " + ("" if extrapolated != extrapolated else
             f"At worst {extrapolated:.0%} of a region is strained beyond its law's data."))
    page = Environment(autoescape=True).from_string(_PAGE).render(
        design=design, style=Markup(STYLE), facts=facts, assumed=assumptions(design), said=report.said, pictures=report.pictures,
        tables=report.tables, fields=report.fields, version=softtact.__version__, machine=machine())
    with atomic_path(report.out / "report.html") as temporary:
        temporary.write_text(page, encoding="utf-8")


def assumptions(design: PalpationDesign) -> list[str]:
    """What a design marks as assumed, a sentence each."""
    materials = {"supports": design.supports, "filler": design.filler, "beam": design.beam} | design.tissues
    said = [f"{name}: {material.source}" for name, material in materials.items() if material.assumed]
    said += [f"film {name}: {film.source}" for name, film in design.films.items() if film.assumed]
    return [*said, "jaw and interfaces: bonded or not as stated above; the paper prints neither"]
