"""How much too stiff are the frusta of each mesh, and what would take it away? `python benchmarks/frustum_stiffness.py`, a minute.

The unit cell of coro (a frustum with its sheet and cover, symmetric sides) under a plate: force over compression of the
frustum, at 2, 10, 20 and 30 % of its height. The reference is `graded`, split once in all directions: linear pressure, and a
ring of elements at the rim, where stress concentrates. A single frustum on glass of that mesh is within 0.5 % of 256
axisymmetric elements of CalculiX (tests/verification/test_frustum_on_glass.py, which has the forces; `on_glass` here), the
default mesh, split as often, within 3.5 %. How far the reference is from its own limit in the cell was not found. `factor`: the
default mesh with all moduli of its frusta times that. Writes benchmarks/results/frustum_stiffness.json.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import record
import trimesh
from scipy.interpolate import PchipInterpolator

from softtact.contact.height_field import HeightField
from softtact.materials.laws.registry import make_law
from softtact.models.hyperelastic import frusta
from softtact.models.hyperelastic.build import build_unit_cell
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.models.hyperelastic.path import press_load_steps
from softtact.sensors.library import sensor_file
from softtact.sensors.specification import SensorSpec

sys.path[:0] = [str(Path(__file__).parents[1] / folder) for folder in ("tests", "tests/verification")]

import test_frustum_on_glass  # noqa: E402

SPEC = SensorSpec.from_yaml(sensor_file("coro"))
LAW = make_law("mooney_rivlin", {"c10": 0.1706, "c01": 0.0040})
SHARES = np.array([0.02, 0.1, 0.2, 0.3])      # of the frustum's height
PRESSURES_MPA = (0.002, 0.005, 0.01, 0.02, 0.03, 0.045, 0.06, 0.08, 0.1, 0.13, 0.16, 0.19)
TIGHT = NewtonSettings(max_augmentations=0, first_touch_mm=1e-3, smallest_scale_n=0.05, smallest_increment_n=1e-3)
FACTOR = 0.945
EVEN = MeshSettings.converging(frustum_heights=(0.0, 1 / 3, 2 / 3, 1.0))
GRADED, REFERENCE = MeshSettings.light(), "graded, split once"
ON_GLASS = dict(zip(test_frustum_on_glass.DEPTHS, test_frustum_on_glass.FORCES, strict=True))


def split(settings, times):
    """Settings split so often in all directions."""
    heights, parts = np.asarray(settings.frustum_heights), np.arange(len(settings.frustum_heights))
    fine = np.interp(np.linspace(0, parts[-1], parts[-1] * 2**times + 1), parts, heights)
    return replace(settings, refinement=times, sheet_layers=2 * 2**times, frustum_heights=tuple(fine.tolist()))


MESHES = {"default": MeshSettings(), "draft": MeshSettings.draft(), "fine": MeshSettings.fine(),
          "default, two rings": MeshSettings(frustum_rings=2), "default, core 0.8": MeshSettings(frustum_core=0.8),
          "default, core 0.9": MeshSettings(frustum_core=0.9, frustum_heights=GRADED.frustum_heights),
          "default, linear pressure": MeshSettings(trilinear_pressure=False), "default, split once": split(MeshSettings(), 1),
          "even": split(EVEN, 0), "even, split once": split(EVEN, 1), "graded (light)": GRADED, REFERENCE: split(GRADED, 1)}


def stiffness(mesh, factor=1.0):
    """Force over compression (shares,) in N/mm of the cell's frustum, and its number of inner unknowns."""
    block = frusta.HexBlock
    frusta.HexBlock = lambda points, law, **settings: block(points, law.scaled(factor), **settings)
    try:
        body = build_unit_cell(SPEC, dielectric_law=LAW, mesh=mesh)
    finally:
        frusta.HexBlock = block
    pitch, height = SPEC.dielectric.frusta.pitch_mm, SPEC.dielectric.frusta.height_mm
    plate = trimesh.creation.box((4 * pitch, 4 * pitch, 1.0))
    plate.apply_translation([0, 0, 0.5])
    steps = press_load_steps(body, HeightField(plate), pitch**2 * np.array(PRESSURES_MPA), settings=TIGHT)
    curve = np.array([(0.0, 0.0), *((float(body.support.compression(step.state.support.displacement)[0]), step.force_n)
                                    for step in steps)])
    body.close()
    return PchipInterpolator(*curve.T)(SHARES * height) / (SHARES * height), len(body.support.inner)


def on_glass(mesh):
    """Force (depths,) of a single frustum on glass over that of CalculiX' axisymmetric elements."""
    forces = test_frustum_on_glass.bonded_forces(test_frustum_on_glass.frustum(mesh=mesh))
    return forces / np.array(list(ON_GLASS.values()))


def main():
    found = {name: stiffness(mesh) for name, mesh in MESHES.items()}
    found[f"default, factor {FACTOR}"] = stiffness(MESHES["default"], FACTOR)
    limit, rows = found[REFERENCE][0], []
    for name, (values, unknowns) in found.items():
        row = {"mesh": name, "inner_unknowns": unknowns, "n_per_mm": values.round(4).tolist(),
               "above_reference_percent": (100 * (values / limit - 1)).round(2).tolist()}
        if name in MESHES:
            row["on_glass_above_calculix_percent"] = (100 * (on_glass(MESHES[name]) - 1)).round(2).tolist()
        print(f"{name:28}{unknowns:6d}", *(value for key, value in row.items() if key.endswith("percent")), flush=True)
        rows.append(row)
    print(record.write("frustum_stiffness", shares_of_height=SHARES.tolist(), reference=REFERENCE,
                       depths_on_glass_mm=list(ON_GLASS), rows=rows))


if __name__ == "__main__":
    main()
