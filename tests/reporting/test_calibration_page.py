"""The figures of a calibration's page: residuals of the readings that were used."""

from types import SimpleNamespace

import numpy as np
import pytest

from softtact.reporting.calibration_page import draw_residuals, draw_taxels


@pytest.fixture
def result():
    """A calibration that misses each used reading by 10 counts, of which 5 of 20 were used, and of taxel 0, 0 none."""
    counts, inverse = np.full((20, 7, 4), 10.0), np.zeros((20, 7, 4))
    counts[5:] = 500.0      # at forces beyond the model's validity
    inverse[:5] = 1.0
    inverse[:, 0, 0] = 0.0
    problem = SimpleNamespace(experiments=[SimpleNamespace(counts=counts, name="plate.csv")], stacked=lambda: (counts, inverse))
    linear = SimpleNamespace(scale=1.0, gain=np.ones((7, 4)), zero=np.zeros((7, 4)))
    return SimpleNamespace(problem=problem, counts=[np.zeros((20, 7, 4))], linear=linear)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("draw", "panel"), [(draw_residuals, 0), (draw_taxels, 2)])
def test_residuals_are_those_of_the_used_readings_and_a_taxel_without_any_shows_no_number(result, draw, panel):
    shown = {text.get_position(): text.get_text() for text in draw(result).axes[panel].texts}
    assert (0, 0) not in shown and len(shown) == 27
    assert set(shown.values()) == {"10.0"}
