"""A camera frame with the discs found in it: outlines, numbers, scale."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from softtact.imaging.light import grey
from softtact.reporting.style import pyplot, save

if TYPE_CHECKING:
    import pandas as pd

COLOURS = {"whole": "#3fd0ff", "touching": "#ffb000", "clipped": "#ff4d6d"}   # apart in brightness and for the colour-blind
MOST_NUMBERS = 200   # discs; more numbers than that hide each other
_WIDEST = 9.0        # inches


def draw_discs(frame: np.ndarray, table: "pd.DataFrame", outlines: Sequence[np.ndarray], path: str | Path, *, pixel_mm: float,
               title: str) -> None:
    """Write a PNG: the frame in mm, the outlines (list of (corners, 2) in mm), clipped and touching discs in their own colours."""
    light, plt = grey(frame), pyplot()
    sides = np.array(light.shape)[::-1] * pixel_mm   # x, y
    inches = sides / sides.max() * _WIDEST
    figure, axes = plt.subplots(figsize=(inches[0] + 1.0, inches[1] + 1.0), layout="constrained")
    axes.imshow(light, cmap="gray", extent=(-sides[0] / 2, sides[0] / 2, sides[1] / 2, -sides[1] / 2), interpolation="nearest")
    kinds = _kinds(table)
    _draw_outlines(axes, outlines, kinds)
    if 0 < len(table) <= MOST_NUMBERS:
        _draw_numbers(axes, table, kinds)
    _draw_scale(axes, sides)
    axes.set(xlabel="x (mm)", ylabel="y (mm), downwards",
             xlim=(-sides[0] / 2, sides[0] / 2), ylim=(sides[1] / 2, -sides[1] / 2))
    axes.set_title(f"{title}: {_words(table)}", loc="left")
    save(figure, path)


def _kinds(table):
    return np.select([table.clipped, table.touching], ["clipped", "touching"], "whole")


def _draw_outlines(axes, outlines, kinds):
    from matplotlib.collections import LineCollection

    for kind, colour in COLOURS.items():
        lines = [outline for outline, own in zip(outlines, kinds, strict=True) if own == kind]
        if lines:
            axes.add_collection(LineCollection(lines, colors=colour, linewidths=1.0, label=f"{kind} ({len(lines)})"))
    if len(outlines):
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False)


def _draw_numbers(axes, table, kinds):
    for disc, x, y, kind in zip(table.disc, table.x_mm, table.y_mm, kinds, strict=True):
        axes.text(x, y, disc, color=COLOURS[kind], ha="center", va="center", fontsize=8, clip_on=True,
                  bbox={"facecolor": "black", "alpha": 0.6, "pad": 0.6, "linewidth": 0})


def _draw_scale(axes, sides):
    """A bar of a round length of about a fifth of the width, above the frame's upper right corner."""
    length = _round(0.2 * sides[0])
    y = -0.5 * sides[1] - 0.015 * sides.max()
    axes.plot([sides[0] / 2 - length, sides[0] / 2], [y, y], color="black", linewidth=3, solid_capstyle="butt", clip_on=False)
    axes.annotate(f"{length:g} mm", (sides[0] / 2 - length / 2, y), (0, 3), textcoords="offset points", ha="center", va="bottom",
                  annotation_clip=False)


def _round(length):
    """The largest of 1, 2, 5 times a power of ten that is not longer."""
    power = 10.0 ** np.floor(np.log10(length))
    return max(factor * power for factor in (1, 2, 5) if factor * power <= length)


def _words(table):
    if table.empty:
        return "no disc"
    return f"{len(table)} disc{'s' if len(table) > 1 else ''}, {table.area_mm2.sum():.4g} mm² in all"
