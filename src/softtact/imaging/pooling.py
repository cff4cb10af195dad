"""What all the discs of a frame tell of light and blur, which change slowly over it.

Each fit's posterior precision less its prior's is what its own pixels tell. Summed over the discs these give the contrast, the
brightness of the glass and the blur as polynomials of the place, also where one disc alone cannot tell a small bright contact from
a larger dim one. Discs that differ by more than their errors keep their own values: the prior is as wide as they scatter.
"""

from collections.abc import Sequence

import numpy as np

from softtact.imaging.outline import COLUMN, ROW, Outline, Prior, R
from softtact.imaging.regions import terms

SHAPE_SD = np.repeat([0.15, 0.08, 0.08], 2)   # of the radius: harmonics 2 (an ellipse of 1.3 has 0.13), 3, 4
FEWEST = 4            # discs; fewer tell nothing of each other
UNKNOWN = 1e6         # standard deviation of what is not known
_SHARED = slice(0, 3)  # contrast, glass, blur
_TOLD = 0.2           # of the contrast: a disc that knows its own to that much tells whether discs differ
_CHANGE = 0.3         # of the contrast and of the blur: by how much each term of the polynomial may change them


def first_priors(start: np.ndarray) -> list[Prior]:
    """`Prior` of each disc (discs, parameters) before any fit: the regions tell contrast and blur to about a half."""
    sd = np.full(start.shape, UNKNOWN)
    sd[:, 0], sd[:, 2] = 0.5 * start[:, 0], 0.3 + 0.5 * start[:, 2]
    return _with_shape(start, sd)


def pooled_priors(fits: Sequence[Outline], priors: Sequence[Prior], *, shape: tuple[int, int]) -> list[Prior]:
    """`Prior` of each disc from the fits of all, made under `priors`."""
    values = np.array([fit.values for fit in fits])
    if len(fits) < FEWEST:
        return [Prior(one.mean, one.sd) for one in priors]
    precision, pull = _own(fits, priors)
    basis = terms(values[:, ROW], values[:, COLUMN], shape)
    shared = _solve(precision, pull, basis, scale=np.median(values[:, _SHARED], axis=0))
    sd = np.full(values.shape, UNKNOWN)
    sd[:, _SHARED] = _excess(precision, pull, shared) + 1e-3 * np.abs(shared)
    mean = values.copy()
    mean[:, _SHARED] = shared
    return _with_shape(mean, sd)


def _with_shape(mean, sd):
    """The priors, with outlines that are round unless the light says otherwise."""
    mean = mean.copy()
    sd[:, R + 1:] = np.maximum(mean[:, [R]], 1.0) * SHAPE_SD
    mean[:, R + 1:] = 0.0
    return [Prior(*pair) for pair in zip(mean, sd, strict=True)]


def _own(fits, priors):
    """What each disc's own pixels tell: precision (discs, 3, 3) and precision times value (discs, 3)."""
    before = np.array([np.diag(prior.sd[_SHARED] ** -2.0) for prior in priors])
    after = np.array([np.linalg.pinv(fit.covariance[_SHARED, _SHARED]) for fit in fits])
    pull = np.einsum("kij,kj->ki", after, [fit.values[_SHARED] for fit in fits])
    return after - before, pull - np.einsum("kij,kj->ki", before, [prior.mean[_SHARED] for prior in priors])


def _solve(precision, pull, basis, *, scale):
    """The polynomials that suit all discs best, at the discs (discs, 3)."""
    count = len(basis)
    normal = np.einsum("tk,uk,kij->tiuj", basis, basis, precision).reshape(3 * count, -1)
    change = _CHANGE * scale[[0, 0, 2]]
    normal += np.diag(np.concatenate([np.zeros(3), np.tile(change**-2.0, count - 1)]))
    factors = np.linalg.solve(normal, np.einsum("tk,ki->ti", basis, pull).ravel()).reshape(count, 3)
    return basis.T @ factors


def _excess(precision, pull, shared):
    """Standard deviation (3,) by which discs differ from the polynomials beyond their own errors."""
    own = np.linalg.pinv(precision, hermitian=True)
    variance = np.maximum(np.diagonal(own, axis1=1, axis2=2), 1e-12)
    told = np.sqrt(variance[:, 0]) < _TOLD * np.abs(shared[:, 0])
    if told.sum() < FEWEST:
        return np.zeros(3)   # discs so small that none tells its own contrast
    z = (np.einsum("kij,kj->ki", own, pull) - shared)[told] / np.sqrt(variance[told])
    spread = (1.4826 * np.median(np.abs(z), axis=0)) ** 2
    by_chance = 1 + 2.3 / np.sqrt(len(z))   # one sd of that estimate above what errors alone give
    return np.sqrt(np.maximum(spread - by_chance, 0.0) * np.median(variance[told], axis=0))
