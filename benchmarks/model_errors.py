"""Errors of the fast models and of the coarser meshes: `python benchmarks/model_errors.py [--mesh fine|default] [OBJECT ...]`.

What they are held against are the hyperelastic maps that `objects.py --mesh fine` left in benchmarks/results/maps. Every object
that has one is pressed with the fast models at the same forces, which takes seconds; other meshes' maps are read. Error: root mean
square over the map in % of its maximum; SSIM: scikit-image's, window of 7, the map's maximum as range. Writes
benchmarks/results/model_errors_MESH.json.
"""

import argparse
from pathlib import Path

import numpy as np
import record
from objects import CONFIG, MAPS
from skimage.metrics import structural_similarity

import softtact
from softtact.geometry.meshes import read_mesh

FAST = ("elastic", "foundation")


def maps_of(sensor, name, model, forces):
    """The model's maps (f, y, x) in mm and whether they are within validity (f,); None where a mesh was not pressed so far."""
    if model in FAST:
        mesh = read_mesh(next((CONFIG / "objects").glob(f"*/{name}.stl")), unit="mm")
        result = sensor.press(mesh, force_n=forces, model=model, label="")
        return result.deformation_map_mm, np.broadcast_to(result.within_validity, len(forces))
    file = MAPS / model / f"{name}.npz"
    if not file.exists():
        return None
    with np.load(file) as kept:
        both = np.isin(kept["force_n"], forces)
        return (kept["map_mm"][both], np.ones(both.sum(), dtype=bool)) if both.sum() == len(forces) else None


def errors(got, truth):
    """Root mean square and largest difference of maps (f, y, x) in % of the true maximum, and SSIM; each (f,)."""
    difference, largest = got - truth, truth.max(axis=(1, 2))
    ssim = [structural_similarity(a, b, win_size=7, data_range=float(b.max())) for a, b in zip(got, truth, strict=True)]
    return (100 * np.sqrt((difference**2).mean(axis=(1, 2))) / largest, 100 * np.abs(difference).max(axis=(1, 2)) / largest,
            np.array(ssim))


def rows_of(sensor, name, mesh):
    """A row for each model and force of one object."""
    with np.load(MAPS / mesh / f"{name}.npz") as kept:
        forces, truth = kept["force_n"], kept["map_mm"].astype(float)
    for model in (*FAST, *sorted(path.name for path in MAPS.iterdir() if path.name != mesh)):
        found = maps_of(sensor, name, model, forces)
        if found is not None:
            rms, largest, ssim = errors(found[0].astype(float), truth)
            for k, force in enumerate(forces):
                yield {"object": name, "model": model, "force_n": float(force), "rms_percent": round(float(rms[k]), 3),
                       "largest_percent": round(float(largest[k]), 2), "ssim": round(float(ssim[k]), 4),
                       "within_validity": bool(found[1][k])}


def summary(rows, model, force):
    """Means and extremes of one model at one force over the objects, as one line of a table."""
    here = [row for row in rows if (row["model"], row["force_n"]) == (model, force)]
    rms, ssim = (np.array([row[key] for row in here]) for key in ("rms_percent", "ssim"))
    valid = np.array([row["within_validity"] for row in here])
    worst = rms[valid].max() if valid.any() else np.nan
    return (f"| {model} | {force:g} | {len(here)} | {rms.mean():.2f} | {rms.max():.2f} | {ssim.mean():.3f} | {ssim.min():.3f} | "
            f"{valid.sum()} | {worst:.2f} |")


def main():
    """Press, print a line for each model and force, write the record."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("objects", nargs="*", metavar="OBJECT")
    parser.add_argument("--mesh", default="fine")
    options = parser.parse_args()
    sensor = softtact.load_sensor("coro")
    rows = []
    for name in options.objects or sorted(path.stem for path in (MAPS / options.mesh).glob("*.npz")):
        rows += rows_of(sensor, name, options.mesh)
    print("| model | N | objects | rms %, mean | largest | SSIM, mean | least | within validity | rms % of these at most |")
    for model in dict.fromkeys(row["model"] for row in rows):
        for force in dict.fromkeys(row["force_n"] for row in rows if row["model"] == model):
            print(summary(rows, model, force))
    print(record.write(f"model_errors_{Path(options.mesh).name}", rows=rows))


if __name__ == "__main__":
    main()
