"""How soft a contact is at nodes beside an edge of the object, so that an edge counts where it is and not at the next node.

A node that is held makes the contact wider by one step, one that is free does not. In between, with its force a share r of what
would hold it, the contact's energy lies between by that share, which is that of an edge r steps beyond the node before. So a
spring of 1/r - 1 times the node's own compliance among the held ones stands for an edge there (a cut cell, in other methods).
On a rounded edge contact ends where the surface, falling away with the root of the distance, meets it: the height up to which it
counts as flat is a share of the depth. Two numbers are not derived: where a held middle of an element puts the edge, taken from
finer grids of the same model; and that share, chosen by the sixteen presses of
docs/notebook/2026-11-23-foundation-model.md.
"""

import numpy as np

from softtact.contact.object_points import ObjectPoints
from softtact.models.foundation.compliance import FoundationCompliance

_AROUND, _DEEP = 6, 6     # nodes along an edge, and held behind it, among which a node's own compliance is found
_ROUNDED = 0.12           # of the depth: height on a rounded edge up to which the object acts as if it had no rounding
_EVEN_MM = 1e-3           # that lies in a plane: heights over it are in single precision
_MIDDLE_BEYOND = 0.26     # of a step, that an edge must be beyond an element's middle to hold it: so found on finer grids


class SoftEdges:
    """How soft points on a `FoundationCompliance`'s grid are beside edges."""

    def __init__(self, compliance: FoundationCompliance) -> None:
        self._grid = compliance.grid
        self._by_axis = np.stack([own_compliance(compliance, axis) for axis in (0, 1)])
        self._last = None

    def __call__(self, points: ObjectPoints, moved: np.ndarray, depth: float) -> np.ndarray:
        """Softness (c,) in mm/N of `ObjectPoints` that have moved sideways by `moved` (2, c) in mm; infinite where not covered.

        depth: how far the object has come down since its first touch, in mm
        """
        contact_compliance = np.zeros(points.count)
        own, held_at = self._of_nodes(points)
        reaches = beyond(points.covered_at(moved, rounding_mm=_ROUNDED * depth + _EVEN_MM)[points.edge])
        with np.errstate(divide="ignore"):
            contact_compliance[points.edge] = own * np.maximum(held_at / reaches - 1, 0.0)
        return contact_compliance

    def _of_nodes(self, points):
        """Compliance (e,) of the nodes near edges among held ones, and how many steps (e,) behind them an edge holds them."""
        if self._last is None or self._last[0] is not points:
            middle = self._grid.from_middle(points.nodes[points.edge]) % 2
            outwards = points.outwards()
            own = (outwards * self._by_axis[[0, 1], middle]).sum(axis=1)
            self._last = points, own, 1 + _MIDDLE_BEYOND * (outwards * middle).sum(axis=1)
        return self._last[1:]


def beyond(covered: np.ndarray) -> np.ndarray:
    """How many steps, up to 2, a straight edge lies beyond the node before those of which it covers a share (c,) of the hat."""
    inner = np.sqrt(2 * np.minimum(covered, 0.5))
    return np.where(covered < 0.5, inner, 2 - np.sqrt(2 * np.clip(1 - covered, 0.0, 0.5)))


def own_compliance(compliance: FoundationCompliance, axis: int) -> np.ndarray:
    """Compliance (2,) in mm/N of a row of nodes across an axis (0: x), pushed alike beside rows that are held, in the sensor's
    middle: of rows of elements' corners, and of their middles.
    """
    grid = compliance.grid
    along, across = (min(_AROUND, (count - 3) // 2) for count in (grid.shape[axis], grid.shape[1 - axis]))
    found = []
    for offset in (0, 1):
        behind = np.arange(offset - min(_DEEP, across), offset + 1)
        beside = np.arange(-along, along + 1)
        steps = np.stack(np.meshgrid(behind, beside), axis=-1).reshape(-1, 2)
        i, j = steps.T if axis == 0 else steps.T[::-1]
        nodes = (j + grid.shape[0] // 2) * grid.shape[1] + i + grid.shape[1] // 2
        places = grid.quarter(nodes)
        matrix = compliance.surface.between(*places, *places).astype(float)
        row = steps[:, 0] == offset
        free = matrix[np.ix_(row, row)] - matrix[np.ix_(row, ~row)] @ np.linalg.solve(matrix[np.ix_(~row, ~row)],
                                                                                  matrix[np.ix_(~row, row)])
        found.append(free[along:along + 2].sum(axis=1).mean())
    return np.array(found)
