"""The dielectric between a plate and glass: how its contact area grows."""

from pathlib import Path

import numpy as np
import pytest

from softtact.geometry.sensor_spec import SensorSpec
from softtact.materials.laws.registry import make_law
from softtact.mechanics.glass_press import press_cell_on_glass

CORO = SensorSpec.from_yaml(Path(__file__).parents[2] / "config/sensors/coro.yaml")
LAW = make_law("mooney_rivlin", {"c10": 0.1706, "c01": 0.0040}, bulk_modulus=20 * 0.3492)


def test_the_contact_area_starts_as_the_tip_and_grows_without_jumps():
    """Up to the paper's 140 N on 540 frusta. A side that snaps onto the glass at once would add 0.05 mm2 from step to step."""
    curve = press_cell_on_glass(CORO, LAW, np.arange(10.0, 141.0, 10.0) / 540)
    assert curve.area_mm2[0] == pytest.approx(np.pi * 0.3**2, rel=0.02)
    assert (np.diff(curve.area_mm2) > 0).all() and (np.diff(curve.compression_mm) > 0).all()
    assert np.abs(np.diff(curve.area_mm2, 2)).max() < 0.015
