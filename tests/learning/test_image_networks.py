"""The networks of marker images: the printed sizes, and what each can see."""

import numpy as np
import pytest
import torch

from softtact.errors import InputError
from softtact.learning.image_networks import (
    ImageGenerator,
    PatchDiscriminator,
    adversarial_loss,
    count_weights,
    load_generator,
    make_networks,
    patch_score,
    save_generator,
)
from softtact.learning.image_settings import NETWORKS


def _small(**options):
    torch.manual_seed(0)
    return ImageGenerator(pixels=8, channels=(4, 6, 8), dropout=0.0, **options).eval()


@pytest.fixture
def on_meta():
    """Shapes and sizes without numbers."""
    with torch.device("meta"):
        yield


def test_the_printed_networks_have_the_printed_weights(on_meta):
    generator, discriminator = make_networks("proposed", size="printed")
    assert f"{count_weights(generator) / 1e6:.1f}" == "58.6"
    assert f"{count_weights(discriminator) / 1e6:.1f}" == "2.8"


def test_without_lstm_the_weights_are_those_of_pix2pix(on_meta):
    generator, discriminator = make_networks("pix2pix", size="printed")
    assert count_weights(generator) == 54_413_955        # of the authors' code of Pix2Pix, UNet of 256 pixels
    assert count_weights(discriminator) == 2_768_705     # and of its PatchGAN with six channels


def test_the_lstm_layers_add_what_two_layers_of_512_have(on_meta):
    plain, with_memory = (make_networks(name, size="printed")[0] for name in ("no_lstm", "proposed"))
    assert count_weights(with_memory) - count_weights(plain) == 2 * 4 * 512 * (512 + 512 + 2)


def test_a_kernel_of_three_frames_does_not_give_the_printed_weights(on_meta):
    assert count_weights(make_networks("temporal", size="printed")[0]) > 160e6


def test_the_printed_shapes():
    """On networks with the printed layers and few channels, which make the same shapes."""
    depth = torch.zeros(1, 2, 256, 256, 3)
    with torch.inference_mode():
        image = ImageGenerator(pixels=256, channels=8 * (2,)).eval()(depth)
        patches = PatchDiscriminator(channels=4 * (2,)).eval()(depth, image)
    assert image.shape == (1, 2, 256, 256, 3)
    assert patches.shape == (1, 2, 30, 30, 1)


def test_the_reduced_generator_has_two_million_weights(on_meta):
    assert count_weights(make_networks("proposed")[0]) == pytest.approx(2.1e6, rel=0.01)


@pytest.mark.parametrize("name", NETWORKS)
def test_no_network_sees_the_future(name):
    generator, depth = _small(**NETWORKS[name]), torch.rand(1, 5, 8, 8, 3)
    changed = depth.clone()
    changed[:, 3:] = 0
    with torch.inference_mode():
        assert torch.allclose(generator(depth)[:, :3], generator(changed)[:, :3], atol=1e-6)


@pytest.mark.parametrize(("name", "sees"), [("proposed", True), ("temporal", True), ("no_lstm", False), ("pix2pix", False)])
def test_only_lstm_and_kernels_in_time_see_the_past(name, sees):
    generator, depth = _small(**NETWORKS[name]), torch.rand(1, 5, 8, 8, 3)
    changed = depth.clone()
    changed[:, :4] = 0
    with torch.inference_mode():
        differs = (generator(depth)[:, 4] - generator(changed)[:, 4]).abs().max() > 1e-6
    assert bool(differs) is sees


def test_images_stay_within_their_range():
    made = _small()(100 * torch.randn(1, 2, 8, 8, 3))
    assert made.abs().max() <= 1


def test_the_printed_output_is_negative_where_the_text_says_0_to_1():
    assert patch_score(torch.tensor(-2.0)) < 0


@pytest.mark.parametrize("real", [True, False])
def test_the_adversarial_loss_is_the_logarithm_of_the_shifted_tanh(real):
    logits = torch.linspace(-3, 3, 7)
    share = (1 + patch_score(logits)) / 2
    expected = -torch.log(share if real else 1 - share).mean()
    assert adversarial_loss(logits, real=real).item() == pytest.approx(expected.item(), rel=1e-5)


def test_a_generator_comes_back_from_its_file(tmp_path):
    generator = _small()
    save_generator(tmp_path / "generator.pt", generator, facts={"seed": 3})
    again, facts = load_generator(tmp_path / "generator.pt")
    depth = torch.rand(1, 3, 8, 8, 3)
    with torch.inference_mode():
        assert torch.equal(generator(depth), again(depth))
    assert facts["seed"] == 3


def test_another_file_is_refused(tmp_path):
    torch.save({"architecture": "printed", "weights": {}}, tmp_path / "model.pt")
    with pytest.raises(InputError, match="it holds no image generator; give a generator.pt"):
        load_generator(tmp_path / "model.pt")


def test_a_number_of_layers_that_does_not_fit_the_pixels_is_refused():
    with pytest.raises(InputError, match="3 layers take images of 8 pixels, not 64; give as many channels"):
        ImageGenerator(pixels=64, channels=(4, 6, 8))


def test_the_discriminator_takes_both_images():
    torch.manual_seed(0)
    discriminator = PatchDiscriminator(channels=(4, 4)).eval()
    depth, image = torch.rand(2, 1, 2, 16, 16, 3)
    plain = discriminator(depth, image)
    assert not np.allclose(plain.detach(), discriminator(depth, 1 - image).detach())
    assert not np.allclose(plain.detach(), discriminator(1 - depth, image).detach())
