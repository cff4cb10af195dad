"""Laws in the isochoric invariants: from scalar derivatives of psi to stress and tangent.

Symbols: I1 = tr C, I2 = (I1^2 - C:C)/2, i1 = J^(-2/3) I1, i2 = J^(-4/3) I2 (isochoric), G = C^-1,
         psi1 = dpsi/di1, psi12 = d2psi/di1 di2, and so on.
Stress:  S = 2 (psi1 A + psi2 B),  A = di1/dC = J^(-2/3) (I - I1/3 G),  B = di2/dC = J^(-4/3) (I1 I - C - 2/3 I2 G)
Tangent: D = 4 (psi11 AA + psi12 (AB + BA) + psi22 BB + psi1 dA/dC + psi2 dB/dC)
         dA/dC = J^(-2/3) (-(IG + GI)/3 + I1/9 GG + I1/3 H)
         dB/dC = J^(-4/3) (II - 1 - 2/3 (MG + GM) + 4/9 I2 GG + 2/3 I2 H),  M = I1 I - C
         where XY is a dyad, 1 the symmetric identity and H = -dG/dC.
Reference: Holzapfel, Nonlinear Solid Mechanics (2000), sections 6.4 and 6.6.

A law only supplies psi and its five derivatives as arrays, so no compiled function is passed to another, and the two
kernels are compiled once for all laws.
"""

from typing import NamedTuple

import numpy as np

from softtact.compiled import compiled
from softtact.materials.laws.base import IsochoricResponse, Law

ROW = np.array([0, 1, 2, 0, 1, 2])
COLUMN = np.array([0, 1, 2, 1, 2, 0])


class Derivatives(NamedTuple):
    """psi and its derivatives by i1 and i2 (MPa); each (n,) or a scalar."""

    psi: np.ndarray
    psi1: np.ndarray | float
    psi2: np.ndarray | float = 0.0
    psi11: np.ndarray | float = 0.0
    psi12: np.ndarray | float = 0.0
    psi22: np.ndarray | float = 0.0


class InvariantLaw(Law):
    """A law psi(i1, i2)."""

    def derivatives(self, i1: np.ndarray, i2: np.ndarray) -> Derivatives:
        """`Derivatives` at the isochoric invariants i1, i2 (n,)."""
        raise NotImplementedError

    @property
    def mu0(self) -> float:
        start = self.derivatives(np.array(3.0), np.array(3.0))
        return float(2 * (start.psi1 + start.psi2))

    def isochoric(self, C6: np.ndarray, *, tangent: bool = True) -> IsochoricResponse:
        C6 = np.ascontiguousarray(C6, dtype=float)
        i1, i2 = isochoric_invariants(C6)
        table = _table(self.derivatives(i1, i2), len(C6))
        stress = np.empty((len(C6), 6))
        moduli = np.empty((len(C6) if tangent else 0, 6, 6))
        _stress_and_tangent(C6, table, stress, moduli)
        return IsochoricResponse(table[:, 0].copy(), stress, moduli if tangent else None)

    def principal_stress(self, stretches: np.ndarray) -> np.ndarray:
        square = np.asarray(stretches) ** 2
        i1 = square.sum(axis=-1)
        i2 = (i1**2 - (square**2).sum(axis=-1)) / 2
        law = self.derivatives(i1, i2)
        psi1, psi2 = (np.broadcast_to(value, i1.shape)[..., None] for value in (law.psi1, law.psi2))
        return 2 * square * (psi1 + psi2 * (i1[..., None] - square))


def _table(derivatives, n):
    """The six derivatives as one array (n, 6), scalars spread."""
    table = np.empty((n, 6))
    for column, value in enumerate(derivatives):
        table[:, column] = value
    return table


