"""Common parts of the decks of both programs: keyword lines, rows of numbers, and laws.

Laws: both programs split the energy as we do, psi of the isochoric stretches plus U(J), and take U = sum (J-1)^(2i) / D_i. Our
quadratic U is K/2 (J-1)^2, so D_1 = 2/K and the further D_i stand for "no term". Only Arruda-Boyce differs there:
U = ((J^2 - 1)/2 - ln J) / D, which is our logarithmic U, and agrees with the quadratic one to second order in J - 1.
The Ogden constants are those of Abaqus in all three: psi = sum 2 mu_k / alpha_k^2 (...).
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

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
_PER_LINE = 16     # both programs read up to 16 numbers a line


@dataclass(frozen=True)
class LawCard:
    """`form`: what follows the keyword on its line; `constants` (MPa, 1, then the D_i in 1/MPa) in the order of the data."""

    form: str
    constants: tuple
    keyword: str = "HYPERELASTIC"


def law_card(law: Law | None, *, no_term: float, dialect: str) -> LawCard:
    """The `LawCard` of a law. `no_term`: the D_i (1/MPa) with which the dialect leaves a volumetric term out."""
    if law is not None and law.inelastic is not None:
        raise InputError(f"The law {law.name!r} softens or relaxes ('mullins', 'prony'), which decks do not take; leave these out.")
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


def number(value: float) -> str:
    """A number in at most 20 characters: CalculiX reads no more of a field."""
    return f"{value:.12g}"


def rows(values: Iterable[float], *, per_line: int = _PER_LINE) -> str:
    """Numbers separated by commas, `per_line` a line; a continued line ends with a comma."""
    texts = [number(value) for value in values]
    lines = [", ".join(texts[k:k + per_line]) for k in range(0, len(texts), per_line)]
    return ",\n".join(lines)


def heading(title: str, program: str, remarks: Iterable[str] = ()) -> list[str]:
    """Title, units and remarks."""
    return ["*HEADING", f"{title}; units: mm, N, MPa", f"** softtact export for {program}", *(f"** {remark}" for remark in remarks)]


def nodes(points: Iterable[np.ndarray], first: int, *, name: str | None = None) -> list[str]:
    """*NODE with points (n, 3) numbered from `first`."""
    head = "*NODE" + (f", NSET={name}" if name else "")
    return [head] + [f"{first + k}, {number(x)}, {number(y)}, {number(z)}" for k, (x, y, z) in enumerate(points)]


def elements(kind: str, name: str, numbers: Iterable[int], connectivity: Iterable[np.ndarray]) -> list[str]:
    """*ELEMENT with the elements' numbers (e,) and nodes (e, k), both as numbered in the deck."""
    head = f"*ELEMENT, TYPE={kind}, ELSET={name}"
    return [head] + [rows([n, *row]) for n, row in zip(numbers, connectivity, strict=True)]


def node_set(name: str, numbers: np.ndarray) -> list[str]:
    """*NSET with the nodes' numbers in the deck."""
    return [f"*NSET, NSET={name}", rows(numbers)] if len(numbers) else []


def surface(name: str, faces: Iterable[Sequence[int]]) -> list[str]:
    """*SURFACE of element faces (f, 2): element number in the deck, and face."""
    return [f"*SURFACE, NAME={name}, TYPE=ELEMENT"] + [f"{element}, S{face}" for element, face in faces]


def equations(ties: Iterable[tuple[int, np.ndarray, np.ndarray]]) -> list[str]:
    """One *EQUATION for all ties (slave, masters, weights), nodes from 0: each component 0 = -slave + sum(weights * masters)."""
    return _equation([[(slave + 1, component, -1.0),
                       *((master + 1, component, weight) for master, weight in zip(masters, weights, strict=True))]
                      for slave, masters, weights in ties for component in (1, 2, 3)])


def moving_along(nodes: Iterable[int], reference: int, component: int) -> list[str]:
    """One *EQUATION by which each node moves along a component (1..3) as the reference node does."""
    return _equation([[(node, component, -1.0), (reference, component, 1.0)] for node in nodes])


def _equation(sums):
    """*EQUATION of sums [(node, component, factor)] that are zero; the first node is eliminated. Four terms a line."""
    lines = ["*EQUATION"] if sums else []
    for terms in sums:
        texts = [f"{node}, {component}, {number(factor)}" for node, component, factor in terms]
        lines += [str(len(terms)), ",\n".join(", ".join(texts[k:k + 4]) for k in range(0, len(texts), 4))]
    return lines


def material(name: str, card: LawCard) -> list[str]:
    """*MATERIAL with the constants of its law, eight a line."""
    return [f"*MATERIAL, NAME={name}", f"*{card.keyword}, {card.form}", rows(card.constants, per_line=8)]
