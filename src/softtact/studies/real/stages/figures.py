"""The figures of the study: force over depth, motion of markers, pictures of a press, the ball's size."""

from typing import Any

import numpy as np

from softtact.files import read_arrays, read_csv
from softtact.reporting.style import pyplot, save
from softtact.studies.real.paths import read_path
from softtact.studies.real.stages.force import ELASTIC, elastic_path
from softtact.studies.real.stages.markers import FORMULAS, LAYER, PHYSICS

_LINES = ("-", "--", "-.", ":")
_COLOURS = ("#1f4e79", "#e08214", "#3f9c6d", "#7b3f8c", "0.4", "#c0392b")
_ARROWS = 6.0       # times the motion


def draw_gel_force(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw force over depth, each variant with one modulus for all points.  inputs: table, path_VARIANT;  outputs: png, svg;
    settings: gel_force
    """
    table, values = read_csv(inputs["table"]), settings["gel_force"]
    figure = pyplot().figure(figsize=(7.2, 3.2), layout="constrained")
    curve, error = figure.subplots(1, 2)
    names = [*values["variants"], ELASTIC]
    for number, name in enumerate(names):
        rows = table[(table.variant == name) & (table.fitted_to == "all")]
        path = _force_path(name, inputs, values)
        style = {"ls": _LINES[number % len(_LINES)], "color": _COLOURS[number % len(_COLOURS)]}
        depth = np.linspace(0, path.depth_mm[-1], 100)
        curve.plot(depth, path.at(depth) * rows.shear_modulus_mpa.iloc[0], **style, label=name.replace("_", " "))
        error.plot(rows.depth_mm, 100 * rows.depth_error, **style, marker="o", ms=3)
    curve.plot(table.depth_mm, table.force_n, "k+", ms=9, label="measured")
    curve.set(xlabel="depth (mm)", ylabel="force (N)")
    curve.legend(fontsize=7)
    error.axhline(0, color="0.6", lw=0.8)
    error.set(xlabel="measured depth (mm)", ylabel="error of the depth at the measured force (%)")
    save(figure, outputs["png"], outputs["svg"])


def _force_path(name, inputs, values):
    if name != ELASTIC:
        return read_path(inputs[f"path_{name}"])
    ratio = values["variants"][values["judged"]]["bulk_over_shear"]
    return elastic_path(values["ball_mm"], values["height_mm"], (3 * ratio - 2) / (6 * ratio + 2), values["depths_mm"])


def draw_markers(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw the measured and the predicted motion of the markers, enlarged.  inputs: motion (CSV);  outputs: png, svg"""
    table = read_csv(inputs["motion"])
    models = [name for name in (PHYSICS, FORMULAS, LAYER) if f"{name} x_px" in table]
    figure = pyplot().figure(figsize=(3.3 * len(models), 3.2), layout="constrained")
    for axes, model in zip(figure.subplots(1, len(models), sharey=True, squeeze=False)[0], models, strict=True):
        for columns, colour, label in ((("measured_x_px", "measured_y_px"), "0.55", "measured"),
                                       ((f"{model} x_px", f"{model} y_px"), _COLOURS[0], "model")):
            axes.quiver(table.x_px, table.y_px, table[columns[0]], table[columns[1]], angles="xy", scale_units="xy",
                        scale=1 / _ARROWS, width=0.006 if label == "measured" else 0.003, color=colour, label=label)
        axes.set_title(model, fontsize=9)
        axes.set_xlabel("column (px)")
        axes.set_aspect("equal")
    figure.axes[0].invert_yaxis()
    figure.axes[0].set_ylabel(f"row (px); arrows {_ARROWS:g} times the motion")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=8)
    save(figure, outputs["png"], outputs["svg"])


def draw_shading(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw one held-out press of each set, measured and by each model.

    inputs: examples (npz);  outputs: png, svg;  settings: sets
    """
    pictures = []
    for path in inputs["examples"]:
        with read_arrays(path) as data:
            pictures.append({name: data[name] for name in data})
    names = list(dict.fromkeys(name for one in pictures for name in one if name != "circle"))
    figure = pyplot().figure(figsize=(1.7 * len(names), 1.9 * len(pictures) + 0.2), layout="constrained")
    for row, (one, title) in enumerate(zip(pictures, settings["sets"], strict=True)):
        for column, name in enumerate(names):
            axes = figure.add_subplot(len(pictures), len(names), row * len(names) + column + 1)
            axes.set_xticks([])
            axes.set_yticks([])
            if name not in one:
                axes.set_axis_off()
                continue
            axes.imshow(one[name])
            x, y, radius = one["circle"]
            axes.add_patch(pyplot().Circle((x, y), radius, fill=False, ec="w", lw=0.6, ls=":"))
            if row == 0 or name not in pictures[0]:
                axes.set_title(name, fontsize=8)
            if column == 0:
                axes.set_ylabel(f"{title.replace('_', ' ')}\n(px)", fontsize=8)
    save(figure, outputs["png"], outputs["svg"])


def draw_circles(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw where the middle of each press is, from its label: by the shading, and by the image's oddness alone.

    inputs: table (CSV);  outputs: png, svg
    """
    table = read_csv(inputs["table"])
    sets = list(dict.fromkeys(table.set))
    figure = pyplot().figure(figsize=(3.0 * len(sets), 3.2), layout="constrained")
    for axes, name in zip(figure.subplots(1, len(sets), squeeze=False)[0], sets, strict=True):
        own = table[table.set == name]
        found, odd = (own[[f"{kind}_x_px", f"{kind}_y_px"]].to_numpy() - own[["label_x_px", "label_y_px"]].to_numpy()
                      for kind in ("found", "odd"))
        axes.plot(*np.stack([found, odd]).transpose(2, 0, 1), "-", color="0.8", lw=0.8)
        axes.plot(*found.T, "o", ms=4, color=_COLOURS[0], label="found by the shading")
        axes.plot(*odd.T, "x", ms=4, color=_COLOURS[1], label="the image is most odd")
        axes.plot(0, 0, "k+", ms=12, label="label")
        axes.set_title(name.replace("_", " "), fontsize=9)
        axes.set_xlabel("column - label (px)")
        axes.set_aspect("equal", adjustable="datalim")
        axes.invert_yaxis()
    figure.axes[0].set_ylabel("row - label (px)")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3, fontsize=8)
    save(figure, outputs["png"], outputs["svg"])


def draw_ball_size(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Draw the error of the colours over the ball's assumed radius.  inputs: table;  outputs: png, svg"""
    table = read_csv(inputs["table"])
    sets = list(dict.fromkeys(table.set))
    figure = pyplot().figure(figsize=(3.0 * len(sets), 2.8), layout="constrained")
    for axes, name in zip(figure.subplots(1, len(sets), squeeze=False)[0], sets, strict=True):
        for number, (model, rows) in enumerate(table[table.set == name].groupby("model", sort=False)):
            axes.plot(rows.ball_px, rows.mae, "o" + _LINES[number % len(_LINES)], ms=3, color=_COLOURS[number], label=model)
        axes.set_title(name.replace("_", " "), fontsize=9)
        axes.set_xlabel("radius of the ball (px)")
        axes.legend(fontsize=7)
    figure.axes[0].set_ylabel("mean absolute error (grey levels)")
    save(figure, outputs["png"], outputs["svg"])
