"""Softening of the first cycles (Mullins effect) by the pseudo-elasticity of Ogden and Roxburgh.

Symbols       W isochoric energy of the law at first loading (MPa = mJ/mm^3), W_max its greatest value so far at this point;
              r > 1 (1), m >= 0 (MPa), beta >= 0 (1), not both zero
Softening     eta = 1 - erf(x)/r with x = (W_max - W)/(m + beta W_max); the stress is eta times that of first loading
Derivative    d eta/dW = 2 exp(-x^2) / (sqrt(pi) r (m + beta W_max)) below W_max
Energy        int eta dW, which is W_max at W = W_max: W + (m + beta W_max) (x erf(x) + (exp(-x^2) - 1)/sqrt(pi))/r
Limits        eta = 1 where W = W_max; eta > 1 - 1/r
References    Ogden and Roxburgh, Proc. R. Soc. A 455 (1999) 2861-2877 (beta = 0); Abaqus Analysis User's Guide, Mullins effect
"""

import math
from dataclasses import asdict, dataclass

import numpy as np
from scipy.special import erf

from softtact.errors import InputError


@dataclass(frozen=True)
class Mullins:
    """Constants of the softening.

    r: 1, above 1; the stress falls by less than 1/r
    m_mpa: MPa, an energy per volume; the smaller, the more a body softens that was loaded little
    beta: 1; the larger, the more slowly the softening sets in below a large W_max
    Raises InputError for constants outside these ranges.
    """

    r: float
    m_mpa: float
    beta: float

    def __post_init__(self):
        for name, value in asdict(self).items():
            low, words = (1.0, "above 1") if name == "r" else (0.0, "of 0 or more")
            if not (value > low or value == low and name != "r") or not math.isfinite(value):
                raise InputError(f"mullins: {name} is {value:g}; give a finite number {words}.")
        if self.m_mpa == self.beta == 0:
            raise InputError("mullins: m_mpa and beta are both 0; make one of them positive.")

    def softening(self, energy: np.ndarray, greatest_energy: np.ndarray) -> np.ndarray:
        """eta (...) at the energy W (...) after the greatest energy W_max (...), both in MPa; 1 where W is no smaller."""
        return 1 - erf(self._argument(energy, greatest_energy)[0]) / self.r

    def softening_derivative(self, energy: np.ndarray, greatest_energy: np.ndarray) -> np.ndarray:
        """d eta/dW (...) in 1/MPa at constant W_max; 0 where W is no smaller than W_max, which is first loading."""
        argument, width = self._argument(energy, greatest_energy)
        slope = 2 / math.sqrt(math.pi) * np.exp(-argument**2) / (self.r * width)
        return np.where(np.asarray(energy) < greatest_energy, slope, 0.0)

    def energy(self, energy: np.ndarray, greatest_energy: np.ndarray) -> np.ndarray:
        """The integral of eta by W (...) in MPa at constant W_max, equal to W where W is no smaller than W_max."""
        x, width = self._argument(energy, greatest_energy)
        lost = x * erf(x) + np.expm1(-(x**2)) / math.sqrt(math.pi)
        found: np.ndarray = energy + width * lost / self.r
        return found

    def _argument(self, energy, greatest_energy):
        """x and m + beta W_max."""
        energy, greatest = np.asarray(energy, float), np.asarray(greatest_energy, float)
        width = self.m_mpa + self.beta * greatest
        width = np.where(width > 0, width, 1.0)     # only of a body that was never loaded, where x is 0
        return np.maximum(greatest - energy, 0.0) / width, width
