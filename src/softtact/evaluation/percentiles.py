"""Expanded percentiles (Hesterberg 2015): bootstrap intervals of a mean that are as wide as Student's of a normal sample.

With few objects plain percentiles are too narrow, by a third for five. They are taken farther out: at those of a normal
distribution beyond as many standard deviations as Student's interval has.
"""

import numpy as np
from scipy.special import ndtr

FEWEST = 10      # draws beyond a percentile from which it is read


def expanded_interval(means: np.ndarray, out: float) -> tuple[float, float]:
    """(low, high) of a mean whose bootstrap gave `means` (draws,), `out` standard deviations of a normal distribution from it.

    Where such a percentile lies beyond the draws, as of five objects and fewer, the means are taken as normal.
    """
    tail = ndtr(-out)
    if tail * len(means) < FEWEST:
        return float(means.mean() - out * means.std()), float(means.mean() + out * means.std())
    low, high = np.quantile(means, [tail, 1 - tail])
    return float(low), float(high)
