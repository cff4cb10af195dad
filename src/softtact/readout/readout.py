"""From relative change of capacitance to counts: the taxels' gain, zero and drift, dead taxels, the converter."""

import numpy as np


def random_walk(steps, size):
    """Sum (trials, ...) of normal steps (trials, ...) of standard deviation `size`; no step before the first trial."""
    walk = size * np.cumsum(steps, axis=0)
    return walk - walk[:1]


def amplified(counts, *, gain, offset, gain_drift=0.0, offset_drift=0.0):
    """Counts (..., rows, columns) of taxels with their own gain and zero; each argument a number or (rows, columns)."""
    return gain * (1 + gain_drift) * counts + offset + offset_drift


def converted(counts, *, noise=0.0, step=1.0, largest=2400.0, dead=False):
    """What the converter gives for counts (...): noise (...) added, rounded to `step` (0: not), within 0 and `largest`.

    dead: (rows, columns) of bool, taxels that read zero whatever happens
    """
    noisy = counts + noise
    rounded = step * np.round(noisy / step) if step > 0 else noisy
    return np.where(dead, 0.0, np.clip(rounded, 0.0, largest))
