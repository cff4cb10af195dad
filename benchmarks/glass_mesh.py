"""How the contact area of a frustum on glass depends on its mesh, and on how contact is asked for (the tables of docs/ftir.md).

    python benchmarks/glass_mesh.py
"""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from softtact.contact.height_field import HeightField
from softtact.geometry.sensor_spec import SensorSpec
from softtact.materials.laws.registry import make_law
from softtact.mechanics import glass_press
from softtact.mechanics.glass_press import GLASS_MESH, contact_area
from softtact.mechanics.hyperelastic import press_levels
from softtact.mechanics.layered_body import build_unit_cell

SPEC = SensorSpec.from_yaml(Path(__file__).parents[1] / "config/sensors/coro.yaml")
LAWS = {"mooney_rivlin": make_law("mooney_rivlin", {"c10": 0.1706, "c01": 0.0040}, bulk_over_shear=20.0),
        "ogden2": make_law("ogden2", {"mu1": 0.1351, "alpha1": 1.4538, "mu2": 0.2223, "alpha2": -4.9910}, bulk_over_shear=20.0)}
FORCES = np.arange(10.0, 141.0, 10.0) / 540     # N on one frustum
GAPS_MM = (2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1.5e-3)
FORMER = replace(GLASS_MESH, frustum_levels=(0.0, 0.1, 0.3, 0.6, 1.0), frustum_rings=1)


def layers(count, above):
    """`count` equal layers in the lowest 40 % of the height and `above` of them over these."""
    return (*np.linspace(0, 0.4, count + 1), *np.linspace(0.4, 1.0, above + 1)[1:])


FINEST = replace(GLASS_MESH, frustum_levels=layers(24, 4), frustum_rings=6, contact_stiffness=10000.0)
MESHES = {
    "24 thin layers, 6 rings, penalty 10000 N/mm3 (finest)": FINEST,
    "4 layers, 1 ring (before)": FORMER,
    "4 layers, 1 ring, all split once in plan": replace(FORMER, refinement=1),
    "16 thin layers, 1 ring": replace(GLASS_MESH, frustum_levels=layers(16, 4), frustum_rings=1),
    "8 thin layers, 2 rings": replace(GLASS_MESH, frustum_levels=layers(8, 2), frustum_rings=2),
    "8 thin layers, 3 rings": replace(GLASS_MESH, frustum_levels=layers(8, 2), frustum_rings=3),
    "12 thin layers, 3 rings": replace(GLASS_MESH, frustum_levels=layers(12, 3), frustum_rings=3),
    "16 thin layers, 4 rings": replace(GLASS_MESH, frustum_levels=layers(16, 4), frustum_rings=4),
    "**chosen**: 17 graded layers, 4 rings": GLASS_MESH,
    "chosen, local_over_shear 0": replace(GLASS_MESH, local_over_shear=0.0, tip_over_shear=0.0),
    "chosen, local_over_shear 0.5": replace(GLASS_MESH, local_over_shear=0.5, tip_over_shear=0.5),
    "chosen, penalty 10000 N/mm3": replace(GLASS_MESH, contact_stiffness=10000.0),
}


def solve(law, mesh):
    """Areas (gaps, f) in mm2, compressions (f,) in mm, and seconds."""
    start, body = time.perf_counter(), build_unit_cell(SPEC, dielectric_law=law, mesh=mesh)
    levels = list(press_levels(body, HeightField(glass_press._plate(SPEC)), FORCES, settings=glass_press._SETTINGS))
    seconds = time.perf_counter() - start
    areas = [[contact_area(body.bed, level.state.bed.displacement, gap_mm=gap) for level in levels] for gap in GAPS_MM]
    body.close()
    return np.array(areas), np.array([level.state.indentation for level in levels]), seconds


def row(name, solved, finest):
    """A row of the table: errors against the finest mesh over all forces."""
    area, depth, seconds = solved
    error, compression = area[2] / finest[0][2] - 1, depth / finest[1] - 1
    return (f"| {name} | {seconds:.1f} | {area[2, -1]:.4f} | {np.sqrt((error**2).mean()):.2%} | {np.abs(error).max():.2%} "
            f"| {np.abs(compression).max():.2%} |")


def main():
    """Print the tables."""
    solve(LAWS["mooney_rivlin"], FORMER)     # compiles
    for name, law in LAWS.items():
        print(f"\n{name}\n\n| mesh | time, s | area at 140 N, mm2 | area: rms | worst | compression: worst |")
        print("|---|---|---|---|---|---|")
        finest = None
        for mesh_name, mesh in MESHES.items():
            solved = solve(law, mesh)
            finest = finest or solved
            print(row(mesh_name, solved, finest), flush=True)
            if mesh is GLASS_MESH:
                areas = solved[0]
        print("\n| gap below, um | 20 N | 60 N | 100 N | 140 N |\n|---|---|---|---|---|")
        for gap, area in zip(GAPS_MM, areas, strict=True):
            print(f"| {1e3 * gap:g} | " + " | ".join(f"{area[k]:.4f}" for k in (1, 5, 9, 13)) + " |", flush=True)


if __name__ == "__main__":
    main()
