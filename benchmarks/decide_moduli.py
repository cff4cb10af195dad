"""Can an elastic layer of another modulus read what the hyperelastic model reads? After `make decide`:

    python benchmarks/decide_moduli.py [FOLDER OF THE STUDY]

The study's matched layer has the modulus that brings its maps nearest to the hyperelastic model's. Nobody says that this is the
one that reads best. Here the elastic model presses all items with a row of moduli, and the gap formula and the quadratic read its
maps. Of each truth and readout two moduli are taken: with the least error on the indenters, to which the readouts are fitted, and
with the least error on the very objects that are then compared, which favours the layer. Then: hyperelastic minus elastic, as in
the study, and the foundation model's difference from the hyperelastic one. These questions were asked after the study's verdicts
were known: they explain, they decide nothing. Record: benchmarks/results/decide_moduli.json.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import record

from softtact.errors import InputError
from softtact.evaluation.paired import compare
from softtact.files import read_yaml
from softtact.sensors.frusta import SensorSpec
from softtact.studies.configuration import found_sensor
from softtact.studies.decide.config import FOUNDATION, HYPERELASTIC
from softtact.studies.decide.pressing import press_item, sensor_of
from softtact.studies.decide.scoring import PRIMARY, formula_predictions, object_scores, read_case
from softtact.studies.registry import checked_study

CONFIG = "config/decide.yaml"
MODULI_MPA = (1.0, 1.6, 2.0, 2.5, 3.2, 4.0)      # and the printed one; below 1 MPa some objects do not reach 50 N
KINDS = ("smooth", "stepped")


def pressed(study, young_mpa, folder):
    """Maps (item, force, y, x) of the elastic model with a modulus, and where it has one (item, force)."""
    model = {"kind": "elastic", "plane": "surface", "young_mpa": young_mpa}
    sensor = sensor_of(found_sensor(study.values.sensor), model)
    presses = [press_item(sensor, model, folder / item.file if item.made else item.file, unit=item.unit,
                          forces_n=study.values.forces_n) for item in [*study.indenters, *study.objects]]
    return (np.array([press.deformation_map_mm.values for press in presses], dtype=np.float32),
            np.array([np.isfinite(press.deformation_map_mm.values).all(axis=(1, 2)) for press in presses]))


def scored(case, model, window):
    """{readout: (error on the indenters, scores of each object)} of a model's maps."""
    fitted = {readout: np.abs(counts - samples.counts).sum() / samples.counts.sum()
              for readout, samples, counts in formula_predictions(case, model, items=case.indenters)}
    return {readout: (float(fitted[readout]), object_scores(samples, counts, window=window, data_range=case.spec.largest_counts))
            for readout, samples, counts in formula_predictions(case, model)}


def compared(better, worse, seed):
    """Numbers for each primary score: the first table of objects minus the second; more is better for the first."""
    for score, sign in PRIMARY.items():
        found = compare(sign * (better[score] - worse[score]).to_numpy(), seed=seed)
        yield {"score": score, **{name: round(getattr(found, name), 4) for name in ("mean", "low", "high")}}


def questions(case, maps, study):
    """Rows of one truth, by readout and kind of objects."""
    names = {young: f"elastic {young:g} MPa" for young in maps}
    valid = case.valid & np.all([reached for _, reached in maps.values()], axis=0)      # the same maps for all
    whole = replace(case, valid=valid, maps_mm=case.maps_mm | {name: maps[young][0] for young, name in names.items()})
    tables = {model: scored(whole, model, study.values.ssim_window) for model in (*names.values(), HYPERELASTIC, FOUNDATION)}
    for readout in tables[HYPERELASTIC]:
        fitted = {young: tables[name][readout][0] for young, name in names.items()}
        for kind in KINDS:
            own = {model: of[readout][1][of[readout][1].kind == kind].set_index("object") for model, of in tables.items()}
            errors = {young: float(own[name].error_share.mean()) for young, name in names.items()}
            pairs = {f"hyperelastic minus elastic, {where}": (HYPERELASTIC, names[min(of, key=of.get)])
                     for where, of in {"chosen on indenters": fitted, "chosen on the objects": errors}.items()}
            for question, (one, other) in (pairs | {"foundation minus hyperelastic": (FOUNDATION, HYPERELASTIC)}).items():
                for row in compared(own[one], own[other], study.values.seed):
                    yield {"truth": case.truth, "readout": readout, "objects": kind, "question": question, "of": other, **row}
            yield {"truth": case.truth, "readout": readout, "objects": kind, "question": "errors",
                   "on_indenters": {f"{young:g}": round(error, 4) for young, error in fitted.items()},
                   "on_objects": {f"{young:g}": round(error, 4) for young, error in errors.items()}}


def main(folder="results/decide"):
    """Press, read, compare, print and write."""
    study, folder = checked_study(read_yaml(CONFIG, missing="there is no such study."), CONFIG).study, Path(folder)
    sensor = found_sensor(study.values.sensor)
    printed = SensorSpec.from_yaml(sensor).elastic_layer.young_mpa
    files = {"maps": folder / "maps.nc", "sensor": sensor}
    cases = [read_case(files | {"readings": folder / f"readings/{truth}.nc"}, study.values.scored) for truth in study.values.truths]
    maps = {}
    for young in sorted({*MODULI_MPA, printed}):
        maps[young] = pressed(study, young, folder)
        print(f"{young:g} MPa: {maps[young][1].mean():.0%} of the load steps have a map", flush=True)
    rows = []
    for case in cases:
        for row in questions(case, maps, study):
            rows.append(row)
            print(*row.values(), flush=True)
    record.write("decide_moduli", rows=rows)


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except InputError as error:
        sys.exit(f"decide_moduli: {error}")