@compiled(error_model="numpy")
def isochoric_invariants(C6: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Isochoric invariants i1, i2 (n,) of C6 (n, 6); NaN where det C <= 0."""
    n = len(C6)
    i1, i2 = np.empty(n), np.empty(n)
    for p in range(n):
        xx, yy, zz, xy, yz, zx = C6[p, 0], C6[p, 1], C6[p, 2], C6[p, 3], C6[p, 4], C6[p, 5]
        det = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * zx) + zx * (xy * yz - yy * zx)
        scale = det ** (-1 / 3) if det > 0 else np.nan
        i1[p] = scale * (xx + yy + zz)
        i2[p] = scale * scale * (xx * yy + yy * zz + zz * xx - xy * xy - yz * yz - zx * zx)
    return i1, i2


@compiled(error_model="numpy", inline="always")
def _inverse(c, G):
    """Components of C^-1 into G (6,); returns det C."""
    G[0] = c[1] * c[2] - c[4] * c[4]
    G[1] = c[0] * c[2] - c[5] * c[5]
    G[2] = c[0] * c[1] - c[3] * c[3]
    G[3] = c[4] * c[5] - c[3] * c[2]
    G[4] = c[3] * c[5] - c[0] * c[4]
    G[5] = c[3] * c[4] - c[1] * c[5]
    det = c[0] * G[0] + c[3] * G[3] + c[5] * G[5]
    for k in range(6):
        G[k] /= det
    return det


@compiled(error_model="numpy", inline="always")
def _inverse_gradient(g, H):
    """H = -dG/dC as (6, 6): H_ijkl = (G_ik G_jl + G_il G_jk)/2, from g (3, 3)."""
    for a in range(6):
        i, j = ROW[a], COLUMN[a]
        for b in range(a, 6):
            k, m = ROW[b], COLUMN[b]
            H[a, b] = 0.5 * (g[i, k] * g[j, m] + g[i, m] * g[j, k])


@compiled(error_model="numpy")
def _stress_and_tangent(C6, table, stress, tangent):
    """Fill stress (n, 6) and, unless it is empty, tangent (n, 6, 6) from C6 (n, 6) and the derivatives (n, 6)."""
    G, M, A, B = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    g, H = np.empty((3, 3)), np.empty((6, 6))
    for p in range(len(C6)):
        c = C6[p]
        det = _inverse(c, G)
        s1 = det ** (-1 / 3)
        s2 = s1 * s1
        I1 = c[0] + c[1] + c[2]
        I2 = c[0] * c[1] + c[1] * c[2] + c[2] * c[0] - c[3] * c[3] - c[4] * c[4] - c[5] * c[5]
        psi1, psi2, psi11, psi12, psi22 = table[p, 1], table[p, 2], table[p, 3], table[p, 4], table[p, 5]
        for a in range(6):
            one = 1.0 if a < 3 else 0.0
            M[a] = I1 * one - c[a]
            A[a] = s1 * (one - I1 / 3 * G[a])
            B[a] = s2 * (M[a] - 2 / 3 * I2 * G[a])
            stress[p, a] = 2 * (psi1 * A[a] + psi2 * B[a])
        if len(tangent) == 0:
            continue
        for a in range(6):
            g[ROW[a], COLUMN[a]] = G[a]
            g[COLUMN[a], ROW[a]] = G[a]
        _inverse_gradient(g, H)
        for a in range(6):
            one_a = 1.0 if a < 3 else 0.0
            for b in range(a, 6):
                one_b = 1.0 if b < 3 else 0.0
                identity = 0.0 if a != b else (1.0 if a < 3 else 0.5)
                GG = G[a] * G[b]
                dA = s1 * (-(one_a * G[b] + G[a] * one_b) / 3 + I1 / 9 * GG + I1 / 3 * H[a, b])
                dB = one_a * one_b - identity - 2 / 3 * (M[a] * G[b] + G[a] * M[b])
                dB = s2 * (dB + I2 * (4 / 9 * GG + 2 / 3 * H[a, b]))
                value = psi11 * A[a] * A[b] + psi12 * (A[a] * B[b] + B[a] * A[b]) + psi22 * B[a] * B[b]
                value = 4 * (value + psi1 * dA + psi2 * dB)
                tangent[p, a, b] = value
                tangent[p, b, a] = value
