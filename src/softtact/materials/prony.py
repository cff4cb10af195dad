"""Relaxation of the shear modulus by a Prony series, in time and in frequency.

Symbols       G0 instantaneous shear modulus; g_i shares of it (1) that relax with the times tau_i (s); g_inf = 1 - sum g_i
Relaxation    G(t)/G0 = g_inf + sum g_i exp(-t/tau_i)
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
