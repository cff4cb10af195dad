"""What a readout gives for a model's maps, scored against a truth's readings, object by object.

Trained is on the indenters, scored on the objects, all models on the same load steps: those at which the truth holds and every
model has a map. What a model flags itself takes nothing out, for what it gives there is what is tested; the configuration may ask
for the load steps at which all models hold.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from softtact.files import read_dataset
from softtact.learning.dataset import Samples
from softtact.readout.capacitance import ideal_counts
from softtact.readout.ssim import map_ssim, own_range_ssim, whole_map_ssim
from softtact.sensors.frusta import SensorSpec
from softtact.studies.decide.config import COMPACT, FORMULAS, GAP, INDENTERS, MODELS, PRINTED, QUADRATIC

READOUTS = (*FORMULAS, COMPACT, PRINTED)
MEAN_READING, NO_READOUT = "mean_reading", "none"     # the contestant that reads no map: the trivial baseline of every readout
SCORES = ["error_share", "ssim_own_range", "ssim_paper", "ssim_paper_whole"]
COLUMNS = ["truth", "model", "readout", "seed", "object", "kind", "maps", "largest_force_n", *SCORES]
PRIMARY = {"error_share": -1.0, "ssim_own_range": 1.0}     # and the sign with which more is better
_LEAST_COUNTS = 1.0     # of a mean reading, below which an error has no share of it


@dataclass(frozen=True)
class Case:
    """A truth's readings with the maps of all tested models."""

    spec: SensorSpec
    """The sensor."""
    truth: str
    """Its name."""
    items: list[str]
    """Names, in the order of the readings."""
    sets: list[str]
    """Set of each item."""
    forces_n: np.ndarray
    """(force,) of the load steps."""
    counts: np.ndarray
    """(item, force, row, column) of the virtual sensor."""
    maps_mm: dict[str, np.ndarray]
    """{model: (item, force, y, x)}."""
    valid: np.ndarray
    """(item, force): where load steps count."""

    def samples(self, model: str, chosen: Sequence[str], split: str) -> Samples:
        """The valid load steps of some items, as `learning` takes them."""
        places = [self.items.index(item) for item in chosen]
        taken = [(k, step) for k in places for step in np.flatnonzero(self.valid[k])]
        rows = tuple(np.array(taken, dtype=int).reshape(-1, 2).T)
        labels = pd.DataFrame({"set": [self.sets[k] for k, _ in taken], "item": [self.items[k] for k, _ in taken], "trial": 0,
                               "force_n": [self.forces_n[step] for _, step in taken]})
        return Samples(self.maps_mm[model][rows].astype(np.float32), self.counts[rows].astype(np.float32), labels, model, split,
                       "virtual sensor")

    def of_sets(self, *sets: str) -> list[str]:
        """The items of some sets."""
        return [item for item, own in zip(self.items, self.sets, strict=True) if own in sets]

    @property
    def indenters(self) -> list[str]:
        """What is trained on."""
        return self.of_sets(INDENTERS)

    @property
    def objects(self) -> list[str]:
        """What is scored."""
        return self.of_sets("smooth", "stepped")


def read_case(inputs: Mapping[str, Any], scored: str) -> Case:
    """The `Case` of a stage's inputs: readings (of `read_truth`), maps (of `gather_maps`), sensor.

    scored: at which load steps, as in the configuration
    """
    readings, maps = read_dataset(inputs["readings"]), read_dataset(inputs["maps"])
    of_models = {model: maps.deformation_map_mm.sel(model=model).values for model in MODELS}
    holding = [*(MODELS if scored == "all" else ()), readings.attrs["model"]]
    counts = maps.valid.sel(model=holding).values.astype(bool).all(axis=0)
    for values in (readings.tactile_map.values, *of_models.values()):
        counts = counts & np.isfinite(values).all(axis=(2, 3))
    return Case(SensorSpec.from_yaml(inputs["sensor"]), readings.attrs["truth"], [str(name) for name in maps.item.values],
                [str(name) for name in maps["set"].values], readings.force_n.values, readings.tactile_map.values, of_models, counts)


def fit_gain(ideal: np.ndarray, counts: np.ndarray) -> float:
    """The one gain with which ideal counts at 1 count for dC / C0 = 1 come nearest to readings, in least squares."""
    return float((ideal * counts).sum() / max((ideal**2).sum(), 1e-300))


def ideal_of(spec: SensorSpec, maps_mm: np.ndarray) -> np.ndarray:
    """Counts (n, row, column) of the ideal readout at 1 count for dC / C0 = 1, of maps (n, y, x) in mm."""
    return ideal_counts(spec, maps_mm, counts_per_relative_change=1.0)


def formula_predictions(case: Case, model: str, *, items: Sequence[str] | None = None) -> Iterator[tuple[str, Samples, np.ndarray]]:
    """(readout, samples, counts (n, row, column)) of the readouts that are no networks, for the maps of items, else of objects."""
    from softtact.evaluation.score_tables import make_predictors

    train, test = case.samples(model, case.indenters, "train"), case.samples(model, items or case.objects, "test")
    gain = fit_gain(ideal_of(case.spec, train.maps_mm), train.counts)
    yield GAP, test, np.clip(gain * ideal_of(case.spec, test.maps_mm), 0.0, case.spec.largest_counts)
    yield QUADRATIC, test, make_predictors(train, spec=case.spec, counts_per_relative_change=None)["quadratic"](test)


def mean_reading(case: Case) -> tuple[Samples, np.ndarray]:
    """Samples of the objects and, for each, the mean reading (n, row, column) of the indenters at its force."""
    from softtact.evaluation.score_tables import mean_reading_predictor

    train, test = (case.samples(next(iter(case.maps_mm)), items, "") for items in (case.indenters, case.objects))
    return test, mean_reading_predictor(train)(test)


def object_scores(samples: Samples, predicted: np.ndarray, *, window: int, data_range: float, **names: Any) -> pd.DataFrame:
    """COLUMNS without what `names` lack: a row for each object of the samples, of predicted counts (n, row, column).

    maps: load steps that count;  largest_force_n: of these
    error_share: the sum of the errors over the sum of the readings, over all maps of the object;  the others: mean SSIM
    """
    measured = samples.counts.astype(float)
    each = samples.labels[["item", "set", "force_n"]].assign(
        error=np.abs(predicted - measured).mean(axis=(1, 2)), reading=measured.mean(axis=(1, 2)),
        ssim_own_range=own_range_ssim(predicted, measured, window=window),
        ssim_paper=map_ssim(predicted, measured, window=window, data_range=data_range),
        ssim_paper_whole=whole_map_ssim(predicted, measured, data_range=data_range))
    rows = []
    for item, own in each.groupby("item", sort=False):
        row = {"object": item, "kind": own["set"].iloc[0], "maps": len(own), "largest_force_n": own.force_n.max(),
               "error_share": own.error.sum() / max(own.reading.sum(), _LEAST_COUNTS * len(own))}
        rows.append(names | row | {name: own[name].mean() for name in SCORES[1:]})
    return pd.DataFrame(rows, columns=[name for name in COLUMNS if name in names or name not in COLUMNS[:4]])
