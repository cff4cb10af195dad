"""All objects of a catalogue on one sheet, as the sensor sees them: `python scripts/draw_objects.py`."""

import argparse
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.geometry.meshes import place, read_mesh
from softtact.reporting.style import pyplot, save
from softtact.studies.hybrid.objects import read_catalogue

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from softtact.studies.hybrid.keys import CatalogueEntry

FOOTPRINT_MM = (22.0, 37.0)      # of the sensor `coro`, drawn around every object
SHOWN_MM = 2.5                   # above the lowest point: the thickness of the soft layers
STEP_MM = 0.15
COLUMNS = 13
TITLES = {"indenters": "Indenters: training and validation", "unseen": "Unseen indenters: never trained on",
          "grasps": "Grasped objects: never trained on"}


def draw(entries: "Iterable[CatalogueEntry]", *, footprint_mm: tuple[float, float] = FOOTPRINT_MM) -> "Figure":
    """Figure of catalogue entries: each underside, dark where it touches first, over the outline of the sensor's surface."""
    sets = {name: [entry for entry in entries if entry.set == name] for name in TITLES}
    rows = {name: -(-len(of_set) // COLUMNS) for name, of_set in sets.items()}
    figure = pyplot().figure(figsize=(1.05 * COLUMNS, 1.85 * sum(rows.values()) + 1.6), layout="constrained")
    parts = figure.subfigures(len(sets), 1, height_ratios=[count + 0.25 for count in rows.values()])
    for part, (name, of_set) in zip(parts, sets.items(), strict=True):
        part.suptitle(f"{TITLES[name]} ({len(of_set)})", x=0.01, ha="left", fontsize=11)
        axes = part.subplots(rows[name], COLUMNS, squeeze=False).ravel()
        for axis in axes[len(of_set):]:
            axis.set_axis_off()
        for axis, entry in zip(axes, of_set, strict=False):
            image = _draw_object(axis, entry, footprint_mm)
    figure.colorbar(image, ax=parts[-1].axes, location="bottom", shrink=0.35, pad=0.02, aspect=40, extend="max",
                    label="height above the lowest point, mm (outline: the sensor's 22 x 37 mm)")
    return figure


def _draw_object(axes, entry, footprint_mm):
    half = np.asarray(footprint_mm) / 2
    x, y = (np.arange(-reach, reach + STEP_MM, STEP_MM) for reach in half + 3)
    mesh = place(read_mesh(entry.file, unit=entry.unit))
    height, _ = HeightField(mesh)(*(grid.ravel() for grid in np.meshgrid(x, y)))
    height = np.where(height < NO_CONTACT_MM / 2, height, np.nan).reshape(len(y), len(x))
    image = axes.imshow(height, origin="lower", extent=(x[0], x[-1], y[0], y[-1]), vmin=0, vmax=SHOWN_MM, cmap="gray")
    axes.add_patch(pyplot().Rectangle(-half, *(2 * half), fill=False, lw=0.6, ec="#e08214"))
    axes.set_title(entry.label, fontsize=7.5, pad=2)
    axes.set(xticks=[], yticks=[])
    axes.spines[:].set_visible(False)
    return image


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Draw all objects of a catalogue on one sheet.")
    parser.add_argument("--catalogue", default="config/objects/catalogue.yaml", type=Path)
    parser.add_argument("--out", default="docs/objects.png", type=Path, help="PNG to write")
    options = parser.parse_args(arguments)
    save(draw(list(read_catalogue(options.catalogue).values())), options.out)


if __name__ == "__main__":
    main()
