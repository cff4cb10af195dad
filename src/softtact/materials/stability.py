"""Drucker stability of a law along the paths of simple tests.

Symbols: l_a principal stretches of the incompressible material, t_a = l_a dpsi/dl_a, T_ab = dt_a/dln l_b.
With direction 3 free of stress, Kirchhoff stresses and logarithmic strains of the loaded plane obey
  dtau_i = D_ij deps_j,  D_ij = T_ij - T_i3 - T_3j + T_33  (i, j = 1, 2).
The law is stable where dtau . deps > 0 for every deps: D is positive definite.
Reference: Abaqus Analysis User's Guide, "Hyperelastic behavior of rubberlike materials", Drucker stability.
"""

from collections.abc import Sequence

import numpy as np

from softtact.materials.laws.base import TEST_PATHS, Law, principal_stretches

SCAN = (0.1, 10.0)
SCAN_POINTS = 461  # 1 % steps of stretch each way from 1
_BISECTIONS = 12   # of such a step: an end of the range is good to 3e-6


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
