"""Objects wider than the sensor, on all models and edges: `python benchmarks/overhang.py`, some ten minutes of a core.

Prints the table of "The edge" in docs/explanation/unknowns.md, and writes, for that of docs/explanation/edge.md (`make numbers`),
benchmarks/results/overhang.json: for each object, edge and mesh of the hyperelastic model sums of counts, depths, and how far maps
are apart (root mean square over the hyperelastic map's maximum).
"""

from pathlib import Path

import numpy as np
import record
import trimesh

import softtact
from softtact.geometry.meshes import read_mesh
from softtact.models.hyperelastic.mesh_settings import PRESETS
from softtact.press.choice import rms
from softtact.press.sensor import Sensor
from softtact.sensors.fields import Edge

ROOT = Path(__file__).resolve().parents[1]
OBJECTS = {"box 19 x 10 mm, inside": lambda: trimesh.creation.box((19.0, 10.0, 6.0)),
           "box 26 x 10 mm, across": lambda: trimesh.creation.box((26.0, 10.0, 6.0)),
           "plate over the whole pad": lambda: trimesh.creation.box((30.0, 45.0, 6.0)),
           "circle_m, inside": lambda: read_mesh(ROOT / "config/objects/indenters/circle_m.stl", unit="mm")}
STANDING, THIN = {"sides_below_mm": 1.5}, {"sides_below_mm": 0.5}
WIDE = list(OBJECTS)[1:3]
# (object, edge, mesh, forces in N)
CASES = [*((name, STANDING, mesh, [20.0]) for mesh in ("default", "fine") for name in list(OBJECTS)[:3]),
         *((name, edge, "default", [20.0]) for edge in ("free", THIN) for name in WIDE),
         *(("circle_m, inside", edge, "default", [20.0, 50.0]) for edge in (STANDING, THIN, "sides", "free"))]


def pressed(name, edge, quality, forces):
    """The row of one case."""
    coro, (mesh, solver) = softtact.load_sensor("coro"), PRESETS[quality]
    sensor = Sensor(coro.spec.model_copy(update={"edge": Edge(held=edge)}), coro.laws, mesh=mesh(), solver=solver())
    found = {model: sensor.press(OBJECTS[name](), force_n=forces, model=model, label="", threads=1)
             for model in ("foundation", "hyperelastic")}
    maps = {model: result.deformation_map_mm for model, result in found.items()}
    top, apart = maps["hyperelastic"].max(axis=(1, 2)), rms(maps["foundation"] - maps["hyperelastic"])
    row = {"object": name, "edge": edge if isinstance(edge, str) else f"sides_below_mm: {edge['sides_below_mm']:g}",
           "mesh": quality, "force_n": forces, "map_maximum_mm": top.tolist(), "apart": (apart / top).tolist()}
    for model, result in found.items():
        numbers = {"counts": result.tactile_map.sum(axis=(1, 2)), "depth_mm": result.indentation_mm,
                   "valid": result.within_validity, "shell_n": result.shell_force_n}
        row |= {f"{model}_{what}": values.tolist() for what, values in numbers.items()}
    return row, maps["hyperelastic"]


def main():
    """Press, print, write."""
    rows, first = [], {}
    for name, edge, quality, forces in CASES:
        row, maps = pressed(name, edge, quality, forces)
        if len(forces) > 1:     # what the choice of the edge is worth, against the default one
            standing = first.setdefault(name, maps)
            change = np.abs(maps - standing) / standing.max(axis=(1, 2), keepdims=True)
            row |= {"largest_change": change.max(axis=(1, 2)).tolist(), "mean_change": change.mean(axis=(1, 2)).tolist()}
        rows.append(row)
        print({key: np.round(value, 4).tolist() if isinstance(value, list) else value for key, value in row.items()}, flush=True)
    print(record.write("overhang", rows=rows))


if __name__ == "__main__":
    main()
