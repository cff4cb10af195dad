"""The hyperparameter search: it draws from its space, prunes, resumes and repeats itself."""

import multiprocessing
import threading
import time
from pathlib import Path

import pandas as pd
import pytest
from formula_study import make_samples

from softtact.learning import search as searching
from softtact.learning.search import best_trial, search_hyperparameters, search_table
from softtact.learning.settings import Search
from softtact.learning.training import prepare_torch

OPTIONS = Search(trials=8, max_epochs=4, batch=4, reduction_factor=2, maps=12,
                 space={"layers": [2, 3], "filters": [[2, 4], [2, 4], [2, 4]], "dense": [4, 24], "learning_rate": [1e-5, 1e-2]})


def search(journal, **changes):
    return search_hyperparameters(
        make_samples(16), make_samples(4, first=100, split="validation"), options=OPTIONS.model_copy(update=changes),
        activation="relu", ssim={"window": 3, "data_range": 2400}, seed=5, device=prepare_torch(threads=1),
        journal=journal)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    return search_table(search(tmp_path_factory.mktemp("search") / "search.journal"))


def test_the_table_has_a_row_per_trial_drawn_from_the_space(undisturbed):
    assert undisturbed.columns.tolist() == [
        "trial", "layers", "filters_1", "filters_2", "filters_3", "dense", "learning_rate", "value", "state", "epochs"]
    assert undisturbed.trial.tolist() == list(range(8))
    assert set(undisturbed.layers) == {2, 3} and (undisturbed.filters_3.isna() == (undisturbed.layers == 2)).all()
    assert undisturbed.filters_2.between(2, 4).all() and undisturbed.dense.between(4, 24).all()
    assert undisturbed.learning_rate.between(1e-5, 1e-2).all() and undisturbed.learning_rate.nunique() == 8


def test_hyperband_stops_trials_early_and_lets_others_finish(undisturbed):
    assert set(undisturbed.state) == {"complete", "pruned"}
    assert (undisturbed[undisturbed.state == "complete"].epochs == 4).all()
    assert (undisturbed[undisturbed.state == "pruned"].epochs < 4).all()


def test_the_same_seed_gives_the_same_table(undisturbed, tmp_path):
    pd.testing.assert_frame_equal(search_table(search(tmp_path / "search.journal")), undisturbed, check_exact=True)


def test_a_search_that_was_cut_off_in_a_trial_ends_as_an_undisturbed_one(undisturbed, tmp_path, monkeypatch):
    journal, true_run = tmp_path / "search.journal", searching.run_trial

    def killed_in_the_fourth(trial, *arguments, **options):
        if trial.number == 3:
            raise KeyboardInterrupt
        return true_run(trial, *arguments, **options)

    monkeypatch.setattr(searching, "run_trial", killed_in_the_fourth)
    with pytest.raises(KeyboardInterrupt):
        search(journal)
    numbers = []
    monkeypatch.setattr(searching, "run_trial",
                        lambda trial, *a, **o: numbers.append(trial.number) or true_run(trial, *a, **o))
    table = search_table(search(journal))
    assert numbers == [3, 4, 5, 6, 7], "finished trials must not run again"
    pd.testing.assert_frame_equal(table, undisturbed, check_exact=True)


def search_in_a_process(journal, trials, started=None):
    """In a process of its own: search; with `started`, the first trial tells that it runs, and lasts for an hour."""
    if started is not None:
        searching.run_trial = lambda *arguments, **options: started.set() or time.sleep(3600)
    search(Path(journal), trials=trials)


@pytest.mark.slow
def test_processes_share_a_search_and_end_with_the_same_table(tmp_path):
    spawn = multiprocessing.get_context("spawn")
    other = spawn.Process(target=search_in_a_process, args=(tmp_path / "search.journal", 8))
    other.start()
    own = search_table(search(tmp_path / "search.journal"))
    other.join(600)
    assert other.exitcode == 0
    assert own.trial.tolist() == list(range(8)) and set(own.state) <= {"complete", "pruned"}
    pd.testing.assert_frame_equal(search_table(search(tmp_path / "search.journal")), own, check_exact=True)


@pytest.mark.slow
def test_the_trial_of_a_process_that_died_is_done_by_the_others(tmp_path):
    spawn = multiprocessing.get_context("spawn")
    started = spawn.Event()
    dying = spawn.Process(target=search_in_a_process, args=(tmp_path / "search.journal", 3, started))
    dying.start()
    assert started.wait(600)
    threading.Timer(1.0, dying.kill).start()       # while this process is at work or waits
    table = search_table(search(tmp_path / "search.journal", trials=3))
    dying.join(600)
    assert dying.exitcode != 0
    assert table.trial.tolist() == [0, 1, 2] and set(table.state) <= {"complete", "pruned"}


def test_a_finished_search_runs_nothing_again(tmp_path, monkeypatch):
    search(tmp_path / "search.journal", trials=1)
    monkeypatch.setattr(searching, "run_trial", None)
    assert len(search(tmp_path / "search.journal", trials=1).trials) == 1


def test_the_best_trial_is_the_finished_one_with_the_smallest_loss(tmp_path):
    study = search(tmp_path / "search.journal")
    best, table = best_trial(study), search_table(study)
    complete = table[table.state == "complete"]
    assert best["trial"] == complete.loc[complete.value.idxmin(), "trial"]
    assert best["validation_loss"] == complete.value.min() and len(best["filters"]) == 3


def test_a_diverging_trial_is_pruned_not_fatal(tmp_path):
    space = OPTIONS.space.model_copy(update={"learning_rate": (1e30, 1e31)})
    study = search(tmp_path / "search.journal", trials=1, space=space)
    assert search_table(study).state.tolist() == ["pruned"]
    with pytest.raises(Exception, match="no trial reached a finite validation loss"):
        best_trial(study)
