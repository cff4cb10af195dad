"""Compiled loops over elements: kinematics, internal forces and tangents. Plain arrays in, plain arrays out.

Symmetric tensors are stored as xx, yy, zz, xy, yz, zx. Many elements are translations of each other: gradients (u, g, 3, m)
and volumes (u, g) are kept once for each shape, `shapes` (e,) tells which is an element's. All kernels run on one core and
release the GIL.
"""

import numpy as np
from numba import njit

_ROW = np.array([0, 1, 2, 0, 1, 2])
_COL = np.array([0, 1, 2, 1, 2, 0])
_VOIGT = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])


@njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})     # sums over nodes, several at once
def _gradient(along, slopes):
    """Derivatives by x, y, z of one component of the displacement (m,) from the shape functions' gradients (3, m) at a point."""
    by_x, by_y, by_z = 0.0, 0.0, 0.0
    for a in range(len(along)):
        by_x += along[a] * slopes[0, a]
        by_y += along[a] * slopes[1, a]
        by_z += along[a] * slopes[2, a]
    return by_x, by_y, by_z


@njit(cache=True, nogil=True)
def deformation(displacement, gradients, shapes):
    """Deformation gradient F (e, g, 3, 3), C (e*g, 6) and J (e, g) from nodal displacement (e, m, 3)."""
    elements, nodes, _ = displacement.shape
    along = np.empty((3, nodes))
    points = gradients.shape[1]
    F = np.empty((elements, points, 3, 3))
    C = np.empty((elements * points, 6))
    J = np.empty((elements, points))
    for e in range(elements):
        for a in range(nodes):
            for i in range(3):
                along[i, a] = displacement[e, a, i]
        for g in range(points):
            slopes = gradients[shapes[e], g]
            xx, xy, xz = _gradient(along[0], slopes)
            yx, yy, yz = _gradient(along[1], slopes)
            zx, zy, zz = _gradient(along[2], slopes)
            xx, yy, zz = xx + 1.0, yy + 1.0, zz + 1.0
            f = F[e, g]
            f[0, 0], f[0, 1], f[0, 2] = xx, xy, xz
            f[1, 0], f[1, 1], f[1, 2] = yx, yy, yz
            f[2, 0], f[2, 1], f[2, 2] = zx, zy, zz
            c = C[e * points + g]
            c[0], c[1], c[2] = xx * xx + yx * yx + zx * zx, xy * xy + yy * yy + zy * zy, xz * xz + yz * yz + zz * zz
            c[3], c[4], c[5] = xx * xy + yx * yy + zx * zy, xy * xz + yy * yz + zy * zz, xz * xx + yz * yx + zz * zx
            J[e, g] = xx * (yy * zz - yz * zy) - xy * (yx * zz - yz * zx) + xz * (yx * zy - yy * zx)
    return F, C, J


