"""Compiled loops over elements: kinematics, internal forces, tangents, and the projection and penalties of the volume change.

They take and return named tuples of arrays, which numba passes to compiled code unchanged. Symmetric tensors are stored as
xx, yy, zz, xy, yz, zx. All kernels run on one core and release the GIL.
"""

from typing import NamedTuple

import numpy as np

from softtact.compiled import compiled

_ROW = np.array([0, 1, 2, 0, 1, 2])
_COL = np.array([0, 1, 2, 1, 2, 0])
_VOIGT = np.array([[0, 3, 5], [3, 1, 4], [5, 4, 2]])
_PAIR = np.array([0, 2, 3])     # components (i, j >= i) are pair _PAIR[i] + j: 00 01 02 11 12 22
_LANES = 16                     # single precision numbers in the widest vector register of a processor
_AT_ONCE = 4                    # modes of the pressure that are added at once


class ElementArrays(NamedTuple):
    """Elements (e,) of one kind at rest. Many are translations of each other, so data that depend on the shape are stored once.

    gradients: (u, g, 3, m) of the shape functions of m nodes at g points, in 1/mm, for the u different shapes
    volumes: (u, g) of the points, in mm3
    shapes: (e,) index of each element's shape among the u shapes
    basis: (g, p) functions on which the volume change is projected
    gram_inverse: (u, p, p) inverse of the integrals of their products, in 1/mm3
    """

    gradients: np.ndarray
    volumes: np.ndarray
    shapes: np.ndarray
    basis: np.ndarray
    gram_inverse: np.ndarray


class Deformation(NamedTuple):
    """Deformation gradient F (e, g, 3, 3), C = F^T F (e*g, 6) and volume ratio J (e, g) at the elements' points."""

    F: np.ndarray
    C: np.ndarray
    J: np.ndarray


class VolumePenalties(NamedTuple):
    """Moduli (MPa) of the penalties on the volume change outside the projection: k and q of `solid_block`."""

    unprojected: float
    quartic: float


class VolumeResponse(NamedTuple):
    """The volumetric response of elements.

    energies: (e,) in mJ
    pressure: (e, g) derivative of the energy density by J in MPa, positive in tension
    modulus: U'' in MPa if it does not depend on J
    stiffness: (e, g) U'' in MPa at the projected J if it depends on J, else (0, 0)
    unprojected: k in MPa
    quartic: (e, g) second derivative in MPa of the quartic penalty by the unprojected part of J, (0, 0) without the penalty
    """

    energies: np.ndarray
    pressure: np.ndarray
    modulus: float
    stiffness: np.ndarray
    unprojected: float
    quartic: np.ndarray

    def of(self, part: slice) -> "VolumeResponse":
        """The response of some of the elements."""
        return self._replace(energies=self.energies[part], pressure=self.pressure[part],
                             stiffness=self.stiffness[part] if self.stiffness.size else self.stiffness,
                             quartic=self.quartic[part] if self.quartic.size else self.quartic)


@compiled(fastmath={"reassoc", "contract"})     # sums over nodes, several at once
def _gradient(along, slopes):
    """Derivatives by x, y, z of one displacement component with nodal values (m,); slopes (3, m): shape gradients at a point."""
    by_x, by_y, by_z = 0.0, 0.0, 0.0
    for a in range(len(along)):
        by_x += along[a] * slopes[0, a]
        by_y += along[a] * slopes[1, a]
        by_z += along[a] * slopes[2, a]
    return by_x, by_y, by_z


@compiled
def deformation(displacement: np.ndarray, at_rest: ElementArrays) -> Deformation:
    """`Deformation` of elements, given by their `ElementArrays`, from nodal displacement (e, m, 3) in mm."""
    gradients, shapes = at_rest.gradients, at_rest.shapes
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
    return Deformation(F, C, J)


@compiled
def add_forces(total: np.ndarray, nodes: np.ndarray, forces: np.ndarray) -> None:
    """Add element forces (e, m, 3) to the nodal forces (n, 3); nodes (e, m)."""
    for e in range(len(nodes)):
        for a in range(nodes.shape[1]):
            for i in range(3):
                total[nodes[e, a], i] += forces[e, a, i]


@compiled
def inverse_symmetric(c: np.ndarray) -> np.ndarray:
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


