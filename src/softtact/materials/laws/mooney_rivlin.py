"""Mooney-Rivlin, two constants.

Symbols       c10, c01 (MPa); i1, i2 isochoric invariants
Energy        psi = c10 (i1 - 3) + c01 (i2 - 3)
Stress        psi1 = c10, psi2 = c01
Tangent       all second derivatives are zero
Small strain  mu0 = 2 (c10 + c01)
Reference     Mooney, J. Appl. Phys. 11 (1940) 582-592; Rivlin, Phil. Trans. R. Soc. A 241 (1948) 379-397
"""

import numpy as np

from softtact.materials.laws.base import Parameter
from softtact.materials.laws.invariants import Derivatives, InvariantLaw


class MooneyRivlin(InvariantLaw):
    name = "mooney_rivlin"
    constants = (Parameter("c10", "MPa", -5.0, 5.0), Parameter("c01", "MPa", -5.0, 5.0))

    def derivatives(self, i1: np.ndarray, i2: np.ndarray) -> Derivatives:
        c10, c01 = self.parameters["c10"], self.parameters["c01"]
        return Derivatives(psi=c10 * (i1 - 3) + c01 * (i2 - 3), psi1=c10, psi2=c01)
