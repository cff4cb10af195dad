"""A picture of one press: deformation map and taxels at every force."""

from pathlib import Path
from typing import TYPE_CHECKING

from softtact.reporting.style import pyplot, save

if TYPE_CHECKING:
    from softtact.press.result import PressResult


def plot_press(result: "PressResult", path: str | Path) -> None:
    """Draw a `PressResult` to PNG or SVG: a column per force, the map in mm above, the ideal counts of the taxels below."""
    plt = pyplot()
    forces = result.normal_force_n
    half = [0.5 * (side[-1] - side[0]) for side in (result.x_mm, result.y_mm)]
    extent = (-half[0], half[0], -half[1], half[1])
    figure, axes = plt.subplots(2, len(forces), figsize=(1.2 + 2.3 * len(forces), 7.2), squeeze=False, layout="constrained")
    top = float(result.deformation_map_mm.max())
    for k, force in enumerate(forces):
        image = axes[0, k].imshow(result.deformation_map_mm[k], origin="lower", extent=extent, vmin=0, vmax=top, cmap="viridis")
        counts = axes[1, k].imshow(result.tactile_map[k], origin="lower", extent=extent, vmin=0,
                                   vmax=result.largest_counts, cmap="viridis")
        axes[0, k].set_title(f"{force:.4g} N, depth {result.indentation_mm[k]:.3g} mm")
        for axis in axes[:, k]:
            axis.set_xlabel("x (mm)")
    for axis, name in zip(axes[:, 0], ("deformation", "taxels"), strict=True):
        axis.set_ylabel(f"{name}: y (mm)")
    figure.colorbar(image, ax=axes[0], label="towards the PCB (mm)")
    figure.colorbar(counts, ax=axes[1], label="counts, ideal readout")
    figure.suptitle(f"{result.model} model, sensor {result.sensor}")
    save(figure, path)
