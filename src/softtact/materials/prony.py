"""Relaxation of the shear modulus by a Prony series, in time and in frequency.

Symbols       G0 instantaneous shear modulus; g_i shares of it (1) that relax with the times tau_i (s); g_inf = 1 - sum g_i
Relaxation    G(t)/G0 = g_inf + sum g_i exp(-t/tau_i)
Creep         under a constant load, of a body of this material alone: c(t) = G0 g_inf J(t), from g_inf to 1,
              c(t) = 1 - sum c_j exp(-t/T_j): h' = -(I + g 1^T/g_inf)^-1 diag(1/tau) h from h(0) = g, and c = 1 - sum h_i
Frequency     G'/G0 = g_inf + sum g_i w^2 tau_i^2/(1 + w^2 tau_i^2),  G''/G0 = sum g_i w tau_i/(1 + w^2 tau_i^2),  w = 2 pi f
References    Ferry, Viscoelastic Properties of Polymers (1980), chapter 3; Simo, Comput. Methods Appl. Mech. Eng. 60 (1987) 153-173
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from softtact.errors import InputError

INSTANTANEOUS, RELAXED = MODULI = ("instantaneous", "relaxed")


@dataclass(frozen=True)
class PronySeries:
    """A Prony series of the shear modulus.

    g: (n,) shares of the instantaneous modulus, none negative, their sum below 1
    tau_s: (n,) relaxation times, s, positive
    moduli: which moduli the constants of the material's law are, `instantaneous` (of fast loading) or `relaxed` (of slow loading)
    Raises InputError for others.
    """

    g: tuple[float, ...]
    tau_s: tuple[float, ...]
    moduli: str = INSTANTANEOUS

    def __post_init__(self):
        object.__setattr__(self, "g", _numbers("g", self.g, low=0.0, strict=False))
        object.__setattr__(self, "tau_s", _numbers("tau_s", self.tau_s, low=0.0, strict=True))
        if len(self.g) != len(self.tau_s):
            raise InputError(f"prony: g has {len(self.g)} values and tau_s {len(self.tau_s)}; give a time for each share.")
        if not sum(self.g) < 1:
            raise InputError(f"prony: the sum of g is {sum(self.g):.6g}; give shares of the instantaneous modulus, below 1 in sum.")
        if self.moduli not in MODULI:
            raise InputError(f"prony: moduli is {self.moduli!r}; write {' or '.join(MODULI)}.")

    @property
    def relaxed_share(self) -> float:
        """g_inf: the modulus after a long time over the instantaneous one."""
        return 1 - sum(self.g)

    @property
    def instantaneous_factor(self) -> float:
        """Factor from the moduli of the material's law to the instantaneous ones."""
        return 1.0 if self.moduli == INSTANTANEOUS else 1 / self.relaxed_share

    def relaxation(self, time_s: float | np.ndarray) -> np.ndarray:
        """G(t)/G0 (...) at the times (...) after a step of strain, s."""
        decays = np.exp(-np.asarray(time_s, float)[..., None] / np.array(self.tau_s))
        return self.relaxed_share + decays @ np.array(self.g)

    def retardation(self) -> tuple[np.ndarray, np.ndarray]:
        """(c_j, T_j), each (n,): shares (1) of the strain under a constant load that come late, and their times in s.

        By the eigenvalues of a symmetric matrix; they interlace with the relaxation times: tau_1 < T_1 < tau_2 < ...
        """
        g, tau = np.array(self.g), np.array(self.tau_s)
        root = np.sqrt(g)
        mixed = np.eye(len(g)) - np.outer(root, root)     # (I + root root^T/g_inf)^-1, by Sherman and Morrison
        half = 1 / np.sqrt(tau)
        rates, vectors = np.linalg.eigh(half[:, None] * mixed * half)
        shares = self.relaxed_share * (vectors.T @ (root * half)) ** 2 / rates
        return shares, 1 / rates

    def creep(self, time_s: float | np.ndarray) -> np.ndarray:
        """c(t) (...) at the times (...) after a constant load began, s: the strain over that after a long time."""
        shares, times = self.retardation()
        return 1 - np.exp(-np.asarray(time_s, float)[..., None] / times) @ shares

    def storage_loss(self, omega: float | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(G'/G0, G''/G0), each (...), at the angular frequencies omega (...) in rad/s."""
        phase = np.asarray(omega, float)[..., None] * np.array(self.tau_s)
        shares = np.array(self.g) / (1 + phase**2)
        return self.relaxed_share + (shares * phase**2).sum(axis=-1), (shares * phase).sum(axis=-1)


def _numbers(name: str, values: Sequence[float], *, low: float, strict: bool) -> tuple[float, ...]:
    """The values as a tuple. Raises InputError unless there are some and all of them are finite and not below `low`."""
    if len(values) == 0:
        raise InputError(f"prony: {name} is empty; give at least one value.")
    for value in values:
        if not math.isfinite(value) or value < low or strict and value == low:
            raise InputError(f"prony: {name} has the value {value:g}; give finite numbers {'above' if strict else 'from'} {low:g}.")
    return tuple(float(value) for value in values)
