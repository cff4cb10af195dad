"""A picture of one press: deformation map and taxels at each load step."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from softtact.files import atomic_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from softtact.press.result import PressResult

_MOST_NUMBERS = 200      # taxels beyond which their counts are not written into the cells
_LIGHT = 0.6             # share of the colour range from which on a number is written in black


def draw(result: "PressResult", *, full_scale: bool = False, figure: "Figure | None" = None) -> "Figure":
    """A column per load step: the map in mm above, the ideal counts of the taxels below, with numbers in the cells.

    full_scale: let the taxels' colours end at the readout's largest count; else at the largest one that is there
    figure: to draw into, by default a new one that no window shows
    """
    from matplotlib.figure import Figure

    steps = len(result.normal_force_n)
    half = [0.5 * (side[-1] - side[0]) for side in (result.x_mm, result.y_mm)]
    extent = (-half[0], half[0], -half[1], half[1])
    figure = figure or Figure()
    figure.set_size_inches(1.2 + 2.3 * steps, 2.4 + 3.2 * half[1] / half[0])
    figure.set_layout_engine("constrained")
    axes = figure.subplots(2, steps, squeeze=False)
    deepest = float(result.deformation_map_mm.max()) or 1.0
    highest = result.largest_counts if full_scale else max(float(result.tactile_map.max()), 1.0)
    for k, force in enumerate(result.normal_force_n):
        image = axes[0, k].imshow(result.deformation_map_mm[k], origin="lower", extent=extent, vmin=0, vmax=deepest, cmap="viridis")
        counts = axes[1, k].imshow(result.tactile_map[k], origin="lower", extent=extent, vmin=0, vmax=highest, cmap="viridis")
        _write_counts(axes[1, k], result.tactile_map[k], half, highest)
        axes[0, k].set_title(f"{force:.4g} N, depth {result.indentation_mm[k]:.3g} mm", fontsize=9)
        for axis in axes[:, k]:
            axis.set_xlabel("x (mm)")
    for axis, name in zip(axes[:, 0], ("deformation", "taxels"), strict=True):
        axis.set_ylabel(f"{name}: y (mm)")
    figure.colorbar(image, ax=axes[0], label="towards the PCB (mm)")
    figure.colorbar(counts, ax=axes[1], label="counts, ideal readout")
    figure.suptitle(f"{result.model} model, sensor {result.sensor}")
    return figure


def _write_counts(axis, counts, half, highest):
    """Each taxel's count in its cell."""
    if counts.size > _MOST_NUMBERS:
        return
    rows, columns = counts.shape
    x, y = ((2 * np.arange(count) + 1 - count) / count * side for count, side in ((columns, half[0]), (rows, half[1])))
    for (j, i), value in np.ndenumerate(counts):
        axis.text(x[i], y[j], f"{value:.0f}", ha="center", va="center", fontsize=6,
                  color="black" if value > _LIGHT * highest else "white")


def save(figure: "Figure", path: str | Path) -> None:
    """Write a figure as PNG or SVG by the path's ending, whole or not at all, the same bytes for the same figure."""
    import matplotlib

    path = Path(path)
    kind = path.suffix[1:]
    metadata = {"Software": None} if kind == "png" else {"Date": None, "Creator": None}
    with matplotlib.rc_context({"svg.hashsalt": "softtact"}), atomic_path(path) as temporary:
        figure.savefig(temporary, format=kind, metadata=metadata, bbox_inches="tight", dpi=160)
