"""How the contact area of a frustum on glass depends on its mesh, and on how contact is asked for.
The tables stand in docs/notebook/2026-11-22-mesh-on-glass.md.

    python benchmarks/glass_mesh.py        (some minutes; benchmarks/results/glass_mesh.json)
"""

import time
from dataclasses import replace

import numpy as np
import record

from softtact.contact.height_field import HeightField
from softtact.materials.laws.registry import make_law
from softtact.models.ftir.specimen import DARK_GAP_MM, GLASS_MESH, SETTINGS, contact_area, plate_over
from softtact.models.hyperelastic.build import build_unit_cell
from softtact.models.hyperelastic.path import press_load_steps
from softtact.sensors.library import sensor_file
from softtact.sensors.specification import SensorSpec

SPEC = SensorSpec.from_yaml(sensor_file("coro"))
LAWS = {"mooney_rivlin": make_law("mooney_rivlin", {"c10": 0.1706, "c01": 0.0040}, bulk_over_shear=20.0),
        "ogden2": make_law("ogden2", {"mu1": 0.1351, "alpha1": 1.4538, "mu2": 0.2223, "alpha2": -4.9910}, bulk_over_shear=20.0)}
FORCES = np.arange(10.0, 141.0, 10.0) / 540     # N on one frustum
GAPS_MM = (2e-5, 5e-5, 1e-4, 2e-4, 5e-4, 1.5e-3)
CHOSEN_GAP = GAPS_MM.index(DARK_GAP_MM)
FORMER = replace(GLASS_MESH, frustum_heights=(0.0, 0.1, 0.3, 0.6, 1.0), frustum_rings=1)


def layers(count, above):
    """`count` equal layers in the lowest 40 % of the height and `above` of them over these."""
    return (*np.linspace(0, 0.4, count + 1), *np.linspace(0.4, 1.0, above + 1)[1:])


FINEST = replace(GLASS_MESH, frustum_heights=layers(24, 4), frustum_rings=6, contact_stiffness=10000.0)
MESHES = {
    "24 thin layers, 6 rings, penalty 10000 N/mm3 (finest)": FINEST,
    "4 layers, 1 ring (before)": FORMER,
    "4 layers, 1 ring, all split once in plan": replace(FORMER, refinement=1),
    "16 thin layers, 1 ring": replace(GLASS_MESH, frustum_heights=layers(16, 4), frustum_rings=1),
    "8 thin layers, 2 rings": replace(GLASS_MESH, frustum_heights=layers(8, 2), frustum_rings=2),
    "8 thin layers, 3 rings": replace(GLASS_MESH, frustum_heights=layers(8, 2), frustum_rings=3),
    "12 thin layers, 3 rings": replace(GLASS_MESH, frustum_heights=layers(12, 3), frustum_rings=3),
    "16 thin layers, 4 rings": replace(GLASS_MESH, frustum_heights=layers(16, 4), frustum_rings=4),
    "**chosen**: 17 graded layers, 4 rings": GLASS_MESH,
    "chosen, unprojected_penalty_ratio 0": replace(GLASS_MESH, unprojected_penalty_ratio=0.0),
    "chosen, unprojected_penalty_ratio 0.5": replace(GLASS_MESH, unprojected_penalty_ratio=0.5),
    "chosen, penalty 10000 N/mm3": replace(GLASS_MESH, contact_stiffness=10000.0),
}


def solve(law, mesh):
    """Areas (gaps, f) in mm2, compressions (f,) in mm, and seconds."""
    start, body = time.perf_counter(), build_unit_cell(SPEC, dielectric_law=law, mesh=mesh)
    load_steps = list(press_load_steps(body, HeightField(plate_over(SPEC)), FORCES, settings=SETTINGS))
    seconds = time.perf_counter() - start
    areas = [[contact_area(body.support, load_step.state.support.displacement, gap_mm=gap) for load_step in load_steps]
             for gap in GAPS_MM]
    body.close()
    return np.array(areas), np.array([load_step.state.indentation for load_step in load_steps]), seconds


def measured(law):
    """Records of all meshes, errors against the first over all forces; and the areas (gaps, f) of the chosen one."""
    records, finest, areas = [], None, None
    for name, mesh in MESHES.items():
        area, depth, seconds = solve(law, mesh)
        finest = finest or (area[CHOSEN_GAP], depth)
        error, compression = area[CHOSEN_GAP] / finest[0] - 1, depth / finest[1] - 1
        records.append({"mesh": name, "seconds": seconds, "area_mm2": area[CHOSEN_GAP].tolist(), "compression_mm": depth.tolist(),
                        "area_rms": float(np.sqrt((error**2).mean())), "area_worst": float(np.abs(error).max()),
                        "compression_worst": float(np.abs(compression).max())})
        print(row(records[-1]), flush=True)
        areas = area if mesh is GLASS_MESH else areas
    return records, areas


def row(found):
    """A row of the table."""
    return (f"| {found['mesh']} | {found['seconds']:.1f} | {found['area_mm2'][-1]:.4f} | {found['area_rms']:.2%} "
            f"| {found['area_worst']:.2%} | {found['compression_worst']:.2%} |")


def main():
    """Print the tables and record them."""
    solve(LAWS["mooney_rivlin"], FORMER)     # compiles
    laws = {}
    for name, law in LAWS.items():
        print(f"\n{name}\n\n| mesh | time, s | area at 140 N, mm2 | area: rms | worst | compression: worst |")
        print("|---|---|---|---|---|---|")
        records, areas = measured(law)
        by_gap = {f"{gap:g}": area.tolist() for gap, area in zip(GAPS_MM, areas, strict=True)}
        laws[name] = {"meshes": records, "area_mm2_by_gap": by_gap}
        print("\n| gap below, um | 20 N | 60 N | 100 N | 140 N |\n|---|---|---|---|---|")
        for gap, area in zip(GAPS_MM, areas, strict=True):
            print(f"| {1e3 * gap:g} | " + " | ".join(f"{area[k]:.4f}" for k in (1, 5, 9, 13)) + " |", flush=True)
    print(record.write("glass_mesh", force_n=FORCES.tolist(), laws=laws))


if __name__ == "__main__":
    main()
