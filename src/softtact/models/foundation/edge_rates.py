"""How points beside an object's edges give way as it moves: by differences, where all else of a gradient is differentiated.

What the object is over such a point depends on the facet that the point follows, on its slope, and on the share of the point's
surroundings that it covers (`contact.object_points`). None of them is a smooth function of the pose, and all follow an edge that
moves aside: with them held, a flat punch that slides would change nothing. Here the object is moved by a part of a grid step to
either side. With all other forces held, the point's force is its overlap over the compliance of its own place and of its contact,
    f = max(overlap, 0) / (own + contact compliance),
and the change of its gap that changes f as much about the present balance is its rate. Differences of the contact compliance alone
would have no limit where a point is about to leave the object; differences of f have.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from softtact.contact.height_field import HeightField
from softtact.contact.object_points import ObjectPoints
from softtact.contact.underside import Underside
from softtact.models.foundation.compliance import FoundationCompliance
from softtact.models.foundation.dof_maps import SoftEdges
from softtact.models.foundation.gradient import Balance, Unknowns

Velocities = Callable[[np.ndarray], np.ndarray]     # (k, n, 3) of an object's points (n, 3) by k numbers

_ASIDE = 0.25     # of a grid step: way of the fastest point to either side; two samples of a point's surroundings
_FREE = 1e6       # mm/N: contact compliance of a point beside the object


@dataclass(frozen=True)
class MovedPoints:
    """The points of an object that is moved to either side by one number of its pose."""

    step: float
    """By how much the number changes to either side."""
    sides: tuple[ObjectPoints, ObjectPoints]
    """The points with the smaller and with the larger number."""


def moved_points(compliance: FoundationCompliance, surface: HeightField, points: ObjectPoints, reach_mm: float,
                 velocities: Velocities, numbers: Sequence[int]) -> dict[int, MovedPoints]:
    """`MovedPoints` by some of the k numbers of an object's pose; empty where no point is beside an edge.

    surface: its underside, of which `points` are those lower than reach_mm above its lowest point
    """
    if not len(points.edge):
        return {}
    speeds = np.linalg.norm(velocities(_around(compliance.grid, points)), axis=-1).max(axis=1)
    steps = _ASIDE * compliance.grid.step.min() / speeds

    def side(number, way):
        moved = surface.carried(lambda corners: way * velocities(corners)[number])
        return Underside(moved, compliance.grid).points(reach_mm)

    return {number: MovedPoints(steps[number], (side(number, -steps[number]), side(number, steps[number]))) for number in numbers}


def _around(grid, points):
    """Corners (4, 3) in mm of a rectangle around points, a grid step wider: the fastest places of a rigid motion."""
    at = grid.points[points.nodes]
    low, high = at.min(axis=0) - grid.step, at.max(axis=0) + grid.step
    return np.array([[x, y, points.gap.min()] for x in (low[0], high[0]) for y in (low[1], high[1])])


class EdgeRates:
    """Gap rates of the points beside edges in a settled load step.

    lowest_mm: the least gap of the press' points at depth 0
    """

    def __init__(self, balance: Balance, at: Unknowns, lowest_mm: float) -> None:
        contact = balance.contact
        self._points, self._soft = contact.points, SoftEdges(balance.places.compliance)
        self._depth, self._moved = float(at.depth) - lowest_mm, balance.moved(at)
        self._own = self._soft.of_nodes(self._points)[0]
        self._now = self._own + balance.on_points(contact.contact_compliance)[self._points.edge]
        self._force = balance.on_points(at.force)[self._points.edge]

    def replaced(self, gap_rates: np.ndarray, moved: Mapping[int, MovedPoints]) -> np.ndarray:
        """Gap rates (k, n) of all points, with those of points beside edges that carry a force, by the numbers in `moved`."""
        rates, loaded = gap_rates.copy(), self._force > 0
        for number, points in moved.items():
            lower, upper = (self._forces(side) for side in points.sides)
            rates[number, self._points.edge[loaded]] = (self._now * (lower - upper) / (2 * points.step))[loaded]
        return rates

    def _forces(self, side):
        """Forces (e,) in N of the points beside edges under an object moved aside."""
        side, edge = side.as_deep(self._depth), self._points.edge
        place = np.minimum(np.searchsorted(side.nodes, self._points.nodes), side.count - 1)
        there = (side.nodes[place] == self._points.nodes)[edge]
        sideways = np.zeros((2, side.count))
        sideways[:, place[edge[there]]] = self._moved[:, edge[there]]
        compliance = np.minimum(self._soft(side, sideways, self._depth), _FREE)[place[edge]]
        overlap = self._now * self._force - (side.gap[place[edge]] - self._points.gap[edge])
        return np.where(there, np.maximum(overlap, 0.0) / (self._own + compliance), 0.0)
