"""Error of readouts against the number of training maps, to 10,400 of them: `python benchmarks/foundation_curve.py FOLDER` from the
project's folder.

Readings are the foundation model's own, without noise. Maps are its own (how far is a readout from what can be known?) or those of
the elastic model of the same presses (what does it make up for?). Four of five indenters train, in random places at twenty forces,
the others validate, and the other objects of the catalogue test. Formulas and networks are fitted to nested subsets, networks in
as many steps for each. Error: mean difference over the mean reading, of each object; rows have their mean and standard deviation.
`--architecture printed --device cuda` adds the paper's network: 4 ms a step of 32 maps on an H200, 0.6 s one of 16 on a core.

Presses are kept in FOLDER, fits in the record; the run goes on from both: benchmarks/results/foundation_curve.json and .png.
"""

import argparse
import itertools
import json
import math
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import record

import softtact
from softtact.errors import ConvergenceError, ShellWarning
from softtact.evaluation.score_tables import make_predictors
from softtact.files import read_yaml
from softtact.geometry.meshes import read_mesh
from softtact.geometry.pose import draw_poses
from softtact.learning.dataset import Samples
from softtact.learning.network import predict
from softtact.learning.settings import Training
from softtact.learning.training import prepare_torch, start_run, train_network
from softtact.progress import progress
from softtact.reporting.style import pyplot, save

SEED, SEEDS = 20251130, (1, 2)
FORCES = np.linspace(2.5, 50.0, 20)
PLACES = {"indenters": 18, "unseen": 4, "grasps": 4}     # random poses of each object
MODELS = {"foundation": "the truth's own maps", "elastic": "elastic maps"}
SIZES = (140, 540, 2600, 10400)
RATES = {"compact": 3e-3, "printed": 1e-4}     # of the first step, then half a cosine to 0
STEPS = 5200                                   # of 16 maps: 8 epochs of the largest subset
VALIDATED = 400                                # maps that choose the best epoch
FORMULAS = ("mean_reading", "nearest_map", "ridge", "quadratic")
SSIM = {"window": 3, "data_range": 2400.0}


def all_samples(folder, places):
    """{model: {role: Samples}} of the load steps at which both models are valid; pressed into `folder` if they are not there."""
    entries = read_yaml("config/objects/catalogue.yaml", missing="there is no such catalogue.")
    sensor, indenters, parts = softtact.load_sensor("coro"), itertools.count(), []
    for number, entry in enumerate(progress(entries, label="objects")):
        role = "test" if entry["set"] != "indenters" else "validation" if next(indenters) % 5 == 4 else "train"
        mesh = read_mesh(f"config/objects/{entry['file']}", unit=entry["unit"])
        poses = draw_poses(mesh.triangles, count=places or PLACES[entry["set"]], footprint_mm=sensor.spec.footprint_mm,
                           seed=[SEED, number])
        for place, pose in enumerate(poses):
            path = folder / f"{entry['set']}-{entry['name']}-{place}.npz"
            if not path.exists():
                np.savez_compressed(path, **pressed(sensor, mesh, pose))
            with np.load(path) as kept:
                parts.append({"role": role, "item": f"{entry['name']}-{place}", **kept})
    return {model: {role: joined(parts, model, role) for role in ("train", "validation", "test")} for model in MODELS}


def pressed(sensor, mesh, pose):
    """force_n (k,) of the load steps at which both models are valid, both models' maps and the foundation model's counts."""
    results = []
    for model in MODELS:
        try:
            results.append(sensor.press(mesh, pose=pose, force_n=FORCES, model=model, threads=1, label=""))
        except ConvergenceError as error:
            results.append(error.result)
    steps = min(result.steps for result in results)
    valid = np.logical_and(*(result.within_validity[:steps] for result in results))
    maps = dict(zip(MODELS, (result.deformation_map_mm[:steps][valid].astype(np.float32) for result in results), strict=True))
    return {"force_n": FORCES[:steps][valid], "counts": results[0].tactile_map[:steps][valid].astype(np.float32), **maps}


def joined(parts, model, role):
    """The `Samples` of a role."""
    parts = [part for part in parts if part["role"] == role]
    maps, counts, forces = (np.concatenate([part[name] for part in parts]) for name in (model, "counts", "force_n"))
    items = np.repeat([part["item"] for part in parts], [len(part["force_n"]) for part in parts])
    labels = pd.DataFrame({"set": role, "item": items, "trial": 0, "force_n": forces})
    return Samples(maps, counts, labels, model, role, "foundation model without noise")


