"""Tangential forces in their friction discs: the convex part of Coulomb's law, where the pressures are known.

    minimise  1/2 q.T q + b.q   over  |q_i| <= bound_i
Each step takes the points inside their discs as free and those on the rim, pressed outwards, as free to turn; conjugate gradients
find the minimum on these, and what leaves its disc is put back on the rim. Where that does not lower the energy, the step is
shortened, and at last a projected gradient step is taken, which always does.
Reference: Dostal and Kozubek, Optim. Methods Softw. 27 (2012) 1099 (separable round constraints).
"""

from typing import TYPE_CHECKING

import numpy as np

from softtact.errors import ConvergenceError

if TYPE_CHECKING:
    from softtact.contact.coulomb import CoulombSettings, Operator

_ON_RIM = 1 - 1e-12     # share of a disc's radius from which on a force is on the rim
_SHORTENED = (1.0, 0.5, 0.25)
_ROUNDING = 1e-13     # of an energy


def solve_in_discs(compliance: "Operator", linear: np.ndarray, bound: np.ndarray, q: np.ndarray, *,
                   settings: "CoulombSettings") -> tuple[np.ndarray, np.ndarray, int]:
    """q (c, 2) in N, the displacement T q (c, 2), and the number of products; from a first guess q.

    compliance: T, mm/N;  linear (c, 2): b in mm;  bound (c,): radii in N, 0 where there is no contact
    """
    own = compliance.diagonal.max(axis=1, keepdims=True)
    q, products = into_discs(q, bound), 1
    moved, safe = compliance @ q, None
    for _ in range(settings.max_iterations):
        slip = moved + linear
        wrong = own * (q - into_discs(q - slip / own, bound))
        largest = np.abs(wrong).max(initial=0.0)
        if largest <= settings.tolerance_mm:
            break
        face = _Face(q, slip, bound)
        least = max(0.1 * settings.tolerance_mm, 0.01 * largest)
        change, moved_by, used = _on_face(compliance, face, slip, own, settings, least=least)
        products += used
        found, used = _shortened(compliance, linear, bound, q, moved, change, moved_by, face)
        products += used
        if found is None:
            safe = safe or _largest_eigenvalue(compliance, own)
            trial = into_discs(q - slip / (safe * own), bound)
            found, products = (trial, compliance @ trial), products + 1
        q, moved = found
    else:
        raise ConvergenceError(f"An increment of the elastic model did not settle its friction in {settings.max_iterations} sets "
                               "of sliding points; move the object in more steps.")
    return q, moved, products


def into_discs(q: np.ndarray, bound: np.ndarray) -> np.ndarray:
    """Each of q (c, 2) moved to the nearest place of its disc of radius bound (c,)."""
    length = np.linalg.norm(q, axis=1)
    share = np.where(length > bound, bound / np.maximum(length, 1e-300), 1.0)
    return q * share[:, None]


class _Face:
    """Which points are free, which only turn, and how stiffly the latter are held to their rim."""

    def __init__(self, q, slip, bound):
        length = np.linalg.norm(q, axis=1)
        outwards = -(q * slip).sum(axis=1)
        self.rim = (bound > 0) & (length >= bound * _ON_RIM) & (outwards > 0)
        self.free = (bound > 0) & ~self.rim
        radius = np.where(self.rim, length, 1.0)[:, None]
        self.along = np.where(self.rim[:, None], q[:, ::-1] * [-1, 1] / radius, 0.0)
        self.multiplier = np.where(self.rim[:, None], outwards[:, None] / radius**2, 0.0)

    def project(self, x):
        """What of x (c, 2) the points are free to do."""
        return x * self.free[:, None] + self.along * (self.along * x).sum(axis=1, keepdims=True)


def _on_face(compliance, face, slip, own, settings, *, least):
    """The change of q (c, 2) that minimises the energy on a face, T times it, and the number of products."""
    change, moved_by, products = np.zeros_like(slip), np.zeros_like(slip), 0
    residual = -face.project(slip)
    scale = 1 / (own + face.multiplier)
    direction = z = face.project(scale * residual)
    rho = (residual * z).sum()
    while np.abs(residual).max(initial=0.0) > least and products < settings.inner_iterations:
        moved = compliance @ direction
        products += 1
        curved = face.project(moved + face.multiplier * direction)
        step = rho / (direction * curved).sum()
        change, moved_by = change + step * direction, moved_by + step * moved
        residual = residual - step * curved
        z = face.project(scale * residual)
        before, rho = rho, (residual * z).sum()
        direction = z + rho / before * direction
    return change, moved_by, products


def _shortened(compliance, linear, bound, q, moved, change, moved_by, face):
    """q and T q after the change, or a part of it, where that lowers the energy; else None. And the number of products."""
    before, products = _energy(q, moved, linear), 0
    for share in _SHORTENED:
        trial = q + share * change
        rim = face.rim
        trial[rim] *= (bound[rim] / np.linalg.norm(trial[rim], axis=1))[:, None]
        trial = into_discs(trial, bound)
        if np.array_equal(trial, q + change):
            return (trial, moved + moved_by), products     # no point left its disc: the quadratic's own minimum on the face
        trial_moved, products = compliance @ trial, products + 1
        if _energy(trial, trial_moved, linear) <= before + _ROUNDING * abs(before):
            return (trial, trial_moved), products
    return None, products


def _energy(q, moved, linear):
    return 0.5 * (q * moved).sum() + (q * linear).sum()


def _largest_eigenvalue(compliance, own, *, iterations=20):
    """Of T scaled by the points' own compliance `own` (c, 1), from above: the power method's with a margin."""
    x = np.sin(np.arange(2 * len(own)) + 1.0).reshape(-1, 2)
    for _ in range(iterations):
        x = (compliance @ (x / np.sqrt(own))) / np.sqrt(own)
        size = np.linalg.norm(x)
        x /= size
    return 1.2 * float(size)
