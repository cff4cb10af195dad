"""The training of image generators on tiny sequences."""

import numpy as np
import pytest
import torch

from softtact.errors import ConvergenceError, InputError
from softtact.learning.image_data import ImageSequences, from_network, open_sequences, to_network
from softtact.learning.image_networks import ImageGenerator, PatchDiscriminator, adversarial_loss, make_networks
from softtact.learning.image_settings import ImageTraining
from softtact.learning.image_training import (
    check_memory,
    generate,
    rate_at,
    start_image_run,
    step_memory_gb,
    train_images,
    train_step,
)

OPTIONS = ImageTraining(epochs=2, constant_epochs=1, learning_rate=2e-3)


def _sequences(count=3, frames=4, pixels=8):
    rng = np.random.default_rng(0)
    grey = rng.integers(0, 256, (count * frames, pixels, pixels), dtype=np.uint8)
    image = np.stack([255 - grey, grey // 2, np.full_like(grey, 40)], axis=-1)
    return ImageSequences([grey], [image], frames * np.arange(count), np.full(count, frames), "made up")


def _run(options=OPTIONS, seed=0, **network):
    generator = ImageGenerator(pixels=8, channels=(4, 6, 8), **{"dropout": 0.5, **network})
    return start_image_run(generator, PatchDiscriminator(channels=(4, 4)), options, seed=seed)


def _weights(run):
    return torch.cat([parameter.detach().ravel() for parameter in run.generator.parameters()])


def test_the_rate_is_constant_for_ten_epochs_and_falls_linearly_to_0():
    options = ImageTraining()
    assert [rate_at(options, done) for done in (0, 9.5, 10)] == [2e-4] * 3
    assert rate_at(options, 15) == pytest.approx(1e-4)
    assert rate_at(options, 20) == 0


def test_the_optimisers_have_the_printed_rate_and_momenta():
    for optimiser in _run(ImageTraining()).optimisers.values():
        assert optimiser.defaults["lr"] == 2e-4
        assert optimiser.defaults["betas"] == (0.5, 0.999)


def test_a_step_changes_both_networks_and_reports_the_losses_before_it():
    run = _run()
    before, judge = _weights(run).clone(), next(run.discriminator.parameters()).detach().clone()
    depth, image = _sequences().tensors(np.arange(4))
    losses = train_step(run, depth, image, OPTIONS)
    assert set(losses) == {"discriminator", "adversarial", "l1"}
    assert (_weights(run) != before).any()
    assert (next(run.discriminator.parameters()) != judge).any()


def test_the_generator_descends_on_the_printed_loss():
    """The gradient of a step is that of L_adv + 100 L_L1, found anew by a difference along it."""
    options = ImageTraining(learning_rate=1e-30)     # so small that no weight moves
    run = _run(options, dropout=0.0)
    depth, image = (part.double() for part in _sequences().tensors(np.arange(4)))
    run.generator.double(), run.discriminator.double()
    weight = next(run.generator.parameters())
    train_step(run, depth, image, options)
    gradient, losses = weight.grad.clone(), []
    for side in (-1, 1):
        with torch.no_grad():
            weight += side * (1e-6 if side < 0 else 2e-6) * gradient / gradient.norm()
        losses.append(_loss(run, depth, image))
    assert (losses[1] - losses[0]) / 2e-6 == pytest.approx(gradient.norm().item(), rel=1e-3)


def _loss(run, depth, image):
    with torch.no_grad():
        made = run.generator(depth)
        return (adversarial_loss(run.discriminator(depth, made), real=True) + 100 * (made - image).abs().mean()).item()


def test_training_brings_the_images_nearer():
    run = _run(dropout=0.0)
    options = ImageTraining(epochs=8, constant_epochs=8, learning_rate=5e-3)
    history = list(train_images(run, _sequences(), options=options, seed=0))
    assert history[-1]["l1"] < 0.8 * history[0]["l1"]


def test_an_interrupted_training_ends_with_the_same_weights(tmp_path):
    options = OPTIONS.model_copy(update={"checkpoint_every_s": 1e-9})     # after each step
    whole = _run()
    list(train_images(whole, _sequences(), options=options, seed=0))
    first, file = _run(), tmp_path / "checkpoint.pt"
    calls = 0

    class Ending(ImageSequences):
        def tensors(self, frames):
            nonlocal calls
            calls += 1
            if calls == 5:     # in the second epoch
                raise KeyboardInterrupt
            return super().tensors(frames)

    data = _sequences()
    with pytest.raises(KeyboardInterrupt):
        list(train_images(first, Ending(**data.__dict__), options=options, seed=0, checkpoint=file))
    second = _run(seed=1)
    records = list(train_images(second, data, options=options, seed=0, checkpoint=file))
    assert len(records) == 1
    assert torch.equal(_weights(second), _weights(whole))


@pytest.mark.parametrize("momenta", [[0.5, 1.0], [-0.1, 0.9], [float("nan"), 0.9]])
def test_momenta_that_adam_does_not_take_are_refused_with_their_key(momenta):
    with pytest.raises(InputError, match="networks.training.momenta"):
        ImageTraining.from_dict({"momenta": momenta}, where="networks.training")


def test_a_checkpoint_of_another_training_is_not_resumed(tmp_path):
    options, file = OPTIONS.model_copy(update={"checkpoint_every_s": 1e-9}), tmp_path / "checkpoint.pt"
    list(train_images(_run(), _sequences(), options=options, seed=0, checkpoint=file))
    assert len(list(train_images(_run(), _sequences(), options=options, seed=1, checkpoint=file))) == options.epochs


def test_equal_seeds_give_equal_weights():
    ends = []
    for seed in (0, 0, 1):
        run = _run(seed=seed)
        list(train_images(run, _sequences(), options=OPTIONS, seed=seed))
        ends.append(_weights(run))
    assert torch.equal(ends[0], ends[1])
    assert not torch.equal(ends[0], ends[2])


def test_shuffled_frames_are_all_taken_once_an_epoch():
    taken = []

    class Noting(ImageSequences):
        def tensors(self, frames):
            taken.append(frames)
            return super().tensors(frames)

    options = ImageTraining(epochs=1, constant_epochs=1, shuffle_frames=True, frames=4)
    list(train_images(_run(options), Noting(**_sequences().__dict__), options=options, seed=0))
    assert sorted(np.concatenate(taken)) == list(range(12))
    assert not np.array_equal(np.sort(taken[0]), taken[0])


def test_a_loss_that_is_not_finite_ends_the_training_in_one_sentence():
    run = _run()
    with torch.no_grad():
        next(run.generator.parameters()).fill_(float("nan"))
    with pytest.raises(ConvergenceError, match=r"a loss is not finite after 0 steps; lower learning_rate"):
        list(train_images(run, _sequences(), options=OPTIONS, seed=0))


def test_images_go_to_the_network_and_back_unchanged():
    image = np.arange(256, dtype=np.uint8).reshape(1, 16, 16, 1).repeat(3, axis=-1)
    assert np.array_equal(from_network(to_network(image)), image)
    assert to_network(image[..., 0]).shape == (1, 16, 16, 3)


def test_a_generator_makes_images_of_a_sequence():
    made = generate(_run().generator, np.zeros((3, 8, 8), dtype=np.uint8))
    assert made.shape == (3, 8, 8, 3)
    assert made.dtype == np.uint8


def test_the_memory_of_a_step_is_near_the_measured_one():
    """Measured on Linux beside an idle process: 0.20 GB with 26 frames, 0.59 GB with 208, of the printed ones with 2 1.52 GB."""
    reduced = make_networks("proposed")
    assert step_memory_gb(*reduced, frames=26) == pytest.approx(0.20, rel=0.25)
    assert step_memory_gb(*reduced, frames=208) == pytest.approx(0.59, rel=0.25)
    with torch.device("meta"):
        printed = make_networks("proposed", size="printed")
    assert step_memory_gb(*printed, frames=2) == pytest.approx(1.52, rel=0.25)


def test_a_training_without_the_memory_for_it_is_refused():
    with pytest.raises(InputError, match=r"networks.size: a step of 100000000 frames takes about .* write size: reduced"):
        check_memory(*make_networks("proposed"), frames=100_000_000, device=torch.device("cpu"))
    check_memory(*make_networks("proposed"), frames=1, device=torch.device("cpu"))


def test_sequences_are_read_from_files(tmp_path):
    paths = [_write_sequences(tmp_path / f"{name}.nc", splits, start) for name, splits, start in (
        ("a", ["train", "train", "test"], 0), ("b", ["train"], 100))]
    data = open_sequences(paths, split="train")
    assert len(data) == 3
    grey, image = data.arrays(data.frames_of(2))
    assert grey[:, 0, 0].tolist() == [100, 101, 102]
    assert image.shape == (3, 4, 4, 3)
    with pytest.raises(InputError, match="no sequence is of the split 'unseen'; press more poses"):
        open_sequences(paths, split="unseen")


def test_sequences_pressed_anew_into_a_file_of_the_same_size_have_another_digest(tmp_path):
    path, other, digests, sizes = tmp_path / "a.nc", tmp_path / "b.nc", [], set()
    for start in (0, 100, 0):
        _write_sequences(path, ["train"], start)
        digests.append(open_sequences([path], split="train").digest())
        sizes.add(path.stat().st_size)
    assert len(sizes) == 1 and digests[0] != digests[1]
    other.write_bytes(path.read_bytes())
    assert open_sequences([other], split="train").digest() == digests[2]


def test_a_file_without_sequences_is_refused(tmp_path):
    path = tmp_path / "other.nc"
    path.write_bytes(b"not a data set")
    with pytest.raises(InputError, match="not a file of image sequences"):
        open_sequences([path], split="train")


def _write_sequences(path, splits, start):
    import xarray

    from softtact.files import write_dataset

    frames = 3 * len(splits)
    grey = (start + np.arange(frames, dtype=np.uint8))[:, None, None] * np.ones((1, 4, 4), dtype=np.uint8)
    data = xarray.Dataset({"depth_grey": (("frame", "row", "column"), grey),
                           "image": (("frame", "row", "column", "channel"), np.repeat(grey[..., None], 3, axis=-1)),
                           "sequence": ("frame", np.repeat(np.arange(len(splits)), 3)),
                           "split": ("frame", np.repeat(np.array(splits, dtype=object), 3))})
    write_dataset(path, data, seed=None, settings={})
    return path
