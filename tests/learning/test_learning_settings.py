"""Settings of the learning stages."""

import pytest

from softtact.errors import InputError
from softtact.learning.settings import LearningCurve, Network, Search, Ssim, Training


def test_defaults_are_what_the_paper_prints():
    network, ssim = Network(), Ssim()
    assert (network.architecture, network.filters, network.dense) == ("printed", (80, 95, 120), 570)
    assert (ssim.window, ssim.data_range) == (3, 2400)


def test_a_wrong_setting_is_refused_with_its_key_and_value():
    for section, values, sentence in [
        (Training, {"epoch": 3}, "it.epoch: there is no such key; use one of epochs, batch"),
        (Training, {"epochs": 0}, r"it.epochs: .*greater than 0 \(it is 0\)"),
        (Search, {"space": {"dense": [64, 8]}}, r"it.space.dense: a range is \[smallest, largest\]"),
        (Network, {"compact": {"filters": [16, 32]}}, "it.compact.filters.2: Field required"),
        (LearningCurve, {"shares": [0.5, 0.2]}, "it.shares: shares rise from one to the next"),
        (Ssim, {"window": 4}, "it.window: a window has a taxel at its centre"),
    ]:
        with pytest.raises(InputError, match=sentence):
            section.from_dict(values, where="it")


def test_a_search_has_filters_for_each_layer_that_it_may_draw():
    assert Search().space.depth == (2, 4)
    assert Search.from_dict({"space": {"filters": [[4, 8]]}}, where="search").space.depth == (1, 1)
    with pytest.raises(InputError, match="layers goes to 5, and filters has ranges for 4; give as many"):
        Search.from_dict({"space": {"layers": [2, 5]}}, where="search")
