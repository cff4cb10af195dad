"""SSIM against the number of training maps: `python benchmarks/learning_curve.py FOLDER` from the project's folder.

The compact network on growing nested subsets of the data of `stand_in.py` (made in FOLDER on first use), equal steps for all.
benchmarks/results/learning_curve.json and .png.
"""

import sys
from pathlib import Path

import record
from stand_in import SEED, SOURCE, stand_in

from softtact.evaluation.retraining import Experiment, learning_curve
from softtact.evaluation.scoring import score_sensor
from softtact.learning.settings import Training
from softtact.learning.training import prepare_torch
from softtact.reporting.style import pyplot, save

SSIM = {"window": 3, "data_range": 2400.0}
SIZES, STEPS = (32, 128, 512), 200
TESTS = ("validation", "unseen", "grasps")


def draw(curve, ceilings):
    """SSIM against the number of maps, a line per set, and the sensor's own repeats."""
    figure, axes = pyplot().subplots(figsize=(5.5, 4), layout="constrained")
    for (name, rows), mark, shade in zip(curve.groupby("set", sort=False), "osD", ("0.0", "0.35", "0.6"), strict=False):
        axes.plot(rows.maps, rows.ssim, f"{mark}-", color=shade, label=f"{name}, at most {ceilings[name]:.3f}")
    axes.set(xscale="log", xlabel="training maps", ylabel="SSIM (window 3, range 2400 counts)")
    axes.set_xticks(sorted(set(curve.maps)), sorted(set(curve.maps)), minor=False)
    axes.minorticks_off()
    axes.legend(frameon=False)
    return figure


def main(folder):
    """Train, print, draw and write."""
    data = stand_in(Path(folder))
    tests = {name: data[name] for name in TESTS}
    experiment = Experiment(data["train"], tests, network={"architecture": "compact"}, options=Training(learning_rate=3e-3),
                            ssim=SSIM, device=prepare_torch(threads=1))
    curve = learning_curve(experiment, sizes=SIZES, steps=STEPS, seed=SEED)
    print(curve.round(4).to_string(index=False))
    ceilings = {name: float(score_sensor(samples, ssim=SSIM).ssim.mean()) for name, samples in tests.items()}
    save(draw(curve, ceilings), record.RESULTS / "learning_curve.png")
    print(record.write("learning_curve", readings=SOURCE, steps=STEPS, ceilings=ceilings, rows=curve.round(4).to_dict("records")))


if __name__ == "__main__":
    main(sys.argv[1])
