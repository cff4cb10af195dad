"""Data sets: deformation maps of each model paired with the sensor's readings, split without leaks between training and tests.

A *load step* is one press at one force. Load steps of the set `indenters` are shuffled with the seed and split into train and
validation: each on its own (as in the paper), or all those of a press, or of an object, together (`split_by`). The sets `unseen`
and `grasps` are tests; their objects are not in the training. All trials of a load step are in one split, because they share its
deformation map. All models share the split, and a load step is used only within every model's validity, so that all networks have
the same samples. `Samples` is one split in memory, to train or score a network.
"""

import hashlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray

from softtact.errors import ConvergenceError, InputError
from softtact.files import read_dataset

SPLITS = ("train", "validation", "unseen", "grasps")
TESTS = SPLITS[1:]     # the splits that are scored
TRAINING_SET = "indenters"
OUT_OF_RANGE = "out_of_range"
MEAN = -1  # in place of a trial's number: the mean over the trials
MANIFEST = ["set", "item", "model", "force_n", "trial", "split", "converged", "within_validity"]
_Presses = dict[tuple[str, str, str], xarray.Dataset]     # by model, set, item
_Readings = dict[tuple[str, str], xarray.Dataset]         # by set, item


def build_datasets(presses: _Presses, tactile: _Readings, *, models: Sequence[str], items: list[Any], train_fraction: float,
                   seed: int, training_trials: str = "each",
                   split_by: str = "map") -> tuple[dict[tuple[str, str], xarray.Dataset], pd.DataFrame]:
    """Join and split presses and readings.

    presses {(model, set, item): dataset};  tactile {(set, item): dataset};  items: [{"set", "item"}, ...]
    split_by: unit that goes to training or validation as a whole: map, press or object
    training_trials: "each" makes every trial a training sample, "mean" the mean over a load step's trials
    Returns {(model, split): dataset} and the manifest, a row per model, load step and trial.
    """
    _check_choices(train_fraction, training_trials)
    items = [(entry["set"], entry["item"]) for entry in items]
    check_items(items)
    for key in items:
        check_item(key, presses, tactile, models)
    load_steps = assign_splits(list_load_steps(items, presses, models), train_fraction=train_fraction, seed=seed, split_by=split_by)
    check_splits(load_steps)
    check_no_map_leaks(load_steps, presses, models)
    samples = {split: order_samples(load_steps, tactile, split, seed=seed, training_trials=training_trials)
               for split in SPLITS}
    datasets = {(model, split): gather(rows, presses, tactile, model=model, split=split)
                for model in models for split, rows in samples.items()}
    return datasets, manifest(load_steps, presses, tactile, models)


def read_presses(paths: Iterable[str | Path]) -> _Presses:
    """{(model, set, item): dataset} of press files, by their attributes."""
    presses: _Presses = {}
    for path in paths:
        data = read_dataset(path)
        check_converged(data, path)
        _add(presses, tuple(_attribute(data, name, path) for name in ("model", "set", "item")), data, path)
    return presses


def read_tactile(paths: Iterable[str | Path]) -> _Readings:
    """{(set, item): dataset} of the sensor's readings."""
    tactile: _Readings = {}
    for path in paths:
        data = read_dataset(path)
        _add(tactile, tuple(_attribute(data, name, path) for name in ("set", "item")), data, path)
    return tactile


def check_converged(press: xarray.Dataset, path: str | Path) -> None:
    """Raise ConvergenceError for a press with a load step that did not converge; none of it may be used."""
    failed = press.normal_force_n.values[press.converged.values == 0]
    if len(failed):
        raise ConvergenceError(f"{path}: the press of {press.attrs.get('item')} with the model "
                               f"{press.attrs.get('model')} did not converge at {failed[0]:g} N; "
                               "press it again with smaller force steps, or leave it out.")


def check_items(items: Iterable[tuple[str, str]]) -> None:
    """Refuse a duplicate item and an object in two sets: a test must not contain an object of the training."""
    sets: dict[str, str]
    sets, seen = {}, set()
    for set_name, item in items:
        first = sets.setdefault(object_of(item), set_name)
        if item in seen or first != set_name:
            raise InputError(f"{item}: it is in the sets {first} and {set_name}; leave it in one of them.")
        seen.add(item)


def check_item(key: tuple[str, str], presses: _Presses, tactile: _Readings, models: Sequence[str]) -> None:
    """Refuse an item whose press or reading is missing, not finite, or at forces that differ."""
    name = "/".join(key)
    if key not in tactile:
        raise InputError(f"{name}: there is no reading of the sensor; add its tactile file.")
    forces = tactile[key].force_n.values
    _check_finite(tactile[key].tactile_map, f"the reading of {name}")
    for model in models:
        if (model, *key) not in presses:
            raise InputError(f"{name}: there is no press with the model {model}; add its press file.")
        press = presses[model, *key]
        _check_finite(press.deformation_map_mm, f"the press of {name} with the model {model}")
        if len(forces) != press.sizes["step"] or not np.allclose(forces, press.normal_force_n.values, rtol=1e-3, atol=0):
            raise InputError(f"{name}: the press with the model {model} is at {_list(press.normal_force_n.values)} N and the "
                             f"reading at {_list(forces)} N; use the same forces for both.")


