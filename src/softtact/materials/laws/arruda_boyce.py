"""Arruda-Boyce: eight chains of limited length, as a series of five terms.

Symbols       mu (MPa), lambda_m locking stretch (1); i1 first isochoric invariant;
              a = 1/2, 1/20, 11/1050, 19/7000, 519/673750 for n = 1..5
Energy        psi = mu sum_n a_n lambda_m^(2-2n) (i1^n - 3^n)
Stress        psi1 = mu sum_n n a_n lambda_m^(2-2n) i1^(n-1)
Tangent       psi11 = mu sum_n n (n-1) a_n lambda_m^(2-2n) i1^(n-2)
Small strain  mu0 = 2 psi1(3) = mu (1 + 3/(5 lambda_m^2) + 99/(175 lambda_m^4) + ...)
Reference     Arruda and Boyce, J. Mech. Phys. Solids 41 (1993) 389-412; series as in the Abaqus Theory Guide, 4.6.1
"""

import numpy as np

from softtact.materials.laws.base import Parameter
from softtact.materials.laws.invariants import Derivatives, InvariantLaw

SERIES = np.array([0, 1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750])  # a_0 = 0, a_1 ... a_5


class ArrudaBoyce(InvariantLaw):
    name = "arruda_boyce"
    constants = (Parameter("mu", "MPa", 0.0, 5.0), Parameter("lambda_m", "1", 1.01, 100.0))

    def derivatives(self, i1: np.ndarray, i2: np.ndarray) -> Derivatives:
        mu, lambda_m = self.parameters["mu"], self.parameters["lambda_m"]
        polynomial = np.polynomial.Polynomial(mu * SERIES * lambda_m ** (2.0 - 2 * np.arange(6)))
        return Derivatives(
            psi=polynomial(i1) - polynomial(3.0),
            psi1=polynomial.deriv(1)(i1),
            psi11=polynomial.deriv(2)(i1),
        )
