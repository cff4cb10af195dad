"""The training loop: it learns, it repeats itself, and it goes on where it was cut off."""

import numpy as np
import pytest
import torch
from formula_study import TINY, make_samples

from softtact.errors import ConvergenceError
from softtact.learning.network import load, predict, summed_l1
from softtact.learning.settings import Training
from softtact.learning.training import prepare_torch, scheduled_rate, start_run, train_network

SSIM = {"window": 3, "data_range": 2400}


@pytest.fixture(autouse=True)
def cpu():
    return prepare_torch(threads=1)


@pytest.fixture(scope="module")
def train():
    return make_samples(16)


@pytest.fixture(scope="module")
def validation():
    return make_samples(6, first=100, split="validation")


def new_run(train, *, seed=1, rate=3e-3, network=TINY):
    return start_run(train, network=network, learning_rate=rate, seed=seed, device="cpu")


def train_to_end(run, train, validation, *, seed=1, checkpoint=None, stop_after=None, **options):
    options = Training(**{"epochs": 4, "batch": 4, "checkpoint_every_s": 0, **options})
    records = train_network(run, train, validation, options=options, ssim=SSIM, seed=seed, checkpoint=checkpoint)
    for record in records:
        if record["epoch"] == stop_after:
            break
    return run


def same_weights(a, b):
    b = b.network.state_dict()
    return all(torch.equal(tensor, b[name]) for name, tensor in a.network.state_dict().items())


@pytest.mark.slow
def test_it_learns_eight_maps_by_heart():
    few = make_samples(8)
    network = {"filters": (8, 8, 8), "dense": 128, "activation": "relu"}  # with less, dead neurons are a matter of luck
    run = train_to_end(new_run(few, rate=2e-3, network=network), few, few, epochs=150, patience=150, batch=8)
    assert run.history[0]["train_loss"] > 2000
    assert run.best["validation_loss"] < 0.05 * run.history[0]["train_loss"]


COMPACT = {"architecture": "compact"}


def test_the_compact_network_learns_more_than_ten_times_as_many_weights_in_equal_steps():
    few, unseen = make_samples(48), make_samples(16, first=1000, split="validation")
    networks = {"printed": {"filters": (8, 8, 8), "dense": 64, "activation": "relu"}, "compact": COMPACT}
    runs = {name: train_to_end(new_run(few, rate=2e-3, network=network), few, unseen, epochs=8, batch=8)
            for name, network in networks.items()}
    weights = {name: sum(tensor.numel() for tensor in run.network.parameters()) for name, run in runs.items()}
    assert weights["printed"] > 10 * weights["compact"]
    assert runs["compact"].best["validation_loss"] < 0.6 * runs["printed"].best["validation_loss"]
    assert runs["compact"].history[-1]["validation_ssim"] > runs["printed"].history[-1]["validation_ssim"]


def test_the_compact_network_resumes_to_the_same_weights(train, validation, tmp_path):
    undisturbed = train_to_end(new_run(train, network=COMPACT), train, validation)
    train_to_end(new_run(train, network=COMPACT), train, validation, checkpoint=tmp_path / "c.pt", stop_after=2)
    resumed = train_to_end(new_run(train, network=COMPACT), train, validation, checkpoint=tmp_path / "c.pt")
    assert same_weights(resumed, undisturbed)


def test_the_loss_is_reported_in_counts(train, validation):
    run = train_to_end(new_run(train), train, validation, epochs=1)
    predicted = torch.from_numpy(predict(run.network, validation.maps_mm))
    assert run.history[0]["validation_loss"] == pytest.approx(
        summed_l1(predicted, torch.from_numpy(validation.counts)).item(), rel=1e-6)


def test_maps_and_counts_are_scaled_by_the_training_sets_largest(train):
    network = new_run(train).network
    assert network.map_scale_mm.item() == train.maps_mm.max() and network.count_scale.item() == train.counts.max()


def test_the_same_seed_gives_the_same_weights_and_another_seed_others(train, validation):
    first, second, other = (train_to_end(new_run(train, seed=seed), train, validation, seed=seed, epochs=2)
                            for seed in (1, 1, 2))
    assert same_weights(first, second) and not same_weights(first, other)


