"""Compiled loops over elements: kinematics, internal forces and tangents. Plain arrays in, plain arrays out.

Symmetric tensors are stored as xx, yy, zz, xy, yz, zx. All kernels run on one core and release the GIL.
"""

import numpy as np
from numba import njit

_ROW = np.array([0, 1, 2, 0, 1, 2])
_COL = np.array([0, 1, 2, 1, 2, 0])


@njit(cache=True, nogil=True)
def deformation(displacement, gradients):
    """Deformation gradient F (e, g, 3, 3), C (e*g, 6) and J (e, g) from nodal displacement (e, m, 3)."""
    elements, points, nodes, _ = gradients.shape
    F = np.empty((elements, points, 3, 3))
    C = np.empty((elements * points, 6))
    J = np.empty((elements, points))
    for e in range(elements):
        for g in range(points):
            f = F[e, g]
            for i in range(3):
                for j in range(3):
                    total = 1.0 if i == j else 0.0
                    for a in range(nodes):
                        total += displacement[e, a, i] * gradients[e, g, a, j]
                    f[i, j] = total
            for k in range(6):
                i, j = _ROW[k], _COL[k]
                C[e * points + g, k] = f[0, i] * f[0, j] + f[1, i] * f[1, j] + f[2, i] * f[2, j]
            J[e, g] = (f[0, 0] * (f[1, 1] * f[2, 2] - f[1, 2] * f[2, 1])
                       - f[0, 1] * (f[1, 0] * f[2, 2] - f[1, 2] * f[2, 0])
                       + f[0, 2] * (f[1, 0] * f[2, 1] - f[1, 1] * f[2, 0]))
    return F, C, J


@njit(cache=True, nogil=True)
def inverse_symmetric(c):
    """Inverse (6,) of a symmetric 3 x 3 tensor (6,)."""
    xx, yy, zz, xy, yz, zx = c[0], c[1], c[2], c[3], c[4], c[5]
    out = np.empty(6)
    out[0] = yy * zz - yz * yz
    out[1] = xx * zz - zx * zx
    out[2] = xx * yy - xy * xy
    out[3] = zx * yz - xy * zz
    out[4] = xy * zx - xx * yz
    out[5] = xy * yz - zx * yy
    determinant = xx * out[0] + xy * out[3] + zx * out[5]
    return out / determinant


@njit(cache=True, nogil=True)
def internal_force(F, C, J, gradients, volumes, stress, pressure):
    """Nodal forces (e, 3 m): isochoric second Piola-Kirchhoff stress (e*g, 6) plus pressure (e, g) J C^-1."""
    elements, points, nodes, _ = gradients.shape
    force = np.zeros((elements, 3 * nodes))
    S = np.empty((3, 3))
    for e in range(elements):
        for g in range(points):
            n = e * points + g
            inverse = inverse_symmetric(C[n])
            for k in range(6):
                value = volumes[e, g] * (stress[n, k] + pressure[e, g] * J[e, g] * inverse[k])
                S[_ROW[k], _COL[k]] = value
                S[_COL[k], _ROW[k]] = value
            P = F[e, g] @ S
            for a in range(nodes):
                for i in range(3):
                    force[e, 3 * a + i] += (P[i, 0] * gradients[e, g, a, 0] + P[i, 1] * gradients[e, g, a, 1]
                                            + P[i, 2] * gradients[e, g, a, 2])
    return force


@njit(cache=True, nogil=True)
def _add_geometric(K, gradients, S):
    """Add (grad N_a . S grad N_b) to the diagonal of each nodal 3 x 3 block."""
    nodes = gradients.shape[0]
    for a in range(nodes):
        s0 = gradients[a, 0] * S[0, 0] + gradients[a, 1] * S[1, 0] + gradients[a, 2] * S[2, 0]
        s1 = gradients[a, 0] * S[0, 1] + gradients[a, 1] * S[1, 1] + gradients[a, 2] * S[2, 1]
        s2 = gradients[a, 0] * S[0, 2] + gradients[a, 1] * S[1, 2] + gradients[a, 2] * S[2, 2]
        for b in range(nodes):
            value = s0 * gradients[b, 0] + s1 * gradients[b, 1] + s2 * gradients[b, 2]
            for i in range(3):
                K[3 * a + i, 3 * b + i] += value


@njit(cache=True, nogil=True)
def _strain_rows(B, f, gradients):
    """Rows of the strain-displacement matrix B (6, 3 m): dE (engineering shear) per nodal displacement."""
    for a in range(gradients.shape[0]):
        x, y, z = gradients[a, 0], gradients[a, 1], gradients[a, 2]
        for i in range(3):
            column = 3 * a + i
            B[0, column] = f[i, 0] * x
            B[1, column] = f[i, 1] * y
            B[2, column] = f[i, 2] * z
            B[3, column] = f[i, 0] * y + f[i, 1] * x
            B[4, column] = f[i, 1] * z + f[i, 2] * y
            B[5, column] = f[i, 2] * x + f[i, 0] * z


@njit(cache=True, nogil=True)
def tangent(F, C, J, gradients, volumes, stress, moduli, pressure, basis, gram_inverse, bulk_modulus, local_modulus):
    """Tangent (e, 3 m, 3 m) of `internal_force` with the pressure of `HexBlock`: a projected and a local part.

    projected = bulk_modulus * basis . gram_inverse . integral(basis (J - 1)), basis (g, p): symmetric, rank p per element
    local = local_modulus (J - 1/J) / 2
    """
    elements, points, nodes, _ = gradients.shape
    size = 3 * nodes
    modes = basis.shape[1]
    out = np.empty((elements, size, size))
    B = np.empty((6 * points, size))
    DB = np.empty((6 * points, size))
    volume_change = np.empty((modes, size))
    D = np.empty((6, 6))
    S = np.empty((3, 3))
    for e in range(elements):
        volume_change[:] = 0.0
        K = out[e]
        K[:] = 0.0
        for g in range(points):
            n = e * points + g
            inverse = inverse_symmetric(C[n])
            w, pj = volumes[e, g], pressure[e, g] * J[e, g]
            local = 0.5 * local_modulus * (J[e, g] * J[e, g] + 1.0)
            for k in range(6):
                value = w * (stress[n, k] + pj * inverse[k])
                S[_ROW[k], _COL[k]] = value
                S[_COL[k], _ROW[k]] = value
                for m in range(6):
                    i, j, p, q = _ROW[k], _COL[k], _ROW[m], _COL[m]
                    ip, jq, iq, jp = _sym(inverse, i, p), _sym(inverse, j, q), _sym(inverse, i, q), _sym(inverse, j, p)
                    D[k, m] = w * (moduli[n, k, m] + (pj + local) * inverse[k] * inverse[m] - pj * (ip * jq + iq * jp))
            rows = B[6 * g:6 * g + 6]
            _strain_rows(rows, F[e, g], gradients[e, g])
            DB[6 * g:6 * g + 6] = D @ rows
            for m in range(modes):
                factor = w * basis[g, m] * J[e, g]
                for k in range(6):
                    for column in range(size):
                        volume_change[m, column] += factor * inverse[k] * rows[k, column]
            _add_geometric(K, gradients[e, g], S)
        K += B.T @ DB
        K += bulk_modulus * (volume_change.T @ (gram_inverse[e] @ volume_change))
    return out


@njit(cache=True, nogil=True)
def _sym(tensor, i, j):
    """Component (i, j) of a symmetric tensor stored as xx, yy, zz, xy, yz, zx."""
    if i == j:
        return tensor[i]
    if i + j == 1:
        return tensor[3]
    return tensor[4] if i + j == 3 else tensor[5]
