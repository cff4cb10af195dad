"""Frusta below a solid sheet, each condensed to its root: compression by its unit cell's law, all else by its stiffness.

A root follows the sheet in the mean (mortar, see `models/foundation/frustum_spring`): its nodes' displacements v = T u. With the
compression c = -b.v and, along x and y, movement and tilt a of the root, the energy of a frustum is

    E = 1/2 v' R v + W(c) + 1/2 sum a' dK(c) a

R: stiffness at rest against all but compression, coupling of movement, tilt and bending of the root included;  W' = p(c): force
of the unit cell, with folding sides and neighbours;  dK: by how much a pressed frustum is stiffer against movement and tilt.
Rotations of a root are small. The board holds no frustum down.

Where tips are not bonded, the tip slides on the board by s, the frustum with it: E(v - s). What the board bears is Coulomb's bound
|Q| <= mu p of Q = -dE/ds, so s returns radially to it (s is the history). E is quadratic in s, so the return is one division.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import PchipInterpolator

from softtact.contact.pair_state import Totals
from softtact.models.solid.items import Item

if TYPE_CHECKING:
    from softtact.models.foundation.frustum_spring import FrustumLaw

_LIFTED = 1e-4  # of the first slope: what a lifted frustum still pulls, so that nothing is loose


@dataclass(frozen=True)
class FrustaResponse:
    """k frusta at given places of all nodes."""

    displacement: np.ndarray
    """(k, 3 n) in mm of the nodes above them."""
    compression: np.ndarray
    """(k,) in mm, negative where lifted."""
    push: np.ndarray
    """(k,) in N, against compression alone."""
    slope: np.ndarray
    """(k,) in N/mm, of the same."""
    energy: np.ndarray
    """(k,) in mJ."""
    stiffening: tuple[np.ndarray, np.ndarray, np.ndarray]
    """dK (k, 2, 2) of movement and tilt, and its first and second derivative by the compression."""
    lateral: np.ndarray
    """(k, 2, 2): along x and y, movement (mm) without the tip's slip, and tilt of the root."""
    slip: np.ndarray
    """(k, 2) in mm, of the tips on the board."""
    trial: np.ndarray
    """(k, 2) in N: what the board would bear without further slip."""
    bound: np.ndarray
    """(k,) in N: what it can bear."""
    sliding: np.ndarray
    """(k,) whether the tip slides."""
    force: np.ndarray
    """(k, 3 n) in N on the nodes: derivative of the energy."""


