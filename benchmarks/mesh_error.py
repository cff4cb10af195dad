"""Error of the hyperelastic press's meshes: `python benchmarks/mesh_error.py [MESH ...]` from the project's folder.

A sensor of 6 x 6 frusta is pressed with a flat punch, a sphere and a ridged block on each mesh and on finer ones; the error is
the largest difference of the deformation map over the map's maximum, against the last mesh asked for. "finer cover" splits the
production mesh's cover once more in height and towards edges, some minutes; "reference" splits all elements in plan and has more
layers everywhere, half an hour.
"""

import sys
import time

import numpy as np
import trimesh

import softtact
from softtact.mechanics.hyperelastic import NewtonSettings
from softtact.mechanics.layered_body import MeshSettings
from softtact.sensor import Sensor

FORCES_N = {"flat punch": [2.0, 4.0, 8.0], "sphere": [2.0, 4.0, 8.0], "ridges": [2.0, 4.0, 6.0]}
OVERLAP_MM = 0.01       # what is pressed apart; of 1 um it takes more iterations and changes the maps by less than 1 %
FRUSTA = (6, 6)
FINE = {"frustum_levels": (0.0, 0.1, 0.3, 0.6, 1.0), "sheet_layers": 2, "cover_levels": (0.0, 0.25, 0.5, 0.75, 1.0)}
MESHES = {
    "draft": MeshSettings.draft(),
    "production": MeshSettings(),
    "finer cover": MeshSettings(cover_levels=FINE["cover_levels"], cover_splits=(1, 1, 2, 2)),
    "reference": MeshSettings(cover_splits=(1, 1, 2, 2), refinement=1, **FINE),
}


def objects():
    """{name: mesh} of the three pressed bodies, in mm, over the sensor's centre."""
    ridges = trimesh.util.concatenate([trimesh.creation.box((0.6, 5.0, 2.0), trimesh.transformations.translation_matrix((x, 0, 1)))
                                       for x in (-1.5, 0.0, 1.5)])
    return {"flat punch": trimesh.creation.cylinder(radius=3.0, height=2.0, sections=96),
            "sphere": trimesh.creation.icosphere(subdivisions=5, radius=4.0), "ridges": ridges}


def small_sensor(mesh):
    """The default sensor cut to FRUSTA, its map as dense as ever."""
    full = softtact.load_sensor("coro")
    side = tuple(count * full.spec.dielectric.frusta.pitch_mm for count in FRUSTA)
    spec = full.spec.model_copy(update={"footprint_mm": side, "map_shape": (25, 25)})
    return Sensor(spec, full.laws, mesh=mesh, solver=NewtonSettings(largest_penetration_mm=OVERLAP_MM))


def main(names):
    """Press everything on every mesh; a table of errors."""
    maps = {}
    for name in names:
        for body, mesh in objects().items():
            start = time.perf_counter()
            result = small_sensor(MESHES[name]).press(mesh, force_n=FORCES_N[body], model="hyperelastic")
            maps[name, body] = result.deformation_map_mm
            print(f"{name:14}{body:12}{result.iterations.sum():4d} iterations {time.perf_counter() - start:8.1f} s  "
                  f"indentation {np.round(result.indentation_mm, 4)} mm", flush=True)
    print("\nlargest error of the map, % of its maximum")
    print(f"{'mesh':14}{'object':12}" + "".join(f"{f'level {k}':>11}" for k in (1, 2, 3)))
    for name in names[:-1]:
        for body in objects():
            truth = maps[names[-1], body]
            error = np.abs(maps[name, body] - truth).max(axis=(1, 2)) / truth.max(axis=(1, 2))
            print(f"{name:14}{body:12}" + "".join(f"{100 * e:11.2f}" for e in error), flush=True)


if __name__ == "__main__":
    main(sys.argv[1:] or list(MESHES))
