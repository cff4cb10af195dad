"""The cost of a hybrid study before it starts.

It is an upper bound: all epochs count, although patience may end a training sooner, and each network of a search counts as the
printed one. Presses count individually, also if a fast model makes several in one job.
"""

import itertools
import math
import operator
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from softtact.errors import InputError
from softtact.studies.cost import Cost, finished_s, left_of, wall_s
from softtact.studies.hybrid.config import Study

if TYPE_CHECKING:
    from softtact.learning.settings import Search
    from softtact.studies.registry import OpenStudy

BYTES = 4          # per number in a data set; twice that in a press
READING_NUMBERS = 2          # numbers per taxel of a reading: loading and unloading


def costs_of_study(opened: "OpenStudy", measured: Mapping[str, Any], folder: str | Path) -> list[Cost]:
    """[Cost] of a `Study`, in the order of its stages. Raises InputError for a study on the published archive."""
    study, folder = opened.study, Path(folder)
    if study.archive:
        raise InputError(f"the study {study.name}: it reads the published archive, whose size is known only after the import; "
                         "costs can be estimated only for studies that press.")
    costs = [*_presses(study, measured, folder), _readings(study, measured, folder), *_learning(study, measured, folder)]
    return [*costs, Cost("all else", 1, int(not (folder / "report.html").exists()), measured["all_else_s"])]


def _presses(study, measured, folder):
    values = study.values
    load_steps, grid = len(values.forces_n), math.prod(study.spec.map_shape)
    for model in study.pressed_with:
        files = [folder / "presses" / item.set / item.id / f"{model}.nc" for item in study.items()]
        times, jobs = measured["presses"].get(model) or measured["presses"][values.models[model].kind], study.press_jobs(model)
        expected_s = times["fixed_s"] * len(jobs) / len(files) + load_steps * times["load_step_s"]
        disk_mb = len(files) * load_steps * grid * 2 * BYTES / 1e6
        seconds = _finished_press_s(folder, model, jobs) or expected_s
        yield Cost(f"simulate_press, {model}", len(files), left_of(files), seconds, disk_mb)


def _readings(study, measured, folder):
    files = [folder / "tactile" / item.set / f"{item.id}.nc" for item in study.items()]
    stage = "read_virtual_sensor" if study.virtual else "read_recordings"
    numbers = sum(map(study.readings_of, study.items())) * len(study.values.forces_n) * READING_NUMBERS
    taxels = study.spec.taxels.rows * study.spec.taxels.columns
    seconds = finished_s(folder, f"{stage}/*/*.tsv") or measured["reading_s"]     # mostly the start of a program
    return Cost(stage, len(files), left_of(files), seconds, numbers * taxels * 2 * BYTES / 1e6)


@dataclass(frozen=True)
class Sizes:
    """Number of samples (a map with its reading) in each split."""

    train: int
    validation: int
    tests: int

    @classmethod
    def of(cls, study: Study) -> "Sizes":
        """The numbers if all presses are within their models' validity."""
        load_steps, dataset = len(study.values.forces_n), study.values.dataset
        maps = {name: len(items) * load_steps for name, items in study.items_of.items()}
        trained = round(dataset.train_fraction * maps["indenters"])
        each = study.trials_of("indenters")
        return cls(train=round(trained * (1 if dataset.training_trials == "mean" else each)),
                   validation=round((maps["indenters"] - trained) * each),
                   tests=round(sum(maps[name] * study.trials_of(name) for name in ("unseen", "grasps"))))


