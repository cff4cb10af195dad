"""What finite displacement adds to the foundation model's linear slab, brought up to date from step to step (`FiniteDisplacement`).

Rocking: where the sheet moves sideways, a frustum that is hardly pressed leans on the rim of its tip and lifts the sheet
(`FrustumLaw.rise`).

Pressed frusta (`FrustumLaw.stiffening`): against a root's movement u and tilt t they are the stiffer the more they are compressed,
    K(c) = K(0) + dK(c):    force and moment -dK (u, t), and 1/2 (u, t) dK'(c) (u, t) more force against compression.
Pressure: the slab's second variation under the pressure p between object and board is, for rubber of constant volume,
1/2 p du_i/dx_j du_j/dx_i. A uniform pressure leaves its boundary terms only, and of these the free object's top has none. At
the board's side they are forces p t and moments p u on roots that tilt and move: pressure pushes what slopes sideways.
Slopes: membrane forces, N the integrals over the height of s_xx, s_yy and s_xy, pull or push where the slab slopes: loads
r = -div(N grad w) on the frusta (initial stress; von Karman's plate). They press the deepest parts deeper and lift the slab beside.
Edges: the top moves sideways, and the object's edges meet other points of it (`soft_edges`). What moves sideways under a slope
meets another height.

Left out: what the slab's strain adds at second order, that pieces of it turn otherwise than its mean slope, pressures that
differ over the height, friction. Their effects:
docs/notebook/2026-11-23-foundation-model.md.
"""

from dataclasses import astuple, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from softtact.contact.object_points import ObjectPoints
from softtact.models.foundation.compliance import FoundationCompliance
from softtact.models.foundation.dof_maps import Places, Sideways

if TYPE_CHECKING:
    from softtact.models.foundation.solve import FoundationSettings

_STEP = 0.01         # of a force, for a difference quotient
_SLOWLY = 5.0        # times as exact must what is followed by half only have settled


@dataclass(frozen=True)
class Effects:
    """loads (b,): N upwards on the frusta;  lateral (4, b): forces (N) and moments (N mm) on roots along x, then along y

    moved (2, c): movement of the points sideways in mm;  rise (b,): of roots on rocking frusta in mm
    """

    loads: np.ndarray
    lateral: np.ndarray
    moved: np.ndarray
    rise: np.ndarray

    def towards(self, other: "Effects", share: float, *, loads: np.ndarray | float, rise: float) -> "Effects":
        """These moved towards others by a share of the difference, and by other shares for their loads and rise."""
        shares = (loads, share, 1.0, rise)
        return Effects(*(a + part * (b - a) for a, b, part in zip(astuple(self), astuple(other), shares, strict=True)))

    def continued(self, before: "Effects", share: float) -> "Effects":
        """These continued by a share of how they differ from those before."""
        loads, lateral, moved, rise = (b + share * (b - a) for a, b in zip(astuple(before), astuple(self), strict=True))
        return Effects(loads, lateral, moved, np.maximum(rise, 0.0))


