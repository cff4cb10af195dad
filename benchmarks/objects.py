"""Which objects reach 50 N? `python benchmarks/objects.py [--mesh default|draft|stable|fine] [OBJECT ...]`, hours for all.

OBJECT: names in config/objects; by default the default study's indenters and the six objects of figure 7. Each is pressed in a
process of its own, on one thread. What is in the record already is not pressed again: an ended run goes on with the next call
(`--again` presses it again). The maps are kept as benchmarks/results/maps/MESH/OBJECT.npz, for `model_errors.py`.
"""

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import record

import softtact
from softtact.errors import ConvergenceError
from softtact.files import read_yaml
from softtact.geometry.meshes import read_mesh
from softtact.models.hyperelastic.mesh_settings import MeshSettings
from softtact.models.hyperelastic.newton import NewtonSettings

CONFIG = Path(__file__).resolve().parents[1] / "config"
FORCES_N = [5, 10, 20, 35, 50]
MESHES = {"default": MeshSettings, "draft": MeshSettings.draft, "stable": MeshSettings.stable, "fine": MeshSettings.fine}
MAPS = record.RESULTS / "maps"


def default_objects():
    """Names of the default study's indenters, trained on or not, and of the paper's six objects."""
    objects = read_yaml(CONFIG / "config.yaml", missing="there is no such study.")["objects"]
    return [*objects["indenters"]["names"], *objects["unseen"]["names"], *(f"object_{k}" for k in range(1, 7))]


def measure(name, mesh):
    """One press in this process: what each load step that was reached says, and what stopped it, if anything did."""
    file = next((CONFIG / "objects").glob(f"*/{name}.stl"))
    sensor = softtact.load_sensor("coro")
    sensor.mesh, sensor.solver = MESHES[mesh](), NewtonSettings.draft() if mesh == "draft" else NewtonSettings()
    stopped, start = None, time.process_time()
    try:
        result = sensor.press(read_mesh(file, unit="mm"), force_n=FORCES_N, model="hyperelastic", threads=1)
    except ConvergenceError as error:
        result, stopped = error.result, str(error)
    row = {"object": name, "mesh": mesh, "stopped": stopped, "processor_s": round(time.process_time() - start, 1),
           "memory_gb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6, 2),
           "solver": getattr(result, "solver", None)}
    if result:
        save_maps(MAPS / mesh / f"{name}.npz", result)
    return {**row, **(_load_steps(result, sensor) if result else {"force_n": []})}


def save_maps(path, result):
    """The maps in mm (single precision: a tenth of a nanometre) with their forces in N, at once or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.NamedTemporaryFile(dir=path.parent, suffix=".part", delete=False) as file:
        np.savez_compressed(file, force_n=result.normal_force_n, map_mm=result.deformation_map_mm.astype(np.float32))
    Path(file.name).replace(path)


def _load_steps(result, sensor):
    height = sensor.spec.dielectric.frusta.height_mm
    lists = {"force_n": (result.normal_force_n, 3), "indentation_mm": (result.indentation_mm, 4),
             "iterations": (result.iterations, 0),
             "overlap_um": (1e3 * result.penetration_mm, 2), "residual_n": (result.residual_n, 5),
             "frustum_compression": (result.frustum_compression_mm / height, 3)}
    return {name: [round(float(value), digits) for value in values] for name, (values, digits) in lists.items()}


def main():
    """Press what is missing, write benchmarks/results/objects.json after each, and print a row of each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("objects", nargs="*", metavar="OBJECT")
    parser.add_argument("--mesh", choices=MESHES, default="default")
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.one:
        print(json.dumps(measure(*options.one)))
        return
    mesh = options.mesh
    for name in options.objects or default_objects():
        if options.reevaluate_contact or not any(_is(row, name, mesh) for row in recorded()):
            run = subprocess.run([sys.executable, __file__, "--one", name, mesh], capture_output=True, text=True,
                                 env=record.threads_of(1), check=False)
            if run.returncode:
                sys.exit(f"{name}: {run.stderr.strip()}")
            others = [row for row in recorded() if not _is(row, name, mesh)]      # read anew: another process may press others
            record.write("objects", rows=[*others, json.loads(run.stdout.splitlines()[-1])])
    for row in recorded():
        print(_line(row))


def recorded():
    """The rows of the record."""
    path = record.RESULTS / "objects.json"
    return json.loads(path.read_text(encoding="utf-8"))["rows"] if path.exists() else []


def _is(row, name, mesh):
    return (row["object"], row["mesh"]) == (name, mesh)


def _line(row):
    if not row["force_n"]:
        return f"| {row['object']} | {row['mesh']} | none | | | | | {row['processor_s']} |"
    return (f"| {row['object']} | {row['mesh']} | {row['force_n'][-1]:g} | {row['indentation_mm'][-1]:.3f} | "
            f"{sum(row['iterations']):.0f} | {max(row['overlap_um']):.2f} | {row['frustum_compression'][-1]:.0%} | "
            f"{row['processor_s']:.0f} |")


if __name__ == "__main__":
    main()
