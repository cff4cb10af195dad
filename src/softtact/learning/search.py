"""Hyperparameter search: Optuna with its Hyperband pruner over layers, filters, hidden neurons and learning rate.

The trials are stored in a journal file. An interrupted search continues from it, discards the unfinished trial, and ends with the
same result, because each trial's draw depends only on the seed and the trials finished before it.

Several processes may share a journal and divide the trials; all end with the same table. The draws then depend on the order in
which trials finish. The trial of a process that dies is repeated by the others.
"""

import contextlib
import fcntl
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

import numpy as np
import optuna
import pandas as pd

from softtact.errors import ConvergenceError, InputError
from softtact.files import digest
from softtact.learning.settings import Search, SearchSpace, Training
from softtact.learning.training import start_run, train_network
from softtact.progress import announce

if TYPE_CHECKING:
    import optuna.storages.journal
    import torch

    from softtact.learning.dataset import Samples

WAIT_S = 1.0     # between two checks for trials left by other processes

optuna.logging.set_verbosity(optuna.logging.WARNING)


def search_hyperparameters(train: "Samples", validation: "Samples", *, options: Search, activation: str, ssim: dict[str, Any],
                           seed: int, device: "torch.device", journal: str | Path) -> optuna.Study:
    """Run the trials of `options` (a `Search`) that are not yet in `journal`; return the finished Optuna study."""
    train, journal = train.subset(options.maps, seed=seed), Path(journal)
    owner = search_digest(train, validation, options, activation, seed)
    journal.parent.mkdir(parents=True, exist_ok=True)
    with open(journal.with_suffix(".users"), "w") as users:
        study = join_study(users, journal, options=options, owner=owner)
        while unfinished(study, options):
            trial = claim_trial(study, journal, options=options, seed=seed)
            if trial is None:      # other processes run the last trials; if one dies, its trial is repeated
                time.sleep(WAIT_S)
                study = join_study(users, journal, options=options, owner=owner)
                continue
            announce(f"search for {train.model}: trial {trial.number + 1} of {options.trials}")
            record_result(study, trial, lambda trial: run_trial(
                trial, train, validation, options=options, activation=activation, ssim=ssim, seed=seed, device=device))
        return study


def unfinished(study: optuna.Study, options: Search) -> bool:
    """Whether a trial is not yet drawn or not yet finished."""
    return len(study.trials) < options.trials or not all(trial.state.is_finished() for trial in study.trials)


def claim_trial(study: optuna.Study, journal: Path, *, options: Search, seed: int) -> optuna.Trial | None:
    """Draw the next trial; None if all are drawn. One process at a time."""
    with open(journal.with_suffix(".claim"), "w") as claim:
        fcntl.flock(claim, fcntl.LOCK_EX)
        drawn = len(study.trials)
        if drawn >= options.trials:
            return None
        # The journal does not hold the state of a sampler, so each trial has a new one: a resumed search draws the same.
        study.sampler = make_sampler([seed, drawn])
        return study.ask()


def record_result(study: optuna.Study, trial: optuna.Trial, run: Callable[[optuna.Trial], float]) -> None:
    """Run a trial and record its value, or that it was pruned."""
    try:
        study.tell(trial, run(trial))
    except optuna.TrialPruned:
        study.tell(trial, state=optuna.trial.TrialState.PRUNED)


def run_trial(trial: optuna.Trial, train: "Samples", validation: "Samples", *, options: Search, activation: str,
              ssim: dict[str, Any], seed: int, device: "torch.device") -> float:
    """Train the network of a trial; return its smallest validation loss. Raises TrialPruned when Hyperband stops it."""
    drawn = draw(trial, options.space)
    network = {"filters": drawn["filters"], "dense": drawn["dense"], "activation": activation}
    run = start_run(train, network=network, learning_rate=drawn["learning_rate"], seed=seed, device=device)
    # No schedule and no patience, since Hyperband compares trials after equal numbers of epochs.
    training = Training(epochs=options.max_epochs, batch=options.batch, schedule="constant", patience=options.max_epochs)
    records = train_network(run, train, validation, options=training, ssim=ssim, seed=seed, checkpoint=None,
                            label=f"trial {trial.number}")
    try:
        for record in records:
            trial.report(record["validation_loss"], step=record["epoch"])
            if record["epoch"] < options.max_epochs and trial.should_prune():
                raise optuna.TrialPruned
    except ConvergenceError:  # a learning rate that is too high is a result, not a failure of the search
        raise optuna.TrialPruned from None
    return run.best["validation_loss"]