@njit(cache=True, nogil=True)
def add_forces(total, nodes, forces):
    """Add elements' forces (e, m, 3) to those of all nodes (n, 3); nodes (e, m)."""
    for e in range(len(nodes)):
        for a in range(nodes.shape[1]):
            for i in range(3):
                total[nodes[e, a], i] += forces[e, a, i]


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
def internal_force(F, C, J, gradients, volumes, shapes, stress, pressure):
    """Nodal forces (e, 3 m): isochoric second Piola-Kirchhoff stress (e*g, 6) plus pressure (e, g) J C^-1."""
    elements, points = J.shape
    nodes = gradients.shape[3]
    force = np.empty((elements, 3 * nodes))
    own = np.empty((3, nodes))
    S = np.empty((3, 3))
    P = np.empty((3, 3))
    for e in range(elements):
        own[:] = 0.0
        for g in range(points):
            n = e * points + g
            w, pj = volumes[shapes[e], g], pressure[e, g] * J[e, g]
            inverse = inverse_symmetric(C[n])
            for k in range(6):
                value = w * (stress[n, k] + pj * inverse[k])
                S[_ROW[k], _COL[k]] = value
                S[_COL[k], _ROW[k]] = value
            for i in range(3):
                for j in range(3):
                    P[i, j] = F[e, g, i, 0] * S[0, j] + F[e, g, i, 1] * S[1, j] + F[e, g, i, 2] * S[2, j]
            slopes = gradients[shapes[e], g]
            for i in range(3):
                x, y, z = P[i, 0], P[i, 1], P[i, 2]
                for a in range(nodes):
                    own[i, a] += x * slopes[0, a] + y * slopes[1, a] + z * slopes[2, a]
        for a in range(nodes):
            for i in range(3):
                force[e, 3 * a + i] = own[i, a]
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
def _moduli(D, S, stress, moduli, inverse, w, pj, local):
    """Stress S (3, 3) and material tangent D (6, 6) at a point, both times its volume w.

    pj: pressure times J;  local: dp/dJ J^2 of what acts at the point alone
    """
    for k in range(6):
        value = w * (stress[k] + pj * inverse[k])
        S[_ROW[k], _COL[k]] = value
        S[_COL[k], _ROW[k]] = value
        for m in range(k, 6):
            i, j, p, q = _ROW[k], _COL[k], _ROW[m], _COL[m]
            ip, jq, iq, jp = _sym(inverse, i, p), _sym(inverse, j, q), _sym(inverse, i, q), _sym(inverse, j, p)
            D[k, m] = w * (moduli[k, m] + (pj + local) * inverse[k] * inverse[m] - pj * (ip * jq + iq * jp))
            D[m, k] = D[k, m]


@njit(cache=True, nogil=True)
def _volume_change(change, f, inverse, gradient, scale):
    """How the volume at a point changes with the nodes' displacements: scale F C^-1 : G, (3 m,) into `change`."""
    for i in range(3):
        x = scale * (f[i, 0] * inverse[0] + f[i, 1] * inverse[3] + f[i, 2] * inverse[5])
        y = scale * (f[i, 0] * inverse[3] + f[i, 1] * inverse[1] + f[i, 2] * inverse[4])
        z = scale * (f[i, 0] * inverse[5] + f[i, 1] * inverse[4] + f[i, 2] * inverse[2])
        for a in range(gradient.shape[1]):
            change[3 * a + i] = x * gradient[0, a] + y * gradient[1, a] + z * gradient[2, a]


@njit(cache=True, nogil=True)
def _times_gradients(rights, A, G, g):
    """Rows of point g in A_ij G for each i, columns j >= i side by side, from A (3, 3, 3, 3) and the gradients G (3 g, m)."""
    x, y, z = G[3 * g], G[3 * g + 1], G[3 * g + 2]
    nodes = len(x)
    for i in range(3):
        for k in range(3):
            row = rights[i][3 * g + k]
            for j in range(i, 3):
                first, ax, ay, az = (j - i) * nodes, A[i, k, j, 0], A[i, k, j, 1], A[i, k, j, 2]
                for a in range(nodes):
                    row[first + a] = ax * x[a] + ay * y[a] + az * z[a]


@njit(cache=True, nogil=True)
def _add_blocks(K, G, rights):
    """K (3 m, 3 m) plus its blocks of components (i, j): G^T (A_ij G)."""
    nodes = G.shape[1]
    for i in range(3):
        block = G.T @ rights[i]
        for a in range(nodes):
            for b in range(nodes):
                K[3 * a + i, 3 * b + i] += block[a, b]
        for j in range(i + 1, 3):
            for a in range(nodes):
                for b in range(nodes):
                    value = block[a, (j - i) * nodes + b]
                    K[3 * a + i, 3 * b + j] += value
                    K[3 * b + j, 3 * a + i] += value


