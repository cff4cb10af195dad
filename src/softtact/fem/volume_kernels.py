"""Compiled loops over elements' changes of volume: their projection, and the penalties on what it does not see."""

import numpy as np
from numba import njit

from softtact.fem.kernel_records import ElementArrays, VolumePenalties


@njit(cache=True, nogil=True)
def project(field: np.ndarray, at_rest: ElementArrays) -> np.ndarray:
    """Fields (e, g) of elements, projected on the functions of the pressure (e, g)."""
    out = np.empty(field.shape)
    for e in range(len(field)):
        _project(field[e], at_rest.volumes[at_rest.shapes[e]], at_rest.basis, at_rest.gram_inverse[at_rest.shapes[e]], out[e])
    return out


@njit(cache=True, nogil=True)
def add_penalties(J: np.ndarray, at_rest: ElementArrays, seen: np.ndarray, density: np.ndarray, pressure: np.ndarray,
                  penalties: VolumePenalties) -> tuple[np.ndarray, np.ndarray]:
    """Energies (e,) in mJ of changes of volume; second derivative (e, g) in MPa of the quartic penalty, or (0, 0).

    seen, density, pressure (e, g): the projected J - 1, and the law's U and U' there, in MPa; the penalties are added to `pressure`
    """
    volumes, (elements, points) = at_rest.volumes, J.shape
    k, q = penalties.unprojected, penalties.quartic
    energies, quartic = np.zeros(elements), np.empty((elements, points) if q > 0 else (0, 0))
    held, share = np.empty(points), np.empty(points)
    for e in range(elements):
        shape = at_rest.shapes[e]
        for g in range(points):
            j, own = J[e, g], density[e, g]
            if k > 0:
                pressure[e, g] += 0.5 * k * (j - 1.0 / j)
                own += 0.25 * k * (j * j - 1.0 - 2.0 * np.log(j))
            if q > 0:
                unseen = j - 1.0 - seen[e, g]
                held[g] = q * unseen * unseen * unseen
                quartic[e, g] = 3.0 * q * unseen * unseen
                own += 0.25 * held[g] * unseen
            energies[e] += volumes[shape, g] * own
        if q > 0:
            _project(held, volumes[shape], at_rest.basis, at_rest.gram_inverse[shape], share)
            pressure[e] += held - share
    return energies, quartic


@njit(cache=True, nogil=True)
def _project(field, w, basis, gram_inverse, out):
    """An element's field (g,) projected on the functions of the pressure, into `out` (g,)."""
    points, modes = basis.shape
    moments, amounts = np.zeros(modes), np.zeros(modes)
    for g in range(points):
        for p in range(modes):
            moments[p] += w[g] * field[g] * basis[g, p]
    for p in range(modes):
        for q in range(modes):
            amounts[q] += gram_inverse[p, q] * moments[p]     # symmetric: row by row
    for g in range(points):
        total = 0.0
        for p in range(modes):
            total += amounts[p] * basis[g, p]
        out[g] = total
