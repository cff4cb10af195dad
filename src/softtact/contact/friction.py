"""Coulomb friction of rubber points on a rigid body, regularised so that a press with friction still minimises a potential.

Per area, with the slip vector s (mm, tangential), the coefficient mu and the pressure p (MPa):
    energy    mu p phi(|s|),   phi = s^2/e - s^3/(3 e^2) up to the slip tolerance e, then s - e/3
    traction  mu p phi'(|s|) s/|s|, opposite to the slip: it grows to mu p at |s| = e and then stays constant
    stiffness mu p [phi'/|s| (1 - dd) + phi'' dd] with d = s/|s|, never negative, as phi is convex
phi' is that of Li et al., Incremental Potential Contact, ACM Trans. Graph. 39 (2020), sec. 5. As there, p is kept while the
potential is minimised (a variable p would make the tangent unsymmetric) and updated afterwards, until both converge.

The slip is measured from an anchor on the rigid body. The anchor is fixed while the point sticks, and follows a sliding point at
the distance e. So the elastic slip is at most e and does not accumulate from load step to load step.
"""

from dataclasses import dataclass, replace
from types import EllipsisType

import numpy as np

# Points slide by 10 to 100 micrometres in a press. Half a micrometre is well below, and the stick stiffness at 0.3 MPa and
# mu = 0.3 (2 mu p / e = 360 N/mm3) is lower than the contacts' penalties, so the tangent stays well conditioned.
SLIP_TOLERANCE_MM = 5e-4


