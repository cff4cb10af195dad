"""Yeoh: cubic in the first invariant, for the upturn of filled rubber.

Symbols       c10, c20, c30 (MPa); i1 first isochoric invariant, x = i1 - 3
Energy        psi = c10 x + c20 x^2 + c30 x^3
Stress        psi1 = c10 + 2 c20 x + 3 c30 x^2
Tangent       psi11 = 2 c20 + 6 c30 x
Small strain  mu0 = 2 c10
Reference     Yeoh, Rubber Chem. Technol. 66 (1993) 754-771
"""

import numpy as np

from softtact.materials.laws.base import Parameter
from softtact.materials.laws.invariants import Derivatives, InvariantLaw


class Yeoh(InvariantLaw):
    name = "yeoh"
    constants = (
        Parameter("c10", "MPa", 0.0, 5.0),
        Parameter("c20", "MPa", -5.0, 5.0),
        Parameter("c30", "MPa", -5.0, 5.0),
    )

    def derivatives(self, i1: np.ndarray, i2: np.ndarray) -> Derivatives:
        c10, c20, c30 = self.parameters.values()
        x = i1 - 3
        return Derivatives(
            psi=x * (c10 + x * (c20 + x * c30)),
            psi1=c10 + x * (2 * c20 + x * 3 * c30),
            psi11=2 * c20 + 6 * c30 * x,
        )
