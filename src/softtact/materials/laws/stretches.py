"""Laws in the isochoric principal stretches that are sums of powers: spectral stress and tangent.

Symbols: c_a, N_a eigenvalues and eigenvectors of C, cb = J^(-2/3) c, lb = sqrt(cb),
         g = lb dpsi/dlb = sum_k 2 mu_k/alpha_k lb^alpha_k,  h = dg/dln lb = sum_k 2 mu_k lb^alpha_k,  m = mean of g.
Stress:  S = sum_a (g_a - m)/c_a  N_a N_a
Tangent: D = sum_ab (T_ab - 2 delta_ab (g_a - m))/(c_a c_b)  N_aN_a x N_bN_b  +  sum_a<b Q_ab W_ab x W_ab
         T_ab = delta_ab h_a - (h_a + h_b)/3 + sum h/9,  W_ab = N_a N_b + N_b N_a,
         Q_ab = (S_a - S_b)/(c_a - c_b) = (c_b (g_a - g_b)/(c_a - c_b) - (g_b - m))/(c_a c_b).
         With d = (c_a - c_b)/c_b the difference quotient of a power is cb_b^(alpha/2) expm1(alpha/2 log1p(d))/d:
         accurate to round-off for every d, with the limit alpha/2 at d = 0, so equal stretches need no tolerance.
Reference: Ogden, Non-linear Elastic Deformations (1984), section 6.1; Holzapfel (2000), section 6.6.
"""

import math
from collections.abc import Callable

import numpy as np

from softtact.compiled import compiled
from softtact.materials.laws.base import IsochoricResponse
from softtact.materials.laws.invariants import COLUMN, ROW


def response(kernel: Callable[..., None], C6: np.ndarray, *constants: np.ndarray, tangent: bool) -> IsochoricResponse:
    """The response at C6 (n, 6) by a kernel that fills energy (n,), stress (n, 6) and, unless it is empty, tangent (n, 6, 6)."""
    C6 = np.ascontiguousarray(C6, dtype=float)
    energy, stress = np.empty(len(C6)), np.empty((len(C6), 6))
    moduli = np.empty((len(C6) if tangent else 0, 6, 6))
    kernel(C6, *constants, energy, stress, moduli)
    return IsochoricResponse(energy, stress, moduli if tangent else None)


@compiled(error_model="numpy")
def eigen(C6: np.ndarray, A: np.ndarray, V: np.ndarray) -> None:
    """Eigenvalues of one symmetric C6 (6,) on the diagonal of A (3, 3), eigenvectors in V's columns: cyclic Jacobi.

    Jacobi rather than a closed formula: eigenvectors stay orthogonal to round-off however close the eigenvalues lie.
    """
    for a in range(6):
        A[ROW[a], COLUMN[a]] = C6[a]
        A[COLUMN[a], ROW[a]] = C6[a]
    for i in range(3):
        for j in range(3):
            V[i, j] = 1.0 if i == j else 0.0
    for _ in range(12):
        off = A[0, 1] ** 2 + A[1, 2] ** 2 + A[0, 2] ** 2
        if not off > 1e-34 * (A[0, 0] ** 2 + A[1, 1] ** 2 + A[2, 2] ** 2):
            return
        for pair in range(3):
            _rotate(A, V, ROW[3 + pair], COLUMN[3 + pair])


@compiled(error_model="numpy", inline="always")
def _rotate(A, V, p, q):
    """One Jacobi rotation that makes A[p, q] zero."""
    if A[p, q] == 0.0:
        return
    theta = (A[q, q] - A[p, p]) / (2 * A[p, q])
    t = math.copysign(1.0, theta) / (abs(theta) + math.sqrt(theta * theta + 1))
    cos = 1 / math.sqrt(t * t + 1)
    sin = t * cos
    r = 3 - p - q
    A[p, p] -= t * A[p, q]
    A[q, q] += t * A[p, q]
    A[p, q] = A[q, p] = 0.0
    rp, rq = A[r, p], A[r, q]
    A[r, p] = A[p, r] = cos * rp - sin * rq
    A[r, q] = A[q, r] = sin * rp + cos * rq
    for i in range(3):
        vp, vq = V[i, p], V[i, q]
        V[i, p] = cos * vp - sin * vq
        V[i, q] = sin * vp + cos * vq


@compiled(error_model="numpy")
def power_sum_response(C6: np.ndarray, mu: np.ndarray, alpha: np.ndarray, energy: np.ndarray, stress: np.ndarray,
                       tangent: np.ndarray) -> None:
    """Fill energy (n,), stress (n, 6) and, unless it is empty, tangent (n, 6, 6); mu, alpha (terms,)."""
    A, V, c, cb, dev, h = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    N, W, D, quotients = np.empty((3, 6)), np.empty((3, 6)), np.empty((3, 3)), np.empty(3)
    for p in range(len(C6)):
        eigen(C6[p], A, V)
        for a in range(3):
            c[a] = A[a, a]
        det = c[0] * c[1] * c[2]
        scale = det ** (-1 / 3) if det > 0 else np.nan
        for a in range(3):
            cb[a] = scale * c[a]
        energy[p] = _principal(cb, mu, alpha, dev, h)
        dyads(V, N, W)
        for k in range(6):
            stress[p, k] = dev[0] / c[0] * N[0, k] + dev[1] / c[1] * N[1, k] + dev[2] / c[2] * N[2, k]
        if len(tangent) == 0:
            continue
        total = h[0] + h[1] + h[2]
        for a in range(3):
            for b in range(3):
                diagonal = h[a] - 2 * dev[a] if a == b else 0.0
                D[a, b] = (diagonal - (h[a] + h[b]) / 3 + total / 9) / (c[a] * c[b])
        quotients[0] = quotient(c, cb, dev, mu, alpha, 0, 1)
        quotients[1] = quotient(c, cb, dev, mu, alpha, 1, 2)
        quotients[2] = quotient(c, cb, dev, mu, alpha, 2, 0)
        sum_dyads(D, quotients, N, W, tangent[p])


