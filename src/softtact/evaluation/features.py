"""What deformation maps show of an object's features: how many stand out, and whether a lower one is seen beside a higher one."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from scipy import ndimage

if TYPE_CHECKING:
    import xarray

STANDS_OUT = 0.5          # of a map's largest deformation: a connected part above it is a feature
LOWER_MM = 0.5            # how much lower the paper's lower features of objects 5 and 6 are
_SAME_HEIGHT_MM = 0.05    # heights that are one

COLUMNS = ["item", "model", "force_n", "features", "raised_mm", "lower_mm", "lower_sd_mm", "lower_points", "lower_share",
           "frustum_share"]


def count_features(map_mm: np.ndarray) -> int:
    """Connected parts (sides or corners touching) of a map (y, x) that are above STANDS_OUT of its largest value."""
    return int(ndimage.label(map_mm > STANDS_OUT * map_mm.max(), structure=np.ones((3, 3)))[1])


def feature_masks(heights_mm: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(raised, lower) masks (y, x) of an object's underside: its lowest parts, which touch first, and those LOWER_MM above."""
    rise = heights_mm - np.nanmin(heights_mm)
    return rise < _SAME_HEIGHT_MM, np.abs(rise - LOWER_MM) < _SAME_HEIGHT_MM


def measure_press(press: "xarray.Dataset", heights_mm: np.ndarray, *, frustum_height_mm: float) -> dict[str, Any]:
    """One row by COLUMNS of a press (data set) at its largest force; `heights_mm` (y, x) of the object over the map's grid."""
    final = press.isel(step=-1)
    values = final.deformation_map_mm.values
    raised, lower = feature_masks(heights_mm)
    there = lower.any()
    high, low = float(values[raised].mean()), float(values[lower].mean()) if there else np.nan
    return {"item": press.attrs["item"], "model": press.attrs["model"], "force_n": float(final.normal_force_n),
            "features": count_features(values), "raised_mm": high, "lower_mm": low,
            "lower_sd_mm": float(values[lower].std(ddof=1)) if lower.sum() > 1 else np.nan, "lower_points": int(lower.sum()),
            "lower_share": low / high, "frustum_share": float(final.frustum_compression_mm) / frustum_height_mm}


def feature_table(presses: "Iterable[xarray.Dataset]", heights_of: dict[str, np.ndarray], *,
                  frustum_height_mm: float) -> pd.DataFrame:
    """A row for each press; heights_of {item: (y, x)} in mm."""
    rows = [measure_press(press, heights_of[press.attrs["item"]], frustum_height_mm=frustum_height_mm) for press in presses]
    return pd.DataFrame(rows, columns=COLUMNS)
