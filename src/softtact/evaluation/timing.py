"""How long a map takes: the solver's time from the press files, and the network's, measured here."""

import statistics
import time
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING

import pandas as pd

if TYPE_CHECKING:
    import numpy as np
    import torch
    import xarray

TIMING_COLUMNS = ["model", "item", "set", "force_n", "solver_s", "network_s"]


def time_presses(presses: "Iterable[xarray.Dataset]", networks: "dict[str, torch.nn.Module]", *,
                 predict: "Callable[[torch.nn.Module, np.ndarray], np.ndarray]", repeats: int = 3) -> pd.DataFrame:
    """A row per map: model, item, set, force_n, solver_s, network_s.

    presses: data sets of `simulate_press`;  networks {model: network};  predict(network, maps (1, y, x))
    network_s: median over `repeats` of one map alone through the network, as one press would use it
    """
    rows = []
    for press in presses:
        names = [press.attrs[name] for name in ("model", "item", "set")]
        network = networks[names[0]]
        predict(network, press.deformation_map_mm.values[:1])  # the first call allocates: it is no map's cost
        for load_step, force in enumerate(press.normal_force_n.values):
            one = press.deformation_map_mm.values[load_step:load_step + 1]
            network_s = statistics.median(seconds(predict, network, one) for _ in range(repeats))
            rows.append((*names, float(force), float(press.wall_time_s.values[load_step]), network_s))
    return pd.DataFrame(rows, columns=TIMING_COLUMNS)


def seconds(call: Callable[..., object], *arguments: object) -> float:
    """Wall time of one call, s."""
    start = time.perf_counter()
    call(*arguments)
    return time.perf_counter() - start


def summarise_times(timing: pd.DataFrame) -> pd.DataFrame:
    """Time per map of solver and network together, s: model, maps, mean, min, max, sd."""
    total = timing.assign(total_s=timing.solver_s + timing.network_s)
    return total.groupby("model", sort=False).total_s.agg(
        maps="size", mean="mean", min="min", max="max", sd="std").reset_index()
