"""The report of the study of grasps: objects in the hand, what both sensors feel, one event by two models, claims."""

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from jinja2 import Environment

import softtact
from softtact.files import atomic_path
from softtact.reporting.page_template import STYLE
from softtact.reporting.run_record import machine
from softtact.reporting.style import pyplot, save

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

_MOST_COLUMNS = 6
_PAGE = """<!doctype html><html lang="en"><head><meta charset="utf-8"><title>softtact: {{ study }}</title>
<meta name="viewport" content="width=device-width"><style>{{ style }}</style></head><body>
<h1>Grasps by a robot: the study <i>{{ study }}</i></h1>
<p class="box"><b>What is synthetic here.</b> Robot and objects move in MuJoCo. Readings are the virtual sensor's, a simulation. No
score here is the paper's.</p>
<p>{{ said }}</p>
{% for f in figures %}<figure><img alt="{{ f.caption }}" src="data:image/png;base64,{{ f.image }}">
<figcaption>{{ f.caption }} <a href="{{ f.link }}">PNG</a>.</figcaption></figure>{% endfor %}
<h2>The paper's claims</h2><p>Each verdict is computed by the rule beside it. <a href="tables/claims.csv">CSV</a>.</p>
<table><tr>{% for c in columns %}<th>{{ c }}</th>{% endfor %}</tr>{% for row in claims %}
<tr class="{{ row.verdict.split()[0] }}">{% for c in columns %}<td>{{ row[c] }}</td>{% endfor %}</tr>{% endfor %}</table>
<h2>Grasps</h2><p><a href="grasps.csv">CSV</a>; each grasp in time: <a href="grasps">grasps/</a>.</p>{{ grasps }}
<h2>Configuration</h2><pre>{{ config }}</pre>
<p>softtact {{ version }}; {{ machine }}.</p></body></html>
"""
_SHOWN = ["grasp", "status", "x_mm", "y_mm", "angle_deg", "trials", "force_left_n", "force_right_n", "model_grip_left",
          "model_grip_right", "deepest_left_mm", "deepest_right_mm", "counts_left", "counts_right", "trial_sd_left_counts",
          "trial_sd_right_counts", "message"]


def write_grasps_report(folder: Path, *, study: str, grasps: pd.DataFrame, claims: pd.DataFrame,
                        figures: Sequence[tuple[Path, str]], config: str) -> None:
    """Write report.html below a folder; figures: [(PNG, caption)]."""
    done = grasps[grasps.status == "done"]
    said = (f"{len(done)} of {len(grasps)} grasps done, {done.object.nunique() if len(done) else 0} objects, "
            f"{int(done.trials.sum()) if len(done) else 0} trials.")
    if len(done) and not (done[["valid_left", "valid_right"]] == 1).to_numpy().all():
        invalid = int((done[["valid_left", "valid_right"]] != 1).to_numpy().sum())
        said += f" {invalid} presses at the grip are beyond what their model is valid for; their maps are not to be relied on."
    shown = [{"caption": caption, "link": str(path.relative_to(folder)), "image": base64.b64encode(path.read_bytes()).decode()}
             for path, caption in figures]
    table = grasps[[name for name in _SHOWN if name in grasps]]
    page = Environment(autoescape=True).from_string(_PAGE).render(
        study=study, style=STYLE, said=said, figures=shown, columns=list(claims.columns), claims=claims.to_dict("records"),
        grasps=_safe(table.to_html(index=False, na_rep="", border=0, float_format=lambda value: f"{value:.4g}")), config=config,
        version=softtact.__version__, machine=machine())
    with atomic_path(folder / "report.html") as temporary:
        temporary.write_text(page, encoding="utf-8")


def _safe(html: str) -> Any:
    from markupsafe import Markup

    return Markup(html)


def draw_objects(path: Path, events: Mapping[str, "xarray.Dataset"], readings: Mapping[str, "xarray.Dataset"],
                 pictures: Mapping[str, np.ndarray]) -> None:
    """Write a PNG with a column for each object at the grip: robot, maps of both sensors, the virtual sensor's mean readings.

    pictures: {object: image (height, width, 3)}, empty where MuJoCo does not draw
    """
    names = list(events)[:2 * _MOST_COLUMNS]
    blocks, columns = -(-len(names) // _MOST_COLUMNS), min(len(names), _MOST_COLUMNS)
    rows = (1 if pictures else 0) + 4
    figure = pyplot().figure(figsize=(2.3 * columns + 0.6, 2.0 * rows * blocks + 0.4), layout="constrained")
    grid = figure.subplots(rows * blocks, columns, squeeze=False)
    for axes in grid.ravel():
        axes.set_axis_off()
    for number, name in enumerate(names):
        block, column = divmod(number, _MOST_COLUMNS)
        _draw_column(grid[block * rows:(block + 1) * rows, column], name, events[name], readings[name], pictures.get(name),
                     with_picture=bool(pictures), figure=figure)
    save(figure, path)


def _draw_column(axes, name, data, read, picture, *, with_picture, figure):
    first = 1 if with_picture else 0
    if picture is not None:
        axes[0].imshow(picture)
    axes[0].set_title(name.replace("_", " "), fontsize=9)
    extent = [float(data[axis][end]) for axis in ("x", "y") for end in (0, -1)]
    for finger, side in enumerate(("left", "right")):
        for offset, (values, unit) in enumerate(((data.deformation_map_mm.values[1, finger], "mm"),
                                                 (read.tactile_map.values[finger].mean(axis=0), "counts"))):
            place = axes[first + 2 * finger + offset]
            place.set_axis_on()
            image = place.imshow(values, origin="lower", extent=extent, vmin=0, vmax=max(float(values.max()), 1e-9), cmap="viridis")
            place.set_xticks([]), place.set_yticks([])
            bar = figure.colorbar(image, ax=place, shrink=0.8, label=unit)
            bar.ax.tick_params(labelsize=6)
            place.set_ylabel(f"{side}, {data.model.values[1, finger]}" if offset == 0 else f"{side}, mean reading", fontsize=6)


def draw_one_event(path: Path, compared: Mapping[str, "xarray.Dataset"]) -> None:
    """Write a PNG with a row for each object: the maps that several models make of one event, one scale a row."""
    models = max(data.sizes["model"] for data in compared.values())
    figure: Figure = pyplot().figure(figsize=(2.6 * models + 0.6, 3.4 * len(compared)), layout="constrained")
    grid = figure.subplots(len(compared), models, squeeze=False)
    for axes, (name, data) in zip(grid, compared.items(), strict=True):
        extent = [float(data[axis][end]) for axis in ("x", "y") for end in (0, -1)]
        deepest = float(data.deformation_map_mm.max())
        for place, model, values, share in zip(axes, data.model.values, data.deformation_map_mm.values, data.lower_share.values,
                                               strict=True):
            image = place.imshow(values, origin="lower", extent=extent, vmin=0, vmax=deepest, cmap="viridis")
            place.set_title(f"{name.replace('_', ' ')}, {model}\nlower feature: {share:z.2f} of the raised", fontsize=8)
            place.set_xlabel("x (mm)"), place.set_ylabel("y (mm)")
        figure.colorbar(image, ax=list(axes), label="towards the PCB (mm)", shrink=0.8)
    save(figure, path)
