"""Do a calibration's intervals cover? Twenty specimens whose truth is another model than the fit's: stated 95 %, seen how many?

    python benchmarks/calibration_intervals.py [SPECIMENS]    (half a core minute a specimen; goes on where it was stopped)

A piece of coro of 6 x 6 frusta is recorded with three objects: a plate, a ball and a bar, of other sizes and places in each
specimen. The recordings are made from presses of the hyperelastic model on its draft mesh, the fit is by the foundation model. Each
specimen has its own gains, zeros, sheet, common scale and moduli (`HiddenConstants`), noise of 6 counts, and objects that lie
0.4 mm and 1.5 degrees beside their stated places. Creep is left out. A row holds each error over its stated standard deviation. The
structure of the model's error (`calibration.discrepancy`: half of it differs from press to press) was chosen on specimens 0 to 5.
Expected: 90 to 99 % of all errors within 1.96 deviations. Writes benchmarks/results/calibration_intervals.json.
"""

import json
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import record
import simulated_recordings
import trimesh
import yaml
from simulated_recordings import HiddenConstants, simulate_recording, staircase_force

import softtact
from softtact.calibration.experiment import experiment
from softtact.calibration.fit import calibrate
from softtact.calibration.ladder import Presses
from softtact.calibration.problem import Problem
from softtact.errors import ConvergenceError
from softtact.models.hyperelastic.mesh_settings import PRESETS
from softtact.sensors.base import read_mapping
from softtact.sensors.library import sensor_file

SPECIMENS, CHOSEN_ON, LEVELS, NORMAL_95 = 20, 6, 7, 1.96
FITTED = ("placement", "modulus")
PLATE = trimesh.creation.box((11, 11, 3))
ROWS = Path(__file__).parent / "results" / "calibration_intervals_rows.json"


def small_sensor():
    """A piece of coro, 7.2 x 7.2 mm, with its 7 x 4 taxels."""
    values = read_mapping(sensor_file("coro")) | {"name": "small", "footprint_mm": [7.2, 7.2], "map_shape": [13, 13],
                                                 "force_range_n": [0.0, 10.0]}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "small.yaml"
        path.write_text(yaml.safe_dump(values))
        return softtact.load_sensor(path)


def objects(rng):
    """(mesh, place, forces in N) of a specimen's three presses."""
    ball = trimesh.creation.icosphere(subdivisions=4, radius=float(rng.uniform(6, 10)))
    bar = trimesh.creation.box((float(rng.uniform(2, 3)), float(rng.uniform(4, 5)), 3))
    return [(PLATE, (0.0, 0.0, 0.0), (2.5, 5.0, 10.0)), (ball, (*rng.uniform(-1, 1, 2), 0.0), (0.75, 1.5, 3.0)),
            (bar, (*rng.uniform(-1, 1, 2), rng.uniform(-20, 20)), (1.0, 2.0, 4.0))]


def calibrated(sensor, seed):
    """Hidden constants of a specimen, true places (3, 3), and its `CalibrationResult`."""
    mesh, solver = PRESETS["draft"]
    truth = Presses(replace(sensor, mesh=mesh(), solver=solver()), model="hyperelastic")
    hidden = replace(HiddenConstants.drawn(sensor, seed=seed), relaxation=(), relaxation_s=())
    rng = np.random.default_rng([seed, 11])
    experiments, places = [], []
    for k, (body, place, forces) in enumerate(objects(rng)):
        recording = simulate_recording(truth, body, hidden, *staircase_force(forces, hold_s=1.0), place=place, seed=100 * seed + k)
        experiments.append(experiment(recording, body, place=tuple(np.add(place, rng.normal(0, [0.4, 0.4, 1.5])))))
        places.append(place)
    return hidden, np.array(places), calibrate(Problem(Presses(sensor), experiments, FITTED), label="")


def errors(sensor, hidden, places, found):
    """{kind: (errors (n,), stated standard deviations (n,))} of what the file of a calibrated sensor states."""
    gain, zero = found.linear.gain / hidden.effective_gain(sensor) - 1, found.linear.zero - hidden.zero_counts
    moved = np.array([found.problem.place(found.vector, k) for k in range(len(places))])[1:, :2] - places[1:, :2]
    deviations = [found.deviation(f"{axis} {k}") for k in (2, 3) for axis in "xy"]
    return {"modulus scale": (np.log([found.modulus_scale / hidden.modulus_scale]), np.array([found.deviation("ln modulus")])),
            "gain": (gain.ravel(), found.gain_deviation.ravel()), "zero": (zero.ravel(), found.zero_deviation.ravel()),
            "place": (moved.ravel(), np.array(deviations))}


def row_of(seed, found, kinds, seconds):
    """What the record keeps of a specimen."""
    row = {"seed": seed, "misfit": round(found.misfit, 3), "model_error": round(found.model_error, 4),
           "processor_s": round(seconds, 1)}
    for kind, (error, deviation) in kinds.items():
        row[kind] = {"error_rms": float(f"{np.sqrt((error**2).mean()):.4g}"), "deviation": float(f"{deviation.mean():.4g}"),
                     "over_deviation": np.round(error / deviation, 3).tolist()}
    return row


def summary_of(rows):
    """{kind: share within 1.96 deviations, root mean square over the deviation}, and of all kinds with equal weights."""
    kinds, refused = {}, sum("refused" in row for row in rows)
    rows = [row for row in rows if "refused" not in row]
    for kind in ("modulus scale", "gain", "zero", "place"):
        ratios = np.concatenate([row[kind]["over_deviation"] for row in rows])
        kinds[kind] = {"within_95": round(float((np.abs(ratios) <= NORMAL_95).mean()), 4),
                       "mean": round(float(ratios.mean()), 3), "rms": round(float(np.sqrt((ratios**2).mean())), 3)}
    return kinds | {"specimens": len(rows), "refused": refused,
                    "within_95": round(float(np.mean([kinds[kind]["within_95"] for kind in kinds])), 4)}


def main(specimens=SPECIMENS):
    simulated_recordings._LEVELS = LEVELS      # of the hyperelastic presses, half of the usual
    sensor, rows = small_sensor(), json.loads(ROWS.read_text()) if ROWS.exists() else []
    for seed in sorted(set(range(specimens)) - {row["seed"] for row in rows}):
        start = time.process_time()
        try:
            hidden, places, found = calibrated(sensor, seed)
            rows.append(row_of(seed, found, errors(sensor, hidden, places, found), time.process_time() - start))
        except ConvergenceError as error:     # such a calibration states nothing
            rows.append({"seed": seed, "refused": str(error)})
        ROWS.write_text(json.dumps(rows))
        print(json.dumps({name: value for name, value in rows[-1].items() if not isinstance(value, dict)}), flush=True)
    summary = {"all": summary_of(rows), "not chosen on": summary_of([row for row in rows if row["seed"] >= CHOSEN_ON] or rows)}
    print(json.dumps(summary, indent=2))
    record.write("calibration_intervals", summary=summary, specimens=sorted(rows, key=lambda row: row["seed"]))
    ROWS.unlink()


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
