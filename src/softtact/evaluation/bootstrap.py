"""How sure a mean score is: a bootstrap that respects what belongs together.

Maps of one object are alike, and so are maps of one trial (one loading, one drift). So objects are drawn with replacement,
then trials of each drawn object; a trial brings all its maps.
"""

from typing import TYPE_CHECKING

import numpy as np
from scipy import stats

if TYPE_CHECKING:
    import pandas as pd

LEVEL, REPEATS = 0.95, 2000


def interval_of_mean(values: np.ndarray, items: "np.ndarray | pd.Series", trials: "np.ndarray | pd.Series", *, seed: int,
                     level: float = LEVEL, repeats: int = REPEATS) -> tuple[float, float]:
    """(low, high) of the mean of `values` (n,), by percentiles over `repeats` draws; items, trials (n,) say what belongs together.

    With a single item nothing tells how items differ: (nan, nan). With few, plain percentiles are too narrow (by a third for
    five), so they are taken farther out, to where Student's interval of a normal sample ends (expanded percentiles, Hesterberg
    2015).
    """
    sums, counts, n_trials = by_trial(values, items, trials)     # (item, trial) each, and (item,)
    if len(n_trials) < 2:
        return np.nan, np.nan
    rng = np.random.default_rng(seed)
    drawn = rng.integers(len(n_trials), size=(repeats, len(n_trials)))                          # (repeats, item)
    picks = np.floor(rng.random((*drawn.shape, sums.shape[1])) * n_trials[drawn, None]).astype(int)   # (repeats, item, trial)
    taken = np.arange(sums.shape[1]) < n_trials[drawn, None]     # an item brings as many trials as it has
    total, count = ((table[drawn[..., None], picks] * taken).sum(axis=(1, 2)) for table in (sums, counts))
    n = len(n_trials)
    tail = stats.norm.cdf(-np.sqrt(n / (n - 1)) * stats.t.ppf(0.5 * (1 + level), n - 1))
    low, high = np.quantile(total / count, [tail, 1 - tail])
    return float(low), float(high)


def by_trial(values: np.ndarray, items: "np.ndarray | pd.Series",
             trials: "np.ndarray | pd.Series") -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sums and counts of `values` per item and trial, trials counted from 0 within an item; and each item's number of trials."""
    _, item = np.unique(np.asarray(items).astype(str), return_inverse=True)
    pairs, pair = np.unique(np.stack([item, np.asarray(trials)]), axis=1, return_inverse=True)
    n_trials = np.bincount(pairs[0])
    column = np.arange(pairs.shape[1]) - (np.cumsum(n_trials) - n_trials)[pairs[0]]
    sums, counts = np.zeros((2, len(n_trials), n_trials.max()))
    sums[pairs[0], column] = np.bincount(pair.ravel(), weights=values)
    counts[pairs[0], column] = np.bincount(pair.ravel())
    return sums, counts, n_trials
