"""Figure 2: a section through the sensor at rest and pressed, whole and near the most pressed frusta."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.models.hyperelastic.deformed_mesh import REGIONS
from softtact.press.vtu import LAYERS
from softtact.reporting.style import pyplot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from softtact.sensors.specification import SensorSpec
    from softtact.studies.hybrid.figures.section import CutBody

# Light to dark from the cover down: distinct in grey, too.
_COLOURS = {"cover": "#f2d6b3", "sheet": "#6fa8c9", "frusta": "#1f4e79"}
_NAMES = {"cover": "cover and fabric", "sheet": "dielectric's sheet", "frusta": "frusta"}
_CLOSE_PITCHES = 1.9      # on either side of the deepest place, in the close-ups


def draw(section: "CutBody", outline: Sequence[np.ndarray], *, spec: "SensorSpec", summary: dict[str, Any],
         y_mm: float) -> "Figure":
    """Figure of a `CutBody`; outline: polygons (k, 2) of the pressed object in the same plane."""
    plt = pyplot()
    figure = plt.figure(figsize=(11, 6.9), layout="constrained")
    rows = figure.add_gridspec(3, 2, height_ratios=(1, 1, 1.25))
    bottom = -spec.thickness_mm
    whole = [figure.add_subplot(rows[k, :]) for k in (0, 1)]
    close = [figure.add_subplot(rows[2, k]) for k in (0, 1)]
    for axes, polygons in zip((*whole, *close), (section.rest_mm, section.pressed_mm) * 2, strict=True):
        _draw_layers(axes, polygons, section.region)
        axes.axhspan(bottom - 0.25, bottom, color="0.35", zorder=0)
    for axes in (whole[1], close[1]):
        for polygon in outline:
            axes.fill(*polygon.T, facecolor="0.82", edgecolor="0.2", lw=0.8, hatch="//", zorder=3)
    height = float(max(points[:, 1].max() for points in section.pressed_mm))
    half, middle = 0.5 * spec.footprint_mm[0], _deepest(section)
    for axes, title in zip(whole, ("at rest", f"pressed by {summary['item']} with {summary['force_n']:g} N: object "
                                   f"{summary['indentation_mm']:.2f} mm deep, frusta shortened by up to "
                                   f"{summary['frustum_compression_mm']:.2f} mm"), strict=True):
        axes.set(xlim=(-half - 0.4, half + 0.4), ylim=(bottom - 0.25, height + 0.6), aspect="equal", ylabel="z (mm)")
        axes.set_title(title, fontsize=9, loc="left")
    reach = _CLOSE_PITCHES * spec.dielectric.frusta.pitch_mm
    for axes, title in zip(close, ("close, at rest", "close, pressed: thin lines: elements, each cut in three"), strict=True):
        axes.set(xlim=(middle - reach, middle + reach), ylim=(bottom - 0.12, bottom + 1.15), aspect="equal", xlabel="x (mm)",
                 ylabel="z (mm)")
        axes.set_title(title, fontsize=9, loc="left")
    whole[1].set_xlabel("x (mm)")
    _legend(figure, bool(outline))
    figure.suptitle(f"Section at y = {y_mm:.1f} mm, through a row of frusta; {summary['model']} model, displacements to scale")
    return figure


def _draw_layers(axes, polygons, region):
    from matplotlib.collections import PolyCollection

    for name in REGIONS:
        of_layer = [polygon for polygon, where in zip(polygons, region, strict=True) if where == LAYERS[name]]
        axes.add_collection(PolyCollection(of_layer, facecolor=_COLOURS[name], edgecolor="0.75" if name == "frusta" else "0.5",
                                           linewidths=0.1, zorder=2))


def _deepest(section):
    """x (mm) where the frusta are displaced most."""
    frusta = [(rest, pressed) for rest, pressed, where in zip(section.rest_mm, section.pressed_mm, section.region, strict=True)
              if where == LAYERS["frusta"]]
    down = [float((rest[:, 1] - pressed[:, 1]).max()) for rest, pressed in frusta]
    return float(frusta[int(np.argmax(down))][0][:, 0].mean())


def _legend(figure, with_object):
    from matplotlib.patches import Patch

    handles = [Patch(facecolor=_COLOURS[name], edgecolor="0.4", label=_NAMES[name]) for name in _COLOURS]
    handles += [Patch(facecolor="0.35", label="PCB")]
    handles += [Patch(facecolor="0.82", edgecolor="0.2", hatch="//", label="object")] if with_object else []
    figure.legend(handles=handles, loc="outside lower center", ncols=5, frameon=False)
