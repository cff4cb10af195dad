"""Hyperparameter search: Optuna with its Hyperband pruner over filters, hidden neurons and learning rate.

The trials stand in a journal file. A search that was cut off takes it up, forgets the trial that was under way, and
ends as it would have: each trial's draw depends on the seed and the trials finished before it.
"""

from pathlib import Path

import numpy as np
import optuna
import pandas as pd

from softtact.errors import ConvergenceError, InputError
from softtact.files import digest
from softtact.learning.settings import Training
from softtact.learning.training import start_run, train_network
from softtact.progress import progress

optuna.logging.set_verbosity(optuna.logging.WARNING)


def search_hyperparameters(train, validation, *, options, activation, ssim, seed, device, journal):
    """Run the trials of `options` (a `Search`) that `journal` does not hold yet; returns the finished Optuna study."""
    train = train.subset(options.maps, seed=seed)
    study = open_study(journal, options=options, owner=search_digest(train, validation, options, activation, seed))
    left = options.trials - len(study.trials)
    for _ in progress(range(left), label=f"search for {train.model}", total=left):
        # A sampler's own state is not in the journal: a fresh one per trial makes resuming harmless.
        study.sampler = make_sampler([seed, len(study.trials)])
        study.optimize(lambda trial: run_trial(trial, train, validation, options=options, activation=activation,
                                               ssim=ssim, seed=seed, device=device), n_trials=1)
    return study


def run_trial(trial, train, validation, *, options, activation, ssim, seed, device):
    """Train the network that a trial draws; returns its smallest validation loss, or leaves when Hyperband prunes it."""
    drawn = draw(trial, options.space)
    network = {"filters": drawn["filters"], "dense": drawn["dense"], "activation": activation}
    run = start_run(train, network=network, learning_rate=drawn["learning_rate"], seed=seed, device=device)
    # No schedule and no patience: Hyperband compares trials by what they reach after equal numbers of epochs.
    training = Training(epochs=options.max_epochs, batch=options.batch, schedule="constant", patience=options.max_epochs)
    records = train_network(run, train, validation, options=training, ssim=ssim, seed=seed, checkpoint=None,
                            label=f"trial {trial.number}")
    try:
        for record in records:
            trial.report(record["validation_loss"], step=record["epoch"])
            if record["epoch"] < options.max_epochs and trial.should_prune():
                raise optuna.TrialPruned
    except ConvergenceError:  # too high a rate is a finding, not a failure of the search
        raise optuna.TrialPruned from None
    return run.best["validation_loss"]


def draw(trial, space):
    """Hyperparameters of a trial: filters (list), dense, learning_rate."""
    filters = [trial.suggest_int(f"filters_{layer}", *bounds) for layer, bounds in enumerate(space.filters, start=1)]
    return {"filters": filters, "dense": trial.suggest_int("dense", *space.dense, log=True),
            "learning_rate": trial.suggest_float("learning_rate", *space.learning_rate, log=True)}


def open_study(journal, *, options, owner):
    """The Optuna study `owner` in the journal file, made if it is not there, without an unfinished trial."""
    journal = Path(journal)
    journal.parent.mkdir(parents=True, exist_ok=True)
    backend = optuna.storages.journal.JournalFileBackend(
        str(journal), lock_obj=optuna.storages.journal.JournalFileOpenLock(str(journal)))
    storage = optuna.storages.JournalStorage(backend)
    pruner = optuna.pruners.HyperbandPruner(min_resource=1, max_resource=options.max_epochs,
                                            reduction_factor=options.reduction_factor)
    known = {"storage": storage, "study_name": owner}
    study = optuna.create_study(**known, pruner=pruner, load_if_exists=True)
    finished = [trial for trial in study.trials if trial.state.is_finished() and trial.state.name != "FAIL"]
    if len(finished) < len(study.trials):
        # Hyperband's brackets go by a trial's number: the numbers must go on without a gap.
        optuna.delete_study(**known)
        study = optuna.create_study(**known, pruner=pruner)
        study.add_trials(finished)
    return study


def make_sampler(seed):
    """Optuna's tree-structured Parzen sampler; `seed` is a list of integers."""
    return optuna.samplers.TPESampler(seed=int(np.random.SeedSequence(seed).generate_state(1)[0]))


def search_digest(train, validation, options, activation, seed):
    """Name of the study: other data or settings get another one."""
    return digest([options.model_dump(exclude={"trials"}), activation, seed, train.digest(), validation.digest()])


def search_table(study):
    """A row per trial: trial, the drawn values, value (validation loss, counts), state, epochs."""
    rows = [{"trial": trial.number, **trial.params, "value": smallest_loss(trial), "state": trial.state.name.lower(),
             "epochs": len(trial.intermediate_values)} for trial in study.trials]
    return pd.DataFrame(rows)


def best_trial(study):
    """filters, dense, learning_rate, trial and validation_loss of the finished trial with the smallest loss."""
    candidates = [trial for trial in study.trials if np.isfinite(smallest_loss(trial))]
    if not candidates:
        raise InputError("the search: no trial reached a finite validation loss; lower search.space.learning_rate.")
    best = min(candidates, key=lambda trial: (trial.state.name != "COMPLETE", smallest_loss(trial)))
    layers = sorted((name for name in best.params if name.startswith("filters_")), key=lambda name: int(name[8:]))
    return {"filters": [best.params[name] for name in layers], "dense": best.params["dense"],
            "learning_rate": best.params["learning_rate"], "trial": best.number,
            "validation_loss": smallest_loss(best)}


def smallest_loss(trial):
    """Smallest validation loss among a trial's epochs, counts."""
    return min(trial.intermediate_values.values(), default=float("nan"))
