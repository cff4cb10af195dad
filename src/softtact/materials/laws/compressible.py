"""Laws of compressible materials: an energy of the principal stretches without an isochoric and a volumetric part.

`isochoric` of such a law gives the whole response, and `projected_modulus` is 0: elements project no part of it, as these
materials do not lock.

Symbols: l_a principal stretches, c_a = l_a^2, J = l_1 l_2 l_3, t_a = l_a dpsi/dl_a Kirchhoff stress, h_ab = dt_a/dln l_b
Stress:  S = sum_a t_a/c_a N_aN_a
Tangent: D = sum_ab (h_ab - 2 delta_ab t_a)/(c_a c_b) N_aN_a x N_bN_b + sum_a<b Q_ab W_ab x W_ab,
         Q_ab = (S_a - S_b)/(c_a - c_b) = (c_b (t_a - t_b)/(c_a - c_b) - t_b)/(c_a c_b), as in `stretches`.
Here     psi = sum_k 2 mu_k/alpha_k^2 (l_1^alpha_k + l_2^alpha_k + l_3^alpha_k - 3 + (J^(-alpha_k beta_k) - 1)/beta_k), so that
         t_a = sum_k 2 mu_k/alpha_k (l_a^alpha_k - J^(-alpha_k beta_k))  and
         h_ab = sum_k 2 mu_k (delta_ab l_a^alpha_k + beta_k J^(-alpha_k beta_k)).
"""

import math

import numpy as np

from softtact.compiled import compiled
from softtact.materials.laws.base import TEST_PATHS, IsochoricResponse, Law
from softtact.materials.laws.stretches import dyads, eigen, quotient, response, sum_dyads


class CompressibleLaw(Law):
    """A law of terms (mu_k, alpha_k, beta_k); a class gives them by `terms`."""

    def __init__(self, parameters: dict[str, float], **volume: object) -> None:
        """parameters {constant: MPa or 1};  volume: not used, the constants determine it."""
        values = {constant.name: float(parameters[constant.name]) for constant in self.constants}
        self._mu, self._alpha, self._beta = (np.array(column, dtype=float) for column in zip(*self.terms(values), strict=True))
        super().__init__(parameters, bulk_modulus=float((2 * self._mu * (1 / 3 + self._beta)).sum()))

    @classmethod
    def terms(cls, parameters: dict[str, float]) -> list[tuple[float, float, float]]:
        """(mu, alpha, beta) of each term."""
        raise NotImplementedError

    @property
    def projected_modulus(self) -> float:
        return 0.0

    @property
    def mu0(self) -> float:
        return float(self._mu.sum())

    def isochoric(self, C6: np.ndarray, *, tangent: bool = True) -> IsochoricResponse:
        """`IsochoricResponse` of the whole energy for C6 (n, 6)."""
        return response(_response, C6, self._mu, self._alpha, self._beta, tangent=tangent)

    def principal_stress(self, stretches: np.ndarray) -> np.ndarray:
        """Kirchhoff stress t_a (..., 3) in MPa at principal stretches (..., 3), not isochoric ones."""
        logs = np.log(stretches)
        volume = np.expm1(-logs.sum(axis=-1)[..., None] * self._alpha * self._beta)
        return (np.expm1(logs[..., None] * self._alpha) - volume[..., None, :]) @ (2 * self._mu / self._alpha)

    def nominal_stress(self, mode: str, stretch: float | np.ndarray) -> np.ndarray:
        """Nominal stress (MPa) in a `uniaxial`, `equibiaxial` or `planar` test, whose free sides are without stress.

        In `simple_shear`, which keeps the volume, it is the shear stress at the shear strain.
        """
        if mode not in TEST_PATHS:
            return super().nominal_stress(mode, stretch)
        stretches = np.array([self._stretches(mode, value) for value in np.ravel(stretch)]).reshape(*np.shape(stretch), 3)
        self._warn_outside(stretches)
        return self.principal_stress(stretches)[..., 0] / np.asarray(stretch, float)

    def pressure(self, volume_ratio: np.ndarray) -> np.ndarray:
        """Pressure (n,) in MPa from all sides at the volume ratios J (n,): -t/J, all stretches J^(1/3)."""
        J = np.asarray(volume_ratio, float)
        return -self.principal_stress(np.cbrt(J)[:, None] * np.ones(3))[:, 0] / J

    def lateral_stretch(self, mode: str, stretch: float | np.ndarray) -> np.ndarray:
        """Stretch along the free direction in the same tests."""
        return np.array([self._stretches(mode, value)[2] for value in np.ravel(stretch)]).reshape(np.shape(stretch))

    def _stretches(self, mode, stretch):
        """Principal stretches (3,), those of free directions such that they bear no stress."""
        from scipy.optimize import brentq

        second = {"uniaxial": None, "equibiaxial": stretch, "planar": 1.0}[mode]

        def stress_across(log):
            across = math.exp(log)
            return self.principal_stress(np.array([stretch, across if second is None else second, across]))[2]

        across = math.exp(brentq(stress_across, *_bracket(stress_across), xtol=1e-14, rtol=1e-14))
        return np.array([stretch, across if second is None else second, across])

    def uniaxial_compressible(self, stretch: float | np.ndarray) -> np.ndarray:
        """Nominal stress (MPa) of the uniaxial test."""
        return self.nominal_stress("uniaxial", stretch)


