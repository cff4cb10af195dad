"""The learning rate of a network is found by trainings of that network; what was found for another one is refused."""

import numpy as np
import pandas as pd
import pytest
from formula_study import TINY, make_samples

from softtact.errors import InputError
from softtact.learning.settings import Network, Training, chosen_training, found_for
from softtact.learning.training import best_rate, try_rates

TRIAL, SEARCH = {"architecture": "printed", "learning_rate": 2e-4}, {"filters": [3], "dense": 8, "learning_rate": 5e-3}


def test_of_several_rates_the_one_with_the_least_validation_loss_is_taken_and_one_that_runs_away_is_not():
    options = Training(rates=(1e-5, 3e-3, 1e30), rate_epochs=3, batch=4)
    table = try_rates(make_samples(16), make_samples(6, first=100), network=TINY, options=options,
                      ssim={"window": 3, "data_range": 2400}, seed=1, device="cpu")
    assert table.learning_rate.tolist() == [1e-5, 3e-3, 1e30] and table.epochs.tolist()[:2] == [3, 3]
    assert best_rate(table) == 3e-3 and not table.validation_loss[2] < table.validation_loss[1]


def test_rates_that_all_run_away_are_refused():
    table = pd.DataFrame({"learning_rate": [1.0, 10.0], "validation_loss": [np.nan, np.inf]})
    with pytest.raises(InputError, match=r"none of training.rates, 1, 10, reached a finite validation loss; give lower ones"):
        best_rate(table)


@pytest.mark.parametrize(("architecture", "rate"), [("printed", 2e-4), ("searched", 5e-3), ("compact", 3e-3)])
def test_each_architecture_takes_the_rate_that_was_found_for_it(architecture, rate):
    network = Network(architecture=architecture)
    found = found_for(network, search=SEARCH, trial=TRIAL)
    assert chosen_training(Training(), network, found).learning_rate == rate


def test_the_printed_network_does_not_fall_back_to_the_rate_of_the_search():
    network = Network(architecture="printed")
    with pytest.raises(InputError, match="training.learning_rate is 'found', but no rate of the printed network is given"):
        chosen_training(Training(), network, found_for(network, search=SEARCH, trial=None))
    assert chosen_training(Training(learning_rate=0.01), network, None).learning_rate == 0.01
