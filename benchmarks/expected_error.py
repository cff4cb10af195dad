"""What error the fast models make, and how well it is told: `python benchmarks/expected_error.py FOLDER`.

FOLDER holds the hyperelastic presses of random contacts that `contacts.py press` left (default mesh; single load steps are presses
here). Each is pressed with the fast models; the coefficients and intervals of `softtact.press.choice` are fitted to the sets `easy`
and `hard`, with each object left out in turn, and tested on the set `unseen`, which nothing else reads. Writes expected_error.json.
"""

import argparse
import json
import warnings
from pathlib import Path

import contacts
import numpy as np
import pandas as pd
import record

import softtact
from softtact.errors import SofttactError
from softtact.press.choice import calibrate, rms

warnings.simplefilter("ignore")
MODELS = ("elastic", "foundation")


def presses(folder):
    """One row a load step that the hyperelastic model holds for valid: features, expected and true errors of both fast models."""
    rows, sensors = [], {}
    for which in contacts.COUNTS:
        for contact in contacts.contacts(which):
            file = folder / f"{contact.name}.npz"
            if file.exists():
                sensor = sensors.setdefault(contact.sensor, softtact.load_sensor(contact.sensor))
                rows += rows_of(sensor, contact, file)
    return pd.DataFrame(rows)


def rows_of(sensor, contact, file):
    """The rows of one contact."""
    with np.load(file) as kept:
        if "force_n" not in kept or not kept["valid"].any():
            return []
        forces, maps, valid = kept["force_n"], kept["map_mm"], kept["valid"].astype(bool)
    pressed = {}
    for model in MODELS:
        try:
            pressed[model] = sensor.press(contact.mesh, pose=contacts.placed_pose(contact), force_n=forces, model=model, label="",
                                          threads=1)
        except SofttactError as error:
            print(contact.name, model, error)
            return []
    compression = pressed["foundation"].frustum_compression_mm / sensor.spec.frustum_height_mm
    depth = pressed["foundation"].indentation_mm / sensor.spec.thickness_mm
    apart = rms(pressed["elastic"].deformation_map_mm - pressed["foundation"].deformation_map_mm)
    return [{"object": contact.name, "sensor": contact.sensor, "force_n": forces[k], "top_mm": maps[k].max(),
             "compression": compression[k], "depth": depth[k], "apart_mm": apart[k],
             **{f"{model}_{name}": value for model, result in pressed.items() for name, value in
                (("true_mm", rms(result.deformation_map_mm[k] - maps[k])), ("rms_mm", rms(result.deformation_map_mm[k])),
                 ("valid", result.within_validity[k]))}} for k in np.flatnonzero(valid)]


def fitted(table):
    """The `FoundationError` of a table's rows."""
    return calibrate((table.foundation_true_mm / table.foundation_rms_mm).to_numpy(), table.compression.to_numpy(),
                     table.depth.to_numpy())


def told(table, error):
    """Expected errors (n,) in mm of a table's rows, of a `FoundationError`."""
    relative = error(np.ones((len(table), 1, 1)), table.compression.to_numpy(), table.depth.to_numpy())
    return relative * table.foundation_rms_mm.to_numpy()


def report(table):
    """Fit, leave-one-object-out, and the test; the numbers for the record."""
    own = table[table.foundation_valid == 1]
    told_apart = table.object.str.startswith("unseen")
    seen, unseen = own[~told_apart], own[told_apart]
    error = fitted(seen)
    left_out = np.concatenate([own_rows.foundation_true_mm.to_numpy() / told(own_rows, fitted(seen[seen.object != name]))
                               for name, own_rows in seen.groupby("object")])
    low, high = np.quantile(left_out, [0.1, 0.9])
    ratio = unseen.foundation_true_mm.to_numpy() / told(unseen, error)
    elastic = table[(table.elastic_valid == 1) & ~told_apart]
    both, other = (rows[(rows.elastic_valid == 1) & (rows.foundation_valid == 1)] for rows in (seen, unseen))
    elastic_ratio, elastic_unseen = (rows.elastic_true_mm / np.hypot(rows.apart_mm, told(rows, error)) for rows in (both, other))
    return {"presses": len(table), "objects": int(table.object.nunique()), "valid": len(own),
            "fit": _count(table[~told_apart], seen), "test": _count(table[told_apart], unseen),
            "coefficients": {"at_rest": error.at_rest, "growth": error.growth, "deep": error.deep},
            "interval": [float(low), float(high)], "coverage_left_out": _share(left_out, low, high),
            "coverage_unseen": _share(ratio, low, high), "above_unseen": float(np.mean(ratio > high)),
            "true_over_expected_unseen": _quantiles(ratio),
            "error_over_maximum_unseen": _quantiles(unseen.foundation_true_mm / unseen.top_mm),
            "elastic_relative": _quantiles(elastic.elastic_true_mm / elastic.elastic_rms_mm),
            "elastic_true_over_expected": _quantiles(elastic_ratio),
            "elastic_interval": [float(value) for value in np.quantile(elastic_ratio, [0.1, 0.9])],
            "elastic_above_unseen": float(np.mean(elastic_unseen > np.quantile(elastic_ratio, 0.9)))}


def _count(pressed, valid):
    """Load steps that the hyperelastic model holds for, those of them that the foundation model does, and objects."""
    return {"load_steps": len(pressed), "presses": len(valid), "objects": int(pressed.object.nunique())}


def _share(values, low, high):
    return float(np.mean((values >= low) & (values <= high)))


def _quantiles(values):
    """At 5, 25, 50, 75 and 95 per cent."""
    return [float(value) for value in np.quantile(values, [0.05, 0.25, 0.5, 0.75, 0.95])]


def main():
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--table", type=Path, help="where the rows are kept, and read from where it is there")
    arguments = parser.parse_args()
    if arguments.table and arguments.table.exists():
        table = pd.read_csv(arguments.table)
    else:
        table = presses(arguments.folder)
        if arguments.table:
            table.to_csv(arguments.table, index=False)
    numbers = report(table)
    print(json.dumps(numbers, indent=1))
    print(record.write("expected_error", **numbers))


if __name__ == "__main__":
    main()
