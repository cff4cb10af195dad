"""All laws by name. To add a law, add a file to this folder and its class to `LAWS`, or to `FOAM_LAWS` for a foam."""

import math
import numbers

from softtact.errors import InputError
from softtact.materials.laws.arruda_boyce import ArrudaBoyce
from softtact.materials.laws.base import Law
from softtact.materials.laws.compressible import CompressibleLaw
from softtact.materials.laws.foams import BlatzKo, Hyperfoam1, Hyperfoam2
from softtact.materials.laws.gent import Gent
from softtact.materials.laws.mooney_rivlin import MooneyRivlin
from softtact.materials.laws.neo_hooke import NeoHooke
from softtact.materials.laws.ogden import Ogden1, Ogden2, Ogden3
from softtact.materials.laws.reduced_polynomial2 import ReducedPolynomial2
from softtact.materials.laws.volumetric import VOLUMETRIC_FUNCTIONS
from softtact.materials.laws.yeoh import Yeoh

_SAME = 1e-3     # of the bulk modulus: a smaller difference comes from rounding in a file
LAWS: dict[str, type[Law]] = {
    law.name: law for law in (NeoHooke, MooneyRivlin, Yeoh, ReducedPolynomial2, ArrudaBoyce, Gent, Ogden1, Ogden2, Ogden3)
}


FOAM_LAWS: dict[str, type[Law]] = {law.name: law for law in (Hyperfoam1, Hyperfoam2, BlatzKo)}


def law_class(name: str, *, fitted: bool = False) -> type[Law]:
    """The class of a law. Unknown names are refused, and laws of foams where the law is to be `fitted`."""
    if fitted and name in FOAM_LAWS:
        raise InputError(f"Law {name!r} describes compressible foams, but a fit assumes curves of an incompressible material; fit "
                         "it elsewhere, and give its constants in a card.")
    if name not in LAWS | FOAM_LAWS:
        raise InputError(f"Law {name!r} is unknown; use one of {', '.join(LAWS | ({} if fitted else FOAM_LAWS))}.")
    return (LAWS | FOAM_LAWS)[name]


def make_law(name: str, parameters: dict[str, float], *, bulk_modulus: float | None = None, bulk_over_shear: float = 20.0,
             volumetric: str = "quadratic") -> Law:
    """A law with its constants (MPa, 1). The bulk modulus (MPa) is `bulk_modulus`, or `bulk_over_shear` * mu0.

    volumetric: name of its U(J) in VOLUMETRIC_FUNCTIONS
    The constants of a foam's law determine its bulk modulus; another one is refused.
    """
    kind = law_class(name)
    _check(kind, parameters)
    if issubclass(kind, CompressibleLaw):
        return _foam(kind, parameters, bulk_modulus)
    if volumetric not in VOLUMETRIC_FUNCTIONS:
        raise InputError(f"Volumetric function {volumetric!r} is unknown; use one of {', '.join(VOLUMETRIC_FUNCTIONS)}.")
    law = kind(parameters, bulk_modulus=1.0 if bulk_modulus is None else bulk_modulus, volumetric=VOLUMETRIC_FUNCTIONS[volumetric])
    if law.mu0 <= 0:
        raise InputError(
            f"Law {name} with {_listing(parameters)} has the initial shear modulus {law.mu0:g} MPa;"
            " choose constants that make it positive."
        )
    if bulk_modulus is None:
        law.volumetric = law.volumetric.with_modulus(bulk_over_shear * law.mu0)
    if not law.bulk_modulus > 0:
        raise InputError(f"Law {name} has the bulk modulus {law.bulk_modulus:g} MPa; give a positive one.")
    return law


def _foam(kind, parameters, bulk_modulus):
    law = kind(parameters)
    if not (law.mu0 > 0 and law.bulk_modulus > 0):
        raise InputError(f"Law {kind.name} with {_listing(parameters)} has the initial shear modulus {law.mu0:g} MPa and the bulk "
                         f"modulus {law.bulk_modulus:g} MPa; choose constants that make both positive.")
    if bulk_modulus is not None and not math.isclose(bulk_modulus, law.bulk_modulus, rel_tol=_SAME):
        raise InputError(f"Law {kind.name} has the bulk modulus {law.bulk_modulus:g} MPa by its constants, not {bulk_modulus:g} "
                         "MPa; leave it out, or change nu.")
    return law


def _check(kind, parameters):
    expected = [constant.name for constant in kind.constants]
    if set(parameters) != set(expected):
        raise InputError(f"Law {kind.name} takes the constants {', '.join(expected)}, not {_listing(parameters)}.")
    for name, value in parameters.items():
        if not isinstance(value, numbers.Real) or not math.isfinite(value):
            raise InputError(f"Law {kind.name}: constant {name} is {value!r}; give a finite number.")
        if name.startswith("alpha") and value == 0 or name in ("lambda_m", "jm") and value <= 0:
            raise InputError(
                f"Law {kind.name}: constant {name} is {value!r}, where the energy is undefined; change it."
            )
        if name.startswith("nu") and not -1 < value < 0.5 or name == "f" and not 0 <= value <= 1:
            low, high = ("above -1", "below 0.5") if name.startswith("nu") else ("from 0", "to 1")
            raise InputError(f"Law {kind.name}: constant {name} is {value!r}; give one {low} and {high}.")


def _listing(parameters):
    return ", ".join(f"{name}={value}" for name, value in parameters.items()) or "none"
