"""How a training ended: what remains of the loss follows from its history."""

import numpy as np
import pandas as pd
import pytest

from softtact.evaluation.networks import convergence


def history(validation, train):
    return pd.DataFrame({"epoch": np.arange(1, len(validation) + 1), "train_loss": train, "validation_loss": validation,
                         "learning_rate": 1e-4})


LATE = [900, 600, 500, 400, 300, 300, 300, 300]


def test_unseen_indenters_show_that_data_are_missing_where_validation_maps_do_not():
    assert convergence(history(LATE, 290), noise_loss=50, unseen_loss=900)["remains"] == "data"
    assert convergence(history(LATE, 290), noise_loss=290, unseen_loss=900)["remains"] == "data"     # validation is at the noise


@pytest.mark.parametrize(("validation", "train", "noise", "remains"), [
    ([900, 600, 400, 250, 210, 205, 204, 204], 200, 190, "noise"),
    ([900, 800, 700, 600, 500, 400, 300, 200], 190, 50, "optimiser"),
    (LATE, 100, 50, "data"),
    (LATE, 290, 50, "network"),
    (LATE, 290, np.nan, "network"),
    ([900, 300], 290, 50, "optimiser")])       # too few epochs to tell
def test_what_remains_of_the_loss(validation, train, noise, remains):
    found = convergence(history(validation, train), noise_loss=noise)
    assert found["remains"] == remains
    assert found["validation_loss"] == min(validation) and found["best_epoch"] == 1 + int(np.argmin(validation))