@compiled(error_model="numpy")
def sum_dyads(D: np.ndarray, Q: np.ndarray, N: np.ndarray, W: np.ndarray, out: np.ndarray) -> None:
    """sum_ab D_ab N_aN_a x N_bN_b + sum_a Q_a W_a x W_a into `out` (6, 6); D (3, 3) symmetric, N and W of `dyads`."""
    for k in range(6):
        d0 = D[0, 0] * N[0, k] + D[0, 1] * N[1, k] + D[0, 2] * N[2, k]
        d1 = D[1, 0] * N[0, k] + D[1, 1] * N[1, k] + D[1, 2] * N[2, k]
        d2 = D[2, 0] * N[0, k] + D[2, 1] * N[1, k] + D[2, 2] * N[2, k]
        w0, w1, w2 = Q[0] * W[0, k], Q[1] * W[1, k], Q[2] * W[2, k]
        for m in range(k, 6):
            value = d0 * N[0, m] + d1 * N[1, m] + d2 * N[2, m] + w0 * W[0, m] + w1 * W[1, m] + w2 * W[2, m]
            out[k, m] = value
            out[m, k] = value


@compiled(error_model="numpy")
def _principal(cb, mu, alpha, dev, h):
    """Energy; dev = g - m and h (3,) at the isochoric eigenvalues cb (3,)."""
    energy, mean = 0.0, 0.0
    for a in range(3):
        dev[a], h[a] = 0.0, 0.0
        log = math.log(cb[a]) / 2
        for k in range(len(mu)):
            excess = math.expm1(alpha[k] * log)  # lb^alpha - 1: keeps the energy exact near the undeformed state
            energy += 2 * mu[k] / alpha[k] ** 2 * excess
            dev[a] += 2 * mu[k] / alpha[k] * excess
            h[a] += 2 * mu[k] * (excess + 1)
        mean += dev[a] / 3
    for a in range(3):
        dev[a] -= mean
    return energy


@compiled(error_model="numpy")
def quotient(c: np.ndarray, cb: np.ndarray, dev: np.ndarray, mu: np.ndarray, alpha: np.ndarray, a: int, b: int) -> float:
    """Q_ab = (S_a - S_b)/(c_a - c_b), exact also where c_a = c_b."""
    d = (c[a] - c[b]) / c[b]
    slope = 0.0
    for k in range(len(mu)):
        beta = alpha[k] / 2
        growth = beta if d == 0.0 else math.expm1(beta * math.log1p(d)) / d
        slope += mu[k] / beta * cb[b] ** beta * growth
    return (slope - dev[b]) / (c[a] * c[b])


@compiled(error_model="numpy")
def dyads(V: np.ndarray, N: np.ndarray, W: np.ndarray) -> None:
    """N_a N_a as N (3, 6) and N_a N_b + N_b N_a of the pairs 01, 12, 20 as W (3, 6)."""
    for a in range(3):
        b = (a + 1) % 3
        for k in range(6):
            i, j = ROW[k], COLUMN[k]
            N[a, k] = V[i, a] * V[j, a]
            W[a, k] = V[i, a] * V[j, b] + V[j, a] * V[i, b]


def stretch_range(C6: np.ndarray, *, isochoric: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Smallest and largest principal stretch (n,), isochoric or not, at points with C6 (n, 6).

    Eigenvalues of a symmetric 3 x 3 matrix in closed form (Smith, Comm. ACM 4 (1961) 168).
    """
    xx, yy, zz, xy, yz, zx = C6.T
    mean = (xx + yy + zz) / 3
    a, b, c = xx - mean, yy - mean, zz - mean
    spread = np.sqrt(np.maximum((a * a + b * b + c * c + 2 * (xy * xy + yz * yz + zx * zx)) / 6, 1e-30))
    deviator = a * (b * c - yz * yz) - xy * (xy * c - yz * zx) + zx * (xy * yz - b * zx)
    angle = np.arccos(np.clip(deviator / (2 * spread**3), -1.0, 1.0)) / 3
    high, low = mean + 2 * spread * np.cos(angle), mean + 2 * spread * np.cos(angle + 2 * np.pi / 3)
    volume = (high * low * (3 * mean - high - low)) ** (1 / 3) if isochoric else 1.0
    return np.sqrt(low / volume), np.sqrt(high / volume)