@pytest.mark.parametrize("stop_after", [1, 3])
def test_a_training_that_was_cut_off_ends_with_the_same_weights(train, validation, tmp_path, stop_after):
    undisturbed = train_to_end(new_run(train), train, validation)
    train_to_end(new_run(train), train, validation, checkpoint=tmp_path / "c.pt", stop_after=stop_after)
    resumed = new_run(train)
    epochs = [record["epoch"] for record in train_network(
        resumed, train, validation, options=Training(epochs=4, batch=4), ssim=SSIM, seed=1, checkpoint=tmp_path / "c.pt")]
    assert epochs == list(range(stop_after + 1, 5)), "it must go on, not start anew"
    assert same_weights(resumed, undisturbed)
    losses = [[record["validation_loss"] for record in run.history] for run in (resumed, undisturbed)]
    assert losses[0] == losses[1] and resumed.best["epoch"] == undisturbed.best["epoch"]


def test_a_checkpoint_of_another_training_is_not_taken_up(train, validation, tmp_path):
    train_to_end(new_run(train), train, validation, checkpoint=tmp_path / "c.pt", stop_after=2)
    run = train_to_end(new_run(train), train, make_samples(6, first=200), checkpoint=tmp_path / "c.pt")
    assert same_weights(run, train_to_end(new_run(train), train, make_samples(6, first=200)))


def test_a_training_does_not_go_on_from_one_whose_history_has_another_ssim(train, validation, tmp_path):
    train_to_end(new_run(train), train, validation, checkpoint=tmp_path / "c.pt", stop_after=2)
    other, options = new_run(train), Training(epochs=4, batch=4)
    records = train_network(other, train, validation, options=options, ssim=SSIM | {"data_range": 100.0}, seed=1,
                            checkpoint=tmp_path / "c.pt")
    assert [record["epoch"] for record in records] == [1, 2, 3, 4]


def test_checkpoints_keep_their_distance_in_time(train, validation, tmp_path):
    train_to_end(new_run(train), train, validation, checkpoint=tmp_path / "c.pt", checkpoint_every_s=3600)
    assert not (tmp_path / "c.pt").exists()


def test_a_checkpoint_holds_tensors_and_plain_values_only(train, validation, tmp_path):
    train_to_end(new_run(train), train, validation, checkpoint=tmp_path / "c.pt", stop_after=1)
    assert set(load(tmp_path / "c.pt")) == {"owner", "network", "optimiser", "history", "best"}


def test_it_stops_when_patience_ends(train, validation):
    run = train_to_end(new_run(train, rate=1e-12), train, validation, epochs=50, patience=2, schedule="constant")
    assert run.epoch == run.best["epoch"] + 2 < 50


def test_the_best_epochs_weights_are_kept_not_the_last(train, validation):
    run = train_to_end(new_run(train, rate=0.05), train, validation, epochs=8, patience=8)
    losses = [record["validation_loss"] for record in run.history]
    assert run.best["validation_loss"] == min(losses) and run.best["epoch"] == 1 + int(np.argmin(losses))


def test_the_schedule_falls_from_the_rate_towards_zero():
    options = Training(epochs=10)
    rates = [scheduled_rate(0.1, epoch, options) for epoch in range(11)]
    assert rates[0] == 0.1 and rates[5] == pytest.approx(0.05) and rates[10] == pytest.approx(0)
    assert all(a > b for a, b in zip(rates, rates[1:], strict=False))
    assert scheduled_rate(0.1, 7, Training(epochs=10, schedule="constant")) == 0.1


def test_a_loss_that_is_not_finite_stops_the_training_with_the_remedy(train, validation):
    with pytest.raises(ConvergenceError, match="lower the learning rate"):
        train_to_end(new_run(train, rate=1e30), train, validation)


def test_a_training_of_one_step_that_runs_away_is_told_by_its_validation_loss(train, validation):
    with pytest.raises(ConvergenceError, match=r"epoch 1: the validation loss is not finite at learning rate 1e\+30; lower"):
        train_to_end(new_run(train, rate=1e30), train, validation, epochs=1, batch=16)
