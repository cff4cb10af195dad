"""Gent: chains of limited length, in closed form.

Symbols       mu (MPa), jm largest value of x = i1 - 3 (1); i1 first isochoric invariant
Energy        psi = -mu jm/2 ln(1 - x/jm), not a number where x >= jm: the chains are taut
Stress        psi1 = mu/2 jm/(jm - x)
Tangent       psi11 = mu/2 jm/(jm - x)^2
Small strain  mu0 = mu
Reference     Gent, Rubber Chem. Technol. 69 (1996) 59-61
"""

import numpy as np

from softtact.materials.laws.base import Parameter
from softtact.materials.laws.invariants import Derivatives, InvariantLaw


class Gent(InvariantLaw):
    name = "gent"
    constants = (Parameter("mu", "MPa", 0.0, 5.0), Parameter("jm", "1", 0.01, 1000.0))

    @classmethod
    def lowest(cls, stretches: np.ndarray) -> dict[str, float]:
        """jm above the largest x of the points (n, 3), so that psi exists there; see `Law.lowest`."""
        return {"jm": 1.001 * float((stretches**2).sum(axis=1).max() - 3) + 1e-6}

    def derivatives(self, i1: np.ndarray, i2: np.ndarray) -> Derivatives:
        mu, jm = self.parameters["mu"], self.parameters["jm"]
        with np.errstate(divide="ignore", invalid="ignore"):
            room = 1 - (i1 - 3) / jm
            room = np.where(np.real(room) > 0, room, np.nan)
            return Derivatives(psi=-mu * jm / 2 * np.log(room), psi1=mu / 2 / room, psi11=mu / (2 * jm) / room**2)
