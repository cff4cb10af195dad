"""Derivatives of a settled elastic press: implicit differentiation of the contact on the points under pressure.

On these points  A f - depth = -gap0,  sum f = F.  With the set of points held, this is linear, so the rates of forces and depth by
a number on which gaps, total force or compliance depend solve the same equations:
    A f' - depth' = -gap0' - A' f,    sum f' = F'
All load steps and numbers are columns of one problem, solved as the press itself by conjugate gradients in single precision with
the residual in double (`contact.unilateral`). Displacements depend on F / E, with Young's modulus E: d/dE = -(F / E) d/dF.
"""

from dataclasses import dataclass

import numpy as np

from softtact.contact.object_points import ObjectPoints
from softtact.contact.unilateral import ContactSettings, DenseCompliance, projected_conjugate_gradients
from softtact.errors import ConvergenceError
from softtact.models.elastic.compliance import Compliance, LayerPress

_RELATIVE, _REFINEMENTS = 1e-9, 30     # residual over the largest term of the equations; solutions in single precision at most
_INNER = ContactSettings(inner_tolerance=1e-4, inner_iterations=100)


@dataclass(frozen=True)
class LayerPressRates:
    """Rates of a `LayerPress` by k numbers, per their units."""

    force: np.ndarray
    """(k, c, l) in N: of the forces at the points; 0 at points without pressure."""
    depth: np.ndarray
    """(k, l) in mm."""
    fields: np.ndarray
    """(k, l, 2 ny - 1, 2 nx - 1) in mm: of the deformation at the surface's nodes."""
    thinning: np.ndarray
    """(k, l, 2 ny - 1, 2 nx - 1) in mm: of the decrease in thickness there."""
    margin: np.ndarray
    """(k, l): the least change of a number, alone and to either side, at which a point gains or loses contact."""


class PressedLayer:
    """A settled `LayerPress` on `ObjectPoints` of a compliance, to differentiate."""

    def __init__(self, compliance: Compliance, points: ObjectPoints, press: LayerPress) -> None:
        self._compliance, self._points, self._press = compliance, points, press
        self._among = DenseCompliance(compliance.among(points))
        self._stencil = compliance.stencil.on(compliance.grid, points.nodes)
        self._active = press.contact.force > 0

    def by_gaps(self, gap_rates: np.ndarray) -> LayerPressRates:
        """By k numbers on which the gaps depend with rates (k, c) in mm."""
        offset = np.repeat(gap_rates[:, :, None], self._active.shape[1], axis=2)
        return self._rates(offset, np.zeros((len(offset), self._active.shape[1])))

    def by_force(self) -> LayerPressRates:
        """By the force on the layer, in N."""
        return self._rates(np.zeros((1, *self._active.shape)), np.ones((1, self._active.shape[1])))

    def by_young(self, young_mpa: float, by_force: LayerPressRates) -> LayerPressRates:
        """By Young's modulus in MPa, from the rates by force."""
        factor = -self._press.contact.force.sum(axis=0) / young_mpa
        force = self._press.contact.force / young_mpa + factor * by_force.force
        fields, thinning = (factor[:, None, None] * rates for rates in (by_force.fields, by_force.thinning))
        margin = self._margin(force, factor * self._opening(by_force))
        return LayerPressRates(force, factor * by_force.depth, fields, thinning, margin)

    def by_compliance(self, lower: Compliance, upper: Compliance, apart: float) -> LayerPressRates:
        """By a number between whose values, `apart` from each other, the compliance changes from `lower` to `upper`."""
        force = self._press.contact.force

        def difference(of):
            return (of(upper) - of(lower)) / apart

        offset = difference(lambda one: one.among(self._points).astype(float) @ force)
        found = self._rates(offset[None], np.zeros((1, force.shape[1])))
        sunk = [getattr(one, name)(self._points, force) for name in ("fields", "lower_fields") for one in (lower, upper)]
        fields = (sunk[1] - sunk[0]) / apart
        thinning = fields if sunk[2] is None else fields - (sunk[3] - sunk[2]) / apart
        return LayerPressRates(found.force, found.depth, found.fields + fields, found.thinning + thinning, found.margin)

    def _rates(self, offset, total):
        """Rates where the points' heights over the object change by offset (k, c, l) with forces held, and the load by (k, l)."""
        k, c, l = offset.shape
        force, depth = self._solve(offset.transpose(1, 0, 2).reshape(c, k * l), total.reshape(-1))
        columns = self._compliance.fields(self._points, force)
        lower = self._compliance.lower_fields(self._points, force)
        thinning = columns if lower is None else columns - lower
        by_number, depth = force.reshape(c, k, l).transpose(1, 0, 2), depth.reshape(k, l)
        opening = (self._among.double(force).reshape(c, k, l).transpose(1, 0, 2) + offset) - depth[:, None]
        shape = (k, l, *columns.shape[1:])
        return LayerPressRates(by_number, depth, columns.reshape(shape), thinning.reshape(shape), self._margin(by_number, opening))

    def _opening(self, rates):
        return np.stack([self._among.double(one) for one in rates.force]) - rates.depth[:, None]

    def _margin(self, force_rates, gap_rates):
        """(k, l): distance of the nearest point from another state, in its rate."""
        contact = self._press.contact
        distance = np.where(self._active, contact.force, np.maximum(contact.gap, 0.0))
        rate = np.abs(np.where(self._active, force_rates, gap_rates))
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(rate > 0, distance / rate, np.inf).min(axis=1)

    def _solve(self, offset, total):
        """Forces (c, m) and depths (m,) for offsets (c, m) and loads (m,), with a column for each number and load step."""
        active = np.tile(self._active, len(total) // self._active.shape[1])
        mask = active.astype(np.float32)
        count = active.sum(axis=0)
        force = np.where(active, total / count, 0.0)     # what follows keeps the sum

        def apply(x):
            return self._among.single(x) * mask

        def precondition(x):
            return self._stencil(x * mask) * mask

        for _ in range(_REFINEMENTS):
            moved = self._among.double(force)
            open_by = moved + offset
            depth = np.where(active, open_by, 0.0).sum(axis=0) / count
            missing = np.where(active, depth - open_by, 0.0)
            largest = np.abs(missing).max(axis=0)
            if (largest <= _RELATIVE * (np.abs(moved).max(axis=0) + np.abs(np.where(active, offset, 0.0)).max(axis=0))).all():
                return force, depth
            scale = np.maximum(largest, np.finfo(float).tiny)      # conjugate gradients of tiny numbers would end too early
            step = projected_conjugate_gradients(apply, precondition, mask, missing / scale, np.zeros(len(total)), _INNER)
            force += scale * np.where(active, step - step.sum(axis=0) / count, 0.0)     # less what single precision adds
        raise ConvergenceError(f"The gradient of an elastic press did not settle in {_REFINEMENTS} solutions; press with other "
                               "forces.")
