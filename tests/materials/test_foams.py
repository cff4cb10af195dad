"""Laws of foams: stress and tangent against finite differences of the printed energies, simple tests against closed forms."""

import numpy as np
import pytest
from law_constants import C_PER_E, COLUMN, ROW

from softtact.errors import InputError
from softtact.fem.solid_block import HexBlock
from softtact.fem.structured_meshes import box
from softtact.materials.cards import law_of_entry
from softtact.materials.curves import synthetic_curve
from softtact.materials.fitting import fit_law
from softtact.materials.laws.registry import FOAM_LAWS, make_law

CONSTANTS = {
    "hyperfoam1": {"mu1": 0.02, "alpha1": 6.0, "nu1": 0.1},
    "hyperfoam2": {"mu1": 0.02, "alpha1": 8.0, "nu1": 0.0, "mu2": 0.01, "alpha2": -2.0, "nu2": 0.2},
    "blatz_ko": {"mu": 0.05, "nu": 0.3, "f": 0.4},
}


def printed_energy(name, C6):
    """psi (n,) in MPa, written down from the papers: Hyperfoam in stretches, Blatz-Ko in invariants."""
    p, C = CONSTANTS[name], np.empty((len(C6), 3, 3))
    C[:, ROW, COLUMN] = C[:, COLUMN, ROW] = C6
    if name == "blatz_ko":
        I1, I3 = np.trace(C, axis1=1, axis2=2), np.linalg.det(C)
        I2, beta = (I1**2 - np.einsum("nij,nij->n", C, C)) / 2, p["nu"] / (1 - 2 * p["nu"])
        first, second = I1 - 3 + (I3**-beta - 1) / beta, I2 / I3 - 3 + (I3**beta - 1) / beta
        return 0.5 * p["mu"] * (p["f"] * first + (1 - p["f"]) * second)
    stretches = np.sqrt(np.linalg.eigvalsh(C))
    J, out = stretches.prod(axis=1), 0.0
    for k in range(1, 1 + len(p) // 3):
        mu, alpha, nu = p[f"mu{k}"], p[f"alpha{k}"], p[f"nu{k}"]
        beta = nu / (1 - 2 * nu)
        volume = (J ** (-alpha * beta) - 1) / beta if beta else -alpha * np.log(J)
        out = out + 2 * mu / alpha**2 * ((stretches**alpha).sum(axis=1) - 3 + volume)
    return out


def by_E(function, C6, step=1e-3):
    """Derivative (..., 6) of function(C6) by E6: central differences of fourth order."""
    moves = [np.eye(6)[k] * step * C_PER_E for k in range(6)]
    return np.stack([(8 * (function(C6 + d) - function(C6 - d)) - (function(C6 + 2 * d) - function(C6 - 2 * d))) / (12 * step)
                     for d in moves], axis=-1)


def relative(value, expected):
    return np.abs(value - expected).max() / np.abs(expected).max()


@pytest.fixture
def states():
    """C6 of random deformations, and three with equal stretches."""
    F = np.concatenate([np.eye(3) + 0.15 * np.random.default_rng(3).standard_normal((20, 3, 3)),
                        [0.7 * np.eye(3), np.eye(3), np.diag([0.6, 1.1, 1.1])]])
    return np.einsum("nki,nkj->nij", F, F)[:, ROW, COLUMN]


def test_stress_and_tangent_are_the_slopes_of_the_printed_energy(states):
    assert set(CONSTANTS) == set(FOAM_LAWS)
    for name, constants in CONSTANTS.items():
        law = make_law(name, constants)
        response = law.isochoric(states)
        assert relative(response.energy, printed_energy(name, states)) < 1e-13, name
        assert relative(response.stress, by_E(lambda C, name=name: printed_energy(name, C), states)) < 1e-7, name
        assert relative(response.tangent, by_E(lambda C, law=law: law.isochoric(C, tangent=False).stress, states)) < 1e-7, name


def test_small_strains_have_the_moduli_of_the_constants():
    for name, constants in CONSTANTS.items():
        law = make_law(name, constants)
        D = law.isochoric(np.array([[1.0, 1, 1, 0, 0, 0]])).tangent[0]
        assert D[3, 3] == pytest.approx(law.mu0, rel=1e-12)
        assert D[0, 1] == pytest.approx(law.bulk_modulus - 2 / 3 * law.mu0, rel=1e-12, abs=1e-15)
        assert law.projected_modulus == 0.0
    nu = CONSTANTS["blatz_ko"]["nu"]
    law = make_law("blatz_ko", CONSTANTS["blatz_ko"])
    assert law.bulk_modulus / law.mu0 == pytest.approx(2 * (1 + nu) / (3 * (1 - 2 * nu)))


def test_uniaxial_tests_have_their_closed_forms():
    stretch = np.array([0.4, 0.8, 1.0, 1.7])
    for nu in (0.0, 0.25):     # l_across = l^-nu of one term, so that P = 2 mu / (alpha l) (l^alpha - l^(-alpha nu))
        law = make_law("hyperfoam1", {"mu1": 0.02, "alpha1": 6.0, "nu1": nu})
        assert law.lateral_stretch("uniaxial", stretch) == pytest.approx(stretch**-nu, rel=1e-12)
        expected = 0.04 / 6 / stretch * (stretch**6 - stretch ** (-6 * nu))
        assert law.nominal_stress("uniaxial", stretch) == pytest.approx(expected, rel=1e-9, abs=1e-12)
    foam = make_law("blatz_ko", {"mu": 0.05, "nu": 0.25, "f": 0.0})     # P = mu (l^-1/2 - l^-3) (Blatz and Ko 1962)
    assert foam.nominal_stress("uniaxial", stretch) == pytest.approx(0.05 * (stretch**-0.5 - stretch**-3.0), rel=1e-9, abs=1e-12)


def test_a_volumetric_curve_of_a_foam_is_the_slope_of_its_energy():
    for name, constants in CONSTANTS.items():
        curve = synthetic_curve(make_law(name, constants), "volumetric", (0.6, 1.2), points=13, noise=0.0, seed=1)

        def energy(J, name=name):
            return printed_energy(name, np.cbrt(J)[:, None] ** 2 * np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0]))

        slope = (energy(curve.volume_ratio + 1e-6) - energy(curve.volume_ratio - 1e-6)) / 2e-6
        assert curve.pressure == pytest.approx(-slope, rel=1e-6, abs=1e-9), name