def list_load_steps(items: Iterable[tuple[str, str]], presses: _Presses, models: Sequence[str]) -> pd.DataFrame:
    """Frame of all load steps, in the order of set, item and force: set, item, load step (index of the force), force_n, usable."""
    rows = []
    for key in sorted(items):
        of_models = [presses[model, *key] for model in models]
        usable = np.all([press.within_validity.values == 1 for press in of_models], axis=0)
        for load_step, force in enumerate(of_models[0].normal_force_n.values):
            rows.append((*key, load_step, float(force), bool(usable[load_step])))
    return pd.DataFrame(rows, columns=["set", "item", "load_step", "force_n", "usable"])


def assign_splits(load_steps: pd.DataFrame, *, train_fraction: float, seed: int, split_by: str = "map") -> pd.DataFrame:
    """`load_steps` with a column split: random train or validation for indenters, else the load step's set."""
    load_steps = load_steps.assign(split=load_steps["set"].where(load_steps.usable, OUT_OF_RANGE))
    candidates = load_steps[load_steps.usable & (load_steps["set"] == TRAINING_SET)]
    item = candidates["item"]
    units = {"map": candidates.index.to_series(), "press": item, "object": item.map(object_of)}[split_by]
    shuffled = np.random.default_rng([seed, 0]).permutation(units.unique())
    trained = units.isin(shuffled[:round(train_fraction * len(shuffled))])
    load_steps.loc[candidates.index, "split"] = np.where(trained, "train", "validation")
    return load_steps


def check_splits(load_steps: pd.DataFrame) -> None:
    """Refuse a split without a load step."""
    for split in SPLITS:
        if not (load_steps.split == split).any():
            dropped = int((load_steps.split == OUT_OF_RANGE).sum())
            raise InputError(f"the data set: no load step is left for {split} ({dropped} of {len(load_steps)} lie outside a "
                             "model's validity); add items or smaller forces.")


def check_no_map_leaks(load_steps: pd.DataFrame, presses: _Presses, models: Sequence[str]) -> None:
    """Refuse a test with a deformation map of the training set, i.e. the same shape under two names.

    Maps of zeros, before an object touches, are ignored.
    """
    usable = load_steps[load_steps.usable]
    for model in models:
        owners = {}
        for row in usable[usable["set"] == TRAINING_SET].itertuples():
            owners[_map_of(presses, model, row).tobytes()] = row.item
        for row in usable[usable["set"] != TRAINING_SET].itertuples():
            tested = _map_of(presses, model, row)
            owner = owners.get(tested.tobytes())
            if owner is not None and tested.any():
                raise InputError(f"{row.set}/{row.item}: its deformation map at {row.force_n:g} N equals one of the "
                                 f"training indenter {owner}; leave one of the two out.")


def order_samples(load_steps: pd.DataFrame, tactile: _Readings, split: str, *, seed: int, training_trials: str) -> pd.DataFrame:
    """Samples of one split as a frame set, item, load step, force_n, trial; shuffled with the seed for training."""
    chosen = load_steps[load_steps.split == split]
    mean = split == "train" and training_trials == "mean"
    rows = [(row.set, row.item, row.load_step, row.force_n, trial) for row in chosen.itertuples()
            for trial in ([MEAN] if mean else range(tactile[row.set, row.item].sizes["trial"]))]
    samples = pd.DataFrame(rows, columns=["set", "item", "load_step", "force_n", "trial"])
    if split in ("train", "validation"):
        order = np.random.default_rng([seed, 1]).permutation(len(samples))
        samples = samples.iloc[order].reset_index(drop=True)
    return samples


def gather(samples: pd.DataFrame, presses: _Presses, tactile: _Readings, *, model: str, split: str) -> xarray.Dataset:
    """The data set (sample, ...) of one model and split, in the order of the frame `samples`."""
    keys = list(zip(samples["set"], samples["item"], samples["load_step"], samples["trial"], strict=True))
    maps: Any = [presses[model, s, i].deformation_map_mm.values[load_step] for s, i, load_step, _ in keys]
    counts: Any = [_reading(tactile[s, i].tactile_map.values[:, load_step], trial) for s, i, load_step, trial in keys]
    first = presses[model, *keys[0][:2]]
    return xarray.Dataset(
        {"deformation_map_mm": (("sample", "y", "x"), np.float32(maps), {"units": "mm"}),
         "tactile_map": (("sample", "row", "column"), np.float32(counts), {"units": "counts"}),
         "force_n": ("sample", samples.force_n.to_numpy(), {"units": "N"}),
         "trial": ("sample", samples.trial.to_numpy(), {"note": f"{MEAN}: the mean over the trials"}),
         "set": ("sample", samples["set"].to_numpy(dtype=object)),
         "item": ("sample", samples["item"].to_numpy(dtype=object))},
        coords={"y": first.y.values, "x": first.x.values},
        attrs={"model": model, "split": split, "source": _one_source(tactile)})


