"""Derivatives of a settled elastic press: implicit differentiation of the contact on the points under pressure.

On these points  A f - depth = -gap0,  sum f = F.  With the set of points held, this is linear, so the rates of forces and depth by
a number on which gaps, total force or compliance depend solve the same equations:
    A f' - depth' = -gap0' - A' f,    sum f' = F'
A of each set of points is factored once (Cholesky, in double precision): of the few hundred points of a usual contact that takes a
millisecond. Displacements depend on F / E, with Young's modulus E: d/dE = -(F / E) d/dF.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
import scipy.linalg as sla

from softtact.contact.object_points import ObjectPoints
from softtact.contact.unilateral import ContactLoadSteps
from softtact.models.elastic.compliance import Compliance


@dataclass(frozen=True)
class LayerPressRates:
    """Rates of a press on a layer by k numbers, per their units."""

    force: np.ndarray
    """(k, c, l) in N: of the forces at the points; 0 at points without pressure."""
    depth: np.ndarray
    """(k, l) in mm."""
    load: np.ndarray
    """(k, c, l) in N: forces under which the layer deforms by the rate of its deformation; `force`, but by Young's modulus."""
    margin: np.ndarray
    """(k, l): the least change of a number, alone and to either side, at which a point gains or loses contact."""

    @classmethod
    def joined(cls, some: Sequence[Self], order: list[int]) -> Self:
        """Those by all numbers of some, in the order of their places there."""
        return cls(*(np.concatenate([getattr(rates, one.name) for rates in some])[order] for one in fields(cls)))


class PressedLayer:
    """The settled contact of `ObjectPoints` on a compliance through l load steps, to differentiate."""

    def __init__(self, compliance: Compliance, points: ObjectPoints, contact: ContactLoadSteps) -> None:
        self._points, self._contact, self._active = points, contact, contact.force > 0
        self._among = compliance.among(points).astype(float)
        sets, number = np.unique(self._active.T, axis=0, return_inverse=True)      # a flat face has one at all forces
        factors = [sla.cho_factor(self._among[np.ix_(active, active)].T, overwrite_a=True, check_finite=False)
                   for active in sets]      # transposed, a symmetric matrix is overwritten without a copy
        self._factors = [factors[one] for one in number]

    def by_gaps(self, gap_rates: np.ndarray) -> LayerPressRates:
        """By k numbers on which the gaps depend with rates (k, c) in mm."""
        return self._rates(np.repeat(gap_rates[:, :, None], self._active.shape[1], axis=2), 0.0)

    def by_force(self) -> LayerPressRates:
        """By the force on the layer, in N."""
        return self._rates(np.zeros((1, *self._active.shape)), 1.0)

    def by_young(self, young_mpa: float, by_force: LayerPressRates) -> LayerPressRates:
        """By Young's modulus in MPa, from the rates by force."""
        factor = -self._contact.force.sum(axis=0) / young_mpa
        force = self._contact.force / young_mpa + factor * by_force.force
        return LayerPressRates(force, factor * by_force.depth, factor * by_force.force,
                               self._margin(force, factor * self._opening(by_force.force, by_force.depth)))

    def by_compliance(self, lower: Compliance, upper: Compliance, apart: float) -> LayerPressRates:
        """By a number between whose values, `apart` from each other, the compliance changes from `lower` to `upper`.

        What the change deforms under the forces as they are is not in `load`.
        """
        sunk = [one.among(self._points).astype(float) @ self._contact.force for one in (lower, upper)]
        return self._rates((sunk[1] - sunk[0])[None] / apart, 0.0)

    def _rates(self, offset, total):
        """Rates where the points' heights over the object change by offset (k, c, l) with forces held, and the load by total."""
        force, depth = np.zeros_like(offset), np.empty((len(offset), offset.shape[2]))
        for step, (active, factor) in enumerate(zip(self._active.T, self._factors, strict=True)):
            right = np.vstack([np.ones(active.sum()), offset[:, active, step]]).T
            solved = sla.cho_solve(factor, right, check_finite=False).T
            per_depth, at_rest = solved[0], solved[1:]
            depth[:, step] = (total + at_rest.sum(axis=1)) / per_depth.sum()
            force[:, active, step] = depth[:, step, None] * per_depth - at_rest
        return LayerPressRates(force, depth, force, self._margin(force, self._opening(force, depth) + offset))

    def _opening(self, force, depth):
        """Rates (k, c, l) of the points' gaps by those of forces and depth."""
        return np.moveaxis(np.tensordot(self._among, force, (1, 1)), 1, 0) - depth[:, None]

    def _margin(self, force_rates, gap_rates):
        """(k, l): distance of the nearest point from another state, in its rate."""
        distance = np.where(self._active, self._contact.force, np.maximum(self._contact.gap, 0.0))
        rate = np.abs(np.where(self._active, force_rates, gap_rates))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(rate > 0, distance / rate, np.inf).min(axis=1)
