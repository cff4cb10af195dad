"""Material laws against textbook energies, finite differences and each other."""

import numpy as np
from law_constants import C_PER_E, COLUMN, PARAMETERS, ROW

from softtact.materials.laws.registry import make_law

ENERGY_SOURCE = "central differences of the energy as textbooks print it, in principal stretches"


def textbook_energy(name, l, p):
    """psi (n,) in MPa at isochoric principal stretches (n, 3), written down anew from the literature."""
    x = (l**2).sum(axis=1) - 3
    if name.startswith("ogden"):
        terms = [(p[f"mu{k}"], p[f"alpha{k}"]) for k in range(1, int(name[-1]) + 1)]
        return sum(2 * mu / a**2 * ((l**a).sum(axis=1) - 3) for mu, a in terms)
    if name == "gent":
        return -p["mu"] * p["jm"] / 2 * np.log1p(-x / p["jm"])
    if name == "arruda_boyce":
        series = [1 / 2, 1 / 20, 11 / 1050, 19 / 7000, 519 / 673750]
        return p["mu"] * sum(c * ((x + 3) ** n - 3**n) / p["lambda_m"] ** (2 * n - 2) for n, c in enumerate(series, start=1))
    polynomial = p["c10"] * x + p.get("c20", 0) * x**2 + p.get("c30", 0) * x**3
    return polynomial + p.get("c01", 0) * ((l**-2).sum(axis=1) - 3)


def energy_of(name, C6):
    """psi (n,) from C6 (n, 6) by numpy's eigenvalues."""
    C = np.empty((len(C6), 3, 3))
    C[:, ROW, COLUMN] = C[:, COLUMN, ROW] = C6
    stretches = np.sqrt(np.linalg.eigvalsh(C))
    return textbook_energy(name, stretches / np.cbrt(stretches.prod(axis=1))[:, None], PARAMETERS[name])


def random_states(n=20):
    """C6 (n, 6) of random deformations with stretches of about 0.6 to 1.6 and volume changes."""
    F = np.eye(3) + 0.15 * np.random.default_rng(11).standard_normal((n, 3, 3))
    return np.einsum("nki,nkj->nij", F, F)[:, ROW, COLUMN]


def derivative_by_E(function, C6, *, step=1e-3):
    """Derivative (..., 6) of function(C6) by E6: central differences of fourth order, error of the order of step^4 to 1e-8."""
    columns = []
    for k in range(6):
        d = np.eye(6)[k] * step * C_PER_E
        near, far = function(C6 + d) - function(C6 - d), function(C6 + 2 * d) - function(C6 - 2 * d)
        columns.append((8 * near - far) / (12 * step))
    return np.stack(columns, axis=-1)


def relative(value, expected):
    return np.abs(value - expected).max() / np.abs(expected).max()


def test_stress_is_the_slope_of_the_textbook_energy(record):
    for name in PARAMETERS:
        C6 = random_states()
        expected = derivative_by_E(lambda C, name=name: energy_of(name, C), C6)
        got = relative(make_law(name, PARAMETERS[name]).isochoric(C6).stress, expected)
        record(f"stress of {name}: relative deviation", expected=0.0, source=ENERGY_SOURCE, got=got)
        assert got < 1e-8, name      # fourth-order differences with step 1e-3


def test_tangent_is_the_slope_of_the_stress(record):
    for name in PARAMETERS:
        law, C6 = make_law(name, PARAMETERS[name]), random_states()
        expected = derivative_by_E(lambda C, law=law: law.isochoric(C, tangent=False).stress, C6)
        got = relative(law.isochoric(C6).tangent, expected)
        record(f"tangent of {name}: relative deviation", expected=0.0, source="central differences of the stress", got=got)
        assert got < 1e-7, name


def test_a_law_becomes_neo_hooke_where_its_constants_say_so(record):
    for name, constants in [
        ("mooney_rivlin", {"c10": 0.2, "c01": 0.0}),
        ("ogden1", {"mu1": 0.4, "alpha1": 2.0}),
        ("yeoh", {"c10": 0.2, "c20": 0.0, "c30": 0.0}),
        ("reduced_polynomial2", {"c10": 0.2, "c20": 0.0}),
        ("arruda_boyce", {"mu": 0.4, "lambda_m": 1e8}),
    ]:
        C6 = random_states()
        one, other = make_law(name, constants).isochoric(C6), make_law("neo_hooke", {"c10": 0.2}).isochoric(C6)
        got = max(relative(getattr(one, key), getattr(other, key)) for key in ("energy", "stress", "tangent"))
        listing = ", ".join(f"{key} = {value:g}" for key, value in constants.items())
        record(f"{name} with {listing}: deviation of energy, stress, tangent from neo-Hooke", expected=0.0,
               source="identity of the laws", got=got)
        assert got < 1e-12, name     # round-off


def inverse_langevin(y):
    """beta with coth(beta) - 1/beta = y, by Newton's method from Cohen's estimate."""
    beta = y * (3 - y**2) / (1 - y**2)
    for _ in range(50):
        beta -= (1 / np.tanh(beta) - 1 / beta - y) / (1 / beta**2 - 1 / np.sinh(beta) ** 2)
    return beta


def test_arruda_boyce_is_the_eight_chain_network_that_its_series_stands_for(record):
    """Uniaxial stress of the chains' own law, stretched to a third of their length; five terms leave 0.67 (1/3)^10 = 1e-5."""
    mu, lambda_m, stretch = 0.3, 6.0, 3.3
    chain = np.sqrt((stretch**2 + 2 / stretch) / 3)
    slope = mu * lambda_m / (6 * chain) * inverse_langevin(chain / lambda_m)      # dpsi/dI1
    expected, source = 2 * slope * (stretch - stretch**-2), "inverse Langevin function (Arruda and Boyce 1993)"
    got = make_law("arruda_boyce", {"mu": mu, "lambda_m": lambda_m}).nominal_stress("uniaxial", stretch)
    error = record("uniaxial nominal stress of arruda_boyce at stretch 3.3", expected=expected, source=source, got=got)
    assert error < 2e-5
