"""What a law remembers at a point: softening of the first cycles (Mullins effect) and relaxation (Prony series).

Symbols       psi and S isochoric energy and second Piola-Kirchhoff stress of the law at first loading (MPa), W = psi and W_max its
              greatest value so far; eta(W, W_max) the softening of `mullins`; S0 = f eta S the instantaneous stress, f the factor
              from the law's moduli to the instantaneous ones; g_i, tau_i of `prony`; E = (C - 1)/2
Relaxation    S_iso(t) = g_inf S0(t) + sum h_i(t),  h_i(t) = int g_i exp(-(t - s)/tau_i) dS0/ds ds
Increment     of dt, with x_i = dt/tau_i, a_i = (1 - exp(-x_i))/x_i and S0 linear in time (error of second order):
              h_i(n+1) = exp(-x_i) h_i(n) + g_i a_i (S0(n+1) - S0(n)),  so that
              S_iso = (g_inf + sum g_i a_i) S0 + H  with  H = sum(exp(-x_i) h_i(n) - g_i a_i S0(n))
Potential     of an increment: (g_inf + sum g_i a_i) f psi_eta(W) + H:E, with d psi_eta/dW = eta; its tangent is symmetric
Limits        dt = 0: the instantaneous law; dt infinite: the relaxed one. The energy U(J) of volume neither softens nor relaxes.
References    Simo, Comput. Methods Appl. Mech. Eng. 60 (1987) 153-173; Holzapfel, Nonlinear Solid Mechanics (2000), section 6.10;
              Taylor, Pister and Goudreau, Int. J. Numer. Methods Eng. 2 (1970) 45-59 (the increment)
"""

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from softtact.materials.laws.base import IsochoricResponse
from softtact.materials.mullins import Mullins
from softtact.materials.prony import PronySeries

_AT_REST = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])  # C
_TWICE = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])  # of components in a product of tensors


@dataclass(frozen=True)
class PointHistory:
    """What n points remember as an increment begins, and what the increment's duration makes of it. Stresses in MPa."""

    greatest: np.ndarray
    """(n,) W_max."""
    internal: np.ndarray
    """(terms, n, 6) h_i."""
    instantaneous: np.ndarray
    """(n, 6) S0."""
    decay: np.ndarray
    """(terms,) exp(-x_i)."""
    gain: np.ndarray
    """(terms,) g_i a_i."""
    share: float
    """g_inf + sum g_i a_i."""
    carried: np.ndarray
    """(n, 6) H."""

    def part(self, elements: slice | np.ndarray, points: int) -> "PointHistory":
        """That of some elements, each with so many points."""
        if isinstance(elements, slice) and elements == slice(None):
            return self

        def of(values: np.ndarray) -> np.ndarray:
            return values.reshape(-1, points, *values.shape[1:])[elements].reshape(-1, *values.shape[1:])

        return replace(self, greatest=of(self.greatest), carried=of(self.carried))


@dataclass(frozen=True)
class Inelastic:
    """Softening and relaxation of a law's isochoric stress; either may be missing."""

    mullins: Mullins | None = None
    """Softening of the first cycles."""
    prony: PronySeries | None = None
    """Relaxation."""

    @property
    def shortest_s(self) -> float:
        """The shortest relaxation time in s; infinite without relaxation."""
        return min(self.prony.tau_s) if self.prony else math.inf

    def scaled(self, factor: float) -> Self:
        """That of the law with all stresses times a factor."""
        softer = self.mullins and replace(self.mullins, m_mpa=factor * self.mullins.m_mpa)
        return replace(self, mullins=softer)

    def at_rest(self, count: int) -> PointHistory:
        """The history of so many points that were never loaded."""
        return self._begun(np.zeros(count), np.zeros((self._terms, count, 6)), np.zeros((count, 6)), math.inf)

    def after(self, history: PointHistory, elastic: IsochoricResponse, seconds: float) -> PointHistory:
        """The history at the end of an increment, from which another one of `seconds` begins.

        elastic: the response of the law at first loading, at the increment's end
        """
        stress = self._instantaneous(history, elastic)
        change = stress - history.instantaneous
        internal = history.decay[:, None, None] * history.internal + history.gain[:, None, None] * change
        return self._begun(np.maximum(history.greatest, elastic.energy), internal, stress, seconds)

    def response(self, history: PointHistory, elastic: IsochoricResponse, C6: np.ndarray) -> IsochoricResponse:
        """Potential, stress and tangent within an increment, of points with C6 (n, 6) and a law's response there."""
        scale = self._factor * history.share
        eta, slope, energy = self._softening(history, elastic)
        tangent = elastic.tangent
        if tangent is not None:
            tangent = scale * eta[:, None, None] * tangent
            if self.mullins:
                tangent += (scale * slope)[:, None, None] * (elastic.stress[:, :, None] * elastic.stress[:, None])
        potential = scale * energy + 0.5 * ((C6 - _AT_REST) * _TWICE * history.carried).sum(axis=1)
        return IsochoricResponse(potential, scale * eta[:, None] * elastic.stress + history.carried, tangent)

    @property
    def _terms(self):
        return len(self.prony.g) if self.prony else 0

    @property
    def _factor(self):
        return self.prony.instantaneous_factor if self.prony else 1.0

    def _begun(self, greatest, internal, stress, seconds):
        """The history as an increment of so many seconds begins."""
        g, tau = (np.array(self.prony.g), np.array(self.prony.tau_s)) if self.prony else (np.zeros(0), np.zeros(0))
        x = seconds / tau
        decay = np.exp(-x)
        gain = g * (np.where(np.isinf(x), 0.0, -np.expm1(-x) / np.where(np.isinf(x), 1.0, x)) if seconds else 1.0)
        carried = np.tensordot(decay, internal, 1) - gain.sum() * stress
        return PointHistory(greatest, internal, stress, decay, gain, 1.0 - g.sum() + gain.sum(), carried)

    def _instantaneous(self, history, elastic):
        return self._factor * self._softening(history, elastic)[0][:, None] * elastic.stress

    def _softening(self, history, elastic):
        """eta, its derivative by W, and psi_eta in MPa, each (n,)."""
        W = elastic.energy
        if self.mullins is None:
            return np.ones_like(W), np.zeros_like(W), W
        greatest = np.maximum(history.greatest, W)
        found = self.mullins.softening(W, greatest), self.mullins.softening_derivative(W, greatest)
        return *found, self.mullins.energy(W, greatest)
