"""Tables of the study: means by source, by object and by depth, and the verdicts of the sliding test."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

SMALL_OBJECTS = ("cone", "tetrahedron")  # that the paper's sliding test does not tell


def by_object(rows: pd.DataFrame) -> pd.DataFrame:
    """A row for each source, object and split: means of d_px, mse, and the share of degenerate images."""
    return rows.groupby(["source", "object", "split"], sort=False)[["d_px", "e_px", "mse", "degenerate"]].mean().reset_index()


def by_motion(rows: pd.DataFrame) -> pd.DataFrame:
    """A row for each source, depth and displacement aside: means of d_px and mse over all objects."""
    rounded = rows.assign(depth_mm=rows.depth_mm.round(3), aside_mm=rows.aside_mm.round(3))
    return rounded.groupby(["source", "depth_mm", "aside_mm"], sort=False)[["d_px", "mse"]].mean().reset_index()


def sliding_verdicts(table: pd.DataFrame, trained: Sequence[str]) -> pd.DataFrame:
    """`table` of the sliding test with threshold_px and right (0 or 1).

    The paper prints no threshold. Here it lies midway, on a logarithmic scale, between the medians of free and fixed objects that
    are trained on, or at 1 px if that is more; it is one for each source. Images without any marker are told wrongly.
    """
    found = []
    for _, one in table.groupby("source", sort=False):
        seen = one[one.object.isin(trained)]
        medians = [max(0.1, float(seen.change_px[seen.state == state].median())) for state in ("free", "fixed")]  # 0.1 for nan
        threshold = max(1.0, float(np.sqrt(medians[0] * medians[1])))
        told = np.where(one.change_px.isna(), "unknown", np.where(one.change_px > threshold, "fixed", "free"))
        found.append(one.assign(threshold_px=threshold, right=(told == one.state).astype(int)))
    return pd.concat(found, ignore_index=True)


def wrong_objects(verdicts: pd.DataFrame, source: str) -> list[str]:
    """Objects that a source tells wrongly in one of their states."""
    one = verdicts[(verdicts.source == source) & (verdicts.right == 0)]
    return list(dict.fromkeys(one.object))
