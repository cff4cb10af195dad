"""Read maps from a user's file for a trained network and write its counts; unsuitable maps are refused or reported."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray

from softtact.errors import InputError
from softtact.files import read_dataset, write_csv, write_dataset
from softtact.inputs import check_input, in_one_sentence
from softtact.tables import read_matrix

MARGIN = 1e-3     # relative excess over the training's range without a remark, for rounded files


@dataclass(frozen=True)
class Maps:
    """Deformation maps of one file.

    maps_mm (n, y, x);  force_n (n,), valid (n,) and model: of a press file, else None
    x_mm (x,), y_mm (y,): the grid, if the file has one
    """

    maps_mm: np.ndarray
    force_n: np.ndarray | None = None
    valid: np.ndarray | None = None
    model: str | None = None
    x_mm: np.ndarray | None = None
    y_mm: np.ndarray | None = None


def read_maps(path: str | Path, *, shape: Sequence[int]) -> Maps:
    """The `Maps` of a press (NetCDF) or of one map (.npy, .csv); `shape` (y, x) is that of the network's input."""
    readers = {".nc": _read_press, ".npy": _read_npy, ".csv": _read_csv}
    if Path(path).suffix not in readers:
        raise InputError(f"{path}: maps are read from {', '.join(readers)}; give one of these.")
    check_input(path, "arrays")
    maps = readers[Path(path).suffix](path)
    got = maps.maps_mm.shape[1:]
    if got != tuple(shape):
        turned = "; it is transposed: rows run along y" if got == tuple(shape)[::-1] else ""
        raise InputError(f"{path}: its map has {' x '.join(map(str, got))} values and the network needs "
                         f"{' x '.join(map(str, shape))} (y, x){turned}.")
    if not np.isfinite(maps.maps_mm).all():
        raise InputError(f"{path}: it holds values that are not finite; make it again.")
    return maps


def _read_press(path):
    data = read_dataset(path)
    if "deformation_map_mm" not in data or data.deformation_map_mm.dims != ("step", "y", "x") or "normal_force_n" not in data:
        raise InputError(f"{path}: not a press with deformation_map_mm (step, y, x) and normal_force_n; "
                         "give what `softtact press` wrote.")
    unit = data.deformation_map_mm.attrs.get("units", "mm")
    if unit != "mm":
        raise InputError(f"{path}: its maps are in {unit!r}; give them in mm.")
    if "converged" in data and not data.converged.values.all():
        raise InputError(f"{path}: a load step of the press did not converge; press it again with smaller force steps.")
    valid = data.within_validity.values == 1 if "within_validity" in data else None
    grid = {f"{side}_mm": data[side].values if side in data.coords else None for side in "xy"}
    return Maps(data.deformation_map_mm.values, data.normal_force_n.values, valid, data.attrs.get("model"), **grid)


def _read_npy(path):
    with in_one_sentence(path, "not an array of numbers", "write it with numpy.save"):
        values = np.load(path, allow_pickle=False)
    return _one_map(path, values)


def _read_csv(path):
    try:
        return _one_map(path, np.array(read_matrix(path, what="map")))
    except InputError as error:
        raise InputError(f"{str(error).removesuffix('.')}; it is not a table of numbers with commas and no header.") from None


def _one_map(path, values):
    if values.ndim != 2 or values.dtype.kind not in "fiu":
        raise InputError(f"{path}: it holds {values.ndim}-dimensional {values.dtype} values; give one map of numbers (y, x) in mm.")
    return Maps(values[None].astype(float))


def outside_training(maps: Maps, facts: dict[str, Any]) -> list[str]:
    """Sentences on maps outside the range of the training; an old network file without ranges gives fewer."""
    remarks = []
    if maps.model and maps.model != facts.get("model", maps.model):
        remarks.append(f"the maps are of the model {maps.model} and the network was trained on {facts['model']}.")
    if maps.valid is not None and not maps.valid.all():
        remarks.append(f"{(~maps.valid).sum()} of {len(maps.valid)} load steps are outside the validity of the press' model.")
    known = facts.get("range", {})
    for name, values, unit in (("map_max_mm", maps.maps_mm.max(axis=(1, 2)), "mm deep at most"), ("force_n", maps.force_n, "N")):
        if values is not None and name in known:
            low, high = known[name]
            outside = (values < low * (1 - MARGIN)) | (values > high * (1 + MARGIN))
            if outside.any():
                remarks.append(f"{outside.sum()} of {len(values)} maps lie outside the training maps' range, {low:.4g} to "
                               f"{high:.4g} {unit} (the first with {values[outside][0]:.4g}); their counts are extrapolated.")
    return remarks


def write_counts(path: Path, maps: Maps, counts: np.ndarray, *, facts: dict[str, Any]) -> None:
    """Write counts (n, row, column) as NetCDF, or as CSV with a line for each taxel."""
    if path.suffix == ".csv":
        n, rows, columns = np.indices(counts.shape).reshape(3, -1)
        forces = {} if maps.force_n is None else {"force_n": maps.force_n[n]}
        write_csv(path, pd.DataFrame({"map": n, **forces, "row": rows, "column": columns, "counts": counts.ravel()}))
        return
    attributes = {"network_model": facts.get("model", ""), "source": f"network trained on: {facts.get('source', '')}"}
    data = xarray.Dataset({"tactile_map": (("force", "row", "column"), counts, {"units": "counts"})}, attrs=attributes)
    data = data if maps.force_n is None else data.assign(force_n=("force", maps.force_n, {"units": "N"}))
    write_dataset(path, data, seed=facts.get("seed"), settings={})