class FrustumItem(Item):
    """Frusta under nodes alike (k, n). Its history are the tips' slips (k, 2) in mm.

    root (m, n): displacements of a root's nodes from those of the nodes above;  law: of one frustum
    bonded: whether tips are held on the board;  friction: Coulomb's coefficient of the others
    """

    def __init__(self, nodes: np.ndarray, root: np.ndarray, law: "FrustumLaw", *, bonded: bool = True, friction: float = 0.0):
        self.nodes, self.limit_mm, self.bonded = np.ascontiguousarray(nodes), law.limit_mm, bonded
        self.friction = 0.0 if bonded else friction
        self._at_rest: np.ndarray | None = None
        from_nodes = np.kron(root, np.eye(3))
        translation = np.tile(np.eye(3)[:, :2], (len(root), 1))
        self._rest = from_nodes.T @ law.rest @ from_nodes
        self._rest = 0.5 * (self._rest + self._rest.T)
        self._rest_slip = from_nodes.T @ (law.rest @ translation)
        self._slip_stiffness = float(translation[:, 0] @ law.rest @ translation[:, 0])
        self._descent = law.descent @ from_nodes
        self._lateral = (law.lateral @ from_nodes).reshape(2, 2, -1)
        self._force = PchipInterpolator(law.compression_mm, law.force_n)
        self._slope, self._energy = self._force.derivative(), self._force.antiderivative()
        self._first, self._last = float(self._slope(0.0)), float(self._slope(law.limit_mm))
        stiffness = PchipInterpolator(law.lateral_at_mm, (law.stiffness - law.stiffness[0])[:, [0, 1, 1, 2]].reshape(-1, 2, 2))
        self._stiffness = stiffness, stiffness.derivative(), stiffness.derivative(2)
        self._stiffest_mm = float(law.lateral_at_mm[-1])

    def supported_nodes(self) -> np.ndarray:
        return np.unique(self.nodes)

    def first(self, at_rest: np.ndarray) -> np.ndarray:
        self._at_rest = at_rest
        return np.zeros((len(self.nodes), 2))

    def begin_step(self, history: np.ndarray, response: FrustaResponse, x: np.ndarray, at_rest: np.ndarray) -> np.ndarray:
        return response.slip

    def compressions(self, displacement: np.ndarray) -> np.ndarray:
        """Compressions (k,) in mm under displacements (nodes of the body, 3) in mm; negative where a frustum is lifted."""
        return -(displacement[self.nodes].reshape(len(self.nodes), -1) @ self._descent)

    def evaluate(
        self, history: np.ndarray, x: np.ndarray, before: FrustaResponse | None = None, *, nearby: bool = False
    ) -> FrustaResponse:
        """The response at x; `before` and `nearby` change nothing."""
        moved = x - self._at_rest
        u, compression = moved[self.nodes].reshape(len(self.nodes), -1), self.compressions(moved)
        push, slope, energy = self._compressed(compression)
        stiffening = self._stiffening(compression)
        more, growth, _ = stiffening
        lateral = np.einsum("idn,kn->kid", self._lateral, u)
        lateral[..., 0] -= history
        trial, slip, bound = np.zeros_like(history), history, np.full(len(u), np.inf)
        if not self.bonded:
            trial = u @ self._rest_slip - self._slip_stiffness * history + np.einsum("kd,kid->ki", more[:, 0], lateral)
            bound = self.friction * np.where(compression > 0, push, 0.0)
            excess, direction = self._excess(trial, bound)
            step = (excess / (self._slip_stiffness + more[:, 0, 0]))[:, None] * direction
            slip, lateral = history + step, lateral - step[..., None] * [1.0, 0.0]
        resisted = np.einsum("kde,kie->kid", more, lateral)
        stiffer = 0.5 * np.einsum("kid,kde,kie->k", lateral, growth, lateral)
        force = u @ self._rest - slip @ self._rest_slip.T + np.einsum("idn,kid->kn", self._lateral, resisted)
        force -= (push + stiffer)[:, None] * self._descent
        energy = energy + 0.5 * np.einsum("kn,kn->k", u, u @ self._rest) - np.einsum("ki,ki->k", u @ self._rest_slip, slip)
        energy += 0.5 * (self._slip_stiffness * (slip**2).sum(axis=1) + (lateral * resisted).sum(axis=(1, 2)))
        sliding = np.linalg.norm(trial, axis=1) > bound
        return FrustaResponse(u, compression, push, slope, energy, stiffening, lateral, slip, trial, bound, sliding, force)

    def _compressed(self, compression):
        """Force (N), slope (N/mm) and energy (mJ) of the unit cell's law at compressions (k,)."""
        inside = np.clip(compression, 0.0, self.limit_mm)
        beyond, lifted = np.maximum(compression - self.limit_mm, 0.0), np.minimum(compression, 0.0)
        pull = _LIFTED * self._first
        force = self._force(inside) + self._last * beyond + pull * lifted
        slope = np.where(compression < 0, pull, np.where(beyond > 0, self._last, self._slope(inside)))
        energy = self._energy(inside) + beyond * (self._force(self.limit_mm) + 0.5 * self._last * beyond) + 0.5 * pull * lifted**2
        return force, slope, energy

    def _stiffening(self, compression):
        place = np.clip(compression, 0.0, self._stiffest_mm)
        varies = ((compression > 0) & (compression < self._stiffest_mm))[:, None, None]
        value, first, second = (curve(place) for curve in self._stiffness)
        return value, np.where(varies, first, 0.0), np.where(varies, second, 0.0)

    @staticmethod
    def _excess(trial, bound):
        """By how much (k,) in N a trial force (k, 2) exceeds its bound (k,), and its direction (k, 2)."""
        size = np.linalg.norm(trial, axis=1)
        return np.maximum(size - bound, 0.0), trial / np.maximum(size, 1e-300)[:, None]

    def totals(self, history: np.ndarray, response: FrustaResponse) -> Totals:
        return Totals(strain_energy=float(response.energy.sum()), size=float(np.abs(response.push).sum()))

    def add_forces(self, history: np.ndarray, response: FrustaResponse, force: np.ndarray) -> None:
        np.add.at(force, self.nodes, response.force.reshape(*self.nodes.shape, 3))

    def tangents(
        self, history: np.ndarray, response: FrustaResponse, x: np.ndarray, *, turning: bool = True
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        more, growth, curvature = response.stiffening
        b, lateral = self._descent, response.lateral
        slope = response.slope + 0.5 * np.einsum("kid,kde,kie->k", lateral, curvature, lateral)
        matrix = self._rest + slope[:, None, None] * np.outer(b, b)
        matrix += np.einsum("idn,kde,iem->knm", self._lateral, more, self._lateral, optimize=True)
        grown = np.einsum("idn,kde,kie->kn", self._lateral, growth, lateral, optimize=True)
        matrix -= grown[:, :, None] * b + b[:, None] * grown[:, None]
        if (slides := response.sliding).any():
            pulled, direction, stiffness = self._sliding(response)
            share = response.bound[slides] / np.linalg.norm(response.trial[slides], axis=1)
            along = direction[:, :, None] * direction[:, None]
            freed = along + (1 - share)[:, None, None] * (np.eye(2) - along)
            matrix[slides] -= np.einsum("kni,kij,kmj->knm", pulled, freed / stiffness[:, None, None], pulled, optimize=True)
        return [(self.nodes, matrix)]

    def _sliding(self, response):
        """Of sliding frusta (s,): derivative (s, 3 n, 2) of what the board bears, its direction (s, 2), stiffness (s,) to slip.

        All at the slip that was found: there the board bears the bound along this direction, which defines the slip implicitly.
        """
        here = response.sliding
        more, growth, _ = (values[here] for values in response.stiffening)
        pulled = self._rest_slip + np.einsum("idn,kd->kni", self._lateral, more[:, 0])
        pulled -= self._descent[:, None] * np.einsum("kd,kid->ki", growth[:, 0], response.lateral[here])[:, None]
        stiffness = self._slip_stiffness + more[:, 0, 0]
        return pulled, self._excess(response.trial, response.bound)[1][here], stiffness

    def slides(self, history: np.ndarray, response: FrustaResponse) -> bool:
        return bool(self.friction) and bool(response.sliding.any())

    def add_coupling(self, history: np.ndarray, response: FrustaResponse, change: np.ndarray, force: np.ndarray) -> None:
        """What the bound changes, as the compression does, of the slip of sliding tips."""
        if not self.slides(history, response):
            return
        here = response.sliding
        pulled, direction, stiffness = self._sliding(response)
        borne = self.friction * response.slope[here] * (response.compression[here] > 0) * self.compressions(change)[here]
        add = np.einsum("kni,ki->kn", pulled, direction) * (borne / stiffness)[:, None]
        np.add.at(force, self.nodes[here], add.reshape(-1, self.nodes.shape[1], 3))

    def dissipated_mj(self, history: np.ndarray, response: FrustaResponse) -> float:
        if not self.friction:
            return 0.0
        slipped = np.linalg.norm(response.slip - history, axis=1)
        return float((np.where(response.sliding, response.bound, 0.0) * slipped).sum())
