"""The report of the study of grasps: objects in the hand, what both sensors feel, one event by two models, claims."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from softtact.reporting.page import Page
from softtact.reporting.style import pyplot, save

if TYPE_CHECKING:
    import xarray
    from matplotlib.figure import Figure

_MOST_COLUMNS = 6
_SHOWN = ["grasp", "status", "x_mm", "y_mm", "angle_deg", "trials", "force_left_n", "force_right_n", "model_grip_left",
          "model_grip_right", "deepest_left_mm", "deepest_right_mm", "counts_left", "counts_right", "trial_sd_left_counts",
          "trial_sd_right_counts", "message"]


def write_grasps_report(folder: Path, *, study: str, grasps: pd.DataFrame, claims: pd.DataFrame,
                        figures: Sequence[tuple[Path, str]], config: str) -> None:
    """Write report.html below a folder; figures: [(PNG, caption)]."""
    page = Page("Grasps by a robot: the study", study, folder=folder)
    page.box("What is synthetic here.", "Robot and objects move in MuJoCo. Readings are the virtual sensor's, a simulation. No "
             "score here is the paper's.")
    page.text(_result(grasps))
    page.section("Figures")
    for path, caption in figures:
        page.figure(path, caption)
    page.claims(claims, file=folder / "tables/claims.csv")
    page.section("Grasps")
    page.table(grasps[[name for name in _SHOWN if name in grasps]], file=folder / "grasps.csv",
               links=[("Each grasp in time", [("grasps", "grasps")])])
    page.section("Configuration")
    page.code(config)
    page.write(folder / "report.html")


def _result(grasps):
    """How many grasps were done, and whether their models are valid, in sentences."""
    done = grasps[grasps.status == "done"]
    objects, trials = (done.object.nunique(), int(done.trials.sum())) if len(done) else (0, 0)
    result = f"{len(done)} of {len(grasps)} grasps done, {objects} objects, {trials} trials."
    invalid = int((done[["valid_left", "valid_right"]] != 1).to_numpy().sum()) if len(done) else 0
    if invalid:
        result += f" {invalid} presses at the grip are beyond what their model is valid for; their maps are not to be relied on."
    return result


def draw_objects(path: Path, events: Mapping[str, "xarray.Dataset"], readings: Mapping[str, "xarray.Dataset"],
                 pictures: Mapping[str, np.ndarray]) -> None:
    """Write a PNG with a column for each object at the grip: robot, maps of both sensors, the virtual sensor's mean readings.

    pictures: {object: image (height, width, 3)}, empty where MuJoCo does not draw
    """
    names = list(events)[:2 * _MOST_COLUMNS]
    if not names:
        figure = pyplot().figure(figsize=(4, 1))
        figure.text(0.5, 0.5, "no grasp was done", ha="center", va="center")
        save(figure, path)
        return
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
