"""Paths of the solid model as files."""

from pathlib import Path
from typing import Any

import xarray

from softtact.files import read_dataset, write_dataset
from softtact.models.solid.ball_on_disc import DiscPress


def write_path(path: str | Path, press: DiscPress, settings: Any) -> None:
    """Write a path of depths as NetCDF."""
    data = xarray.Dataset(
        {"force_over_shear": ("step", press.force_over_shear, {"units": "mm2"}),
         "outward_mm": (("step", "node"), press.outward_mm, {"units": "mm"}),
         "lowering_mm": (("step", "node"), press.lowering_mm, {"units": "mm"})},
        coords={"depth_mm": ("step", press.depth_mm, {"units": "mm"}), "radius_mm": ("node", press.radius_mm, {"units": "mm"})})
    write_dataset(path, data, seed=None, settings=settings)


def read_path(path: str | Path) -> DiscPress:
    """Read a path of depths."""
    data = read_dataset(path)
    return DiscPress(*(data[name].values for name in ("depth_mm", "force_over_shear", "radius_mm", "outward_mm", "lowering_mm")))
