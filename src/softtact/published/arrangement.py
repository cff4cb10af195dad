"""How tax1 to tax28 lie under the map: nobody states it, but maps and readings tell.

A taxel is pressed where the map over it is deep. So the mean depth over each taxel's share of the map is correlated with the
counts, for each of the eight ways to number a grid row by row or column by column from any corner; the right one correlates best.
"""

import numpy as np

ARRANGEMENTS = [f"{order}{flip}" for order in ("rows", "columns") for flip in ("", "_x", "_y", "_xy")]


def arrange(counts: np.ndarray, arrangement: str, *, shape: tuple[int, int]) -> np.ndarray:
    """Counts (n, taxel) as tactile maps (n, row, column) of `shape`; `_x` and `_y`: numbered from the far end of that axis."""
    order, _, flips = arrangement.partition("_")
    rows, columns = shape
    maps = counts.reshape(-1, rows, columns) if order == "rows" else counts.reshape(-1, columns, rows).swapaxes(1, 2)
    return np.ascontiguousarray(maps[:, ::-1 if "y" in flips else 1, ::-1 if "x" in flips else 1])


def taxel_depths(maps_mm: np.ndarray, *, shape: tuple[int, int]) -> np.ndarray:
    """Mean of maps (n, y, x) over each taxel's share of the grid: (n, row, column)."""
    rows, columns = (np.array_split(np.arange(size), parts) for size, parts in zip(maps_mm.shape[1:], shape, strict=True))
    return np.stack([np.stack([maps_mm[:, r[:, None], c].mean(axis=(1, 2)) for c in columns], axis=-1) for r in rows], axis=1)


def correlations(maps_mm: np.ndarray, counts: np.ndarray, *, shape: tuple[int, int]) -> dict[str, float]:
    """{arrangement: correlation over the taxels of depth and counts, each less its mean over the map}.

    maps_mm (n, y, x);  counts (n, taxel).  Without the means a strong press would correlate with any arrangement.
    """
    depth = _within(taxel_depths(maps_mm, shape=shape))
    return {name: _correlation(depth, _within(arrange(counts, name, shape=shape))) for name in ARRANGEMENTS}


def _within(values):
    return values - values.mean(axis=(1, 2), keepdims=True)


def _correlation(a, b):
    return float((a * b).sum() / max(np.sqrt((a * a).sum() * (b * b).sum()), 1e-300))
