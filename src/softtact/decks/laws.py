"""Hyperelastic laws as Abaqus and CalculiX take them: the form's name and its constants in the order of the keyword's data.

Both programs split the energy as we do, psi of the isochoric stretches plus U(J), and take U = sum (J-1)^(2i) / D_i. Our
quadratic U is K/2 (J-1)^2, so D_1 = 2/K and the further D_i stand for "no term". Only Arruda-Boyce differs there:
U = ((J^2 - 1)/2 - ln J) / D, which is our logarithmic U, and agrees with the quadratic one to second order in J - 1.
The Ogden constants are those of Abaqus in all three: psi = sum 2 mu_k / alpha_k^2 (...).
"""

from dataclasses import dataclass

from softtact.errors import InputError
from softtact.materials.laws.base import Law

# Law: the form's parameters on the keyword line, our constants in the order of the data, number of D_i.
_FORMS = {
    "neo_hooke": ("NEO HOOKE", ("c10",), 1),
    "mooney_rivlin": ("MOONEY-RIVLIN", ("c10", "c01"), 1),
    "yeoh": ("YEOH", ("c10", "c20", "c30"), 3),
    "reduced_polynomial2": ("REDUCED POLYNOMIAL, N=2", ("c10", "c20"), 2),
    "arruda_boyce": ("ARRUDA-BOYCE", ("mu", "lambda_m"), 1),
    "ogden1": ("OGDEN, N=1", ("mu1", "alpha1"), 1),
    "ogden2": ("OGDEN, N=2", ("mu1", "alpha1", "mu2", "alpha2"), 2),
    "ogden3": ("OGDEN, N=3", ("mu1", "alpha1", "mu2", "alpha2", "mu3", "alpha3"), 3),
}
_FOAMS = {"hyperfoam1": ("mu1", "alpha1", "nu1"), "hyperfoam2": ("mu1", "alpha1", "mu2", "alpha2", "nu1", "nu2")}


@dataclass(frozen=True)
class LawCard:
    """`form`: what follows the keyword on its line; `constants` (MPa, 1, then the D_i in 1/MPa) in the order of the data."""

    form: str
    constants: tuple
    keyword: str = "HYPERELASTIC"


def law_card(law: Law | None, *, no_term: float, dialect: str) -> LawCard:
    """The `LawCard` of a law. `no_term`: the D_i (1/MPa) with which the dialect leaves a volumetric term out."""
    if law is not None and law.name in _FOAMS:
        names = _FOAMS[law.name]
        return LawCard(f"N={len(names) // 3}", tuple(law.parameters[name] for name in names), keyword="HYPERFOAM")
    if law is None or law.name not in _FORMS:
        name = getattr(law, "name", None)
        raise InputError(f"The law {name!r} cannot be written for {dialect}; use one of {', '.join([*_FORMS, *_FOAMS])}.")
    form, names, terms = _FORMS[law.name]
    written = ("quadratic", *(("logarithmic",) if form == "ARRUDA-BOYCE" else ()))
    if law.volumetric.name not in written:
        raise InputError(f"The law {law.name!r} has the volumetric function {law.volumetric.name!r}, which {dialect} does not take;"
                         f" use {' or '.join(written)}.")
    volumetric = (2 / law.bulk_modulus, *[no_term] * (terms - 1))
    return LawCard(form, (*(law.parameters[name] for name in names), *volumetric))
