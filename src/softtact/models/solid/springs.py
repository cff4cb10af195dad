"""Frusta below a solid sheet as springs: what the foundation model takes them for, under a sheet of finite strain.

Each frustum stands against the mean descent of its root by the law of its unit cell (`FrustumLaw`), and against the mean movement
sideways by its stiffness at rest. The board holds no frustum down. Tilting roots meet no moment here.
"""

from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import PchipInterpolator

if TYPE_CHECKING:
    from softtact.models.foundation.frustum_spring import FrustumLaw

_LIFTED = 1e-4  # of the first slope: what a lifted frustum still pulls, so that nothing is loose


class FrustumSprings:
    """Springs under nodes (k, m) with weights (k, m) that make a root's mean movement; law: of one frustum."""

    def __init__(self, nodes: np.ndarray, weights: np.ndarray, law: "FrustumLaw") -> None:
        self.nodes, self.weights, self.limit_mm = np.ascontiguousarray(nodes), weights, law.limit_mm
        self._force = PchipInterpolator(law.compression_mm, law.force_n)
        self._slope, self._energy = self._force.derivative(), self._force.antiderivative()
        self._first, self._last = float(self._slope(0.0)), float(self._slope(law.limit_mm))
        self._sideways = float(law.stiffness[0, 0])

    def compressions(self, displacement: np.ndarray) -> np.ndarray:
        """Compressions (k,) in mm of the frusta; negative where they are lifted."""
        return -(self.weights * displacement[self.nodes, 2]).sum(axis=1)

    def _response(self, compression):
        """Force (N), slope (N/mm) and energy (mJ) at compressions (k,)."""
        inside = np.clip(compression, 0.0, self.limit_mm)
        beyond, lifted = np.maximum(compression - self.limit_mm, 0.0), np.minimum(compression, 0.0)
        pull = _LIFTED * self._first
        force = self._force(inside) + self._last * beyond + pull * lifted
        slope = np.where(compression < 0, pull, np.where(beyond > 0, self._last, self._slope(inside)))
        energy = self._energy(inside) + beyond * (self._force(self.limit_mm) + 0.5 * self._last * beyond) + 0.5 * pull * lifted**2
        return force, slope, energy

    def add_force(self, displacement: np.ndarray, force: np.ndarray) -> tuple[float, float]:
        """Add to nodal forces (n, 3) in N what stands against the springs; returns their energy (mJ) and the sum of their
        forces."""
        push, _, energy = self._response(self.compressions(displacement))
        sideways = np.einsum("km,kmi->ki", self.weights, displacement[self.nodes][..., :2])
        along = np.column_stack([self._sideways * sideways, -push])
        np.add.at(force, self.nodes, self.weights[..., None] * along[:, None])
        return float(energy.sum() + 0.5 * self._sideways * (sideways**2).sum()), float(np.abs(push).sum())

    def tangents(self, displacement: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Nodes (k, m) and matrices (k, 3 m, 3 m) in N/mm."""
        _, slope, _ = self._response(self.compressions(displacement))
        k, m = self.nodes.shape
        stiffness = np.zeros((k, 3, 3))
        stiffness[:, 0, 0] = stiffness[:, 1, 1] = self._sideways
        stiffness[:, 2, 2] = slope
        matrix = np.einsum("ka,kb,kij->kaibj", self.weights, self.weights, stiffness)
        return self.nodes, np.ascontiguousarray(matrix.reshape(k, 3 * m, 3 * m))
