"""How much a score depends on the gain of the readings: SSIM's constants forgive what is wrong with faint maps."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from softtact.readout.capacitance import ideal_counts
from softtact.readout.ssim import map_ssim, mean_absolute_counts, others_mean
from softtact.readout.virtual_sensor import VirtualSensorSettings, read_virtual_sensor

if TYPE_CHECKING:
    import xarray

    from softtact.sensors.specification import SensorSpec

SHARES = (0.25, 0.5, 0.75, 1.0, 1.5)     # of the study's own gain
PERCENTILE = 99.0


def gain_table(references: "Sequence[xarray.Dataset]", tested: "Mapping[str, Sequence[xarray.Dataset]]", *, spec: "SensorSpec",
               settings: VirtualSensorSettings, seed: int, ssim: dict[str, Any]) -> pd.DataFrame:
    """A row for each gain: how far readings at the largest force fill the range, and SSIM of untrained predictors at that force.

    references: presses that the virtual sensor reads, once each;  tested: {model: the same presses with that model}
    percentile_counts: PERCENTILE of all taxels' readings;  peak_counts: median of the maps' largest;  full_share: of taxels at the
    end of the range;  ssim_mean: of the mean of the other presses' readings;  ssim_gap_MODEL: of the gap formula
    """
    rows = []
    for gain in (share * settings.counts_per_relative_change for share in SHARES):
        at_gain = replace(settings, counts_per_relative_change=gain)
        counts = np.stack([_last_reading(press, spec, at_gain, seed) for press in references])
        row = {"gain": gain, "percentile_counts": np.percentile(counts, PERCENTILE),
               "peak_counts": np.median(counts.max(axis=(1, 2))),
               "full_share": float((counts >= spec.largest_counts).mean()), "mean_counts": counts.mean()}
        predicted = {"mean": others_mean(counts)} if len(counts) > 1 else {}
        predicted |= {f"gap_{model}": np.stack([ideal_counts(spec, press.deformation_map_mm.values[-1],
                                                             counts_per_relative_change=gain) for press in presses])
                      for model, presses in tested.items()}
        row |= {f"ssim_{name}": map_ssim(maps, counts, **ssim).mean() for name, maps in predicted.items()}
        row |= {f"mae_share_{name}": mean_absolute_counts(maps, counts).mean() / counts.mean() for name, maps in predicted.items()}
        rows.append(row)
    return pd.DataFrame(rows)


def _last_reading(press, spec, settings, seed):
    """Counts (row, column) of one trial at the largest force."""
    item = f"{press.attrs['set']}/{press.attrs['item']}"
    return read_virtual_sensor(spec, press.deformation_map_mm.values, force_n=press.normal_force_n.values, trials=1, seed=seed,
                               item=item, settings=settings)[0, -1]
