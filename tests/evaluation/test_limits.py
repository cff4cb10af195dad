"""Which of model, data and network limits a score, on numbers of which the answer is known."""

import pandas as pd
import pytest

from softtact.evaluation.limits import limits


def curve(model, half, full, *, set_name="unseen", architecture="compact"):
    return pd.DataFrame({"model": model, "architecture": architecture, "maps": [50, 100], "set": set_name, "ssim": [half, full]})


def scored(model, printed, compact, *, set_name="unseen", mean=0.5):
    return pd.DataFrame({"model": model, "architecture": ["printed", "compact"], "set": set_name, "ssim": [printed, compact],
                         "sensor_ssim": 0.99, "mean_reading_ssim": mean})


def row(*, half, full, perfect, printed, compact, **changes):
    curves = pd.concat([curve("elastic", half, full), curve("reference", perfect, perfect)])
    facts = {"architecture": "printed", "tested": ["elastic"], "reference": "reference", "source": "virtual sensor"} | changes
    return limits(curves, scored("elastic", printed, compact), **facts).iloc[0]


def test_what_gains_most_is_the_limit():
    for numbers, limit, words in [
        ({"half": 0.80, "full": 0.80, "perfect": 0.95, "printed": 0.80, "compact": 0.81}, "model", "the mechanical model"),
        ({"half": 0.60, "full": 0.80, "perfect": 0.81, "printed": 0.80, "compact": 0.79}, "data", "the number of maps"),
        ({"half": 0.90, "full": 0.90, "perfect": 0.90, "printed": 0.70, "compact": 0.90}, "network", "the network or its training"),
        ({"half": 0.90, "full": 0.90, "perfect": 0.905, "printed": 0.90, "compact": 0.80}, "none", "none of the three"),
    ]:
        found = row(**numbers)
        assert found.limit == limit and words in found.sentence, numbers


def test_each_gain_is_the_difference_with_all_else_equal():
    found = row(half=0.7, full=0.8, perfect=0.95, printed=0.75, compact=0.79)
    assert (found.perfect_model_gain, found.more_maps_gain, found.other_network_gain) == pytest.approx((0.15, 0.1, 0.05))
    assert (found.ssim, found.paper, found.sensor_ssim) == (0.75, 0.82, 0.99)
    assert found.sentence.startswith("SSIM 0.750 (below the paper's 0.82, which is of other readings): a perfect model would bring "
                                     "+0.150, going from 50 to 100 maps brought +0.100, the best network trained here +0.050;")


def test_without_a_reference_nothing_is_said_of_a_perfect_model():
    found = row(half=0.7, full=0.8, perfect=0.95, printed=0.75, compact=0.79, reference="another")
    assert pd.isna(found.perfect_model_gain) and "perfect" not in found.sentence and found.limit == "data"


def test_a_network_below_the_mean_reading_is_not_trained_whatever_else_would_gain():
    found = row(half=0.6, full=0.8, perfect=0.95, printed=0.45, compact=0.79)
    assert found.limit == "training" and "not trained, for the mean training reading at that force has 0.500" in found.sentence


@pytest.mark.parametrize(("kinds", "brought"), [(("compact", "printed"), 0.1), (("printed",), 0.3), (("searched",), 0.2),
                                                (("searched", "printed"), 0.3)])
@pytest.mark.parametrize("reference", ["compact", None])
def test_a_learning_curve_is_judged_by_one_network_and_a_reference_that_has_it(kinds, brought, reference):
    """The compact one, or else the study's; the reference is learnt by the compact network, or not at all."""
    gains = {"compact": 0.1, "searched": 0.2, "printed": 0.3}
    curves = [curve("elastic", 0.8 - gains[kind], 0.8, architecture=kind) for kind in kinds]
    curves += [curve("reference", 0.9, 0.9, architecture=reference)] if reference else []
    found = limits(pd.concat(curves), scored("elastic", 0.8, 0.79), architecture="printed", tested=["elastic"],
                   reference="reference", source="virtual sensor").iloc[0]
    assert found.more_maps_gain == pytest.approx(brought)
    assert found.perfect_model_gain == pytest.approx(0.1 if reference in kinds else float("nan"), nan_ok=True)
