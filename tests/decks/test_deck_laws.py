"""Laws in the programs' conventions: constants by their own formulas, and the stress that ccx finds with them."""

import subprocess
from types import SimpleNamespace

import numpy as np
import pytest
from deck_study import Tables, needs_ccx
from law_constants import PARAMETERS

from softtact.decks import keywords
from softtact.decks.keywords import law_card
from softtact.errors import InputError
from softtact.fem.elements import HEX20
from softtact.materials.laws.registry import LAWS, make_law

CONSTANTS = {
    "neo_hooke": {"c10": 0.17},
    "mooney_rivlin": {"c10": 0.1706, "c01": 0.0040},
    "yeoh": {"c10": 0.17, "c20": -0.01, "c30": 0.004},
    "reduced_polynomial2": {"c10": 0.17, "c20": 0.01},
    "arruda_boyce": {"mu": 0.3, "lambda_m": 2.5},
    "ogden1": {"mu1": 0.35, "alpha1": 3.0},
    "ogden2": {"mu1": 0.3, "alpha1": 2.5, "mu2": 0.05, "alpha2": -1.5},
    "ogden3": {"mu1": 0.3, "alpha1": 2.5, "mu2": 0.05, "alpha2": -1.5, "mu3": 0.01, "alpha3": 6.0},
}


def abaqus_energy(card, stretches):
    """Energy (MPa) by the formulas of the Abaqus Theory Guide, 4.6.1, from a card's form and constants alone."""
    J = np.prod(stretches)
    bar = J ** (-1 / 3) * np.asarray(stretches)
    i1, i2 = (bar**2).sum(), (bar**-2.0).sum()
    name, _, terms = card.form.partition(", N=")
    c = card.constants
    if name == "OGDEN":
        n = int(terms)
        psi = sum(2 * mu / a**2 * ((bar**a).sum() - 3) for mu, a in zip(c[0:2 * n:2], c[1:2 * n:2], strict=True))
        d = c[2 * n:]
    elif name == "ARRUDA-BOYCE":
        series = (1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750)
        psi = c[0] * sum(a / c[1] ** (2 * k) * (i1 ** (k + 1) - 3 ** (k + 1)) for k, a in enumerate(series))
        return psi + ((J**2 - 1) / 2 - np.log(J)) / c[2]
    else:
        n = {"NEO HOOKE": 1, "MOONEY-RIVLIN": 1, "YEOH": 3, "REDUCED POLYNOMIAL": 2}[name]
        psi = sum(value * (i1 - 3) ** (k + 1) for k, value in enumerate(c[:n]))
        if name == "MOONEY-RIVLIN":
            psi += c[1] * (i2 - 3)
        d = c[-n:]
    return psi + sum((J - 1) ** (2 * (k + 1)) / value for k, value in enumerate(d) if value)


def test_the_card_has_our_energy_by_the_formulas_of_abaqus():
    for name in CONSTANTS:
        law = make_law(name, CONSTANTS[name])
        stretches = np.array([0.8, 1.05, 1.2])
        C = np.array([[*stretches**2, 0, 0, 0]])
        J = np.prod(stretches)
        # Arruda-Boyce: (K/2) ((J^2 - 1)/2 - ln J) instead of (K/2) (J-1)^2
        volumetric = law.volumetric.energy(J - 1) if name != "arruda_boyce" else law.bulk_modulus / 2 * ((J**2 - 1) / 2 - np.log(J))
        ours = law.isochoric(C).energy[0] + volumetric
        assert abaqus_energy(law_card(law, no_term=0.0, dialect="Abaqus"), stretches) == pytest.approx(ours, rel=1e-12), name


def test_only_an_arruda_boyce_law_is_written_with_a_logarithmic_volumetric_function():
    arruda_boyce = make_law("arruda_boyce", PARAMETERS["arruda_boyce"], bulk_modulus=4.0, volumetric="logarithmic")
    assert law_card(arruda_boyce, no_term=0.0, dialect="Abaqus").constants[-1] == 0.5
    with pytest.raises(InputError, match="'neo_hooke' has the volumetric function 'logarithmic', which Abaqus does not take"):
        law_card(make_law("neo_hooke", {"c10": 0.2}, volumetric="logarithmic"), no_term=0.0, dialect="Abaqus")


def test_every_law_of_ours_has_its_card_and_another_is_refused():
    assert set(CONSTANTS) == set(LAWS) - {"gent"}    # neither program has it
    with pytest.raises(InputError, match="'gent' cannot be written for Abaqus; use one of neo_hooke"):
        law_card(SimpleNamespace(name="gent", inelastic=None), no_term=0.0, dialect="Abaqus")


@needs_ccx
def test_one_hexahedron_of_ccx_in_tension_and_compression_has_our_stress(tmp_path):
    """Expected: `Law.uniaxial_compressible`, a root of the lateral stress, without finite elements."""
    for name in CONSTANTS:
        law = make_law(name, CONSTANTS[name])
        stretches = (0.8, 1.3)
        lines = keywords.nodes(0.5 * (HEX20.nodes + 1), 1) + keywords.elements("C3D20R", "ALL", [1], [np.arange(1, 21)])
        lines += keywords.material("RUBBER", law_card(law, no_term=1e20, dialect="CalculiX"))
        lines += ["*SOLID SECTION, ELSET=ALL, MATERIAL=RUBBER", *keywords.node_set("TOP", HEX20.top + 1)]
        fixed = [f"{n + 1}, 3" for n in HEX20.bottom]
        fixed += [f"{n + 1}, {axis + 1}" for axis in (0, 1) for n in np.flatnonzero(HEX20.nodes[:, axis] == -1)]
        for stretch in stretches:
            lines += ["*STEP, NLGEOM", "*STATIC", "0.2, 1", "*BOUNDARY", *fixed, f"TOP, 3, 3, {stretch - 1}",
                      "*NODE PRINT, NSET=TOP, TOTALS=ONLY, FREQUENCY=1000", "RF", "*END STEP"]
        (tmp_path / "one.inp").write_text("\n".join(lines) + "\n")
        subprocess.run(["ccx", "one"], cwd=tmp_path, capture_output=True, check=True)
        found = [table[0, 2] for table in Tables(tmp_path / "one.dat").of("TOP")]
        # 1e-5: ccx's printed digits and its tolerance. Arruda-Boyce: another energy of the volume, of third order in J - 1
        assert found == pytest.approx(law.uniaxial_compressible(stretches), rel=1e-5 if name != "arruda_boyce" else 1e-3), name