class FiniteDisplacement:
    """The effects of one press, of loads (n + b,) on its nodes and frusta."""

    def __init__(self, compliance: FoundationCompliance, points: ObjectPoints, places: Places,
                 settings: "FoundationSettings") -> None:
        """settings: `FoundationSettings`, of which `follow` and `rocking` count"""
        self.law, self.settings, self.lattice = compliance.law, settings, compliance.counts[::-1]
        self.frusta, self.points = len(places.frusta), points
        if settings.follow or settings.rocking:
            self.lateral = places.lateral()
        if settings.follow:
            self.lateral_self, self.membrane = places.lateral_self(), places.membrane()
            self.sideways, self._own = Sideways(compliance, points, places), self._own_compliance()

    def none(self) -> Effects:
        """Those of the unloaded sensor."""
        b = self.frusta
        return Effects(np.zeros(b), np.zeros((4, b)), np.zeros((2, self.points.count)), np.zeros(b))

    def down(self, effects: Effects) -> np.ndarray:
        """How far nodes and frusta (n + b,) come down under lateral loads of the frusta, in mm."""
        if not self.settings.follow:
            return np.zeros(self.points.count + self.frusta, dtype=np.float32)
        return effects.lateral.ravel().astype(np.float32) @ self.lateral

    def renewed(self, effects: Effects, load: np.ndarray, down: np.ndarray, q: np.ndarray, *,
                share: float) -> tuple[Effects, float]:
        """The effects under a load, frusta down by `down` (b,) under their law's forces q (b,), or a share of the change to them.

        The rise goes half of the way, for all of it would swing: a force ends what lifts it. Returns the effects, and what was
        missing, as the largest change of a frustum's force in N.
        """
        found, missing, load = effects, 0.0, load.astype(np.float32)
        roots: Any = self._roots(effects, load) if self.settings.follow or self.settings.rocking else None
        if self.settings.follow:
            found = self._found(effects, load, down.reshape(self.lattice), q, roots)
            missing = max(np.abs(found.loads - effects.loads).max(), np.abs(found.lateral - effects.lateral).max())
        if self.settings.rocking:
            rise = self.law.rise(np.hypot(*roots[:, :, 0].T), q)
            found = Effects(found.loads, found.lateral, found.moved, rise)
            missing = max(missing, _SLOWLY * (np.abs(rise - effects.rise) / self.law.slope(q)).max())
        return effects.towards(found, share, loads=share * self._pace(q, roots), rise=0.5), float(missing)

    def _pace(self, q, roots):
        """Share (b,) of their change that loads take at once: the more force a frustum has taken, the less is left to its law,
        and where the law turns steep the whole change would swing.
        """
        if not self.settings.follow:
            return 1.0
        step = np.maximum(_STEP * q, _STEP * self.law.force_n[1])
        slope = (self._stiffened(q + step, roots)[1] - self._stiffened(q, roots)[1]) / step
        return 1.0 / (1.0 + np.maximum(slope, 0.0))

    def _roots(self, effects, load):
        """Movement in mm and tilt of roots along x and along y (b, axis, movement or tilt)."""
        moved = self.lateral @ load
        if self.settings.follow:
            moved += self.lateral_self @ effects.lateral.ravel().astype(np.float32)
        return moved.astype(float).reshape(2, 2, -1).transpose(2, 0, 1)

    def _found(self, effects, load, down, q, roots):
        forces = (self.membrane @ load).reshape(3, *self.lattice)
        more, pushed = self._stiffened(q, roots)
        loads = membrane_loads(down, forces).ravel() + pushed
        pressed = more - q[:, None, None] * [[0.0, 1.0], [1.0, 0.0]]
        return Effects(loads, self._lateral(effects.lateral, pressed, roots), self.sideways(load), effects.rise)

    def _stiffened(self, q, roots):
        """Stiffness (b, 2, 2) of roots beyond the linear one, and how much more force than their law's (b,) frusta take in N."""
        more, growth = self.law.stiffening(q)
        return more, 0.5 * np.einsum("bai,bij,baj->b", roots, growth, roots)

    def _lateral(self, present, stiffness, roots):
        """Forces and moments (4, b) with which roots of a stiffness (b, 2, 2) beyond the linear one resist, implicit in each root's
        own answer: pressed frusta are stiffer than the slab about them.
        """
        present = present.reshape(2, 2, -1).transpose(2, 0, 1)
        free = roots - present @ self._own.T
        resisted = np.linalg.solve(np.eye(2) + stiffness @ self._own, stiffness @ free.transpose(0, 2, 1))
        return -resisted.transpose(2, 1, 0).reshape(4, -1)

    def _own_compliance(self):
        """What force and moment on the middle's frustum do to its movement and tilt along x (2, 2)."""
        middle = np.ravel_multi_index([count // 2 for count in self.lattice], self.lattice)
        both = middle + self.frusta * np.arange(2)
        return self.lateral_self[np.ix_(both, both)].astype(float)


def membrane_loads(down: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Loads on the frusta (ny, nx), upwards in N, of membrane forces (3, ny, nx) in N/mm in a slab that has come down by `down`
    (ny, nx) in mm: the gradient of 1/2 sum N_ab w_a w_b over the cells; beyond the lattice the slab is held.

    Slopes w_a are taken over two pitches: the slab, thicker than a pitch, turns as a whole only over such lengths.
    """
    x, y = _centred(down, 1), _centred(down, 0)
    return -_centred(forces[0] * x + forces[2] * y, 1) - _centred(forces[1] * y + forces[2] * x, 0)


def _centred(values, axis):
    """Half the difference of the neighbours along an axis, zero beyond the borders; minus its transpose."""
    padded = np.moveaxis(np.pad(values, [(1, 1) if k == axis else (0, 0) for k in range(2)]), axis, 0)
    return np.moveaxis(0.5 * (padded[2:] - padded[:-2]), 0, axis)
