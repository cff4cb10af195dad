"""Energy and forces of linear tetrahedra, several of them with each of the processor's instructions. Symbols: see `tetrahedra`.

The data of _LANES elements stand side by side in the rows of one flat array: at places a fixed number apart, so that the compiler
sees that no row overlaps another, and computes several lanes at once. A third of the time of one element after the other.
"""

import numpy as np
from numba import njit

from free_bodies.small_tensors import cofactor, combined, left_cauchy_green, symmetric_times, times

_LANES = 16
# First rows: displacements of nodes 1 to 3 from node 0's, gradients, volume, psi and its derivatives by i1 and i2, forces ...
_MOVE, _GRADIENT, _VOLUME, _LAW, _FORCE = 0, 9, 18, 19, 22
# ... and, over all elements so far, energy, sum of the forces' magnitudes, least and largest J.
_ENERGY, _SIZE, _LEAST, _LARGEST, _ROWS = 34, 35, 36, 37, 38
_MOST_J = 19.0       # up to this, and down to its inverse, `_cube_root` is exact to rounding; no rubber changes its volume so


@njit(cache=True, nogil=True, error_model="numpy")
def add_forces(displacement: np.ndarray, nodes: np.ndarray, gradients: np.ndarray, volumes: np.ndarray, table: np.ndarray,
               bulk_modulus: float, force: np.ndarray) -> tuple[float, float]:
    """Add nodal forces (n, 3) in N for displacement (n, 3) in mm; returns the energy (mJ) and the forces' summed magnitudes (N).

    table (e, 6) or (1, 6): psi and its derivatives, see `LinearTetrahedra`;  energy: NaN where a J <= 0, or is beyond _MOST_J
    """
    work, count = np.zeros(_ROWS * _LANES), len(nodes)
    rows = work.reshape(_ROWS, _LANES)
    rows[_LEAST:] = 1.0
    for start in range(0, count, _LANES):
        for lane in range(_LANES):
            e = min(start + lane, count - 1)      # behind the last element its data once more, without a volume
            _load(rows, lane, displacement, nodes[e], gradients[e], table[e] if len(table) > 1 else table[0])
            rows[_VOLUME, lane] = volumes[e] if start + lane < count else 0.0
        _compute(work, bulk_modulus, 1.0 if len(table) == 1 else 0.0)
        for lane in range(min(_LANES, count - start)):
            for a in range(4):
                node = nodes[start + lane, a]
                for i in range(3):
                    force[node, i] += rows[_FORCE + 3 * a + i, lane]
    known = rows[_LEAST].min() >= 1 / _MOST_J and rows[_LARGEST].max() <= _MOST_J
    return rows[_ENERGY].sum() if known else np.nan, rows[_SIZE].sum()


@njit(cache=True, nogil=True, inline="always")
def _load(rows, lane, displacement, nodes, gradients, law):
    for i in range(3):
        rows[_LAW + i, lane] = law[i]
        for a in range(3):
            rows[_MOVE + 3 * a + i, lane] = displacement[nodes[a + 1], i] - displacement[nodes[0], i]
            rows[_GRADIENT + 3 * a + i, lane] = gradients[a, i]


@njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract"})
def _compute(work, bulk_modulus, linear):
    """Forces and sums of all lanes; linear: 1 where psi is linear in the invariants and follows from its derivatives, else 0."""
    for k in range(_LANES):
        G1, G2, G3 = _three(work, _GRADIENT, k), _three(work, _GRADIENT + 3, k), _three(work, _GRADIENT + 6, k)
        f = _deformation(_three(work, _MOVE, k), _three(work, _MOVE + 3, k), _three(work, _MOVE + 6, k), G1, G2, G3)
        J, h = cofactor(f)
        I1, I2, b = left_cauchy_green(f)
        root, V, (psi, psi1, psi2) = _cube_root(J), work[_VOLUME * _LANES + k], _three(work, _LAW, k)
        s1 = 1 / (root * root)
        i1, i2 = s1 * I1, s1 * s1 * I2
        psi += linear * (psi1 * (i1 - 3) + psi2 * (i2 - 3))
        p1, p2 = V * psi1, V * psi2
        P = _stress(f, h, b, 2 * s1 * p1 + 2 * s1 * s1 * p2 * I1, -2 * s1 * s1 * p2,
                    -2 / 3 * (p1 * i1 + 2 * p2 * i2) / J + V * bulk_modulus * (J - 1))
        one, two, three = times(P, G1), times(P, G2), times(P, G3)
        none = combined(-1.0, one, -1.0, two, -1.0, three)
        for i in range(3):
            work[(_FORCE + i) * _LANES + k] = none[i]
            work[(_FORCE + 3 + i) * _LANES + k] = one[i]
            work[(_FORCE + 6 + i) * _LANES + k] = two[i]
            work[(_FORCE + 9 + i) * _LANES + k] = three[i]
        work[_ENERGY * _LANES + k] += V * (psi + 0.5 * bulk_modulus * (J - 1) ** 2)
        work[_SIZE * _LANES + k] += _magnitudes(none) + _magnitudes(one) + _magnitudes(two) + _magnitudes(three)
        work[_LEAST * _LANES + k] = min(work[_LEAST * _LANES + k], J)
        work[_LARGEST * _LANES + k] = max(work[_LARGEST * _LANES + k], J)


@njit(cache=True, nogil=True, inline="always")
def _three(work, row, lane):
    return work[row * _LANES + lane], work[(row + 1) * _LANES + lane], work[(row + 2) * _LANES + lane]


@njit(cache=True, nogil=True, inline="always")
def _deformation(u, v, w, G1, G2, G3):
    """F by the displacements of nodes 1 to 3 from that of node 0, whose gradient is minus the sum of the others'."""
    x, y, z = combined(u[0], G1, v[0], G2, w[0], G3), combined(u[1], G1, v[1], G2, w[1], G3), combined(u[2], G1, v[2], G2, w[2], G3)
    return 1 + x[0], x[1], x[2], y[0], 1 + y[1], y[2], z[0], z[1], 1 + z[2]


@njit(cache=True, nogil=True, inline="always")
def _stress(f, h, b, cf, cb, ch):
    """V times the first Piola-Kirchhoff stress: (cf + cb B) F + ch H."""
    x, y, z = symmetric_times(b, (f[0], f[3], f[6])), symmetric_times(b, (f[1], f[4], f[7])), symmetric_times(b, (f[2], f[5], f[8]))
    return (cf * f[0] + cb * x[0] + ch * h[0], cf * f[1] + cb * y[0] + ch * h[1], cf * f[2] + cb * z[0] + ch * h[2],
            cf * f[3] + cb * x[1] + ch * h[3], cf * f[4] + cb * y[1] + ch * h[4], cf * f[5] + cb * z[1] + ch * h[5],
            cf * f[6] + cb * x[2] + ch * h[6], cf * f[7] + cb * y[2] + ch * h[7], cf * f[8] + cb * z[2] + ch * h[8])


@njit(cache=True, nogil=True, inline="always")
def _magnitudes(v):
    return abs(v[0]) + abs(v[1]) + abs(v[2])


@njit(cache=True, nogil=True, inline="always")
def _cube_root(J):
    """By Halley's iteration from 1, exact to rounding from 1/19 to 19: a library's function would be called lane by lane."""
    root = (1 + 2 * J) / (2 + J)
    for _ in range(3):
        cube = root * root * root
        root *= (cube + 2 * J) / (2 * cube + J)
    return root
