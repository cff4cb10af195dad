"""A picture of a prediction: deformation maps and the taxels that a network reads off them."""

from pathlib import Path
from typing import TYPE_CHECKING

from softtact.reporting.style import pyplot, save

if TYPE_CHECKING:
    import numpy as np

    from softtact.learning.prediction import Maps

MOST = 8     # maps in one picture; of more, evenly chosen ones


def plot_prediction(maps: "Maps", counts: "np.ndarray", path: str | Path) -> None:
    """Draw `Maps` and counts (n, row, column) to PNG or SVG: a column per map, in mm above, the counts below."""
    plt = pyplot()
    shown = [round(k * (len(counts) - 1) / max(1, min(MOST, len(counts)) - 1)) for k in range(min(MOST, len(counts)))]
    extent, unit = _extent(maps)
    figure, axes = plt.subplots(2, len(shown), figsize=(1.2 + 2.3 * len(shown), 7.2), squeeze=False, layout="constrained")
    most = max(1.0, float(counts.max()))          # the whole range of 2400 counts would leave light presses dark
    low, high = min(0.0, float(maps.maps_mm.min())), float(maps.maps_mm.max())
    for column, k in enumerate(shown):
        image = axes[0, column].imshow(maps.maps_mm[k], origin="lower", extent=extent, vmin=low, vmax=high, cmap="viridis")
        taxels = axes[1, column].imshow(counts[k], origin="lower", extent=extent, vmin=0.0, vmax=most, cmap="viridis")
        axes[0, column].set_title("" if maps.force_n is None else f"{maps.force_n[k]:g} N")
        axes[1, column].set_xlabel(f"x ({unit})")
    for axis, name in zip(axes[:, 0], ("deformation", "predicted taxels"), strict=True):
        axis.set_ylabel(f"{name}: y ({unit})")
    figure.colorbar(image, ax=axes[0], label="towards the PCB (mm)")
    figure.colorbar(taxels, ax=axes[1], label="counts, predicted")
    save(figure, path)


def _extent(maps):
    """The sides of a map for both rows of pictures: in mm where the file tells the grid, else counted in its points."""
    if maps.x_mm is None or maps.y_mm is None:
        height, width = maps.maps_mm.shape[1:]
        return (0, width - 1, 0, height - 1), "points"
    return (maps.x_mm[0], maps.x_mm[-1], maps.y_mm[0], maps.y_mm[-1]), "mm"