def error_of(predicted, samples):
    """Mean and standard deviation over objects of the mean difference over the mean reading."""
    rows = pd.DataFrame({"object": samples.labels["item"].str.partition("-")[0], "read": samples.counts.mean(axis=(1, 2)),
                         "off": np.abs(predicted - samples.counts).mean(axis=(1, 2))}).groupby("object").sum()
    shares = rows.off / rows["read"]
    return {"error": round(float(shares.mean()), 4), "sd_of_objects": round(float(shares.std()), 4), "objects": len(shares)}


def trained(train, samples, architecture, *, seed, steps, device, checkpoint):
    """A network's error on the tests, and at which share of its steps the validation was best."""
    epochs = max(1, round(steps / math.ceil(len(train) / 16)))
    options = Training(epochs=epochs, patience=epochs, learning_rate=RATES[architecture])
    run = start_run(train, network={"architecture": architecture}, learning_rate=RATES[architecture], seed=seed, device=device)
    validation = samples["validation"].subset(VALIDATED, seed=SEED)
    for _ in train_network(run, train, validation, options=options, ssim=SSIM, seed=seed, checkpoint=checkpoint,
                           label=f"{architecture} network, {len(train)} {train.model} maps, seed {seed}"):
        pass
    run.network.load_state_dict(run.best["weights"])
    predicted = predict(run.network, samples["test"].maps_mm)
    return error_of(predicted, samples["test"]) | {"best_at": round(run.best["epoch"] / epochs, 2)}


def fits(samples, folder, options):
    """Rows of the record, yielded as they are made: those that it has are not made again."""
    rows = kept_rows(options)
    done = {(row["readout"], row["maps_of"], row["maps"], row["seed"]) for row in rows}
    device, sensor = prepare_torch(threads=1, device=options.device), softtact.load_sensor("coro")
    for size, (model, parts) in itertools.product(options.sizes, samples.items()):
        part = parts["train"].subset(size, seed=SEED)      # nested: each size's maps are among those of the next
        at = {"maps_of": model, "maps": len(part)}
        if ("quadratic", model, len(part), 0) not in done:
            formulas, test = make_predictors(part, spec=sensor.spec, counts_per_relative_change=None), parts["test"]
            yield [{"readout": name, **at, "seed": 0, **error_of(formulas[name](test), test)} for name in FORMULAS]
        for seed in SEEDS:
            if (options.architecture, model, len(part), seed) not in done:
                checkpoint = folder / f"{options.architecture}-{model}-{len(part)}-{seed}.pt"
                yield [{"readout": options.architecture, **at, "seed": seed,
                        **trained(part, parts, options.architecture, seed=seed, steps=options.steps, device=device,
                                  checkpoint=checkpoint)}]
                checkpoint.unlink(missing_ok=True)


def kept_rows(options):
    """Rows of the record, if they were made with the same number of steps and presses."""
    path = record.RESULTS / f"{options.name}.json"
    kept = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    return kept["rows"] if (kept.get("steps"), kept.get("places")) == (options.steps, options.places) else []


def draw(rows):
    """Error against the number of maps, a panel for each kind of maps."""
    figure, axes = pyplot().subplots(1, 2, figsize=(8, 4), layout="constrained", sharey=True)
    for axis, (model, words) in zip(axes, MODELS.items(), strict=True):
        for (name, part), mark in zip(rows[rows.maps_of == model].groupby("readout", sort=False), "osD^vx", strict=False):
            mean = part.groupby("maps").error.mean()
            axis.plot(mean.index, mean, f"{mark}-", label=name.replace("_", " "))
        axis.set(xscale="log", yscale="log", xlabel="training maps", title=f"from {words}")
        axis.set_xticks(sorted(set(rows.maps)), [f"{size:,}" for size in sorted(set(rows.maps))])
        axis.minorticks_off()
    axes[0].set_ylabel("error over mean reading, objects never seen")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=5, frameon=False)
    return figure


def main():
    """Press, fit, and print and write after each fit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--architecture", choices=RATES, default="compact")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu")
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES)
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--places", type=int, help="of each object, for a trial; by default 18 of each indenter")
    parser.add_argument("--name", default="foundation_curve", help="of the record")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    warnings.simplefilter("ignore", ShellWarning)
    samples, rows = all_samples(options.folder, options.places), kept_rows(options)
    counts = {role: len(part) for role, part in samples["elastic"].items()}
    print(counts)
    for found in fits(samples, options.folder, options):
        rows += found
        print(pd.DataFrame(found).to_string(index=False), flush=True)
        record.write(options.name, steps=options.steps, places=options.places, valid_maps=counts, rows=rows)
    save(draw(pd.DataFrame(rows)), record.RESULTS / f"{options.name}.png")


if __name__ == "__main__":
    main()
