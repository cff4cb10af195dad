"""Laws of elastomer foams: Hyperfoam with one or two terms in the convention of Abaqus, and Blatz-Ko.

Symbols       mu_k, mu (MPa), alpha_k (1, not zero), nu_k, nu (1, above -1 and below 0.5), f (1, from 0 to 1); beta = nu/(1 - 2 nu)
Hyperfoam     psi = sum_k 2 mu_k/alpha_k^2 (l_1^alpha_k + l_2^alpha_k + l_3^alpha_k - 3 + (J^(-alpha_k beta_k) - 1)/beta_k)
Blatz-Ko      psi = mu f/2 (I1 - 3 + (I3^-beta - 1)/beta) + mu (1 - f)/2 (I2/I3 - 3 + (I3^beta - 1)/beta), which is Hyperfoam with
              the exponents 2 and -2. f = 0 with nu = 0.25 is their foam, psi = mu/2 (I2/I3 + 2 J - 5).
Small strain  mu0 = sum_k mu_k, K = sum_k 2 mu_k (1/3 + beta_k); with one nu, that is Poisson's ratio
Reference     Ogden, Proc. R. Soc. A 328 (1972) 567-583; Storakers, J. Mech. Phys. Solids 34 (1986) 125-145; Abaqus Theory Guide,
              4.6.2; Blatz and Ko, Trans. Soc. Rheology 6 (1962) 223-251
"""

from softtact.materials.laws.base import Parameter
from softtact.materials.laws.compressible import CompressibleLaw

_NU = (-0.99, 0.499)


def _constants(terms):
    of_term = {"mu": ("MPa", -5.0, 5.0), "alpha": ("1", -25.0, 25.0), "nu": ("1", *_NU)}
    return tuple(Parameter(f"{name}{k}", *bounds) for k in terms for name, bounds in of_term.items())


class Hyperfoam1(CompressibleLaw):
    name = "hyperfoam1"
    constants = _constants([1])

    @classmethod
    def terms(cls, parameters: dict[str, float]) -> list[tuple[float, float, float]]:
        count = len(parameters) // 3
        return [(parameters[f"mu{k}"], parameters[f"alpha{k}"], _beta(parameters[f"nu{k}"])) for k in range(1, count + 1)]


class Hyperfoam2(Hyperfoam1):
    name = "hyperfoam2"
    constants = _constants([1, 2])


class BlatzKo(CompressibleLaw):
    name = "blatz_ko"
    constants = (Parameter("mu", "MPa", 0.0, 5.0), Parameter("nu", "1", *_NU), Parameter("f", "1", 0.0, 1.0))

    @classmethod
    def terms(cls, parameters: dict[str, float]) -> list[tuple[float, float, float]]:
        mu, f, beta = parameters["mu"], parameters["f"], _beta(parameters["nu"])
        return [(mu * f, 2.0, beta), (mu * (1 - f), -2.0, beta)]


def _beta(nu: float) -> float:
    return nu / (1 - 2 * nu)