@compiled
def internal_force(deformed: Deformation, at_rest: ElementArrays, stress: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """Nodal forces (e, 3 m) in N: isochoric second Piola-Kirchhoff stress (e*g, 6) plus pressure (e, g) J C^-1, both in MPa."""
    F, C, J = deformed.F, deformed.C, deformed.J
    gradients, volumes, shapes = at_rest.gradients, at_rest.volumes, at_rest.shapes
    elements, points = J.shape
    nodes = gradients.shape[3]
    force = np.empty((elements, 3 * nodes))
    nodal = np.empty((3, nodes))
    S = np.empty((3, 3))
    P = np.empty((3, 3))
    for e in range(elements):
        nodal[:] = 0.0
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
                    nodal[i, a] += x * slopes[0, a] + y * slopes[1, a] + z * slopes[2, a]
        for a in range(nodes):
            for i in range(3):
                force[e, 3 * a + i] = nodal[i, a]
    return force


@compiled(fastmath={"contract"})
def _elasticity(A, f, S, D):
    """First elasticity tensor A (k, ij, l) = F_ip F_jq D_pkql + delta_ij S_kl, pairs ij as in `_PAIR`, from D (6, 6) at rest."""
    half = np.empty((3, 6))
    for i in range(3):
        for k in range(3):
            for m in range(6):
                half[k, m] = f[i, 0] * D[_VOIGT[0, k], m] + f[i, 1] * D[_VOIGT[1, k], m] + f[i, 2] * D[_VOIGT[2, k], m]
        for j in range(i, 3):
            for k in range(3):
                for l in range(3):
                    total = S[k, l] if i == j else 0.0
                    for q in range(3):
                        total += half[k, _VOIGT[q, l]] * f[j, q]
                    A[k, _PAIR[i] + j, l] = total


@compiled(inline="always")
def _moduli(D, S, stress, moduli, inverse, w, pj, local):
    """Stress S (3, 3) and material tangent D (6, 6) at a point, both times its volume w.

    pj: pressure times J;  local: J^2 dp/dJ of the terms that depend on this point's J alone
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


@compiled(fastmath={"contract"})
def _volume_change(change, f, inverse, slopes, scale):
    """Write the derivatives of a point's volume by the nodal displacements, scale F C^-1 : G, into `change`, by components."""
    number, (by_x, by_y, by_z), width = slopes.dtype.type, (slopes[0], slopes[1], slopes[2]), slopes.shape[1]
    for i in range(3):
        x = number(scale * (f[i, 0] * inverse[0] + f[i, 1] * inverse[3] + f[i, 2] * inverse[5]))
        y = number(scale * (f[i, 0] * inverse[3] + f[i, 1] * inverse[1] + f[i, 2] * inverse[4]))
        z = number(scale * (f[i, 0] * inverse[5] + f[i, 1] * inverse[4] + f[i, 2] * inverse[2]))
        part = change[i * width:(i + 1) * width]
        for a in range(width):
            part[a] = x * by_x[a] + y * by_y[a] + z * by_z[a]


@compiled(fastmath={"contract"})
def _times_gradients(right, A, slopes):
    """A_ij G of a point (3, 6 width), the pairs ij side by side, from A (3, 6, 3) and the gradients G (3, width)."""
    by_x, by_y, by_z, width = slopes[0], slopes[1], slopes[2], slopes.shape[1]
    for k in range(3):
        for pair in range(6):
            x, y, z, part = A[k, pair, 0], A[k, pair, 1], A[k, pair, 2], right[k, pair * width:(pair + 1) * width]
            for a in range(width):
                part[a] = x * by_x[a] + y * by_y[a] + z * by_z[a]


@compiled(fastmath={"contract"})
def _add_products(blocks, G, right):
    """Blocks (even, 6 width) plus G^T (A_ij G) of two points: gradients G (6, width), A_ij G (6, 6 width).

    It handles two points and two nodes at once, so that each loaded number is used twice: twice as fast as BLAS for small matrices.
    """
    g0, g1, g2, g3, g4, g5 = G[0], G[1], G[2], G[3], G[4], G[5]
    r0, r1, r2, r3, r4, r5 = right[0], right[1], right[2], right[3], right[4], right[5]
    for a in range(0, len(blocks), 2):
        s0, s1, s2, s3, s4, s5 = g0[a], g1[a], g2[a], g3[a], g4[a], g5[a]
        t0, t1, t2, t3, t4, t5 = g0[a + 1], g1[a + 1], g2[a + 1], g3[a + 1], g4[a + 1], g5[a + 1]
        first, second = blocks[a], blocks[a + 1]
        for b in range(blocks.shape[1]):
            x0, x1, x2, x3, x4, x5 = r0[b], r1[b], r2[b], r3[b], r4[b], r5[b]
            first[b] += s0 * x0 + s1 * x1 + s2 * x2 + s3 * x3 + s4 * x4 + s5 * x5
            second[b] += t0 * x0 + t1 * x1 + t2 * x2 + t3 * x3 + t4 * x4 + t5 * x5


@compiled(fastmath={"contract"})
def _add_modes(blocks, nodes, left, right):
    """Blocks plus left^T right of modes (p, 3 width), p a multiple of `_AT_ONCE`."""
    width = left.shape[1] // 3
    for m in range(0, len(left), _AT_ONCE):
        for i in range(3):
            start, (r0, r1, r2, r3) = i * width, (right[m], right[m + 1], right[m + 2], right[m + 3])
            r0, r1, r2, r3 = r0[start:], r1[start:], r2[start:], r3[start:]
            for a in range(nodes):
                w, x, y, z = left[m, start + a], left[m + 1, start + a], left[m + 2, start + a], left[m + 3, start + a]
                row = blocks[a, (_PAIR[i] + i) * width:(_PAIR[i] + 3) * width]
                for b in range(len(row)):
                    row[b] += w * r0[b] + x * r1[b] + y * r2[b] + z * r3[b]


@compiled(inline="always")
def _add_volumetric(blocks, nodes, change, modes, volumes, volume, e):
    """Add the blocks of an element's projected volume change and of the quartic penalty, without the latter's pointwise part.

    change (g, 3 width): see `_volume_change`;  modes: basis (g, p) and inverse Gram matrix (p, p);  volume: `VolumeResponse`
    """
    basis, gram_inverse = modes
    seen = basis.T @ change
    projected = gram_inverse @ seen
    if volume.stiffness.size > 0:
        stiff = (_weighted(basis, volumes).T @ _weighted(basis, volume.stiffness[e])) @ projected
    else:
        stiff = change.dtype.type(volume.modulus) * seen
    if volume.quartic.size == 0:
        _add_modes(blocks, nodes, projected, stiff)
        return
    weighted, measured = _weighted(basis, volume.quartic[e]), _weighted(basis, volumes)
    # P^T (k seen + inner P) - P^T cross - cross^T P as one symmetric sum of two products.
    half = (stiff + (measured.T @ weighted) @ projected) * change.dtype.type(0.5) - weighted.T @ change
    _add_modes(blocks, nodes, projected, half)
    _add_modes(blocks, nodes, half, projected)


@compiled
def _weighted(basis, weights):
    """Functions (g, p), each times its point's weight (g,), in the functions' precision."""
    out = np.empty_like(basis)
    for g in range(len(weights)):
        for p in range(basis.shape[1]):
            out[g, p] = weights[g] * basis[g, p]
    return out


@compiled(inline="always")
def _spread(K, blocks, width):
    """Fill K (3 m, 3 m), unknowns node by node, from the blocks of pairs (ij) of components."""
    nodes = len(K) // 3
    for i in range(3):
        for j in range(i, 3):
            start = (_PAIR[i] + j) * width
            for a in range(nodes):
                for b in range(nodes):
                    K[3 * a + i, 3 * b + j] = K[3 * b + j, 3 * a + i] = blocks[a, start + b]


@compiled(inline="always")
def _padded(values, rows, columns, like):
    """A copy of the values (n, k) in the precision of another array, with zeros up to (rows, columns)."""
    out = np.zeros((rows, columns), like.dtype)
    for i in range(len(values)):
        for j in range(values.shape[1]):
            out[i, j] = values[i, j]
    return out


@compiled
def tangent(deformed: Deformation, at_rest: ElementArrays, stress: np.ndarray, moduli: np.ndarray, volume: VolumeResponse,
            like: np.ndarray) -> np.ndarray:
    """Tangent (e, 3 m, 3 m) in N/mm of `internal_force` with the pressure of a `VolumeResponse`.

    stress (e*g, 6), moduli (e*g, 6, 6) in MPa: of the law without its volume
    Derivatives of the pressure by J, with P = basis . gram_inverse . integral(basis ...): P U'' P of rank p per element; of the
    unprojected penalty k (1 + 1/J^2) / 2 at each point; of the quartic one (1 - P) quartic (1 - P).
    like: an array in whose precision the products are taken; quantities at single points are computed in double precision

    The products use blocks of components (i, j >= i): K_ij = G^T A_ij G with the gradients G (3 g, m), six blocks side by side in
    rows of full vector registers, instead of one product with the strain-displacement matrix, of which a third are zeros.
    """
    F, C, J = deformed.F, deformed.C, deformed.J
    gradients, volumes, shapes = at_rest.gradients, at_rest.volumes, at_rest.shapes
    pressure, quartic, unprojected = volume.pressure, volume.quartic, volume.unprojected
    elements, points = J.shape
    nodes = gradients.shape[3]
    width = -(-nodes // _LANES) * _LANES
    out = np.empty((elements, 3 * nodes, 3 * nodes), like.dtype)
    blocks, right = np.empty((nodes + nodes % 2, 6 * width), like.dtype), np.empty((6, 6 * width), like.dtype)
    G, change = np.zeros((3 * points + 3, width), like.dtype), np.empty((points, 3 * width), like.dtype)
    several = -(-at_rest.basis.shape[1] // _AT_ONCE) * _AT_ONCE
    basis = _padded(at_rest.basis, points, several, like)
    A, D, S = np.empty((3, 6, 3), like.dtype), np.empty((6, 6)), np.empty((3, 3))
    penalised = quartic.size > 0
    for e in range(elements):
        blocks[:], right[:] = 0.0, 0.0
        for g in range(points):
            n, j, w, slopes = e * points + g, J[e, g], volumes[shapes[e], g], G[3 * g:3 * g + 3]
            inverse = inverse_symmetric(C[n])
            local = 0.5 * unprojected * (j * j + 1.0)
            if penalised:
                local += quartic[e, g] * j * j
            _moduli(D, S, stress[n], moduli[n], inverse, w, pressure[e, g] * j, local)
            _elasticity(A, F[e, g], S, D)
            for i in range(3):
                for a in range(nodes):
                    slopes[i, a] = gradients[shapes[e], g, i, a]
            _volume_change(change[g], F[e, g], inverse, slopes, w * j)
            _times_gradients(right[3 * (g % 2):], A, slopes)
            if g % 2 == 1:
                _add_products(blocks, G[3 * g - 3:], right)
        if points % 2 == 1:
            right[3:] = 0.0
            _add_products(blocks, G[3 * points - 3:], right)
        modes = basis, _padded(at_rest.gram_inverse[shapes[e]], several, several, like)
        _add_volumetric(blocks, nodes, change, modes, volumes[shapes[e]], volume, e)
        _spread(out[e], blocks, width)
    return out


@compiled(inline="always")
def _sym(tensor, i, j):
    """Component (i, j) of a symmetric tensor stored as xx, yy, zz, xy, yz, zx."""
    if i == j:
        return tensor[i]
    if i + j == 1:
        return tensor[3]
    return tensor[4] if i + j == 3 else tensor[5]


@compiled
def project(field: np.ndarray, at_rest: ElementArrays) -> np.ndarray:
    """Fields (e, g) of elements, projected on the functions of the pressure (e, g)."""
    out = np.empty(field.shape)
    for e in range(len(field)):
        _project(field[e], at_rest.volumes[at_rest.shapes[e]], at_rest.basis, at_rest.gram_inverse[at_rest.shapes[e]], out[e])
    return out


@compiled
def add_penalties(J: np.ndarray, at_rest: ElementArrays, seen: np.ndarray, density: np.ndarray, pressure: np.ndarray,
                  penalties: VolumePenalties) -> tuple[np.ndarray, np.ndarray]:
    """Volumetric energies (e,) in mJ; second derivative (e, g) in MPa of the quartic penalty, or (0, 0) without it.

    seen, density, pressure (e, g): the projected J - 1, and the law's U and U' there, in MPa; the penalties are added to `pressure`
    """
    volumes, (elements, points) = at_rest.volumes, J.shape
    k, q = penalties.unprojected, penalties.quartic
    energies, quartic = np.zeros(elements), np.empty((elements, points) if q > 0 else (0, 0))
    held, share = np.empty(points), np.empty(points)
    for e in range(elements):
        shape = at_rest.shapes[e]
        for g in range(points):
            j, energy = J[e, g], density[e, g]
            if k > 0:
                pressure[e, g] += 0.5 * k * (j - 1.0 / j)
                energy += 0.25 * k * (j * j - 1.0 - 2.0 * np.log(j))
            if q > 0:
                unseen = j - 1.0 - seen[e, g]
                held[g] = q * unseen * unseen * unseen
                quartic[e, g] = 3.0 * q * unseen * unseen
                energy += 0.25 * held[g] * unseen
            energies[e] += volumes[shape, g] * energy
        if q > 0:
            _project(held, volumes[shape], at_rest.basis, at_rest.gram_inverse[shape], share)
            for g in range(points):
                pressure[e, g] += held[g] - share[g]
    return energies, quartic


@compiled
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
