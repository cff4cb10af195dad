"""SSIM against the gain of the readings."""

import numpy as np
import pytest
import xarray
from support.sensors import CORO

from softtact.evaluation.limits import SHARES, gain_table
from softtact.readout.virtual_sensor import VirtualSensorSettings


def test_faint_readings_hide_what_a_higher_gain_shows():
    y, x = np.mgrid[-1:1:57j, -1:1:33j]
    maps = [0.25 * np.exp(-8 * ((x - at)**2 + y**2)) for at in (-0.4, 0.4)]
    presses = [xarray.Dataset({"deformation_map_mm": (("step", "y", "x"), one[None]), "normal_force_n": ("step", [50.0])},
                              attrs={"set": "grasps", "item": f"object_{k}", "model": "elastic"}) for k, one in enumerate(maps)]
    blurred = [press.assign(deformation_map_mm=0.8 * press.deformation_map_mm) for press in presses]
    settings = VirtualSensorSettings.ideal(counts_per_relative_change=2000.0)
    table = gain_table(presses, {"elastic": blurred}, spec=CORO, settings=settings, seed=0, ssim={"window": 3,
                                                                                                  "data_range": 2400.0})
    assert table.gain.tolist() == [share * 2000 for share in SHARES]
    assert table.percentile_counts.is_monotonic_increasing and table.ssim_gap_elastic.is_monotonic_decreasing
    assert table.mae_share_gap_elastic.to_numpy() == pytest.approx(table.mae_share_gap_elastic[0], rel=0.05)
    assert (table.ssim_mean < table.ssim_gap_elastic).all()
    alone = gain_table(presses[:1], {"elastic": blurred[:1]}, spec=CORO, settings=settings, seed=0,
                       ssim={"window": 3, "data_range": 2400.0})  # fmt: skip
    assert "ssim_mean" not in alone and alone.ssim_gap_elastic.notna().all()     # there are no other presses to take the mean of