@dataclass(frozen=True)
class Coulomb:
    """Coefficient of friction, and the slip in mm at which the traction reaches its limit."""

    coefficient: float
    slip_tolerance_mm: float = SLIP_TOLERANCE_MM

    def energy(self, slip: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """mJ/mm2 (p,) for slips (p, d) in mm at pressures (p,) in MPa."""
        e, length = self.slip_tolerance_mm, np.linalg.norm(slip, axis=-1)
        inside = np.minimum(length, e)
        return self.coefficient * pressure * (inside**2 / e - inside**3 / (3 * e**2) + (length - inside))

    def traction(self, slip: np.ndarray, pressure: np.ndarray) -> np.ndarray:
        """Slope of the energy by the slip (p, d) in MPa: at most the coefficient times the pressure."""
        return (self.coefficient * pressure * self._secant(slip))[..., None] * slip

    def stiffness(self, slip: np.ndarray, pressure: np.ndarray, plane: np.ndarray, share: np.ndarray) -> np.ndarray:
        """Slope of the traction (p, d, d) in N/mm3, if `share` (p, d) is the traction's part of its limit (see `FrictionResponse`).

        plane (d, d) or (p, d, d) projects on the tangential directions.
        """
        turned = self._growth(slip)[..., None, None] * share[..., :, None] * _direction(slip)[..., None, :]
        slope = self._secant(slip)[..., None, None] * (plane - 0.5 * (turned + np.swapaxes(turned, -1, -2)))
        return (self.coefficient * pressure)[..., None, None] * slope

    def share(self, slip: np.ndarray) -> np.ndarray:
        """The traction's part of its limit (p, d): phi'(|s|) s/|s|."""
        return self._secant(slip)[..., None] * slip

    def next_share(self, slip: np.ndarray, share: np.ndarray, before: np.ndarray) -> np.ndarray:
        """`share` extrapolated over one Newton step from `before` to `slip` (p, d), cut to the friction limit."""
        along = self._growth(before) * (_direction(before) * (slip - before)).sum(axis=-1)
        ahead = self._secant(before)[..., None] * (slip - along[..., None] * share)
        return ahead / np.maximum(1.0, np.linalg.norm(ahead, axis=-1, keepdims=True))

    def _secant(self, slip):
        """phi'(|s|) / |s|."""
        e, length = self.slip_tolerance_mm, np.linalg.norm(slip, axis=-1)
        return np.where(length < e, 2 / e - length / e**2, 1 / np.maximum(length, e))

    def _growth(self, slip):
        """Slope of |s| / phi'(|s|) by |s|."""
        ratio = np.minimum(np.linalg.norm(slip, axis=-1) / self.slip_tolerance_mm, 1.0)
        return 1 / (2 - ratio) ** 2


def _direction(slip):
    return slip / np.maximum(np.linalg.norm(slip, axis=-1, keepdims=True), 1e-300)


@dataclass(frozen=True)
class FrictionState:
    """Friction variables of points (p,) on a rigid body, constant during one step.

    anchor, start (p, d) in mm, in the rigid body's frame: the origin of the slip, and the position at the step's start;
    start_gap (p,) in mm: gap at the step's start; pressure (p,) in MPa, which limits the friction; touching (p,): whether the
    anchor is set; slid (p,) in mm: length of the sliding path since the point came into contact.
    """

    law: Coulomb
    anchor: np.ndarray
    start: np.ndarray
    start_gap: np.ndarray
    pressure: np.ndarray
    touching: np.ndarray
    slid: np.ndarray

    @classmethod
    def first(cls, law: Coulomb, position: np.ndarray, gap: np.ndarray) -> "FrictionState":
        """The friction state of a body at rest: no point touches, and no anchor is set."""
        none = np.zeros(gap.shape)
        return cls(law, position, position, gap, none, np.zeros(gap.shape, dtype=bool), none)

    def friction_response(self, position: np.ndarray, normal: np.ndarray | None = None) -> "FrictionResponse":
        """Friction at positions (p, d) on a rigid body with normals (p, d); None: all d directions are tangential."""
        way = position - self.anchor
        slip = way if normal is None else way - (way * normal).sum(axis=-1, keepdims=True) * normal
        return FrictionResponse(self, position, slip, normal)

    def at(self, points: np.ndarray) -> "FrictionState":
        """The friction state of some of the points, or of the points of some bodies."""
        parts = {name: getattr(self, name)[points] for name in ("anchor", "start", "start_gap", "pressure", "touching", "slid")}
        return replace(self, **parts)

    def halfway(self, other: "FrictionState") -> "FrictionState":
        """`other` with the pressures halfway between both."""
        return replace(other, pressure=0.5 * (self.pressure + other.pressure))


@dataclass(frozen=True)
class FrictionResponse:
    """Friction at one displacement: its friction state, positions and tangential slips from the anchors (p, d) in mm.

    normal (p, d): see `FrictionState.friction_response`
    share (p, d): the linearised ratio of the traction to its limit, see `after`; None: the ratio at this slip.
    """

    friction_state: FrictionState
    position: np.ndarray
    slip: np.ndarray
    normal: np.ndarray | None = None
    share: np.ndarray | None = None

    @property
    def energy(self) -> np.ndarray:
        """mJ/mm2 (p,)."""
        return self.friction_state.law.energy(self.slip, self.friction_state.pressure)

    @property
    def traction(self) -> np.ndarray:
        """MPa (p, d), opposite to the slip."""
        return self.friction_state.law.traction(self.slip, self.friction_state.pressure)

    def stiffness(self, points: np.ndarray | slice | EllipsisType = ...) -> np.ndarray:
        """N/mm3 (p, d, d) of all points or of some."""
        plane = np.eye(self.slip.shape[-1])
        if self.normal is not None:
            plane = plane - (self.normal[..., :, None] * self.normal[..., None, :])[points]
        return self.friction_state.law.stiffness(self.slip[points], self.friction_state.pressure[points], plane,
                                                 self._share(points))

    def _share(self, points=...):
        return self.friction_state.law.share(self.slip[points]) if self.share is None else self.share[points]

    def after(self, before: "FrictionResponse | None") -> "FrictionResponse":
        """The response for the next tangent, if the last tangent was taken at `before`.

        A sliding point has no stiffness along its path, so full Newton steps oscillate across the slip tolerance. A primal-dual
        method, with the share as a separate linearised unknown, avoids this (Chan, Golub and Mulet, SIAM J. Sci.
        Comput. 20 (1999) 1964): it needs a third to a half of the iterations. At equilibrium the tangent is the same.
        """
        if before is None or before.friction_state is not self.friction_state:
            return self
        return replace(self, share=self.friction_state.law.next_share(self.slip, before._share(), before.slip))

    @property
    def slid(self) -> np.ndarray:
        """Length (p,) in mm of the sliding path since the points came into contact."""
        length = np.linalg.norm(self.slip, axis=-1)
        return self.friction_state.slid + np.maximum(length - self.friction_state.law.slip_tolerance_mm, 0.0)

    def next_step(self, gap: np.ndarray) -> FrictionState:
        """The friction state of a step that starts here, with gaps (p,): anchors follow points that slid beyond the tolerance."""
        friction_state, length = self.friction_state, np.linalg.norm(self.slip, axis=-1, keepdims=True)
        kept = self.slip * np.minimum(1.0, friction_state.law.slip_tolerance_mm / np.maximum(length, 1e-300))
        touching = friction_state.pressure > 0
        anchor = np.where(touching[..., None], self.position - kept, self.position)
        return replace(friction_state, anchor=anchor, start=self.position, start_gap=gap, touching=touching,
                       slid=np.where(touching, self.slid, 0.0))

    def next_pass(self, gap: np.ndarray, pressure: np.ndarray) -> FrictionState:
        """The same step's friction state with updated pressures; the anchor of a new contact is where its path met the rigid
        body.
        """
        friction_state, new = self.friction_state, ~self.friction_state.touching & (pressure > 0)
        approach = np.where(new, np.maximum(friction_state.start_gap - gap, 1e-300), 1.0)
        share = np.clip(np.where(new, friction_state.start_gap, 0.0) / approach, 0.0, 1.0)[..., None]
        anchor = np.where(new[..., None], friction_state.start + share * (self.position - friction_state.start),
                          friction_state.anchor)
        return replace(friction_state, anchor=anchor, pressure=pressure, touching=friction_state.touching | new)


def coulomb(coefficient: float) -> Coulomb | None:
    """The law with a coefficient; None for a coefficient of 0: no friction."""
    return Coulomb(coefficient) if coefficient > 0 else None
