"""All laws by name. A new law is one file here beside, and its class in `LAWS`."""

import math

from softtact.errors import InputError
from softtact.materials.laws.arruda_boyce import ArrudaBoyce
from softtact.materials.laws.base import Law
from softtact.materials.laws.gent import Gent
from softtact.materials.laws.mooney_rivlin import MooneyRivlin
from softtact.materials.laws.neo_hooke import NeoHooke
from softtact.materials.laws.ogden import Ogden1, Ogden2, Ogden3
from softtact.materials.laws.reduced_polynomial2 import ReducedPolynomial2
from softtact.materials.laws.volumetric import VOLUMETRIC_FUNCTIONS
from softtact.materials.laws.yeoh import Yeoh

LAWS: dict[str, type[Law]] = {
    law.name: law for law in (NeoHooke, MooneyRivlin, Yeoh, ReducedPolynomial2, ArrudaBoyce, Gent, Ogden1, Ogden2, Ogden3)
}


def law_class(name: str) -> type[Law]:
    """The class of a law; an unknown name is refused."""
    if name not in LAWS:
        raise InputError(f"Law {name!r} is unknown; use one of {', '.join(LAWS)}.")
    return LAWS[name]


def make_law(name: str, parameters: dict[str, float], *, bulk_modulus: float | None = None, bulk_over_shear: float = 20.0,
             volumetric: str = "quadratic") -> Law:
    """A law with its constants (MPa, 1). The bulk modulus (MPa) is `bulk_modulus`, or `bulk_over_shear` * mu0.

    volumetric: name of its U(J) in VOLUMETRIC_FUNCTIONS
    """
    kind = law_class(name)
    _check(kind, parameters)
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


def _check(kind, parameters):
    expected = [constant.name for constant in kind.constants]
    if set(parameters) != set(expected):
        raise InputError(f"Law {kind.name} takes the constants {', '.join(expected)}, not {_listing(parameters)}.")
    for name, value in parameters.items():
        if not isinstance(value, (int, float)) or not math.isfinite(value):
            raise InputError(f"Law {kind.name}: constant {name} is {value!r}; give a finite number.")
        if name.startswith("alpha") and value == 0 or name in ("lambda_m", "jm") and value <= 0:
            raise InputError(
                f"Law {kind.name}: constant {name} is {value!r}, where the energy is undefined; change it."
            )


def _listing(parameters):
    return ", ".join(f"{name}={value}" for name, value in parameters.items()) or "none"
