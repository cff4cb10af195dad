"""report.html: one file, figures inside, links to the data beside it."""

import base64
import os

import pandas as pd
from jinja2 import Environment
from markupsafe import Markup

import softtact
from softtact.files import read_json
from softtact.reporting.tables import machine

CAPTIONS = {
    "fig4_complexity": "Figure 4. Mesh (grey) and convex hull (lines) of an object for each chosen model, and the ratios of all "
                       "objects with the two thresholds.",
    "fig5_ftir": "Figure 5. Contact area of the dielectric pressed on glass.",
    "fig6_ssim": "Figure 6. SSIM of the networks' readings per item: bars are means, boxes quartiles over forces and trials; "
                 "black dashes, where trials are repeated: the sensor's own trials against each other, which no model passes by "
                 "more than the noise left in a mean of few trials.",
    "fig7_maps": "Figure 7. Objects from below, deformation maps of both models, tactile maps predicted from them, and the virtual "
                 "sensor's (mean of its trials). Jet colours as printed; tactile maps from 0 to the readout's largest count.",
    "fig8_policies": "Figure 8. Left: what each policy costs and which error it accepts, against the study's hyperelastic model. "
                     "Right: the error that was expected before the costly model ran, against the true one.",
    "fig9_networks": "Figure 9. The paper's network and another architecture on the same split. Left: mean SSIM with its 95 % "
                     "interval (bootstrap over objects, then trials). Right: loss and SSIM of the validation maps after an epoch.",
    "fig10_learning_curve": "Figure 10. Mean SSIM against the number of training maps, with its 95 % interval (bootstrap over "
                            "objects, then trials): equal steps of the optimiser for each. The reference's maps are those that the "
                            "virtual sensor itself felt, so that line is what the same network reads from a perfect model.",
}

PAPERS_SENSOR = "coro: "     # how the line on it begins

