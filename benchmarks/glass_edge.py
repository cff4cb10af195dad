"""What the dielectric's free border does to contact area and compression: patches of n x n frusta against an endless lattice.

    python benchmarks/glass_edge.py
A rigid plate without friction presses the sheet; there is no cover. The patch is symmetric, so its border and corners are its own.
"""

from dataclasses import replace

import numpy as np
import trimesh
from glass_mesh import LAWS, SPEC

from softtact.contact.height_field import HeightField
from softtact.models.ftir.specimen import GLASS_MESH, contact_area, press_cell_on_glass
from softtact.models.hyperelastic.build import build_patch
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.models.hyperelastic.path import press_load_steps

SIZES = (4, 6)
FORCES = np.array([10.0, 40.0, 80.0, 140.0]) / 540      # N on the mean frustum
MESH = replace(GLASS_MESH, frustum_heights=(0.0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.6, 1.0), frustum_rings=2)


def press_patch(law, size):
    """Mean areas of all, border and inner frusta (f, 3) in mm2, and the plate's way (f,) in mm."""
    body = build_patch(SPEC, (size, size), dielectric_law=law, mesh=MESH)
    plate = trimesh.creation.box((2 * size, 2 * size, 1.0))
    plate.apply_translation([0, 0, 0.5])
    settings = NewtonSettings(max_augmentations=0, first_touch_mm=1e-3, smallest_scale_n=0.1 * size**2, smallest_increment_n=0.02)
    border = ~body.support.geometry.neighbours.all(axis=1)
    rows, way = [], []
    for load_step in press_load_steps(body, HeightField(plate), FORCES * size**2, settings=settings):
        areas = np.array([contact_area(body.support, load_step.state.support.displacement, frustum=k) for k in range(size**2)])
        rows.append((areas.mean(), areas[border].mean(), areas[~border].mean()))
        way.append(load_step.state.indentation)
    body.close()
    return np.array(rows), np.array(way)


def main():
    """Print the table."""
    law = LAWS["mooney_rivlin"]
    endless = press_cell_on_glass(SPEC, law, FORCES, mesh=MESH)
    print("| frusta | N of 540 | area: mean | border | inner | compression |\n|---|---|---|---|---|---|")
    for size in SIZES:
        areas, way = press_patch(law, size)
        for force, row, alone, depth, compression in zip(FORCES, areas, endless.area_mm2, way, endless.compression_mm, strict=True):
            shares = " | ".join(f"{100 * (value / alone - 1):+.1f} %" for value in (*row, alone * depth / compression))
            print(f"| {size} x {size} | {540 * force:.0f} | {shares} |", flush=True)


if __name__ == "__main__":
    main()
