"""What limits a score: the mechanical model, the number of maps, or the network; and the effect of the gain on the score.

Three differences of mean SSIM, each with all else equal:
model    the same network on the reference model's maps, from which the readings were made, minus on the tested model's maps
data     all maps minus the next smaller number of maps (the same network, equal steps)
network  the best network on the same maps (the two of the study and that of the learning curve) minus the study's
The learning curve is that of one network: the compact one, which the reference has, too, or else the study's, without `model`.
The largest difference above `CLEAR` is reported as the limit. A network that predicts worse than the mean training reading at that
force counts as not trained, which is reported instead. These numbers do not affect any choice of the study.
The constants of SSIM reduce the effect of errors in faint maps, so a score depends on the gain of the readings; see `gain_table`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from softtact.published.archive import PRINTED_SSIM
from softtact.published.archive import SOURCE as PUBLISHED
from softtact.readout.capacitance import ideal_counts
from softtact.readout.ssim import map_ssim, mean_absolute_counts, others_mean
from softtact.readout.virtual_sensor import VirtualSensorSettings, read_virtual_sensor

if TYPE_CHECKING:
    import xarray

    from softtact.sensors.specification import SensorSpec

CLEAR = 0.01      # of mean SSIM; another seed can make a smaller difference (assumed)
COLUMNS = ["model", "set", "ssim", "paper", "sensor_ssim", "perfect_model_gain", "more_maps_gain", "other_network_gain", "limit",
           "sentence"]
WORDS = {"model": "the mechanical model", "data": "the number of maps", "network": "the network or its training"}
SHARES = (0.25, 0.5, 0.75, 1.0, 1.5)     # of the study's gain
PERCENTILE = 99.0


def limits(curves: pd.DataFrame, networks: pd.DataFrame, *, architecture: str, tested: Sequence[str], reference: str,
           source: str) -> pd.DataFrame:
    """Frame with COLUMNS, a row per tested model and set.

    curves: learning_curve.csv of all models, the reference's (where there is one) among them;  networks: networks.csv
    architecture: the study's;  source: of the readings
    """
    rows = []
    for model in tested:
        of_network = curves[curves.architecture == _network_of(curves[curves.model == model], architecture)]
        for set_name in curves["set"].unique():
            scored = networks[(networks.model == model) & (networks["set"] == set_name)].set_index("architecture")
            of_set = of_network[of_network["set"] == set_name]
            rows.append(_row(model, set_name, scored, of_set[of_set.model == model], of_set[of_set.model == reference],
                             architecture=architecture, source=source))
    return pd.DataFrame(rows, columns=COLUMNS)


def _network_of(curve, architecture):
    """The network of a model's learning curve that is judged: the compact one, the study's, or its first."""
    there = list(curve.architecture)
    return next(name for name in ("compact", architecture, *there) if name in there)


def _row(model, set_name, scored, curve, perfect, *, architecture, source):
    curve, score = curve.sort_values("maps"), scored.ssim[architecture]
    gains = {"model": perfect.sort_values("maps").ssim.iloc[-1] - curve.ssim.iloc[-1] if len(perfect) else np.nan,
             "data": curve.ssim.iloc[-1] - curve.ssim.iloc[-2] if len(curve) > 1 else np.nan,
             "network": max(scored.ssim.max(), curve.ssim.iloc[-1]) - score}
    paper = PRINTED_SSIM.get(set_name, {}).get(model, np.nan)
    mean = scored.mean_reading_ssim[architecture]
    limit = "training" if score < mean else _largest(gains)
    return {"model": model, "set": set_name, "ssim": score, "paper": paper, "sensor_ssim": scored.sensor_ssim.iloc[0],
            "perfect_model_gain": gains["model"], "more_maps_gain": gains["data"], "other_network_gain": gains["network"],
            "limit": limit, "sentence": _sentence(score, paper, curve, gains, limit, source, mean)}


def _largest(gains):
    """The name of the largest clear gain, or `none`."""
    clear = {name: gain for name, gain in gains.items() if gain > CLEAR}
    return max(clear, key=clear.get, default="none")


def _sentence(score, paper, curve, gains, limit, source, mean):
    against = "" if np.isnan(paper) else (f" ({'at least' if score >= paper else 'below'} the paper's {paper:g}, which is of other "
                                          "readings)" if source != PUBLISHED else f" (paper: {paper:g})")
    parts = [f"a perfect model would bring {gains['model']:+.3f}" if not np.isnan(gains["model"]) else "",
            f"going from {curve.maps.iloc[-2]} to {curve.maps.iloc[-1]} maps brought {gains['data']:+.3f}"
            if not np.isnan(gains["data"]) else "", f"the best network trained here {gains['network']:+.3f}"]
    if limit == "training":
        return f"SSIM {score:.3f}{against}: not trained, for the mean training reading at that force has {mean:.3f}."
    end = f"what limits first is {WORDS[limit]}" if limit in WORDS else f"none of the three stands out by more than {CLEAR:g}"
    return f"SSIM {score:.3f}{against}: {', '.join(filter(None, parts))}; {end}."


def gain_table(references: "Sequence[xarray.Dataset]", tested: "Mapping[str, Sequence[xarray.Dataset]]", *, spec: "SensorSpec",
               settings: VirtualSensorSettings, seed: int, ssim: dict[str, Any]) -> pd.DataFrame:
    """A row for each gain: how much of the range the readings at the largest force fill, and SSIM of untrained predictors there.

    references: presses that the virtual sensor reads once each;  tested: {model: the same presses with that model}
    percentile_counts: PERCENTILE of all taxels' readings;  peak_counts: median over the maps of their largest count
    full_share: of taxels at the end of the range;  ssim_mean: SSIM of the mean of the other presses' readings
    ssim_gap_MODEL: SSIM of the gap formula
    """
    rows = []
    for gain in (share * settings.counts_per_relative_change for share in SHARES):
        at_gain = replace(settings, counts_per_relative_change=gain)
        counts = np.stack([_last_reading(press, spec, at_gain, seed) for press in references])
        row = {"gain": gain, "percentile_counts": np.percentile(counts, PERCENTILE),
               "peak_counts": np.median(counts.max(axis=(1, 2))),
               "full_share": float((counts >= spec.largest_counts).mean()), "mean_counts": counts.mean()}
        predicted = {"mean": others_mean(counts)} if len(counts) > 1 else {}
        predicted |= {f"gap_{model}": np.stack([ideal_counts(spec, _thinning(press)[-1], counts_per_relative_change=gain)
                                                for press in presses])
                      for model, presses in tested.items()}
        row |= {f"ssim_{name}": map_ssim(maps, counts, **ssim).mean() for name, maps in predicted.items()}
        row |= {f"mae_share_{name}": mean_absolute_counts(maps, counts).mean() / counts.mean() for name, maps in predicted.items()}
        rows.append(row)
    return pd.DataFrame(rows)


def _thinning(press):
    """Maps (step, y, x) in mm from which a press' counts follow."""
    return (press.thinning_map_mm if "thinning_map_mm" in press else press.deformation_map_mm).values


def _last_reading(press, spec, settings, seed):
    """Counts (row, column) of one trial at the largest force."""
    item = f"{press.attrs['set']}/{press.attrs['item']}"
    return read_virtual_sensor(spec, press.deformation_map_mm.values, force_n=press.normal_force_n.values, trials=1, seed=seed,
                               item=item, settings=settings)[0, -1]
