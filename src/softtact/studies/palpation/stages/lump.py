"""The search for a hidden lump: a table of film forces, where a lump is detected, and the errors of its estimates.

Setting `design`: the values of a `PalpationDesign` with its `search`.
"""

from typing import Any

import numpy as np
import pandas as pd
import xarray

from softtact.files import read_dataset, write_csv, write_dataset, write_json
from softtact.probe.design import LumpSearch, PalpationDesign
from softtact.probe.lump import PARAMETERS, LumpTable, detection_map, lump_table, recovery
from softtact.progress import Watch

_AXES = ("x_mm", "depth_mm", "stiffness_ratio")


def solve_lumps(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Solve all lumps of a search.  outputs: lumps (NetCDF);  settings: design."""
    design, search, watch = *_design(settings), Watch("lumps")
    table = lump_table(design, search, threads=threads, report=watch.report)
    watch.end()
    data = xarray.Dataset({"force_n": ((*_AXES, "film"), table.force_n, {"units": "N"}),
                           "unladen_n": ("film", table.unladen_n, {"units": "N"})},
                          coords={name: getattr(table, name) for name in _AXES})
    write_dataset(outputs["lumps"], data, seed=None, settings=settings)


def find_lumps(*, inputs: dict[str, Any], outputs: dict[str, Any], settings: dict[str, Any], threads: int = 1) -> None:
    """Find hidden lumps from noisy forces on the films.

    inputs: lumps (NetCDF);  outputs: detection, recovery (CSV), facts (JSON);  settings: design
    """
    design, search, watch = *_design(settings), Watch("hidden lumps")
    data = read_dataset(inputs["lumps"])
    table = LumpTable(data.x_mm.values, data.depth_mm.values, data.stiffness_ratio.values, data.force_n.values,
                      data.unladen_n.values, search.noise_n, np.array(search.moves))
    seen, found = detection_map(table), recovery(design, search, table, threads=threads, report=watch.report)
    watch.end()
    write_csv(outputs["detection"], seen)
    write_csv(outputs["recovery"], found)
    write_json(outputs["facts"], {"lump": _facts(seen, found), "noise_n": search.noise_n, "presses": len(search.moves)})


def _design(settings: dict[str, Any]) -> tuple[PalpationDesign, LumpSearch]:
    design = PalpationDesign.model_validate(settings["design"])
    assert design.search is not None
    return design, design.search


def _facts(seen: pd.DataFrame, found: pd.DataFrame) -> dict[str, Any]:
    """Errors of the estimates of lumps: with all presses, with the first press only, and with the same guess for every lump."""
    error, alone = ({name: float((found[f"{how}_{name}"] - found[name]).abs().median()) for name in _AXES}
                    for how in ("found", "alone"))
    guess = {name: float((found[name] - found[name].median()).abs().median()) for name in _AXES}     # the best constant estimate
    return {"median_error": error, "median_error_in_one_press": alone, "median_error_of_one_guess": guess,
            "within_interval": {name: float(found[f"{name}_within"].mean()) for name in PARAMETERS},
            "least_ratio_seen": [float(seen.least_stiffness_ratio.min()), float(seen.least_stiffness_ratio.max())],
            "median_depth_interval_mm": float((found.depth_mm_high - found.depth_mm_low).median()),
            "largest_table_error_n": float(found.table_error_n.max())}
