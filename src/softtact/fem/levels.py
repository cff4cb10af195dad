"""Heights of element layers, with one of them where something begins."""

import numpy as np

_NEAR = 0.5     # of the layer it lies in: a level that is nearer to the new one is moved there, else the new one is put between


def with_level(levels: np.ndarray, level: float) -> np.ndarray:
    """Rising levels (n,) in mm, `level` among them: the nearest inner one moved there, or a new one.

    Unchanged where `level` is not between the first and the last.
    """
    levels = np.asarray(levels, dtype=float)
    if not levels[0] + 1e-9 < level < levels[-1] - 1e-9 or np.abs(levels - level).min() < 1e-9:
        return levels
    above = int(np.searchsorted(levels, level))
    nearest = above if levels[above] - level < level - levels[above - 1] else above - 1
    inner = 0 < nearest < len(levels) - 1
    if inner and abs(levels[nearest] - level) <= _NEAR * (levels[above] - levels[above - 1]):
        return np.concatenate([levels[:nearest], [level], levels[nearest + 1:]])
    return np.insert(levels, above, level)
