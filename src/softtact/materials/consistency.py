"""Whether the laws of one material are stable, and agree with each other.

Two laws can both be stable and fit their data, and still describe different materials: a shear modulus six times
as large, or five times the stress in compression. Each disagreement is reported in a sentence with its numbers.

Drucker stability along the paths of simple tests:
Symbols: l_a principal stretches of the incompressible material, t_a = l_a dpsi/dl_a, T_ab = dt_a/dln l_b.
With direction 3 free of stress, Kirchhoff stresses and logarithmic strains of the loaded plane obey
  dtau_i = D_ij deps_j,  D_ij = T_ij - T_i3 - T_3j + T_33  (i, j = 1, 2).
The law is stable where dtau . deps > 0 for every deps: D is positive definite.
Reference: Abaqus Analysis User's Guide, "Hyperelastic behavior of rubberlike materials", Drucker stability.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from softtact.materials.laws.base import TEST_PATHS, Law, principal_stretches
from softtact.materials.laws.registry import make_law
from softtact.materials.linear import LinearConstants

SCAN = (0.1, 10.0)
SCAN_POINTS = 461  # 1 % steps of stretch to both sides of 1
_BISECTIONS = 12   # of such a step: an end of the range is accurate to 3e-6
PRINTED = "Printed constants: "    # prefix of a card's sentences on published constants
# Where the laws are compared: states that the sensor's layers reach under a fingertip's load.
PROBES = (("uniaxial", 0.5), ("uniaxial", 1.5), ("equibiaxial", 1.3), ("planar", 1.5))
# Range of a tensile specimen (ISO 3167); laws that differ elsewhere can be fits of one such test.
TENSION = np.linspace(1.05, 2.0, 20)
# Laws fitted to the same curves differ by tens of percent outside them; beyond this factor they are two materials.
FACTOR = 1.5


def stable_ranges(law: Law, *, scan: tuple[float, float] = SCAN) -> dict[str, list[float]]:
    """{mode: [lowest, highest] stretch}, the range around 1 in which the law is stable, inside `scan`."""
    return {mode: stable_range(law, mode, scan=scan) for mode in TEST_PATHS}


def stable_range(law: Law, mode: str, *, scan: tuple[float, float] = SCAN) -> list[float]:
    """[lowest, highest] stable stretch on the path of a mode; [1, 1] if the law is unstable at rest."""
    if not is_stable(law, mode, np.array([1.0]))[0]:
        return [1.0, 1.0]
    return [_last_stable(law, mode, end) for end in scan]


def covers(outer: Sequence[float], inner: Sequence[float]) -> bool:
    """Whether a range covers another, up to the last digits."""
    return outer[0] <= inner[0] * (1 + 1e-5) and outer[1] >= inner[1] * (1 - 1e-5)


def is_stable(law: Law, mode: str, stretch: np.ndarray) -> np.ndarray:
    """Boolean (n,) whether D is positive definite at the stretches (n,) of a test mode."""
    D = plane_tangent(law, mode, stretch)
    with np.errstate(invalid="ignore", over="ignore"):
        determinant = D[:, 0, 0] * D[:, 1, 1] - D[:, 0, 1] * D[:, 1, 0]
        return (D[:, 0, 0] > 0) & (determinant > 0)


def plane_tangent(law: Law, mode: str, stretch: np.ndarray) -> np.ndarray:
    """D (n, 2, 2) in MPa at the stretches (n,) of a test mode."""
    T = log_tangent(law, principal_stretches(mode, stretch))
    T = T - T[:, 2:, :]
    return (T - T[:, :, 2:])[:, :2, :2]


def log_tangent(law: Law, stretches: np.ndarray, *, step: float = 1e-30) -> np.ndarray:
    """T (n, 3, 3), T_ab = dt_a/dln l_b at principal stretches (n, 3), by complex steps: exact to round-off."""
    columns = [law.principal_stress(stretches * (1 + 1j * step * np.eye(3)[b])).imag / step for b in range(3)]
    return np.stack(columns, axis=-1)


def _last_stable(law, mode, end):
    """The stretch between 1 and `end` up to which the law is stable."""
    stretch = np.geomspace(1.0, end, SCAN_POINTS // 2 + 1)
    stable = is_stable(law, mode, stretch)
    if stable.all():
        return float(stretch[-1])
    first = int(np.argmin(stable))
    good, bad = stretch[first - 1], stretch[first]
    for _ in range(_BISECTIONS):
        middle = np.sqrt(good * bad)
        good, bad = (middle, bad) if is_stable(law, mode, np.array([middle]))[0] else (good, middle)
    return float(good)


def printed_warnings(printed: Mapping[str, Any], *, bulk_over_shear: float = 20.0) -> list[str]:
    """Sentences on where published constants {law: {"parameters": {...}}} contradict each other."""
    laws = {
        name: make_law(name, entry["parameters"], bulk_over_shear=bulk_over_shear)
        for name, entry in printed.items()
        if name != "linear"
    }
    linear = LinearConstants(**printed["linear"]["parameters"]) if "linear" in printed else None
    return [f"{PRINTED}{sentence}" for sentence in disagreements(laws, linear=linear)]


def disagreements(laws: Mapping[str, Law], *, linear: LinearConstants | None = None, factor: float = FACTOR) -> list[str]:
    """Sentences on laws {name: Law} of one material that differ by more than `factor`.

    linear: `LinearConstants` of the same material, or None
    """
    found = [_parting("the initial shear modulus", {name: law.mu0 for name, law in laws.items()}, factor)]
    for mode, stretch in PROBES:
        stable = {name: law for name, law in laws.items() if is_stable(law, mode, np.array([stretch]))[0]}
        stress = {name: float(law.nominal_stress(mode, stretch)) for name, law in stable.items()}
        found.append(_parting(f"the nominal stress at {mode} stretch {stretch:g}", stress, factor))
    return [sentence for sentence in found if sentence] + against_linear(laws, linear, factor=factor)


def largest_parting_in_tension(laws: Mapping[str, Law]) -> tuple[float, str]:
    """(ratio, sentence): largest difference of laws {name: Law} of one material, in mu0 and in uniaxial tension to stretch 2."""
    moduli = {name: law.mu0 for name, law in laws.items()}
    stress = np.array([law.nominal_stress("uniaxial", TENSION) for law in laws.values()])
    ratios = stress.max(axis=0) / stress.min(axis=0)
    values = " against ".join(f"{value:.3g} MPa ({name})" for name, value in moduli.items())
    return (max(float(ratios.max()), max(moduli.values()) / min(moduli.values())),
            f"mu0 {values}; stresses in tension part by {1 - 1 / ratios.max():.0%} of the larger one at most, at stretch "
            f"{TENSION[ratios.argmax()]:.2f}")


def longest_common_test(laws: Mapping[str, Law], *, allowed_mpa: float, to: float = 2.5, points: int = 3000) -> float:
    """The largest stretch of a uniaxial tensile test that two laws {name: Law} can both be fits of; `to` where they never part.

    allowed_mpa: the sum of both fits' RMSE. Two curves that lie within e1 and e2 of the same data (root mean square over the test)
    lie within e1 + e2 of each other; a test to stretch s has points evenly spaced in stretch from 1 to s.
    """
    one, other = laws.values()
    stretch = np.linspace(1.0, to, points + 1)[1:]
    gap = one.nominal_stress("uniaxial", stretch) - other.nominal_stress("uniaxial", stretch)
    rms = np.sqrt(np.cumsum(gap**2) / np.arange(1, points + 1))
    apart = np.flatnonzero(rms > allowed_mpa)
    return float(stretch[apart[0]]) if len(apart) else to


def _parting(quantity, values, factor):
    """The sentence on the two laws farthest apart, or None."""
    if len(values) < 2:
        return None
    small, large = min(values, key=lambda name: abs(values[name])), max(values, key=lambda name: abs(values[name]))
    ratio = abs(values[large] / values[small])
    if ratio <= factor:
        return None
    return (
        f"{large} and {small} disagree {ratio:.1f}-fold in {quantity}:"
        f" {values[large]:.3g} against {values[small]:.3g} MPa."
    )


def against_linear(laws: Mapping[str, Law], linear: LinearConstants | None, *, factor: float = FACTOR) -> list[str]:
    """A sentence on linear constants whose moduli no law has, in a list that is empty otherwise."""
    if linear is None or not laws:
        return []
    moduli = [law.mu0 for law in laws.values()]
    if any(_ratio(modulus, linear.mu_mpa) <= factor for modulus in moduli):
        return []
    return [
        f"E {linear.young_mpa:.4g} MPa and nu {linear.poisson:.4g} mean the shear modulus {linear.mu_mpa:.3g} MPa, which none of"
        f" {', '.join(laws)} has: theirs are {min(moduli):.3g} to {max(moduli):.3g} MPa. They also mean the bulk modulus"
        f" {linear.bulk_modulus_mpa:.3g} MPa; the other laws' own ones come from an assumed K/mu0 and prove nothing."
    ]


def _ratio(a, b):
    return max(a / b, b / a)
