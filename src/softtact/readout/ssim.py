"""Structural similarity of small tactile maps.

scikit-image's `structural_similarity` with a uniform window (gaussian_weights=False), sample covariance, and the mean
over the windows that lie wholly inside. The usual sides of 7 or 11 do not fit on 7 x 4 taxels: 3 by default, with a
data range of the readout's 2400 counts.
"""

import numpy as np

from softtact.errors import InputError

LEAST_RANGE = 30.0     # counts: four standard deviations of the virtual sensor's offsets and noise together
_K1, _K2 = 0.01, 0.03     # of SSIM's two constants, as everywhere


def map_ssim(predicted: np.ndarray, measured: np.ndarray, *, window: int, data_range: float) -> np.ndarray:
    """SSIM (n,) of predicted against measured tactile maps (n, row, column) in counts."""
    from skimage.metrics import structural_similarity

    check_maps(predicted, measured, window)
    return np.array([
        structural_similarity(a, b, win_size=window, data_range=data_range, gaussian_weights=False)
        for a, b in zip(np.asarray(predicted, float), np.asarray(measured, float), strict=True)])


def mean_absolute_counts(predicted: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Mean absolute difference (n,) of tactile maps (n, row, column) in counts."""
    return np.abs(np.float64(predicted) - np.float64(measured)).mean(axis=(1, 2))


def own_range_ssim(predicted: np.ndarray, measured: np.ndarray, *, window: int) -> np.ndarray:
    """SSIM (n,) as of `map_ssim`, each with the largest count of its measured map as data range.

    SSIM's two constants grow with the range: with a readout's whole range they hide the errors of a faint map. The range is at
    least LEAST_RANGE counts, so that noise on an empty map does not count as a shape.
    """
    check_maps(predicted, measured, window)
    ranges = np.maximum(np.abs(measured).max(axis=(1, 2)), LEAST_RANGE)
    return np.array([map_ssim(a[None], b[None], window=window, data_range=float(top))[0]
                     for a, b, top in zip(predicted, measured, ranges, strict=True)])


def whole_map_ssim(predicted: np.ndarray, measured: np.ndarray, *, data_range: float) -> np.ndarray:
    """SSIM (n,) of maps (n, row, column) with one window that holds the whole map; constants and covariance as for `map_ssim`.

    The largest window that a publication can have taken, as 3 is the smallest.
    """
    check_maps(predicted, measured, 1)
    a, b = (np.asarray(maps, dtype=float).reshape(len(maps), -1) for maps in (predicted, measured))
    c1, c2 = (_K1 * data_range)**2, (_K2 * data_range)**2
    mean_a, mean_b = a.mean(axis=1), b.mean(axis=1)
    covariance = ((a - mean_a[:, None]) * (b - mean_b[:, None])).sum(axis=1) / (a.shape[1] - 1)
    spread = a.var(axis=1, ddof=1) + b.var(axis=1, ddof=1)
    return (2 * mean_a * mean_b + c1) * (2 * covariance + c2) / ((mean_a**2 + mean_b**2 + c1) * (spread + c2))


def others_mean(trials: np.ndarray) -> np.ndarray:
    """For each reading (trial, row, column) the mean of the others.

    A predictor that knows the sensor perfectly, but not the trial's noise, reaches this.
    """
    return (trials.sum(axis=0, keepdims=True) - trials) / (len(trials) - 1)


def leave_one_out_ssim(trials: np.ndarray, *, window: int, data_range: float) -> np.ndarray:
    """SSIM (trial,) of each reading (trial, row, column) against the mean of the others."""
    return map_ssim(others_mean(trials), trials, window=window, data_range=data_range)


def check_maps(predicted: np.ndarray, measured: np.ndarray, window: int) -> None:
    """Refuse maps of different shapes, and a window that does not fit on them."""
    if predicted.shape != measured.shape:
        raise InputError(f"SSIM: {predicted.shape} predicted and {measured.shape} measured values; give maps alike.")
    check_window(window, predicted.shape[1:])


def check_window(window: int, taxels: tuple[int, ...]) -> None:
    """Refuse a window that does not fit on (rows, columns) of taxels."""
    smallest = min(taxels)
    if window > smallest:
        raise InputError(f"ssim.window is {window}; it must fit on the {smallest} taxels of the map's shorter side.")