@njit(cache=True, nogil=True)
def _volumetric(K, change, basis, gram_inverse, bulk_modulus, volumes, growing):
    """K (3 m, 3 m) of the pressure's projected part, and of its growing part but for what stands at the points."""
    seen = basis.T @ change
    projected = gram_inverse @ seen
    bulk_modulus = change.dtype.type(bulk_modulus)
    if len(growing) == 0:
        K[:] = bulk_modulus * (projected.T @ seen)
        return
    weighted, measured = np.empty_like(basis), np.empty_like(basis)
    for g in range(len(growing)):
        weighted[g], measured[g] = growing[g] * basis[g], volumes[g] * basis[g]
    # P^T (k seen + inner P) - P^T cross - cross^T P as one symmetric product of twice as many rows.
    half = (bulk_modulus * seen + (measured.T @ weighted) @ projected) * change.dtype.type(0.5) - weighted.T @ change
    K[:] = np.vstack((projected, half)).T @ np.vstack((half, projected))


@njit(cache=True, nogil=True)
def _in_precision(values, like):
    """A copy of the values (n, k) in the precision of another array."""
    out = np.empty(values.shape, like.dtype)
    out[:] = values
    return out


@njit(cache=True, nogil=True)
def tangent(F, C, J, gradients, volumes, shapes, stress, moduli, pressure, basis, gram_inverse, bulk_modulus, local_modulus,
            growing, like):
    """Tangent (e, 3 m, 3 m) of `internal_force` with the pressure of `SolidBlock`: a projected, a local and a growing part.

    projected = bulk_modulus P(J - 1), P = basis . gram_inverse . integral(basis ...), basis (g, p): symmetric, rank p per element
    local = local_modulus (J - 1/J) / 2;  both moduli in MPa
    growing: derivative (1 - P) growing (1 - P), a modulus (e, g) in MPa, or (0, 0) where there is none
    like: an array in whose precision the products are taken; what stands at a point is found in double precision

    The products run over blocks of components (i, j >= i): K_ij = G^T A_ij G with the gradients G (3 g, m), three large
    products an element instead of one with the strain-displacement matrix, which has a third of zeros.
    """
    elements, points = J.shape
    nodes = gradients.shape[3]
    out = np.empty((elements, 3 * nodes, 3 * nodes), like.dtype)
    G = np.empty((3 * points, nodes), like.dtype)
    rights = (np.empty((3 * points, 3 * nodes), like.dtype), np.empty((3 * points, 2 * nodes), like.dtype),
              np.empty((3 * points, nodes), like.dtype))
    change = np.empty((points, 3 * nodes), like.dtype)
    modes = _in_precision(basis, like)
    A, D, S = np.empty((3, 3, 3, 3), like.dtype), np.empty((6, 6)), np.empty((3, 3))
    grows = growing.size > 0
    for e in range(elements):
        for g in range(points):
            n, j, w, gradient = e * points + g, J[e, g], volumes[shapes[e], g], gradients[shapes[e], g]
            inverse = inverse_symmetric(C[n])
            local = 0.5 * local_modulus * (j * j + 1.0)
            if grows:
                local += growing[e, g] * j * j
            _moduli(D, S, stress[n], moduli[n], inverse, w, pressure[e, g] * j, local)
            _elasticity(A, F[e, g], S, D)
            _volume_change(change[g], F[e, g], inverse, gradient, w * j)
            G[3 * g:3 * g + 3] = gradient
            _times_gradients(rights, A, G, g)
        _volumetric(out[e], change, modes, _in_precision(gram_inverse[shapes[e]], like), bulk_modulus, volumes[shapes[e]],
                    growing[e:e + 1].ravel())
        _add_blocks(out[e], G, rights)
    return out


@njit(cache=True, nogil=True)
def _sym(tensor, i, j):
    """Component (i, j) of a symmetric tensor stored as xx, yy, zz, xy, yz, zx."""
    if i == j:
        return tensor[i]
    if i + j == 1:
        return tensor[3]
    return tensor[4] if i + j == 3 else tensor[5]
