"""Linear tetrahedra without any projection of the pressure, fast: they lock, and serve where another program has no better.

The deformation is constant in an element, so forces and tangent need only three vectors per node.
Symbols: F deformation gradient, H = J F^-T its cofactor, B = F F^T, I1 = tr B, I2 = (I1^2 - B:B)/2, s1 = J^(-2/3), s2 = J^(-4/3),
         G_a gradient of node a's shape function; f_a = F G_a, h_a = H G_a, g_a = 2 (I1 f_a - B f_a).
Forces:  V (psi1 s1 (2 f_a + r1 h_a) + psi2 s2 (g_a + r2 h_a) + U' h_a),  r1 = -2/3 I1/J, r2 = -4/3 I2/J, U' = K (J - 1)
Tangent: of nodes a, b, components i, k: dyads of f, g, h (coefficients c_ff ... c_hh), and
         V (d_ik (c_1 G_a.G_b + c_2 f_a.f_b) + c_2 (B_ik G_a.G_b + f_b,i f_a,k) + c_3 e_ikm (F (G_a x G_b))_m)
         with c_1 = 2 psi1 s1 + 2 psi2 s2 I1, c_2 = -2 psi2 s2, c_3 = psi1 s1 r1 + psi2 s2 r2 + U'.
Reference: the derivatives of the invariants by F, Holzapfel, Nonlinear Solid Mechanics (2000), section 6.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
from numba import njit


class LinearTetrahedra:
    """Linear tetrahedra (e, 4) at points (n, 3) in mm, of a law psi(i1, i2) of the invariants; `threads` share the elements."""

    def __init__(self, points, tetrahedra, law, *, threads=1):
        self.law, self.nodes = law, np.ascontiguousarray(tetrahedra)
        self.gradients, self.volumes = _gradients(points, self.nodes)
        if self.volumes.min() <= 0:
            raise ValueError(f"tetrahedron {int(np.argmin(self.volumes))} is inverted")
        bounds = np.linspace(0, len(self.nodes), threads + 1).astype(int)
        self._constants = _constant_derivatives(law)
        self._shares = [slice(a, b) for a, b in zip(bounds[:-1], bounds[1:], strict=True)]
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def add_force(self, displacement, force):
        """Add nodal forces (n, 3) in N for displacement (n, 3) in mm.

        Returns the energy (mJ) and the sum of the magnitudes of all elements' force components (N); None where a J <= 0.
        """
        def share(part):
            own = force if part.start == 0 else np.zeros_like(force)
            return own, *_forces(displacement, self.nodes[part], self.gradients[part], self.volumes[part],
                                 self._table(displacement, part), self.law.bulk_modulus, own)

        results = self._map(share)
        energy = sum(energy for _, energy, _ in results)
        if not np.isfinite(energy):
            return None
        for own, _, _ in results[1:]:
            force += own
        return energy, sum(size for _, _, size in results)

    def add_tangent(self, displacement, values, positions):
        """Add the tangent's entries (i, j >= i) to the matrix's values at `positions` (e, 78)."""
        def share(part):
            own = values if part.start == 0 else np.zeros_like(values)
            _tangents(displacement, self.nodes[part], self.gradients[part], self.volumes[part], self._table(displacement, part),
                      self.law.bulk_modulus, positions[part], own)
            return own

        for own in self._map(share)[1:]:
            values += own

    def _map(self, function):
        return list((self._pool.map if self._pool else map)(function, self._shares))

    def _table(self, displacement, part):
        """psi and its five derivatives (e, 6), see `materials.laws.invariants`; (1, 6) where the derivatives are constant."""
        if self._constants is not None:
            return self._constants
        i1, i2 = _invariants(displacement, self.nodes[part], self.gradients[part])
        return _as_table(self.law.derivatives(i1, i2), len(i1))


def _as_table(derivatives, count):
    table = np.empty((count, 6))
    for column, value in enumerate(derivatives):
        table[:, column] = value
    return table


def _constant_derivatives(law):
    """The derivatives (1, 6) of a psi that is linear in the invariants, None for any other law."""
    derivatives = law.derivatives(np.array([3.0, 4.0]), np.array([3.0, 5.0]))
    linear = all(np.ndim(value) == 0 for value in derivatives[1:])
    return _as_table(derivatives._replace(psi=0.0), 1) if linear else None


@njit(cache=True, nogil=True)
def _gradients(points, nodes):
    """Gradients (e, 4, 3) of the shape functions in 1/mm and volumes (e,) in mm3."""
    gradients, volumes = np.empty((len(nodes), 4, 3)), np.empty(len(nodes))
    edges, cofactor = np.empty((3, 3)), np.empty((3, 3))
    for e in range(len(nodes)):
        for i in range(3):
            for j in range(3):
                edges[i, j] = points[nodes[e, i + 1], j] - points[nodes[e, 0], j]
        determinant = _cofactor(edges, cofactor)
        volumes[e] = determinant / 6
        for j in range(3):
            total = 0.0
            for i in range(3):
                gradients[e, i + 1, j] = cofactor[i, j] / determinant
                total += gradients[e, i + 1, j]
            gradients[e, 0, j] = -total
    return gradients, volumes


@njit(cache=True, nogil=True, inline="always")
def _cofactor(f, h):
    """Cofactor of f (3, 3) into h; returns the determinant."""
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        h[i, 0] = f[j, 1] * f[k, 2] - f[j, 2] * f[k, 1]
        h[i, 1] = f[j, 2] * f[k, 0] - f[j, 0] * f[k, 2]
        h[i, 2] = f[j, 0] * f[k, 1] - f[j, 1] * f[k, 0]
    return f[0, 0] * h[0, 0] + f[0, 1] * h[0, 1] + f[0, 2] * h[0, 2]


@njit(cache=True, nogil=True, inline="always")
def _deformation(displacement, nodes, gradients, f):
    for i in range(3):
        for j in range(3):
            total = 1.0 if i == j else 0.0
            for a in range(4):
                total += displacement[nodes[a], i] * gradients[a, j]
            f[i, j] = total


@njit(cache=True, nogil=True, inline="always")
def _left_cauchy_green(f, b):
    """B = F F^T into b; returns its invariants I1, I2."""
    squares = 0.0
    for i in range(3):
        for j in range(3):
            b[i, j] = f[i, 0] * f[j, 0] + f[i, 1] * f[j, 1] + f[i, 2] * f[j, 2]
            squares += b[i, j] * b[i, j]
    I1 = b[0, 0] + b[1, 1] + b[2, 2]
    return I1, 0.5 * (I1 * I1 - squares)


@njit(cache=True, nogil=True, inline="always")
def _node_vectors(f, h, b, I1, gradients, fa, ga, ha):
    for a in range(4):
        for i in range(3):
            fa[a, i] = f[i, 0] * gradients[a, 0] + f[i, 1] * gradients[a, 1] + f[i, 2] * gradients[a, 2]
            ha[a, i] = h[i, 0] * gradients[a, 0] + h[i, 1] * gradients[a, 1] + h[i, 2] * gradients[a, 2]
        for i in range(3):
            ga[a, i] = 2 * (I1 * fa[a, i] - b[i, 0] * fa[a, 0] - b[i, 1] * fa[a, 1] - b[i, 2] * fa[a, 2])


@njit(cache=True, nogil=True, error_model="numpy")
def _invariants(displacement, nodes, gradients):
    """Isochoric invariants i1, i2 (e,); NaN where J <= 0."""
    i1, i2 = np.empty(len(nodes)), np.empty(len(nodes))
    f, h, b = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for e in range(len(nodes)):
        _deformation(displacement, nodes[e], gradients[e], f)
        J = _cofactor(f, h)
        I1, I2 = _left_cauchy_green(f, b)
        s1 = J ** (-2 / 3) if J > 0 else np.nan
        i1[e], i2[e] = s1 * I1, s1 * s1 * I2
    return i1, i2


@njit(cache=True, nogil=True, error_model="numpy")
def _forces(displacement, nodes, gradients, volumes, table, bulk_modulus, force):
    energy, size = 0.0, 0.0
    f, h, b = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    fa, ga, ha = np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3))
    for e in range(len(nodes)):
        _deformation(displacement, nodes[e], gradients[e], f)
        J = _cofactor(f, h)
        I1, I2 = _left_cauchy_green(f, b)
        s1 = J ** (-2 / 3) if J > 0 else np.nan
        t = table[e] if len(table) > 1 else table[0]
        psi = t[0] if len(table) > 1 else t[1] * (s1 * I1 - 3) + t[2] * (s1 * s1 * I2 - 3)
        p1, p2 = volumes[e] * s1 * t[1], volumes[e] * s1 * s1 * t[2]
        ch = -2 / 3 * I1 / J * p1 - 4 / 3 * I2 / J * p2 + volumes[e] * bulk_modulus * (J - 1)
        energy += volumes[e] * (psi + 0.5 * bulk_modulus * (J - 1) ** 2)
        _node_vectors(f, h, b, I1, gradients[e], fa, ga, ha)
        for a in range(4):
            for i in range(3):
                value = 2 * p1 * fa[a, i] + p2 * ga[a, i] + ch * ha[a, i]
                force[nodes[e, a], i] += value
                size += abs(value)
    return energy, size


@njit(cache=True, nogil=True, error_model="numpy")
def _tangents(displacement, nodes, gradients, volumes, table, bulk_modulus, positions, values):
    f, h, b = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    fa, ga, ha = np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3))
    fc, gc, hc = np.empty((4, 3)), np.empty((4, 3)), np.empty((4, 3))
    cross, turned, block = np.empty(3), np.empty(3), np.empty((3, 3))
    for e in range(len(nodes)):
        G, V = gradients[e], volumes[e]
        _deformation(displacement, nodes[e], G, f)
        J = _cofactor(f, h)
        I1, I2 = _left_cauchy_green(f, b)
        _node_vectors(f, h, b, I1, G, fa, ga, ha)
        s1 = J ** (-2 / 3)
        s2 = s1 * s1
        r1, r2 = -2 / 3 * I1 / J, -4 / 3 * I2 / J
        t = table[e] if len(table) > 1 else table[0]
        p1, p2 = V * t[1] * s1, V * t[2] * s2
        p11, p12, p22 = V * t[3] * s1 * s1, V * t[4] * s1 * s2, V * t[5] * s2 * s2
        c_ff, c_fg, c_gg = 4 * p11 + 4 * p2, 2 * p12, p22
        c_fh = 2 * p11 * r1 + 2 * p12 * r2 - 4 / 3 * p1 / J
        c_gh = p12 * r1 + p22 * r2 - 4 / 3 * p2 / J
        c_hh = (p11 * r1 * r1 + 2 * p12 * r1 * r2 + p22 * r2 * r2 + (10 / 9 * p1 * I1 + 28 / 9 * p2 * I2) / (J * J)
                + V * bulk_modulus)
        c_1, c_2, c_3 = 2 * p1 + 2 * p2 * I1, -2 * p2, p1 * r1 + p2 * r2 + V * bulk_modulus * (J - 1)
        for a in range(4):
            for i in range(3):
                fc[a, i] = c_ff * fa[a, i] + c_fg * ga[a, i] + c_fh * ha[a, i]
                gc[a, i] = c_fg * fa[a, i] + c_gg * ga[a, i] + c_gh * ha[a, i]
                hc[a, i] = c_fh * fa[a, i] + c_gh * ga[a, i] + c_hh * ha[a, i]
        for p in range(4):
            for q in range(p, 4):
                GG = G[p, 0] * G[q, 0] + G[p, 1] * G[q, 1] + G[p, 2] * G[q, 2]
                ff = fa[p, 0] * fa[q, 0] + fa[p, 1] * fa[q, 1] + fa[p, 2] * fa[q, 2]
                cross[0] = G[p, 1] * G[q, 2] - G[p, 2] * G[q, 1]
                cross[1] = G[p, 2] * G[q, 0] - G[p, 0] * G[q, 2]
                cross[2] = G[p, 0] * G[q, 1] - G[p, 1] * G[q, 0]
                for i in range(3):
                    turned[i] = c_3 * (f[i, 0] * cross[0] + f[i, 1] * cross[1] + f[i, 2] * cross[2])
                    for k in range(3):
                        block[i, k] = (fa[p, i] * fc[q, k] + ga[p, i] * gc[q, k] + ha[p, i] * hc[q, k]
                                       + c_2 * (b[i, k] * GG + fa[q, i] * fa[p, k]))
                    block[i, i] += c_1 * GG + c_2 * ff
                for i in range(3):
                    j, k = (i + 1) % 3, (i + 2) % 3
                    block[i, j] += turned[k]
                    block[j, i] -= turned[k]
                for i in range(3):
                    row = 3 * p + i
                    for k in range(i if p == q else 0, 3):
                        place = positions[e, row * 12 - row * (row - 1) // 2 + 3 * q + k - row]
                        if place >= 0:
                            values[place] += block[i, k]