def draw(trial: optuna.Trial, space: SearchSpace) -> dict[str, Any]:
    """Hyperparameters of a trial: filters (list), dense, learning_rate."""
    layers = trial.suggest_int("layers", *space.depth)
    filters = [trial.suggest_int(f"filters_{layer}", *bounds) for layer, bounds in enumerate(space.filters[:layers], start=1)]
    return {"filters": filters, "dense": trial.suggest_int("dense", *space.dense, log=True),
            "learning_rate": trial.suggest_float("learning_rate", *space.learning_rate, log=True)}


def join_study(users: TextIO, journal: Path, *, options: Search, owner: str) -> optuna.Study:
    """The study, with a shared lock on `users`; a process that finds no other user discards unfinished trials."""
    fcntl.flock(users, fcntl.LOCK_UN)
    with contextlib.suppress(BlockingIOError):
        fcntl.flock(users, fcntl.LOCK_EX | fcntl.LOCK_NB)     # the system releases the lock of a process that dies
        open_study(journal, options=options, owner=owner, alone=True)
    fcntl.flock(users, fcntl.LOCK_SH)
    return open_study(journal, options=options, owner=owner, alone=False)


def open_study(journal: Path, *, options: Search, owner: str, alone: bool) -> optuna.Study:
    """The Optuna study `owner` in the journal file, created if needed; `alone`: discard unfinished trials."""
    backend = optuna.storages.journal.JournalFileBackend(
        str(journal), lock_obj=optuna.storages.journal.JournalFileOpenLock(str(journal)))
    storage = optuna.storages.JournalStorage(backend)
    pruner = optuna.pruners.HyperbandPruner(min_resource=1, max_resource=options.max_epochs,
                                            reduction_factor=options.reduction_factor)
    known: dict[str, Any] = {"storage": storage, "study_name": owner}
    study = optuna.create_study(**known, pruner=pruner, load_if_exists=True)
    finished = [trial for trial in study.trials if trial.state.is_finished() and trial.state.name != "FAIL"]
    if alone and len(finished) < len(study.trials):
        # Hyperband assigns brackets by the trial's number, so the numbers must have no gap.
        optuna.delete_study(**known)
        study = optuna.create_study(**known, pruner=pruner)
        study.add_trials(finished)
    return study


def make_sampler(seed: Sequence[int]) -> optuna.samplers.TPESampler:
    """Optuna's tree-structured Parzen sampler; `seed` is a list of integers."""
    return optuna.samplers.TPESampler(seed=int(np.random.SeedSequence(seed).generate_state(1)[0]))


def search_digest(train: "Samples", validation: "Samples", options: Search, activation: str, seed: int) -> str:
    """Name of the study, which depends on data and settings."""
    return digest([options.model_dump(exclude={"trials"}), activation, seed, train.digest(), validation.digest()])


def search_table(study: optuna.Study) -> pd.DataFrame:
    """A row per trial: trial, drawn values (empty for a missing layer), value (validation loss in counts), state, epochs."""
    rows = [{"trial": trial.number, **trial.params, "value": smallest_loss(trial), "state": trial.state.name.lower(),
             "epochs": len(trial.intermediate_values)} for trial in study.trials]
    table = pd.DataFrame(rows)
    filters = sorted(name for name in table if name.startswith("filters_"))
    return table[["trial", "layers", *filters, "dense", "learning_rate", "value", "state", "epochs"]]


def best_trial(study: optuna.Study) -> dict[str, Any]:
    """filters, dense, learning_rate, trial and validation_loss of the best finished trial; trials: their number."""
    candidates = [trial for trial in study.trials if np.isfinite(smallest_loss(trial))]
    if not candidates:
        raise InputError("the search: no trial reached a finite validation loss; lower search.space.learning_rate.")
    best = min(candidates, key=lambda trial: (trial.state.name != "COMPLETE", smallest_loss(trial)))
    layers = sorted((name for name in best.params if name.startswith("filters_")), key=lambda name: int(name[8:]))
    return {"filters": [best.params[name] for name in layers], "dense": best.params["dense"],
            "learning_rate": best.params["learning_rate"], "trial": best.number, "trials": len(study.trials),
            "validation_loss": smallest_loss(best)}


def smallest_loss(trial: optuna.trial.FrozenTrial) -> float:
    """Smallest validation loss among a trial's epochs in counts."""
    return min(trial.intermediate_values.values(), default=float("nan"))
