"""What acts on a solid beside the strain of its regions: each an item of the sum that makes the potential.

An item gives its share of energy and forces, its part of the tangent, and its history, the state variables that advance from
increment to increment (as felupe's items do; Dutzler, felupe, 2023). `SolidBody` only adds up. There are contact
(`contact.pair.ContactPair`), frusta (`frusta.FrustumItem`) and pressure (`FacePressure`); a further item needs no change elsewhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np

from softtact.contact.pair_state import Totals
from softtact.contact.surfaces import Surface, quadrature_points


class ItemState(NamedTuple):
    """An item at a state of the body."""

    history: Any
    """Its state variables as the increment began."""
    response: Any
    """What `Item.evaluate` found."""


class Item(Protocol):
    """What `SolidBody` asks of an item; x (n, 3) are the places of all nodes in mm. What is left out has the default here."""

    friction: float = 0.0
    """Coulomb's coefficient; 0 where nothing rubs."""

    def supported_nodes(self) -> np.ndarray:
        """Nodes that it ties to the ground, in all directions."""
        return np.zeros(0, dtype=np.int64)

    def first(self, at_rest: np.ndarray) -> Any:
        """The history before any load, nodes at rest (n, 3)."""
        return None

    def begin_step(self, history: Any, response: Any, x: np.ndarray, at_rest: np.ndarray) -> Any:
        """The history as an increment begins, from a balanced state."""
        return history

    def evaluate(self, history: Any, x: np.ndarray, before: Any = None, *, nearby: bool = False) -> Any:
        """The response at x.

        before: the response that this one follows on;  nearby: continue it along its tangent, for a derivative
        """
        ...

    def totals(self, history: Any, response: Any) -> Totals:
        """Energies and size."""
        ...

    def add_forces(self, history: Any, response: Any, force: np.ndarray) -> None:
        """Add the derivative of its potential to nodal forces (n, 3) in N."""
        ...

    def tangents(self, history: Any, response: Any, x: np.ndarray, *, turning: bool = True) -> list[tuple[np.ndarray, np.ndarray]]:
        """Nodes (q, k) and matrices (q, 3 k, 3 k) in N/mm, of which the upper triangle counts.

        turning: with the part that pressures have as surfaces turn, which may be negative
        """
        ...

    def slides(self, history: Any, response: Any) -> bool:
        """Whether the tangent has a part that is not symmetric (`add_coupling`)."""
        return False

    def add_coupling(self, history: Any, response: Any, change: np.ndarray, force: np.ndarray) -> None:
        """Add that part, times a change (n, 3) of the places, to forces (n, 3)."""

    def conservative(self, history: Any) -> bool:
        """Whether its forces, friction aside, are the derivative of an energy."""
        return True

    def settled(self, history: Any, response: Any, tolerance_mm: float) -> bool:
        """Whether its constraints are met."""
        return True

    def anchored(self, history: Any, response: Any, x: np.ndarray) -> Any:
        """The history with friction from where points came to touch since the increment began."""
        return history

    def augmented(self, history: Any, response: Any) -> Any:
        """The history with multipliers that meet its constraints better."""
        return history

    def overlap_mm(self, history: Any, response: Any) -> float:
        """By how much its constraints are missed."""
        return 0.0

    def penetration_mm(self, response: Any) -> float:
        """Deepest overlap of surfaces in mm."""
        return 0.0

    def unresolved_n(self, history: Any, response: Any, penetration_mm: float) -> float:
        """Force in N at an overlap of so much of all that touches."""
        return 0.0

    def gap_mm(self, response: Any) -> float:
        """Least gap in mm of what may touch; infinite where nothing may."""
        return np.inf

    def dissipated_mj(self, history: Any, response: Any) -> float:
        """What friction took within the increment."""
        return 0.0


@dataclass(frozen=True)
class PressureResponse:
    """Pressure on a face at given places of all nodes."""

    pressure: float
    """In MPa."""
    push: np.ndarray
    """(p, 3) in N, at the face's points."""


@dataclass
class FacePressure(Item):
    """A follower pressure on a surface, positive against its outward normal. Its history is the pressure in MPa.

    surface, at_rest (n, 3): facets and nodes at rest in mm;  axisymmetric, thickness_mm: what a plane's lines stand for
    """

    surface: Surface
    at_rest: np.ndarray
    axisymmetric: bool = False
    thickness_mm: float = 1.0
    name: str = "pressure"
    _share: np.ndarray = field(init=False, repr=False)

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

    def first(self, at_rest: np.ndarray) -> float:
        return 0.0

    def evaluate(self, history: float, x: np.ndarray, before: Any = None, *, nearby: bool = False) -> PressureResponse:
        along = self._along(x)
        return PressureResponse(history, history * (self._share * self._thickness(x))[:, None] * np.cross(along[:, 0], along[:, 1]))

    def totals(self, history: float, response: PressureResponse) -> Totals:
        return Totals(size=float(np.abs(response.push).sum()))

    def add_forces(self, history: float, response: PressureResponse, force: np.ndarray) -> None:
        np.add.at(force, self._points.nodes, self._points.values[..., None] * response.push[:, None])

    def conservative(self, history: float) -> bool:
        return history == 0.0  # of an open surface the work is no function of the places

    def _along(self, x):
        """Vectors (p, 2, 3) along the surface."""
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

    def tangents(
        self, history: float, response: PressureResponse, x: np.ndarray, *, turning: bool = True
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Nodes (p, k) and symmetric parts (p, 3 k, 3 k) of the force's derivative in N/mm."""
        if not history:
            return []
        width, along = self.surface.width, self._along(x)
        N, (d1, d2) = self._points.values[:, :width], self._points.slopes[:, :, :width].transpose(1, 0, 2)
        scale = history * self._share * self._thickness(x)
        if self.surface.is_line:
            d2 = 0 * d2
        # d(a1 x a2) = da1 x a2 + a1 x da2
        spin1, spin2 = -_spin(along[:, 1]), _spin(along[:, 0])
        turn = d1[:, :, None, None] * spin1[:, None] + d2[:, :, None, None] * spin2[:, None]  # (p, b, i, j)
        matrix = scale[:, None, None, None, None] * N[:, :, None, None, None] * turn[:, None]
        if self.surface.is_line and self.axisymmetric:
            normal = history * (self._share * 2 * np.pi)[:, None] * np.cross(along[:, 0], along[:, 1])
            matrix[..., 0] += (N[:, :, None] * N[:, None])[..., None] * normal[:, None, None]
        matrix = matrix.transpose(0, 1, 3, 2, 4).reshape(len(N), 3 * width, 3 * width)
        nodes = self._points.nodes[:, :width]
        return [(np.ascontiguousarray(np.where(nodes < 0, nodes[:, :1], nodes)), 0.5 * (matrix + matrix.transpose(0, 2, 1)))]


def with_pressures(items: Sequence[Item], histories: Sequence[Any], pressures: Sequence[float]) -> tuple[Any, ...]:
    """Histories of items with those of the faces under pressure replaced, in their order."""
    values = iter(pressures)
    return tuple(
        float(next(values)) if isinstance(item, FacePressure) else history for item, history in zip(items, histories, strict=True)
    )


def _spin(a: np.ndarray) -> np.ndarray:
    """Matrices (p, 3, 3) with spin(a) b = a x b."""
    out = np.zeros((len(a), 3, 3))
    out[:, 0, 1], out[:, 0, 2], out[:, 1, 2] = -a[:, 2], a[:, 1], -a[:, 0]
    out[:, 1, 0], out[:, 2, 0], out[:, 2, 1] = a[:, 2], -a[:, 1], a[:, 0]
    return out
