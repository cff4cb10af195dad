"""Elements' tangents without modes of negative stiffness: where rubber folds, steps are to go on lowering the energy.

Reference: H. Chen et al., Stabler Neo-Hookean Simulation: Absolute Eigenvalue Filtering for Projected Newton, SIGGRAPH 2024: for
nearly incompressible elements absolute values leave shorter ways than zeros in place of negative eigenvalues.
"""

import numpy as np
from numba import njit

from softtact.linalg.lapack import ROUTINES, address, call, keep_alive

_NOTHING = 2e-5     # of the largest stiffness: rounding of a tangent in single precision, whose rigid motions have none


def make_positive(tangents: np.ndarray) -> int:
    """Give the indefinite ones among symmetric tangents (e, k, k), in single precision, |eigenvalues|; in place.

    Returns how many were. Those that are not even finite stay, for no factor will be found of them.
    """
    return int(_make_positive(tangents, np.empty(tangents.shape[1:], dtype=np.float32), ROUTINES))


@njit(cache=True, nogil=True)
def _make_positive(tangents, scratch, blas):
    size = np.array([tangents.shape[1], 0], dtype=np.int32)
    lower, count, info, changed = address(blas.letters, 0), address(size, 0), address(size, 1), 0
    for tangent in tangents:
        scratch[:] = tangent
        nothing = _NOTHING * np.abs(np.diag(tangent)).max()
        for i in range(len(tangent)):
            scratch[i, i] += nothing
        call(blas.potrf, (lower, count, scratch.ctypes.data, count, info))
        if size[1] != 0 and np.isfinite(tangent).all():
            values, vectors = np.linalg.eigh(tangent.astype(np.float64))
            tangent[:] = ((vectors * np.abs(values)) @ vectors.T).astype(np.float32)
            changed += 1
    keep_alive(size)
    return changed