def test_simple_shear_of_the_foam_of_blatz_and_ko_has_no_stress_along_it():
    # F = 1 + g e1 x e2: sigma = mu (1 - B^-1), so sigma12 = mu g, sigma11 = 0, sigma22 = -mu g^2.
    g, mu = 0.6, 0.05
    F = np.array([[1, g, 0], [0, 1, 0], [0, 0, 1.0]])
    S = make_law("blatz_ko", {"mu": mu, "nu": 0.25, "f": 0.0}).isochoric((F.T @ F)[None][:, ROW, COLUMN]).stress[0]
    second = np.empty((3, 3))
    second[ROW, COLUMN] = second[COLUMN, ROW] = S
    expected = np.array([[0, mu * g, 0], [mu * g, -mu * g**2, 0], [0, 0, 0.0]])
    assert np.allclose(F @ second @ F.T, expected, atol=1e-15)


def test_elements_take_a_foam_as_it_is():
    mesh, law = box((0, 0, 0), (1, 1, 1), (1, 1, 1)), make_law("hyperfoam1", CONSTANTS["hyperfoam1"])
    corners = mesh.points[mesh.cells[0][2]]
    state = HexBlock(corners, law).evaluate(corners * ([0.8, 0.9, 1.3]) - corners)
    assert state.energy == pytest.approx(printed_energy("hyperfoam1", np.array([[0.64, 0.81, 1.69, 0, 0, 0]]))[0], rel=1e-12)


def test_cards_know_foams_and_fits_of_incompressible_curves_refuse_them():
    entry = {"parameters": CONSTANTS["hyperfoam1"]}
    assert law_of_entry("hyperfoam1", entry).mu0 == pytest.approx(0.02)
    for change, told in [({"nu1": 0.5}, "nu1 is 0.5"), ({"alpha1": 0.0}, "alpha1"), ({"mu1": -1.0}, "make both positive")]:
        with pytest.raises(InputError, match=told):
            make_law("hyperfoam1", CONSTANTS["hyperfoam1"] | change)
    with pytest.raises(InputError, match="by its constants, not 1 MPa;"):
        law_of_entry("hyperfoam1", entry | {"bulk_modulus_mpa": 1.0})
    with pytest.raises(InputError, match="compressible foams"):
        fit_law("hyperfoam1", [])
