"""One picture of a grasp: the robot at the events beside what both sensors feel."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from softtact.press.plot import save

if TYPE_CHECKING:
    import xarray


def draw_grasp(data: "xarray.Dataset", path: str | Path, *, images: np.ndarray | None) -> None:
    """Write a PNG or SVG with a row for each event: robot, maps and counts of both fingers.

    data: of an `events.nc`;  images: (event, height, width, 3) of the robot, or None without
    """
    from matplotlib.figure import Figure

    events, first = data.sizes["event"], 0 if images is None else 1
    figure = Figure(figsize=(4.2 * first + 7.2, 2.6 * events + 0.6), layout="constrained")
    grid = figure.subplots(events, 4 + first, squeeze=False, width_ratios=[3.0] * first + [1.0] * 4)
    deepest = max(float(data.deformation_map_mm.max()), 1e-9)
    highest = max(float(data.tactile_map.max()), 1.0)
    extent = [float(data[axis][end]) for axis in ("x", "y") for end in (0, -1)]
    for event in range(events):
        row = int(data.event_row[event])
        if images is not None:
            grid[event, 0].imshow(images[event])
            grid[event, 0].set_axis_off()
        head = f"{data.event.values[event]}, {float(data.time_s[row]):.2f} s"
        grid[event, 0].set_title(head, fontsize=9, loc="left")
        for finger, name in enumerate(data.finger.values):
            force = -float(data.force_n[row, finger, 2])
            maps, counts = grid[event, first + 2 * finger], grid[event, first + 2 * finger + 1]
            shown = maps.imshow(data.deformation_map_mm[event, finger], origin="lower", extent=extent, vmin=0, vmax=deepest,
                                cmap="viridis")
            read = counts.imshow(data.tactile_map[event, finger], origin="lower", extent=extent, vmin=0, vmax=highest,
                                 cmap="viridis")
            maps.set_title(f"{name}: {force:.3g} N\n{data.model.values[event, finger]}", fontsize=8)
            for axes in (maps, counts):
                axes.set_xlabel("x (mm)", fontsize=7)
                axes.tick_params(labelsize=7)
            maps.set_ylabel("y (mm)", fontsize=7)
    bars = figure.colorbar(shown, ax=grid, label="towards the PCB (mm)", shrink=0.6), \
        figure.colorbar(read, ax=grid, label="counts, ideal readout", shrink=0.6)
    for bar in bars:
        bar.ax.tick_params(labelsize=7)
    save(figure, path)