def manifest(load_steps: pd.DataFrame, presses: _Presses, tactile: _Readings, models: Sequence[str]) -> pd.DataFrame:
    """A row per model, load step and trial with its split, also for those left out."""
    rows = []
    for model in models:
        for row in load_steps.itertuples():
            press = presses[model, row.set, row.item]
            flags = int(press.converged.values[row.load_step]), int(press.within_validity.values[row.load_step])
            rows += [(row.set, row.item, model, row.force_n, trial, row.split, *flags)
                     for trial in range(tactile[row.set, row.item].sizes["trial"])]
    return pd.DataFrame(rows, columns=MANIFEST)


def _check_choices(train_fraction, training_trials):
    if not 0 < train_fraction < 1:
        raise InputError(f"train_fraction is {train_fraction}; it must lie between 0 and 1.")
    if training_trials not in ("each", "mean"):
        raise InputError(f"training_trials is {training_trials!r}; use 'each' or 'mean'.")


def _check_finite(array, name):
    if not np.isfinite(array.values).all():
        raise InputError(f"{name}: it holds values that are not finite; make it again.")


def _attribute(data, name, path):
    if name not in data.attrs:
        raise InputError(f"{path}: the attribute {name!r} is missing; make the file again.")
    return data.attrs[name]


def _add(found, key, data, path):
    if key in found:
        raise InputError(f"{path}: it is a second file of {' '.join(key)}; give one of them.")
    found[key] = data


def _map_of(presses, model, row):
    return presses[model, row.set, row.item].deformation_map_mm.values[row.load_step]


def _reading(trials, trial):
    return trials.mean(axis=0) if trial == MEAN else trials[trial]


def _one_source(tactile):
    sources = sorted({data.attrs.get("source", "unknown") for data in tactile.values()})
    if len(sources) > 1:
        raise InputError(f"the tactile files come from {' and '.join(sources)}; do not mix them in one study.")
    return sources[0]


def _list(values):
    return ", ".join(f"{value:g}" for value in values)


@dataclass(frozen=True)
class Samples:
    """Deformation maps with the sensor's readings.

    maps_mm (n, y, x) float32;  counts (n, row, column) float32;  labels: a row each of set, item, trial, force_n
    model: of the deformation maps;  split: train, validation, unseen or grasps
    source: of the readings ("virtual sensor", "recording of a TSF-85", "published archive")
    """

    maps_mm: np.ndarray
    counts: np.ndarray
    labels: pd.DataFrame
    model: str
    split: str
    source: str

    def __len__(self) -> int:
        return len(self.maps_mm)

    def digest(self) -> str:
        """Hash of the contents: 16 hex digits over model, maps and counts."""
        content: Any = hashlib.sha256(self.model.encode())
        content.update(np.ascontiguousarray(self.maps_mm))
        content.update(np.ascontiguousarray(self.counts))
        return content.hexdigest()[:16]

    def range(self) -> dict[str, list[float]]:
        """Ranges of the samples as plain values: [least, greatest] of the maps' maxima in mm and of the forces in N."""
        deepest, forces = self.maps_mm.max(axis=(1, 2)), self.labels.force_n
        return {"map_max_mm": [float(deepest.min()), float(deepest.max())], "force_n": [float(forces.min()), float(forces.max())]}

    def subset(self, count: int | None, *, seed: int) -> "Samples":
        """At most `count` samples (None: all), drawn with the seed, in their order."""
        if count is None or count >= len(self):
            return self
        chosen = np.sort(np.random.default_rng(seed).permutation(len(self))[:count])
        return Samples(self.maps_mm[chosen], self.counts[chosen], self.labels.iloc[chosen].reset_index(drop=True),
                       self.model, self.split, self.source)


def object_of(item: str) -> str:
    """The object of an item's name: `square-1` is the square in its first drawn pose."""
    return item.partition("-")[0]


LABELS = ("set", "item", "trial", "force_n")


def read_samples(path: str | Path) -> Samples:
    """The samples of one file of `build_dataset`."""
    data = read_dataset(path)
    if "deformation_map_mm" not in data or "sample" not in data.dims:
        raise InputError(f"{path}: not a split of a data set; give a file that build_dataset wrote.")
    labels = pd.DataFrame({name: data[name].values for name in LABELS})
    return Samples(data.deformation_map_mm.values, data.tactile_map.values, labels,
                   data.attrs["model"], data.attrs["split"], data.attrs["source"])
