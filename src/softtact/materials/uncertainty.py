"""What data tell of the constants of a fit: covariance, correlation, what they do not determine, and Akaike's criterion."""

import numpy as np

_SINGULAR = 1e-7        # of the largest singular value: the constants' columns depend on each other
_PARTICIPATES = 0.1       # component of a unit vector of constants that does not change the curves


def covariance_of(jacobian: np.ndarray, variance: float) -> np.ndarray | None:
    """variance (J^T J)^-1 (p, p) for J (n, p), or None where columns of J depend on each other."""
    size = np.linalg.norm(jacobian, axis=0)
    if not (size > 0).all() or np.linalg.cond(jacobian / size) > 1 / _SINGULAR:
        return None
    scaled = np.linalg.inv((jacobian / size).T @ (jacobian / size))
    return variance * scaled / np.outer(size, size)


def correlation_of(covariance: np.ndarray) -> np.ndarray:
    """Correlation (p, p) of constants with a covariance (p, p); 0 between constants without a deviation."""
    deviation = np.sqrt(np.diag(covariance))
    with np.errstate(divide="ignore", invalid="ignore"):   # a fit without any error has no deviations
        correlation = covariance / np.outer(deviation, deviation)
    return np.where(np.isfinite(correlation), correlation, np.eye(len(deviation)))


def unseen(jacobian: np.ndarray) -> np.ndarray:
    """Whether (p,) each constant takes part in a joint change of constants that does not change the data; J (n, p)."""
    size = np.linalg.norm(jacobian, axis=0)
    _, singular, directions = np.linalg.svd(jacobian / np.where(size > 0, size, 1.0), full_matrices=False)
    unseen = directions[singular <= _SINGULAR * singular.max()]
    return (size == 0) | (np.abs(unseen) > _PARTICIPATES).any(axis=0)


def corrected_aic(residual: np.ndarray, constants: int) -> float:
    """n ln(SS/n) + 2k n/(n - k - 1); k counts the constants and the variance (Burnham and Anderson 2002, section 7.7.6)."""
    n, k = len(residual), constants + 1
    return float(n * np.log(max(residual @ residual, 1e-30) / n) + 2 * k * n / max(n - k - 1, 0.5))
