"""Error of the hyperelastic press's meshes: `python benchmarks/mesh_error.py [MESH ...]`, some minutes.

A sensor of 6 x 6 frusta is pressed with a flat punch, a sphere and a ridged block on each mesh and on finer ones; the error is
the difference of the deformation map over the map's maximum, largest and in the root mean square, against the last mesh asked for.
"two rings" is the production mesh with finer frusta, "three layers" has two layers above the cover's lowest one and is finer at
edges, "tied cover" has these three on the sheet, "fine" three layers and two rings, and "finer edges" is split once more there.
"reference" keeps to the plan in two layers, splits all in plan and has more layers everywhere; it is solved more exactly.
"""

import sys
import time
from dataclasses import replace

import numpy as np
import record
import trimesh

import softtact
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.newton import NewtonSettings
from softtact.press.sensor import Sensor

FORCES_N = {"flat punch": [2.0, 4.0, 8.0], "sphere": [2.0, 4.0, 6.0], "ridges": [1.0, 2.0, 4.0]}
OVERLAP_MM = 1e-3       # what is pressed apart
TRUTH_TOLERANCE = 1e-5  # of the last mesh's forces; that of the others, 3e-4, is worth up to 0.2 % of these light presses' maps
FRUSTA = (6, 6)
MORE_LAYERS = {"frustum_heights": (0.0, 0.1, 0.3, 0.6, 1.0), "sheet_layers": 2, "cover_heights": (0.0, 0.25, 0.5, 0.75, 1.0)}
THREE_LAYERS = (0.0, 0.45, 0.8, 1.0)
MESHES = {
    "draft": MeshSettings.draft(),
    "production": MeshSettings(),
    "two rings": MeshSettings(frustum_rings=2),
    "tied cover": MeshSettings(cover_heights=THREE_LAYERS, cover_splits=(1, 1, 2)),
    "three layers": MeshSettings(cover_heights=THREE_LAYERS, cover_splits=(1, 2)),
    "fine": MeshSettings.fine(),
    "finer edges": replace(MeshSettings.fine(), cover_splits=(1, 3)),
    "reference": MeshSettings(cover_splits=(1, 4), refinement=1, **MORE_LAYERS),
}


def objects():
    """{name: mesh} of the three pressed bodies, in mm, over the sensor's centre."""
    ridges = trimesh.util.concatenate([trimesh.creation.box((0.6, 5.0, 2.0), trimesh.transformations.translation_matrix((x, 0, 1)))
                                       for x in (-1.5, 0.0, 1.5)])
    return {"flat punch": trimesh.creation.cylinder(radius=3.0, height=2.0, sections=96),
            "sphere": trimesh.creation.icosphere(subdivisions=5, radius=4.0), "ridges": ridges}


def small_sensor(mesh, **solver):
    """The default sensor cut to FRUSTA, its map as dense as ever; solver: what else than the default counts as solved."""
    full = softtact.load_sensor("coro")
    side = tuple(count * full.spec.dielectric.frusta.pitch_mm for count in FRUSTA)
    spec = full.spec.model_copy(update={"footprint_mm": side, "map_shape": (25, 25)})
    return Sensor(spec, full.laws, mesh=mesh, solver=NewtonSettings(largest_penetration_mm=OVERLAP_MM, **solver))


def press(mesh, body, **solver):
    """The press of one body on one mesh, and its processor time in s."""
    start = time.process_time()
    result = small_sensor(MESHES[mesh], **solver).press(objects()[body], force_n=FORCES_N[body], model="hyperelastic", threads=1)
    seconds = time.process_time() - start
    print(f"{mesh:14}{body:12}{result.iterations.sum():4d} iterations {seconds:8.1f} s  "
          f"indentation {np.round(result.indentation_mm, 4)} mm", flush=True)
    return result, seconds


def row_of(mesh, body, result, seconds, truth):
    """What the record keeps of a press: errors of each load step against the last mesh's, in % of the map's maximum."""
    difference, largest = result.deformation_map_mm - truth.deformation_map_mm, truth.deformation_map_mm.max(axis=(1, 2))
    return {"mesh": mesh, "object": body, "force_n": FORCES_N[body], "iterations": int(result.iterations.sum()),
            "processor_s": round(seconds, 1), "indentation_mm": np.round(result.indentation_mm, 5).tolist(),
            "largest_error_percent": np.round(100 * np.abs(difference).max(axis=(1, 2)) / largest, 3).tolist(),
            "rms_error_percent": np.round(100 * np.sqrt((difference**2).mean(axis=(1, 2))) / largest, 3).tolist()}


def main(names):
    """Press everything on every mesh; a table of errors, and benchmarks/results/mesh_error.json."""
    bodies = list(objects())
    presses = {(name, body): press(name, body) for body in bodies for name in names[:-1]}
    presses |= {(names[-1], body): press(names[-1], body, relative_tolerance=TRUTH_TOLERANCE) for body in bodies}
    rows = [row_of(name, body, *presses[name, body], presses[names[-1], body][0]) for name in names for body in bodies]
    print(f"\nlargest error of the map, % of its maximum, against {names[-1]!r}")
    print(f"{'mesh':14}{'object':12}" + "".join(f"{f'load step {k}':>11}" for k in (1, 2, 3)))
    for row in rows[:-len(bodies)]:
        print(f"{row['mesh']:14}{row['object']:12}" + "".join(f"{error:11.2f}" for error in row["largest_error_percent"]))
    print(record.write("mesh_error", against=names[-1], rows=rows))


if __name__ == "__main__":
    main(sys.argv[1:] or list(MESHES))
