"""Recovery of hidden constants by `softtact calibrate`: five specimens, each from four recordings, judged on objects left out.

    python benchmarks/calibration.py      (about ten minutes; writes benchmarks/results/calibration.json)

A specimen has its own gains (5 % apart), zeros, sheet, common scale and moduli (each within a fifth), creep (two terms, within a
third), noise of 6 counts. Each object lies up to a millimetre and some degrees beside where it is said to lie. Recordings and fit
share the foundation model, so this tells how well constants come back, not how far the model is from a real sensor.
Expected: gains within 2 %, zeros within 3 counts, modulus scale within 5 %, error on objects left out at least halved.
"""

import json
import time
from dataclasses import replace

import numpy as np
import record
import trimesh
from simulated_recordings import HiddenConstants, simulate_recording, staircase_force

import softtact
from softtact.calibration.experiment import experiment
from softtact.calibration.fit import calibrate
from softtact.calibration.ladder import Presses
from softtact.calibration.problem import Problem
from softtact.readout.taxels import relative_change
from softtact.readout.virtual_sensor import amplified, taxel_capacitance

PLATE, BAR = trimesh.creation.box((26, 41, 4)), trimesh.creation.box((6, 20, 4))
BALL = trimesh.creation.icosphere(subdivisions=4, radius=12.0)
PUNCH = trimesh.creation.cylinder(radius=6, height=5, sections=64)
PRESSES = [(PLATE, (0, 0, 0), (10, 25, 50)), (BALL, (3, 6, 0), (1, 3, 5)), (BAR, (-3, -4, 0), (5, 15, 25)),
           (PUNCH, (2, -11, 0), (5, 15, 25))]
HELD_OUT = [(trimesh.creation.box((10, 10, 4)), (-2, 3, 30), 20.0), (trimesh.creation.cylinder(radius=5, height=4, sections=64),
                                                                      (4, 10, 0), 15.0),
            (trimesh.creation.icosphere(subdivisions=4, radius=20.0), (-3, -6, 0), 6.0)]
SCALE = 2600.0      # of the twin before: the default study's
SPECIMENS = 5


def main():
    sensor = softtact.load_sensor("coro")
    presses, rows = Presses(sensor), []
    for seed in range(SPECIMENS):
        rows.append(one_specimen(sensor, presses, seed))
        print(json.dumps(rows[-1]), flush=True)
    summary = {"gain_error_largest": max(row["gain_error_largest"] for row in rows),
               "zero_error_largest_counts": max(row["zero_error_largest_counts"] for row in rows),
               "modulus_error_largest": max(abs(row["modulus_error"]) for row in rows),
               "held_out_error_ratio_largest": max(row["held_out_after_counts"] / row["held_out_before_counts"] for row in rows)}
    record.write("calibration", summary=summary, specimens=rows)
    print(json.dumps(summary, indent=2))


def one_specimen(sensor, presses, seed):
    hidden = HiddenConstants.drawn(sensor, seed=seed)
    rng = np.random.default_rng([seed, 11])
    experiments, places = [], []
    for k, (mesh, place, levels) in enumerate(PRESSES):
        places.append(np.add(place, rng.normal(0, [0.4, 0.4, 1.5])))
        recording = simulate_recording(presses, mesh, hidden, *staircase_force(levels), place=places[-1], seed=100 * seed + k)
        experiments.append(experiment(recording, mesh, place=place))
    start = time.perf_counter()
    found = calibrate(Problem(presses, experiments, ("placement", "relaxation", "modulus")), label=f"specimen {seed}")
    before, after = held_out(presses, hidden, found)
    gain, own = found.linear.gain, hidden.effective_gain(sensor)
    moved = [np.subtract(found.problem.place(found.vector, k), place) for k, place in enumerate(places)]
    shares, times = found.problem.creep(found.vector)
    return {"seed": seed, "gain_error_largest": float(np.abs(gain / own - 1).max()),
            "gain_error_rms": float(np.sqrt(np.mean((gain / own - 1) ** 2))),
            "gain_error_of_raw_gain_largest": float(np.abs(gain / hidden.gain - 1).max()),
            "gain_deviation_told": float(found.gain_deviation.mean()),
            "zero_error_largest_counts": float(np.abs(found.linear.zero - hidden.zero_counts).max()),
            "modulus_hidden": hidden.modulus_scale, "modulus_error": found.modulus_scale / hidden.modulus_scale - 1,
            "modulus_deviation_told": found.deviation("ln modulus"),
            "place_error_largest_mm": float(max(np.abs(one[:2]).max() for one in moved[1:])),
            "shares": [*map(float, hidden.relaxation)], "shares_found": shares, "times_s": [*map(float, hidden.relaxation_s)],
            "times_s_found": times, "misfit": found.misfit, "held_out_before_counts": before, "held_out_after_counts": after,
            "not_identifiable": found.not_identifiable, "seconds": time.perf_counter() - start}


def held_out(presses, hidden, found):
    """Mean absolute error (counts) over objects that no recording has: of the twin before, and of the calibrated one.

    Long after the press, where both know the place and force; taxels that read anything count.
    """
    errors = np.zeros((0, 2))
    spec = presses.sensor.spec
    for mesh, place, force in HELD_OUT:
        ladder = presses.ladder(mesh, place, largest_n=2.0 * force)
        at = {scale: np.tensordot(ladder.weights(np.array([force / scale]))[0], ladder.maps_mm, 1)
              for scale in (1.0, hidden.modulus_scale, found.modulus_scale)}
        still = replace(hidden, noise_counts=0.0)
        true = amplified(_of_specimen(spec, still, at[hidden.modulus_scale]), gain=still.gain, offset=still.zero_counts)
        before = SCALE * relative_change(spec, at[1.0])
        after = found.linear.gain * relative_change(spec, at[found.modulus_scale]) + found.linear.zero
        felt = true > 20.0
        errors = np.vstack([errors, np.abs(np.stack([before, after]) - true)[:, felt].T])
    return tuple(map(float, errors.mean(axis=0)))


def _of_specimen(spec, hidden, maps):
    """dC/C0 (row, column) of a specimen, whose sheet is its own, under a map."""
    rest = taxel_capacitance(spec, np.zeros_like(maps), sheet_excess_mm=hidden.sheet_excess_mm)
    return taxel_capacitance(spec, maps, sheet_excess_mm=hidden.sheet_excess_mm) / rest - 1


if __name__ == "__main__":
    main()
