"""neo-Hooke: the statistical theory of a Gaussian network.

Symbols       c10 (MPa); i1 first isochoric invariant
Energy        psi = c10 (i1 - 3)
Stress        psi1 = c10
Tangent       all second derivatives are zero
Small strain  mu0 = 2 c10
Reference     Treloar, Trans. Faraday Soc. 39 (1943) 241-246
"""

import numpy as np

from softtact.materials.laws.base import Parameter
from softtact.materials.laws.invariants import Derivatives, InvariantLaw


class NeoHooke(InvariantLaw):
    name = "neo_hooke"
    constants = (Parameter("c10", "MPa", 0.0, 5.0),)

    def derivatives(self, i1: np.ndarray, i2: np.ndarray) -> Derivatives:
        c10 = self.parameters["c10"]
        return Derivatives(psi=c10 * (i1 - 3), psi1=c10)
