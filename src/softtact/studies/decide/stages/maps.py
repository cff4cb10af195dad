"""The collapse of the lower feature's share, and the map of robustness."""

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from softtact.contact.height_field import HeightField
from softtact.evaluation.curve_shape import lower_shares
from softtact.evaluation.paired import compare, verdict
from softtact.files import read_dataset, read_json, write_csv
from softtact.geometry.meshes import place, read_mesh
from softtact.sensors.frusta import SensorSpec
from softtact.studies.decide.config import ELASTIC, ELECTRODES, FOUNDATION, HYPERELASTIC, MATCHED
from softtact.studies.decide.pressing import press_item, sensor_of
from softtact.studies.decide.scoring import fit_gain, ideal_of

COLLAPSE_COLUMNS = ["family", "model", "young_mpa", "object", "step_mm", "force_n", "indentation_mm", "ratio", "lower_share"]


def trace_collapse(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Tabulate the lower feature's share against step over indentation, of all models and of elastic layers of other moduli.

    inputs: objects (list), facts (list), presses_MODEL (lists), sensor, materials;  outputs: collapse (CSV: COLLAPSE_COLUMNS)
    settings: young_mpa [further moduli], forces_n
    family: elastic (read at the surface), electrodes, foundation, or hyperelastic
    """
    rows: list[dict] = []
    elastic = {"kind": "elastic", "plane": "surface"}
    sensors = {young: sensor_of(inputs["sensor"], elastic | {"young_mpa": young}) for young in settings["young_mpa"]}
    for number, (path, facts) in enumerate(zip(inputs["objects"], inputs["facts"], strict=True)):
        one = read_json(facts)
        mesh = read_mesh(path, unit="mm")
        presses = {name.removeprefix("presses_"): read_dataset(paths[number]) for name, paths in inputs.items()
                   if name.startswith("presses_")}
        presses |= {f"elastic {young:g} MPa": press_item(sensor, elastic, path, unit="mm", forces_n=settings["forces_n"])
                    for young, sensor in sensors.items()}
        heights = HeightField(place(mesh)).on_grid(*(next(iter(presses.values()))[axis].values for axis in ("x", "y")))
        for name, press in presses.items():
            rows += _shares(name, press, heights, one)
    write_csv(outputs["collapse"], pd.DataFrame(rows, columns=COLLAPSE_COLUMNS))


def _shares(name: str, press: Any, heights: np.ndarray, facts: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """A row for each valid load step of a press."""
    linear = name in (ELASTIC, MATCHED) or name.startswith("elastic ")
    family = ELASTIC if linear else name if name in (ELECTRODES, FOUNDATION) else HYPERELASTIC
    young = float(name.split()[1]) if name.startswith("elastic ") else np.nan
    shares = lower_shares(press.deformation_map_mm.values, heights, lower_mm=facts["step_mm"])
    for step in np.flatnonzero((press.within_validity.values == 1) & np.isfinite(shares)):
        depth = float(press.indentation_mm[step])
        yield {"family": family, "model": name, "young_mpa": young, "object": facts["name"], "step_mm": facts["step_mm"],
               "force_n": float(press.normal_force_n[step]), "indentation_mm": depth, "ratio": facts["step_mm"] / depth,
               "lower_share": float(shares[step])}


def map_robustness(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Tabulate, for each combination of a truth's law, K / mu0, tips and mesh, which tested model comes nearer to its counts.

    inputs: variants (presses, the objects of one variant after those of the other), presses_elastic, presses_matched,
    presses_hyperelastic (lists, of the objects), sensor;  outputs: robustness (CSV)
    settings: variants [{law, bulk_over_shear, tips_bonded, mesh}, ...], objects, forces_n, seed, statistics, scored
    A row for all forces (force_n: all), whose one gain fits no linear layer to a sensor that stiffens, and one for each force.
    Read by the gap formula, whose one gain is fitted to the other objects, and of a single object to itself. With fewer objects
    than the statistics ask for every verdict is undecided: means and intervals then orient, they test nothing.
    All models are scored on the same load steps (`scoring`); `objects` is how many have one.
    """
    spec, count = SensorSpec.from_yaml(inputs["sensor"]), len(settings["objects"])
    tested = {model: [read_dataset(path) for path in inputs[f"presses_{model}"]] for model in (ELASTIC, MATCHED, HYPERELASTIC)}
    rows = []
    for number, varied in enumerate(settings["variants"]):
        truths = [read_dataset(path) for path in inputs["variants"][number * count:(number + 1) * count]]
        for force in ["all", *(settings["forces_n"] if len(settings["forces_n"]) > 1 else [])]:
            held = [_held(*of, force, settings["scored"]) for of in zip(truths, zip(*tested.values(), strict=True), strict=True)]
            errors = {model: _errors(spec, truths, presses, held) for model, presses in tested.items()}
            row = varied | {"force_n": force if force == "all" else f"{force:g}", "objects": sum(one.any() for one in held)}
            row |= {f"error_{model}": values[np.isfinite(values)].mean() if np.isfinite(values).any() else np.nan
                    for model, values in errors.items()}
            for other in (ELASTIC, MATCHED):
                row |= _nearer(errors[other] - errors[HYPERELASTIC], f"over_{other}", settings)
            rows.append(row)
    write_csv(outputs["robustness"], pd.DataFrame(rows))


def _nearer(gain: np.ndarray, name: str, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Columns on what the hyperelastic model errs less (object,): mean, interval, and which of the two is nearer."""
    gain = gain[np.isfinite(gain)]
    if not len(gain):
        return {f"gain_{name}": np.nan, f"low_{name}": np.nan, f"high_{name}": np.nan, f"verdict_{name}": "undecided"}
    found = compare(gain, seed=settings["seed"])
    statistics = settings["statistics"]
    word = verdict(found.p_above, found.p_below, objects=found.objects, least_objects=statistics["least_objects"],
                   level=statistics["level"])
    return {f"gain_{name}": found.mean, f"low_{name}": found.low, f"high_{name}": found.high, f"verdict_{name}": word}


def _errors(spec: SensorSpec, truths: list[Any], presses: list[Any], held: list[np.ndarray]) -> np.ndarray:
    """Errors over the readings (object,) of the gap formula at the load steps that are `held`; nan without one.

    The gain is fitted to the other objects, or to the object itself where no other has a load step.
    """
    pairs = [_counts(spec, *of) for of in zip(truths, presses, held, strict=True)]
    errors = np.full(len(pairs), np.nan)
    for k, (true, ideal) in enumerate(pairs):
        others = [pair for other, pair in enumerate(pairs) if other != k and len(pair[0])] or [(true, ideal)]
        gain = fit_gain(np.concatenate([one for _, one in others]), np.concatenate([one for one, _ in others]))
        if len(true):
            errors[k] = np.abs(gain * ideal - true).sum() / true.sum()
    return errors


def _held(truth: Any, presses: Iterable[Any], force: float | str, scored: str) -> np.ndarray:
    """Which of a truth's load steps, at a force in N or all, count."""
    held: np.ndarray = truth.within_validity.values == 1
    for press in presses:
        steps = _steps_of(truth, press)
        held = held & np.isfinite(press.deformation_map_mm.values[steps]).all(axis=(1, 2))
        held = held & ((press.within_validity.values[steps] == 1) | (scored != "all"))
    return held if force == "all" else held & np.isclose(truth.normal_force_n.values, force, rtol=1e-6)


def _steps_of(truth: Any, press: Any) -> list[int]:
    """The load steps of a press at the forces of a truth."""
    return [int(np.argmin(np.abs(press.normal_force_n.values - force))) for force in truth.normal_force_n.values]


def _counts(spec: SensorSpec, truth: Any, press: Any, held: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ideal counts (n, row, column) of a truth and of a tested model at those of the truth's load steps that are `held`."""
    return (ideal_of(spec, truth.deformation_map_mm.values[held]),
            ideal_of(spec, press.deformation_map_mm.values[_steps_of(truth, press)][held]))
