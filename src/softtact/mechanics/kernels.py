"""Compiled loops over elements: kinematics, internal forces and tangents. Plain arrays in, plain arrays out.

Symmetric tensors are stored as xx, yy, zz, xy, yz, zx. All kernels run on one core and release the GIL.
"""

import numpy as np
from numba import njit

_ROW = np.array([0, 1, 2, 0, 1, 2])
_COL = np.array([0, 1, 2, 1, 2, 0])
_VOIGT = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])


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
def _elasticity(A, f, S, D):
    """First elasticity tensor A (i, k, j, l) = F_ip F_jq D_pkql + delta_ij S_kl from the material one D (6, 6)."""
    half = np.empty((3, 3, 6))
    for i in range(3):
        for k in range(3):
            for m in range(6):
                total = 0.0
                for p in range(3):
                    total += f[i, p] * D[_VOIGT[p, k], m]
                half[i, k, m] = total
    for i in range(3):
        for k in range(3):
            for j in range(3):
                for l in range(3):
                    total = S[k, l] if i == j else 0.0
                    for q in range(3):
                        total += half[i, k, _VOIGT[q, l]] * f[j, q]
                    A[i, k, j, l] = total


@njit(cache=True, nogil=True)
def tangent(F, C, J, gradients, volumes, stress, moduli, pressure, basis, gram_inverse, bulk_modulus, local_modulus):
    """Tangent (e, 3 m, 3 m) of `internal_force` with the pressure of `SolidBlock`: a projected and a local part.

    projected = bulk_modulus * basis . gram_inverse . integral(basis (J - 1)), basis (g, p): symmetric, rank p per element
    local = local_modulus (J - 1/J) / 2

    The products run over blocks of components (i, j >= i): K_ij = G^T A_ij G with the gradients G (3 g, m), three large
    products an element instead of one with the strain-displacement matrix, which has a third of zeros.
    """
    elements, points, nodes, _ = gradients.shape
    modes = basis.shape[1]
    out = np.empty((elements, 3 * nodes, 3 * nodes))
    G = np.empty((nodes, 3 * points))
    # A_ij G for each i, columns j >= i side by side
    rights = (np.empty((3 * points, 3 * nodes)), np.empty((3 * points, 2 * nodes)), np.empty((3 * points, nodes)))
    volume_change = np.empty((modes, 3 * nodes))
    A = np.empty((3, 3, 3, 3))
    D = np.empty((6, 6))
    S = np.empty((3, 3))
    for e in range(elements):
        volume_change[:] = 0.0
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
            f = F[e, g]
            _elasticity(A, f, S, D)
            for a in range(nodes):
                x, y, z = gradients[e, g, a, 0], gradients[e, g, a, 1], gradients[e, g, a, 2]
                G[a, 3 * g], G[a, 3 * g + 1], G[a, 3 * g + 2] = x, y, z
                for i in range(3):
                    # row i of the cofactor J F^-T = J F C^-1, times the gradient: dJ by displacement i of node a
                    cofactor = 0.0
                    for k in range(3):
                        along = f[i, 0] * _sym(inverse, 0, k) + f[i, 1] * _sym(inverse, 1, k) + f[i, 2] * _sym(inverse, 2, k)
                        cofactor += along * gradients[e, g, a, k]
                    for m in range(modes):
                        volume_change[m, 3 * a + i] += w * basis[g, m] * J[e, g] * cofactor
                    right = rights[i]
                    for j in range(i, 3):
                        for k in range(3):
                            right[3 * g + k, (j - i) * nodes + a] = A[i, k, j, 0] * x + A[i, k, j, 1] * y + A[i, k, j, 2] * z
        K = out[e]
        for i in range(3):
            block = G @ rights[i]
            for a in range(nodes):
                for j in range(i, 3):
                    for b in range(nodes):
                        K[3 * a + i, 3 * b + j] = block[a, (j - i) * nodes + b]
                        K[3 * b + j, 3 * a + i] = block[a, (j - i) * nodes + b]
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
