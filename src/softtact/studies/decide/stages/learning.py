"""Scores of the readouts: formulas for all models at once, networks model by model."""

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from softtact.files import read_csv, write_csv
from softtact.studies.decide.config import MODELS
from softtact.studies.decide.scoring import (
    COLUMNS,
    MEAN_READING,
    NO_READOUT,
    Case,
    formula_predictions,
    mean_reading,
    object_scores,
    read_case,
)

if TYPE_CHECKING:
    from softtact.learning.dataset import Samples

CURVE_COLUMNS = ["truth", "model", "readout", "share", "indenters", "maps", "best_epoch", "epochs", "error_share", "ssim_own_range"]
_FIRST = 0     # seed of a curve's trainings


def score_formulas(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Score the gap formula with one gain and the quadratic, for all tested models against one truth, and the mean reading.

    inputs: readings, maps, sensor;  outputs: scores (CSV)
    settings: truth, seed, ssim_window, scored
    """
    case = read_case(inputs, settings["scored"])
    predicted = [(model, *one) for model in MODELS for one in formula_predictions(case, model)]
    predicted += [(MEAN_READING, NO_READOUT, *mean_reading(case))]
    frames = [object_scores(samples, counts, window=settings["ssim_window"], data_range=case.spec.largest_counts,
                            truth=settings["truth"], model=model, readout=readout, seed=0)
              for model, readout, samples, counts in predicted]
    write_csv(outputs["scores"], pd.concat(frames)[COLUMNS])


def learn(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Train a network on one model's maps of the indenters from several seeds, and score it on the objects.

    inputs: as of `score_formulas`;  outputs: scores (CSV)
    settings: truth, model, architecture, trained (values of `config.Trainings` without seeds), seeds, validation_share, device,
        seed, ssim_window, scored
    """
    work = _Work(read_case(inputs, settings["scored"]), settings, threads)
    write_csv(outputs["scores"], pd.concat([work.trained(work.training, seed)[0] for seed in settings["seeds"]])[COLUMNS])


def trace_curve(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Train a network on growing shares of the indenters; all of them are those of the first training.

    inputs: as of `score_formulas`, and whole (scores of `learn`, of seed 0 and others)
    outputs: curve (CSV: CURVE_COLUMNS; epochs of the whole are not known)
    settings: as of `learn`, with shares in place of seeds
    """
    work = _Work(read_case(inputs, settings["scored"]), settings, threads)
    rows = pd.DataFrame([*work.curve(), work.end_of_curve(read_csv(inputs["whole"]))], columns=CURVE_COLUMNS)
    write_csv(outputs["curve"], rows.astype({"best_epoch": "Int64", "epochs": "Int64"}))


class _Work:
    """The trainings of one model, truth and architecture."""

    def __init__(self, case: Case, settings: dict[str, Any], threads: int) -> None:
        from softtact.learning.training import prepare_torch

        self._case, self._settings, self._model = case, settings, settings["model"]
        self._device = prepare_torch(threads=threads, device=settings["device"])
        order = np.random.default_rng(settings["seed"]).permutation(case.indenters)
        kept = min(max(1, round(settings["validation_share"] * len(order))), len(order) - 1)
        self._validation = case.samples(self._model, list(order[:kept]), "validation")
        self.training = list(order[kept:])
        self._test = case.samples(self._model, case.objects, "test")

    def curve(self) -> Iterator[dict[str, Any]]:
        """A row for each share of the training indenters, first ones of one order."""
        for share in self._settings["shares"]:
            chosen = self.training[:max(1, round(share * len(self.training)))]
            scores, facts = self.trained(chosen, _FIRST)
            yield self._point(scores, share, chosen) | facts

    def end_of_curve(self, scores: pd.DataFrame) -> dict[str, Any]:
        """The row of all training indenters, from the scores of a `learn` job."""
        return self._point(scores[scores.seed == _FIRST], 1.0, self.training)

    def _point(self, scores, share, chosen):
        names = {"truth": self._settings["truth"], "model": self._model, "readout": self._settings["architecture"]}
        return names | {"share": share, "indenters": len(chosen), "maps": len(self._case.samples(self._model, chosen, "train")),
                        "error_share": scores.error_share.mean(), "ssim_own_range": scores.ssim_own_range.mean()}

    def trained(self, chosen: list[str], seed: int) -> tuple[pd.DataFrame, dict[str, Any]]:
        """Scores of the best network of one training on some indenters, and what is known of the training."""
        from softtact.learning.network import predict
        from softtact.learning.settings import Training
        from softtact.learning.training import start_run, train_network

        architecture, plan = self._settings["architecture"], self._settings["trained"]
        train = self._case.samples(self._model, chosen, "train")
        whole = max(1, math.ceil(len(self.training) * len(self._case.forces_n) / plan["batch"]))
        steps = max(1, math.ceil(len(train) / plan["batch"]))
        epochs = max(1, round(plan["epochs"] * whole / steps))     # as many steps for a share
        options = Training(epochs=epochs, batch=plan["batch"], patience=epochs, learning_rate=plan["learning_rate"])
        number = self._settings["seed"] + seed
        run = start_run(train, network={"architecture": architecture}, learning_rate=plan["learning_rate"], seed=number,
                        device=self._device)
        label = f"{self._settings['truth']}/{self._model}, {architecture}, {len(chosen)} indenters, seed {seed}"
        for _ in train_network(run, train, self._validation, options=options, ssim=self._ssim, seed=number, checkpoint=None,
                               label=label):
            pass
        run.network.load_state_dict(run.best["weights"])
        facts = {"best_epoch": run.best["epoch"], "epochs": run.epoch}
        return self._scored(self._test, predict(run.network, self._test.maps_mm), architecture, seed), facts

    @property
    def _ssim(self) -> dict[str, Any]:
        return {"window": self._settings["ssim_window"], "data_range": self._case.spec.largest_counts}

    def _scored(self, samples: "Samples", predicted: np.ndarray, architecture: str, seed: int) -> pd.DataFrame:
        return object_scores(samples, predicted, **self._ssim, truth=self._settings["truth"], model=self._model,
                             readout=architecture, seed=seed)
