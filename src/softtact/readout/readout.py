"""From relative change of capacitance to counts: the taxels' gain, zero and drift, dead taxels, the converter."""

import numpy as np


def random_walk(steps: np.ndarray, size: float) -> np.ndarray:
    """Sum (trials, ...) of normal steps (trials, ...) of standard deviation `size`; no step before the first trial."""
    walk = size * np.cumsum(steps, axis=0)
    return walk - walk[:1]


def amplified(counts: np.ndarray, *, gain: float | np.ndarray, offset: float | np.ndarray, gain_drift: float | np.ndarray = 0.0,
              offset_drift: float | np.ndarray = 0.0) -> np.ndarray:
    """Counts (..., rows, columns) of taxels with their own gain and zero; each argument a number or (rows, columns)."""
    return gain * (1 + gain_drift) * counts + offset + offset_drift


def converted(counts: np.ndarray, *, noise: float | np.ndarray = 0.0, step: float = 1.0, largest: float = 2400.0,
              dead: bool | np.ndarray = False) -> np.ndarray:
    """What the converter gives for counts (...): noise (...) added, rounded to `step` (0: not), within 0 and `largest`.

    dead: (rows, columns) of bool, taxels that read zero whatever happens
    """
    noisy = counts + noise
    rounded = step * np.round(noisy / step) if step > 0 else noisy
    return np.where(dead, 0.0, np.clip(rounded, 0.0, largest))