TEMPLATE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>softtact: {{ study }}</title>
<style>body{font:16px/1.5 system-ui,sans-serif;max-width:1080px;margin:2em auto;padding:0 1em;color:#222}
h1,h2{line-height:1.2}table{border-collapse:collapse;font-size:13px;margin:1em 0;display:block;overflow-x:auto}
td,th{border-bottom:1px solid #ddd;padding:4px 8px;text-align:left;vertical-align:top}th{background:#f4f4f4}
figure{margin:2em 0}img{max-width:100%}figcaption{font-size:14px;color:#444}.box{background:#fff6e0;border-left:4px solid #e0a000;
padding:.6em 1em}.reproduced{background:#d9f0d9}.not{background:#f7d7d7}.contradicts{background:#ffe9c7}.needs{background:#e6e6f5}
.undecided{background:#eee}
</style><h1>Simulating a soft tactile sensor: the study <i>{{ study }}</i></h1>
<p>{{ facts }}</p>
<p class="box"><b>What is synthetic here.</b> {{ synthetic }}</p>
<h2>Result in one table</h2>{{ summary }}
<h2>Figures</h2>{% for f in figures %}<figure><img alt="{{ f.caption }}" src="data:image/png;base64,{{ f.data }}">
<figcaption>{{ f.caption }}
{{ f.said }} <a href="{{ f.link }}">PNG</a>, <a href="{{ f.svg }}">SVG</a></figcaption></figure>{% endfor %}
<h2>Tables</h2>{% for t in tables %}<h3>{{ t.title }}</h3>{{ t.html }}<p><a href="{{ t.link }}">CSV</a></p>{% endfor %}
<h2>The paper's claims</h2><p>Each verdict is computed by the rule beside it.</p>
<table><tr>{% for c in claim_columns %}<th>{{ c }}</th>
{% endfor %}</tr>{% for row in claims %}<tr class="{{ row.verdict.split()[0] }}">{% for c in claim_columns %}<td>{{ row[c] }}</td>
{% endfor %}</tr>{% endfor %}</table>
<p>softtact {{ version }}; {{ machine }}. Files: <a href="presses">presses</a>, <a href="tactile">readings</a>,
<a href="dataset">data sets</a>, <a href="learning">networks</a>, <a href="evaluation">evaluation</a>,
<a href="logs">logs</a>.</p></html>
"""


def render_page(inputs, settings, *, folder):
    """The page as text; `inputs` as in the stage, links relative to `folder`."""
    claims = pd.read_csv(inputs["claims"], keep_default_na=False)
    titles = {"table1": "Table 1. Material laws (stress in MPa)",
              "contradictions": "Where the paper's table 1 contradicts itself",
              "table2": "Table 2. Complexity and choice of model",
              "table3": "Table 3. Time per tactile map (s)",
              "counts": "The archive's counts against those in print",
              "policies": "Policies that choose a model, on the presses that the expected error was not calibrated on",
              "networks": "Architectures on the same split: scores with their 95 % interval, and times in s (epoch_s an epoch, "
                          "map_s one map alone)",
              "limits": "What limits the scores: model, data or network"}
    tables = [{"title": title, "html": _html(pd.read_csv(inputs[name])), "link": _link(inputs[name], folder)}
              for name, title in titles.items() if name in inputs]
    ftir = read_json(inputs["ftir"])
    archive = read_json(inputs["inventory"]) if "inventory" in inputs else None
    figures = [_figure(path, folder) | {"said": ftir["verdict"] if path.stem == "fig5_ftir" else ""} for path in inputs["figures"]]
    environment = Environment(autoescape=True)
    for table in tables:
        table["html"] = Markup(table["html"])
    return environment.from_string(TEMPLATE).render(
        study=settings["study"], facts=_archive_facts(settings, archive) if archive else _facts(settings),
        synthetic=_synthetic_but_for_the_archive(ftir) if archive else _synthetic(ftir), tables=tables,
        summary=Markup(_html(_summary(pd.read_csv(inputs["summary"])))),
        figures=figures, claims=claims.to_dict("records"),
        claim_columns=list(claims.columns), version=softtact.__version__, machine=machine())


def _facts(settings):
    said = {name: f"{settings[name]} {words} in {settings['presses'][name]} places, each read {settings['trials'][name]} times"
            for name, words in (("indenters", "indenters"), ("unseen", "unseen ones"), ("grasps", "objects"))}
    forces = ", ".join(f"{force:g}" for force in settings["forces_n"])
    another = "It is not the paper's sensor: the paper's numbers and claims below are another sensor's. "
    return (f"Sensor {settings['sensor']}. {'' if settings['sensor'].startswith(PAPERS_SENSOR) else another}"
            f"Pressed at {forces} N with each model and read by the virtual sensor: {'; '.join(said.values())}. "
            f"Seed {settings['seed']}.")


def _archive_facts(settings, archive):
    """What stands for the presses of a study on the published archive."""
    items = archive["items"]
    return (f"Maps and readings are those of the published archive: {archive['tests_used']} of {archive['tests']} tests of "
            f"{len(items['indenters'])} indenters, {len(items['unseen'])} held-out ones (our choice: the paper does not name its "
            f"own) and {len(items['grasps'])} objects; {archive['tests_left_out']} odd tests are left out (published/odd.csv). "
            f"{archive['sentence']} No object was pressed, so figures 7 and 8 and our times are not here. Seed {settings['seed']}.")


def _synthetic_but_for_the_archive(ftir):
    return ("Stress-strain curves are made from the paper's printed constants with noise; the measured contact area is from: "
            f"{ftir['source']}; tables 1 and 2 and figures 4 and 5 are of our own curves, objects and specimen. "
            "Maps and readings, and so all SSIM values, are of the published archive; that maps and readings match by their "
            "order, how the taxels lie, and which indenters are held out is assumed.")


def _synthetic(ftir):
    return ("The paper's curves, camera frames and taxel readings are not published here. Stress-strain curves are made from "
            f"its printed constants with noise; the measured contact area is from: {ftir['source']}; the readings come from a "
            "virtual sensor (another law, another mesh, scatter, hysteresis, noise). SSIM values below are against that virtual "
            "sensor and are not the paper's.")


def _summary(summary):
    """The summary with headings for readers, and the interval in words."""
    interval = ["one item: none" if low != low else f"{low:.3f} to {high:.3f}"
                for low, high in zip(summary.ssim_low, summary.ssim_high, strict=True)]
    shown = summary.assign(ssim_low=interval).drop(columns="ssim_high")
    return shown.rename(columns={"ssim": "SSIM", "ssim_low": "95 % interval of the mean", "mae_counts": "mean error, counts",
                                 "overlap": "overlap of the contact patches", "sensor_ssim": "SSIM, sensor against itself"})


def _html(frame):
    return frame.to_html(index=False, na_rep="", float_format=lambda value: f"{value:.4g}", border=0)


def _link(path, folder):
    return os.path.relpath(path, folder)


def _figure(path, folder):
    material = path.stem.removeprefix("material_")
    caption = CAPTIONS.get(path.stem) or (f"Material {material}: test curves and the laws fitted to them, what they leave, and the "
                                          "stretches over which each law is stable.")
    return {"caption": caption, "data": base64.b64encode(path.read_bytes()).decode(),
            "link": _link(path, folder), "svg": _link(path.with_suffix(".svg"), folder)}