def _bracket(function):
    """Two numbers around 0 between which an increasing function changes its sign."""
    low, high = -0.1, 0.1
    while function(low) > 0 and low > -20:
        low *= 2
    while function(high) < 0 and high < 20:
        high *= 2
    return low, high


@compiled(error_model="numpy")
def _response(C6, mu, alpha, beta, energy, stress, tangent):
    """Fill energy (n,), stress (n, 6) and, unless it is empty, tangent (n, 6, 6); mu, alpha, beta (terms,)."""
    A, V, c, t, h, Q = np.empty((3, 3)), np.empty((3, 3)), np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    N, W, D = np.empty((3, 6)), np.empty((3, 6)), np.empty((3, 3))
    for p in range(len(C6)):
        eigen(C6[p], A, V)
        for a in range(3):
            c[a] = A[a, a]
        energy[p], coupling = _principal(c, mu, alpha, beta, t, h)
        dyads(V, N, W)
        for k in range(6):
            stress[p, k] = t[0] / c[0] * N[0, k] + t[1] / c[1] * N[1, k] + t[2] / c[2] * N[2, k]
        if len(tangent) == 0:
            continue
        for a in range(3):
            for b in range(3):
                diagonal = h[a] - 2 * t[a] if a == b else 0.0
                D[a, b] = (diagonal + coupling) / (c[a] * c[b])
        Q[0] = quotient(c, c, t, mu, alpha, 0, 1)
        Q[1] = quotient(c, c, t, mu, alpha, 1, 2)
        Q[2] = quotient(c, c, t, mu, alpha, 2, 0)
        sum_dyads(D, Q, N, W, tangent[p])


@compiled(error_model="numpy")
def _principal(c, mu, alpha, beta, t, h):
    """Energy and sum_k 2 mu_k beta_k J^(-alpha_k beta_k); t and, as h, sum_k 2 mu_k l_a^alpha_k (3,) at eigenvalues c (3,) of C."""
    log_J = 0.5 * (math.log(c[0]) + math.log(c[1]) + math.log(c[2]))
    energy, coupling = 0.0, 0.0
    for a in range(3):
        t[a], h[a] = 0.0, 0.0
    for k in range(len(mu)):
        volume = math.expm1(-alpha[k] * beta[k] * log_J)      # J^(-alpha beta) - 1: exact near rest, too
        coupling += 2 * mu[k] * beta[k] * (volume + 1)
        energy += 2 * mu[k] / alpha[k] ** 2 * (volume / beta[k] if beta[k] != 0.0 else -alpha[k] * log_J)
        for a in range(3):
            excess = math.expm1(0.5 * alpha[k] * math.log(c[a]))
            energy += 2 * mu[k] / alpha[k] ** 2 * excess
            t[a] += 2 * mu[k] / alpha[k] * (excess - volume)
            h[a] += 2 * mu[k] * (excess + 1)
    return energy, coupling
