"""Reduced polynomial of second order: Yeoh without its cubic term.

Symbols       c10, c20 (MPa); i1 first isochoric invariant, x = i1 - 3
Energy        psi = c10 x + c20 x^2
Stress        psi1 = c10 + 2 c20 x
Tangent       psi11 = 2 c20
Small strain  mu0 = 2 c10
Reference     Abaqus Theory Guide, section 4.6.1 (REDUCED POLYNOMIAL, N=2)
"""

import numpy as np

from softtact.materials.laws.base import Parameter
from softtact.materials.laws.invariants import Derivatives, InvariantLaw


class ReducedPolynomial2(InvariantLaw):
    name = "reduced_polynomial2"
    constants = (Parameter("c10", "MPa", 0.0, 5.0), Parameter("c20", "MPa", -5.0, 5.0))

    def derivatives(self, i1: np.ndarray, i2: np.ndarray) -> Derivatives:
        c10, c20 = self.parameters["c10"], self.parameters["c20"]
        x = i1 - 3
        return Derivatives(psi=x * (c10 + x * c20), psi1=c10 + 2 * c20 * x, psi11=2 * c20)