def _learning(study, measured, folder):
    values, sizes, models = study.values, Sizes.of(study), study.tested
    numbers = math.prod(study.spec.map_shape) + study.spec.taxels.rows * study.spec.taxels.columns
    disk = (sizes.train + sizes.validation + sizes.tests) * numbers * BYTES * len(study.learnt_from) / 1e6
    times, chosen = measured["networks"], values.network.architecture
    beside = "printed" if chosen == "compact" else "compact"
    score = {kind: (sizes.validation + sizes.tests) * time["predict_map_s"] for kind, time in times.items()}
    searched = min(sizes.train, values.search.maps or sizes.train)
    search_s = values.search.trials * epochs_of_a_trial(values.search) * _epoch_s(times["printed"], searched, sizes)
    start_s = measured["start_s"]

    def stage(name, files, seconds, pattern, disk_mb=0.0):
        files = [folder / file for file in files]
        return Cost(name, len(files), left_of(files), finished_s(folder, pattern) or start_s + seconds, disk_mb)

    def learnt(name, among=models):
        return [f"learning/{model}/{name}" for model in among]

    return [
        stage("build_dataset", ["dataset/manifest.csv"], disk / measured["write_mb_per_s"], "build_dataset/*.tsv", disk),
        stage("search_hyperparameters", learnt("search.csv"), search_s, "search_hyperparameters/*.tsv"),
        *([stage("find_learning_rate", learnt("rate.json"), _rates_s(times["printed"], values, sizes), "find_learning_rate/*.tsv")]
          if "printed" in (chosen, beside) and values.training.learning_rate == "found" else []),
        stage(f"train_cnn, {chosen}", learnt("model.pt"), _training_s(times[_form(chosen)], chosen, values, sizes),
              "train_cnn/*.tsv"),
        stage(f"train_beside, {beside}", learnt(f"{beside}/model.pt"), _training_s(times[beside], beside, values, sizes),
              "train_beside/*.tsv"),
        stage("evaluate", ["evaluation/summary.csv"], len(models) * score[_form(chosen)], "evaluate/*.tsv"),
        stage("compare_networks", ["tables/networks.csv"], len(models) * sum(score.values()), "compare_networks/*.tsv"),
        *([stage("repeat_learning", learnt("seeds.csv"), _repeats_s(times, values, sizes), "repeat_learning/*.tsv")]
          if values.learning.seeds > 1 else []),
        *([stage("learning_curve", learnt("learning_curve.csv", study.learnt_from), _curve_s(times, values, sizes),
                 "learning_curve/*.tsv")] if values.learning_curve.shares else []),
    ]


def _form(architecture):
    """The architecture in the table of measured times; a searched network counts as printed."""
    return "printed" if architecture == "searched" else architecture


def _epoch_s(time, train, sizes):
    """Seconds of one epoch over `train` samples, with its validation."""
    return train * time["train_map_s"] + sizes.validation * time["predict_map_s"]


def epochs_of_a_trial(search: "Search") -> float:
    """Mean epochs of a trial under Hyperband: in each of Optuna's brackets one trial in `reduction_factor` continues."""
    factor = search.reduction_factor
    rungs = [factor**k for k in range(search.max_epochs.bit_length()) if factor**k <= search.max_epochs]     # 1, 3, 9, ...
    shares, means = [], []
    for bracket in range(len(rungs)):
        stops = [*rungs[bracket:], search.max_epochs]
        means.append(stops[0] + sum((high - low) / factor**(k + 1) for k, (low, high) in enumerate(itertools.pairwise(stops))))
        s = len(rungs) - 1 - bracket
        shares.append(math.ceil(len(rungs) * factor**s / (s + 1)))
    return sum(map(operator.mul, shares, means)) / sum(shares)


def _training_s(time, architecture, values, sizes):
    epochs = (architecture == "compact" and values.network.compact.epochs) or values.training.epochs
    return epochs * _epoch_s(time, sizes.train, sizes)


def _repeats_s(times, values, sizes):
    each = (_training_s(times[_form(kind)], kind, values, sizes) for kind in values.learning.networks)
    return values.learning.seeds * sum(each)


def _rates_s(time, values, sizes):
    return len(values.training.rates) * values.training.rate_epochs * _epoch_s(time, sizes.train, sizes)


def _curve_s(times, values, sizes):
    """Seconds of one model's learning curve: equal steps for each share, and a prediction of all test maps after each."""
    total, batch = 0.0, values.training.batch
    for kind in values.learning_curve.networks:
        time = times[_form(kind)]
        for share in values.learning_curve.shares:
            part = max(1, round(share * sizes.train))
            epochs = max(1, round(values.learning_curve.steps / math.ceil(part / batch)))
            total += epochs * _epoch_s(time, part, sizes) + (sizes.validation + sizes.tests) * time["predict_map_s"]
    return total


def _finished_press_s(folder, model, jobs):
    """Mean wall time of a model's finished presses, or None. jobs: [[Item]], since several presses may share a job."""
    seconds, presses = 0.0, 0
    for items in jobs:
        stage = "simulate_press" if len(items) == 1 else "simulate_presses"
        path = folder / "benchmarks" / stage / items[0].set / items[0].id / f"{model}.tsv"
        took = wall_s(path) if path.exists() else None
        if took is not None:
            seconds, presses = seconds + took, presses + len(items)
    return seconds / presses if presses else None
