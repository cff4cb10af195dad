"""Errors of the fast models in counts: `python benchmarks/count_errors.py [MODEL ...]`; other models' rows stay in the record.

Held against the counts of the hyperelastic maps that `objects.py --mesh fine` left in benchmarks/results/maps, of a sensor whose
sides are held up to the surface, as these were pressed. For each press: counts of all taxels, and the share by which the fast
model's deformation would have to be smaller everywhere to read the hyperelastic model's counts, as a linear function of the mean
depth (`softtact.press.count_error`). It is fitted to two of three objects and tested on the others. Writes count_errors.json.
"""

import sys

import numpy as np
import record
from objects import CONFIG, MAPS
from scipy.optimize import brentq

import softtact
from softtact.errors import SofttactError
from softtact.geometry.meshes import read_mesh
from softtact.press.count_error import mean_depth
from softtact.press.sensor import Sensor
from softtact.readout.capacitance import ideal_counts

UNSEEN = 3     # every third object tests what the others fit


def gain_error(spec, maps, counts, truth):
    """Share g of a map (y, x) for which it reads `truth` in place of `counts` once it is 1 - g times as deep."""
    whole = ideal_counts(spec, maps).sum()
    return brentq(lambda g: counts * ideal_counts(spec, (1 - g) * maps).sum() / whole - truth, -0.9, 0.9)


def rows_of(sensor, name, models):
    """A row for each model and force of one object."""
    with np.load(MAPS / "fine" / f"{name}.npz") as kept:
        forces, truth = kept["force_n"], ideal_counts(sensor.spec, kept["map_mm"].astype(float)).sum(axis=(1, 2))
    mesh = read_mesh(next((CONFIG / "objects").glob(f"*/{name}.stl")), unit="mm")
    for model in models:
        try:
            result = sensor.press(mesh, force_n=forces, model=model, label="", threads=1)
        except SofttactError as error:
            print(name, model, error)
            continue
        counts = result.tactile_map.sum(axis=(1, 2))
        for k, force in enumerate(forces):
            yield {"object": name, "model": model, "force_n": float(force), "hyperelastic": round(float(truth[k]), 1),
                   "counts": round(float(counts[k]), 1), "valid": bool(result.within_validity[k]),
                   "mean_depth_mm": round(float(mean_depth(result.deformation_map_mm[k])), 5),
                   "gain_error": round(gain_error(sensor.spec, result.deformation_map_mm[k], counts[k], truth[k]), 4)}


def summary(rows, names):
    """Of each model: the fit, quantiles of what it leaves, and the share of the other objects' presses that lie between these."""
    out = {}
    for model in dict.fromkeys(row["model"] for row in rows):
        valid = [row for row in rows if row["model"] == model and row["valid"]]
        depth, share, percent = (np.array([row[key] for row in valid]) for key in ("mean_depth_mm", "gain_error", "counts"))
        percent = 100 * (1 - np.array([row["hyperelastic"] for row in valid]) / percent)
        test = np.isin([row["object"] for row in valid], names[::UNSEEN])
        slope, at_rest = np.polyfit(depth[~test], share[~test], 1)
        left = share - at_rest - slope * depth
        low, high = np.quantile(left[~test], [0.05, 0.95])
        out[model] = {"objects": [len(names) - len(names[::UNSEEN]), len(names[::UNSEEN])], "presses": [int((~test).sum()),
                      int(test.sum())], "at_rest": round(at_rest, 4), "per_mm": round(slope, 4), "left": _quantiles(left[~test]),
                      "unseen_between_5_and_95": round(float(np.mean((left[test] >= low) & (left[test] <= high))), 3),
                      "left_unseen": _quantiles(left[test]), "error_in_percent_of_counts": _quantiles(percent)}
    return out


def _quantiles(values):
    """At 5, 10, 50, 90 and 95 per cent."""
    return [round(float(value), 4) for value in np.quantile(values, [0.05, 0.1, 0.5, 0.9, 0.95])]


def main(models):
    """Press, write the record and print the summary."""
    coro = softtact.load_sensor("coro")
    sensor = Sensor(coro.spec.model_copy(update={"edge": coro.spec.edge.model_copy(update={"held": "sides"})}), coro.laws)
    names = sorted(path.stem for path in (MAPS / "fine").glob("*.npz"))
    kept = record.read("count_errors")["rows"] if (record.RESULTS / "count_errors.json").exists() else []
    rows = [row for row in kept if row["model"] not in models]
    for name in names:
        rows += rows_of(sensor, name, models)
        print(rows[-1], flush=True)
    found = summary(rows, names)
    record.write("count_errors", summary=found, rows=rows)
    for name, values in found.items():
        print(name, values)


if __name__ == "__main__":
    main(sys.argv[1:] or ["elastic", "foundation"])
