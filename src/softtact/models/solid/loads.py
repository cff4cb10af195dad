"""Pressure on a face of a solid, which follows it as it moves and turns."""

from dataclasses import dataclass

import numpy as np

from softtact.contact.surfaces import Surface, quadrature_points


@dataclass
class FacePressure:
    """A follower pressure on a surface, positive against its outward normal.

    surface, at_rest (n, 3): facets and nodes at rest in mm;  axisymmetric, thickness_mm: what a plane's lines stand for
    """

    surface: Surface
    at_rest: np.ndarray
    axisymmetric: bool = False
    thickness_mm: float = 1.0
    name: str = "pressure"

    def __post_init__(self) -> None:
        self._points = quadrature_points(self.surface, self.at_rest)
        slopes = self._points.slopes
        corners = self.at_rest[self._points.nodes]
        along = np.einsum("pda,pai->pdi", slopes, corners)
        size = (
            np.linalg.norm(along[:, 0], axis=1)
            if self.surface.is_line
            else np.linalg.norm(np.cross(along[:, 0], along[:, 1]), axis=1)
        )
        self._share = self._points.weight / size

    def _tangents(self, x):
        along = np.einsum("pda,pai->pdi", self._points.slopes, x[self._points.nodes])
        if self.surface.is_line:
            along[:, 1] = [0.0, 0.0, 1.0]
        return along

    def _thickness(self, x):
        """Length (p,) in mm along z, or of the ring, that a line's point stands for."""
        if not self.surface.is_line:
            return np.ones(len(self._share))
        radius = np.einsum("pa,pa->p", self._points.values, x[self._points.nodes][..., 0])
        return 2 * np.pi * radius if self.axisymmetric else np.full(len(self._share), self.thickness_mm)

    def add_force(self, x: np.ndarray, pressure: float, force: np.ndarray) -> float:
        """Add to nodal forces (n, 3) in N what stands against the pressure (MPa), nodes at x (n, 3); returns its sum."""
        along = self._tangents(x)
        push = pressure * (self._share * self._thickness(x))[:, None] * np.cross(along[:, 0], along[:, 1])
        np.add.at(force, self._points.nodes, self._points.values[..., None] * push[:, None])
        return float(np.abs(push).sum())

    def tangents(self, x: np.ndarray, pressure: float) -> tuple[np.ndarray, np.ndarray]:
        """Nodes (p, k) and symmetric parts (p, 3 k, 3 k) of the force's derivative in N/mm."""
        width, along = self.surface.width, self._tangents(x)
        N, (d1, d2) = self._points.values[:, :width], self._points.slopes[:, :, :width].transpose(1, 0, 2)
        scale = pressure * self._share * self._thickness(x)
        if self.surface.is_line:
            d2 = 0 * d2
        # d(a1 x a2) = da1 x a2 + a1 x da2
        spin1, spin2 = -_spin(along[:, 1]), _spin(along[:, 0])
        turn = d1[:, :, None, None] * spin1[:, None] + d2[:, :, None, None] * spin2[:, None]  # (p, b, i, j)
        matrix = scale[:, None, None, None, None] * N[:, :, None, None, None] * turn[:, None]
        if self.surface.is_line and self.axisymmetric:
            normal = pressure * (self._share * 2 * np.pi)[:, None] * np.cross(along[:, 0], along[:, 1])
            matrix[..., 0] += (N[:, :, None] * N[:, None])[..., None] * normal[:, None, None]
        matrix = matrix.transpose(0, 1, 3, 2, 4).reshape(len(N), 3 * width, 3 * width)
        nodes = self._points.nodes[:, :width]
        return np.ascontiguousarray(np.where(nodes < 0, nodes[:, :1], nodes)), 0.5 * (matrix + matrix.transpose(0, 2, 1))


def _spin(a: np.ndarray) -> np.ndarray:
    """Matrices (p, 3, 3) with spin(a) b = a x b."""
    out = np.zeros((len(a), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -a[:, 2], a[:, 1], -a[:, 0]
    out[:, 1, 0], out[:, 2, 0], out[:, 2, 1] = a[:, 2], -a[:, 1], a[:, 0]
    return out
