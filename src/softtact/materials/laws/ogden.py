"""Ogden with one, two or three terms, in the convention of Abaqus.

Symbols       mu_k (MPa), alpha_k (1, not zero); lb_a isochoric principal stretches
Energy        psi = sum_k 2 mu_k/alpha_k^2 (lb_1^alpha_k + lb_2^alpha_k + lb_3^alpha_k - 3)
Stress        g = lb dpsi/dlb = sum_k 2 mu_k/alpha_k lb^alpha_k; the deviator of g is the Kirchhoff stress
Tangent       h = dg/dln lb = sum_k 2 mu_k lb^alpha_k, spectral form in stretches.py
Small strain  mu0 = sum_k mu_k
Reference     Ogden, Proc. R. Soc. A 326 (1972) 565-584; convention of the Abaqus Theory Guide, 4.6.1
"""

from typing import Any

import numpy as np

from softtact.materials.laws.base import IsochoricResponse, Law, Parameter
from softtact.materials.laws.stretches import power_sum_response, response


def _constants(terms):
    pairs = [(Parameter(f"mu{k}", "MPa", -5.0, 5.0), Parameter(f"alpha{k}", "1", -20.0, 20.0)) for k in terms]
    return tuple(constant for pair in pairs for constant in pair)


class Ogden1(Law):
    name = "ogden1"
    constants = _constants([1])

    def __init__(self, parameters: dict[str, float], **volume: Any) -> None:
        super().__init__(parameters, **volume)
        self._mu, self._alpha = np.array(list(self.parameters.values())).reshape(-1, 2).T.copy()
        self._alpha[self._alpha == 0] = 1e-9  # a search may reach 0, whose limit is finite; `make_law` refuses it

    @classmethod
    def in_order(cls, parameters: dict[str, float]) -> dict[str, float]:
        """The terms by falling exponent."""
        values: Any = np.array([parameters[constant.name] for constant in cls.constants]).reshape(-1, 2)
        values = values[np.argsort(-values[:, 1], kind="stable")].ravel().tolist()
        return {constant.name: value for constant, value in zip(cls.constants, values, strict=True)}

    @property
    def mu0(self) -> float:
        return float(self._mu.sum())

    def isochoric(self, C6: np.ndarray, *, tangent: bool = True) -> IsochoricResponse:
        return response(power_sum_response, C6, self._mu, self._alpha, tangent=tangent)

    def principal_stress(self, stretches: np.ndarray) -> np.ndarray:
        excess = np.expm1(np.log(stretches)[..., None] * self._alpha)  # lb^alpha - 1: exact near alpha = 0
        return excess @ (2 * self._mu / self._alpha)


class Ogden2(Ogden1):
    name = "ogden2"
    constants = _constants([1, 2])


class Ogden3(Ogden1):
    name = "ogden3"
    constants = _constants([1, 2, 3])
