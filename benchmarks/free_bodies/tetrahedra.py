"""Linear tetrahedra without any projection of the pressure, fast: they lock, and serve where another program has no better.

The deformation is constant in an element, so forces and tangent need only three vectors for each of nodes 1 to 3; what node 0
feels is minus what the others do.
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

from free_bodies.small_tensors import cofactor, combined, cross, dot, left_cauchy_green, symmetric_times, times
from free_bodies.tetrahedra_forces import add_forces
from softtact.materials.laws.invariants import InvariantLaw

_PLACE = ((0, 3, 5), (3, 1, 4), (5, 4, 2))     # of a symmetric matrix's entries in xx, yy, zz, xy, yz, zx


class LinearTetrahedra:
    """Linear tetrahedra (e, 4) at points (n, 3) in mm, of a law psi(i1, i2) of the invariants; `threads` share the elements."""

    def __init__(self, points: np.ndarray, tetrahedra: np.ndarray, law: InvariantLaw, *, threads: int = 1) -> None:
        if not law.volumetric.linear:
            raise ValueError(f"the volumetric function {law.volumetric.name!r} is not that of linear tetrahedra; use 'quadratic'")
        self.law, self.nodes = law, np.ascontiguousarray(tetrahedra, dtype=np.int32)
        self.gradients, self.volumes = _gradients(points, self.nodes)
        if self.volumes.min() <= 0:
            raise ValueError(f"tetrahedron {int(np.argmin(self.volumes))} is inverted")
        bounds = np.linspace(0, len(self.nodes), threads + 1).astype(int)
        self._constants = _constant_derivatives(law)
        self._shares = [slice(a, b) for a, b in zip(bounds[:-1], bounds[1:], strict=True)]
        self._pool = ThreadPoolExecutor(threads) if threads > 1 else None

    def add_force(self, displacement: np.ndarray, force: np.ndarray) -> tuple[float, float] | None:
        """Add nodal forces (n, 3) in N for displacement (n, 3) in mm.

        Returns the energy (mJ) and the sum of the magnitudes of all elements' force components (N); None where a
        J <= 0, or farther from 1 than a nineteenth or nineteenfold.
        """
        def share(part):
            own = force if part.start == 0 else np.zeros_like(force)
            return own, *add_forces(displacement, self.nodes[part], self.gradients[part], self.volumes[part],
                                    self._table(displacement, part), self.law.bulk_modulus, own)

        results = self._map(share)
        energy = sum(energy for _, energy, _ in results)
        if not np.isfinite(energy):
            return None
        for own, _, _ in results[1:]:
            force += own
        return energy, sum(size for _, _, size in results)

    def add_tangent(self, displacement: np.ndarray, values: np.ndarray, positions: np.ndarray) -> None:
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
    """Gradients (e, 3, 3) in 1/mm of the shape functions of nodes 1 to 3 (node 0 has minus their sum), and volumes (e,) in mm3."""
    gradients, volumes = np.empty((len(nodes), 3, 3)), np.empty(len(nodes))
    for e in range(len(nodes)):
        origin = points[nodes[e, 0]]
        x, y, z = points[nodes[e, 1]] - origin, points[nodes[e, 2]] - origin, points[nodes[e, 3]] - origin
        determinant, dual = cofactor((x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]))
        volumes[e] = determinant / 6
        for i in range(9):
            gradients[e, i // 3, i % 3] = dual[i] / determinant
    return gradients, volumes


@njit(cache=True, nogil=True, inline="always")
def _deformation(u, n, g):
    """F by the nodes' displacements from that of node 0, whose gradient is minus the sum of the others'."""
    x0, y0, z0 = u[n[0], 0], u[n[0], 1], u[n[0], 2]
    x1, y1, z1 = u[n[1], 0] - x0, u[n[1], 1] - y0, u[n[1], 2] - z0
    x2, y2, z2 = u[n[2], 0] - x0, u[n[2], 1] - y0, u[n[2], 2] - z0
    x3, y3, z3 = u[n[3], 0] - x0, u[n[3], 1] - y0, u[n[3], 2] - z0
    return (1 + x1 * g[0, 0] + x2 * g[1, 0] + x3 * g[2, 0], x1 * g[0, 1] + x2 * g[1, 1] + x3 * g[2, 1],
            x1 * g[0, 2] + x2 * g[1, 2] + x3 * g[2, 2], y1 * g[0, 0] + y2 * g[1, 0] + y3 * g[2, 0],
            1 + y1 * g[0, 1] + y2 * g[1, 1] + y3 * g[2, 1], y1 * g[0, 2] + y2 * g[1, 2] + y3 * g[2, 2],
            z1 * g[0, 0] + z2 * g[1, 0] + z3 * g[2, 0], z1 * g[0, 1] + z2 * g[1, 1] + z3 * g[2, 1],
            1 + z1 * g[0, 2] + z2 * g[1, 2] + z3 * g[2, 2])


@njit(cache=True, nogil=True, inline="always")
def _isochoric(J):
    """J^(-2/3), NaN where the element is inside out."""
    root = np.cbrt(J) if J > 0 else np.nan
    return 1 / (root * root)


@njit(cache=True, nogil=True, inline="always")
def _row(matrix, row):
    return matrix[row, 0], matrix[row, 1], matrix[row, 2]


@njit(cache=True, nogil=True, error_model="numpy")
def _invariants(displacement, nodes, gradients):
    """Isochoric invariants i1, i2 (e,); NaN where J <= 0."""
    i1, i2 = np.empty(len(nodes)), np.empty(len(nodes))
    for e in range(len(nodes)):
        f = _deformation(displacement, nodes[e], gradients[e])
        I1, I2, _ = left_cauchy_green(f)
        s1 = _isochoric(cofactor(f)[0])
        i1[e], i2[e] = s1 * I1, s1 * s1 * I2
    return i1, i2


@njit(cache=True, nogil=True, error_model="numpy")
def _tangents(displacement, nodes, gradients, volumes, table, bulk_modulus, positions, values):
    whole = np.empty((12, 12))
    for e in range(len(nodes)):
        t = table[e] if len(table) > 1 else table[0]
        _blocks(_deformation(displacement, nodes[e], gradients[e]), gradients[e], volumes[e], t, bulk_modulus, whole)
        _complete(whole)
        count = 0
        for row in range(12):
            for column in range(row, 12):
                place = positions[e, count]
                count += 1
                if place >= 0:
                    values[place] += whole[row, column]


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _blocks(f, gradients, V, t, bulk_modulus, whole):
    """The tangent (12, 12) of nodes 1 to 3, above its diagonal of blocks and on it."""
    J, h = cofactor(f)
    I1, I2, b = left_cauchy_green(f)
    s1 = _isochoric(J)
    s2 = s1 * s1
    r1, r2 = -2 / 3 * I1 / J, -4 / 3 * I2 / J
    p1, p2 = V * t[1] * s1, V * t[2] * s2
    p11, p12, p22 = V * t[3] * s1 * s1, V * t[4] * s1 * s2, V * t[5] * s2 * s2
    c_ff, c_fg, c_gg = 4 * p11 + 4 * p2, 2 * p12, p22
    c_fh = 2 * p11 * r1 + 2 * p12 * r2 - 4 / 3 * p1 / J
    c_gh = p12 * r1 + p22 * r2 - 4 / 3 * p2 / J
    c_hh = (p11 * r1 * r1 + 2 * p12 * r1 * r2 + p22 * r2 * r2 + (10 / 9 * p1 * I1 + 28 / 9 * p2 * I2) / (J * J)
            + V * bulk_modulus)
    c_1, c_2, c_3 = 2 * p1 + 2 * p2 * I1, -2 * p2, p1 * r1 + p2 * r2 + V * bulk_modulus * (J - 1)
    one = _vectors(f, h, b, I1, _row(gradients, 0))
    two = _vectors(f, h, b, I1, _row(gradients, 1))
    three = _vectors(f, h, b, I1, _row(gradients, 2))
    squares, mixed = (c_ff, c_gg, c_hh, c_1), (c_fg, c_gh, c_fh)
    _block(whole, 3, 3, one, one, f, b, squares, mixed, c_2, c_3)
    _block(whole, 3, 6, one, two, f, b, squares, mixed, c_2, c_3)
    _block(whole, 3, 9, one, three, f, b, squares, mixed, c_2, c_3)
    _block(whole, 6, 6, two, two, f, b, squares, mixed, c_2, c_3)
    _block(whole, 6, 9, two, three, f, b, squares, mixed, c_2, c_3)
    _block(whole, 9, 9, three, three, f, b, squares, mixed, c_2, c_3)


@njit(cache=True, nogil=True, inline="always")
def _vectors(f, h, b, I1, G):
    """G_a, f_a, g_a = 2 (I1 f_a - B f_a) and h_a of a node."""
    fa = times(f, G)
    bf = symmetric_times(b, fa)
    return G, fa, (2 * (I1 * fa[0] - bf[0]), 2 * (I1 * fa[1] - bf[1]), 2 * (I1 * fa[2] - bf[2])), times(h, G)


@njit(cache=True, nogil=True, inline="always")
def _block(whole, row, column, first, second, f, b, squares, mixed, c_2, c_3):
    """The block of two nodes, each given by its `_vectors`, at a row and column of `whole`; coefficients as above."""
    (G, fa, ga, ha), (Gb, fb, gb, hb), (c_ff, c_gg, c_hh, c_1), (c_fg, c_gh, c_fh) = first, second, squares, mixed
    fc, gc = combined(c_ff, fb, c_fg, gb, c_fh, hb), combined(c_fg, fb, c_gg, gb, c_gh, hb)
    hc = combined(c_fh, fb, c_gh, gb, c_hh, hb)
    GG, (x, y, z) = dot(G, Gb), times(f, cross(G, Gb))
    unity, turned = c_1 * GG + c_2 * dot(fa, fb), ((0.0, z, -y), (-z, 0.0, x), (y, -x, 0.0))
    for i in range(3):
        for k in range(3):
            whole[row + i, column + k] = (
                fa[i] * fc[k] + ga[i] * gc[k] + ha[i] * hc[k] + (unity if i == k else 0.0)
                + c_2 * (b[_PLACE[i][k]] * GG + fb[i] * fa[k]) + c_3 * turned[i][k])


@njit(cache=True, nogil=True, inline="always")
def _complete(whole):
    """The rows of node 0, minus the sums of the others': a body that moves as a whole feels nothing."""
    for i in range(3):
        for column in range(3, 12):
            total = 0.0
            for row in (3 + i, 6 + i, 9 + i):
                total -= whole[row, column] if row // 3 <= column // 3 else whole[column, row]
            whole[i, column] = total
    for i in range(3):
        for k in range(i, 3):
            whole[i, k] = -(whole[i, 3 + k] + whole[i, 6 + k] + whole[i, 9 + k])
