"""How much too stiff are the frusta of each mesh, and what would take it away? `python benchmarks/frustum_stiffness.py`, a minute.

The unit cell of coro (a frustum with its sheet and cover, symmetric sides) under a plate: force over compression of the frustum, at
2, 10, 20 and 30 % of its height. The reference is even layers with linear pressure, refined once and twice in all directions, and
their limit if the error falls with first order, as tests/verification/test_unit_cell.py finds it at small strain. `factor`: the
default mesh with all moduli of its frusta times that. Writes benchmarks/results/frustum_stiffness.json.
"""

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

SPEC = SensorSpec.from_yaml(sensor_file("coro"))
LAW = make_law("mooney_rivlin", {"c10": 0.1706, "c01": 0.0040})
SHARES = np.array([0.02, 0.1, 0.2, 0.3])      # of the frustum's height
PRESSURES_MPA = (0.002, 0.005, 0.01, 0.02, 0.03, 0.045, 0.06, 0.08, 0.1, 0.13, 0.16, 0.19)
TIGHT = NewtonSettings(max_augmentations=0, first_touch_mm=1e-3, smallest_scale_n=0.05, smallest_increment_n=1e-3)
FACTOR = 0.945


def even(times):
    """Settings of even layers with linear pressure, split so often in all directions."""
    heights = tuple(np.linspace(0, 1, 3 * 2**times + 1))
    return MeshSettings.converging(refinement=times, sheet_layers=2 * 2**times, frustum_heights=heights)


MESHES = {"default": MeshSettings(), "draft": MeshSettings.draft(), "fine": MeshSettings.fine(),
          "default, two rings": MeshSettings(frustum_rings=2), "default, core 0.8": MeshSettings(frustum_core=0.8),
          "default, linear pressure": MeshSettings(trilinear_pressure=False), "even": even(0), "even, split once": even(1)}


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


def main():
    found = {name: stiffness(mesh) for name, mesh in MESHES.items()}
    found[f"default, factor {FACTOR}"] = stiffness(MESHES["default"], FACTOR)
    limit = 2 * found["even, split once"][0] - found["even"][0]
    rows = [{"mesh": name, "inner_unknowns": unknowns, "n_per_mm": values.round(4).tolist(),
             "above_limit_percent": (100 * (values / limit - 1)).round(2).tolist()} for name, (values, unknowns) in found.items()]
    for row in rows:
        print(f"{row['mesh']:28}{row['inner_unknowns']:6d}  {row['above_limit_percent']}")
    print(record.write("frustum_stiffness", shares_of_height=SHARES.tolist(), limit_n_per_mm=limit.round(4).tolist(), rows=rows))


if __name__ == "__main__":
    main()
