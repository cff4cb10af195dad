"""Maps between the nodes and frusta of a press of the foundation model and the compliance of a quarter.

`SoftEdges` computes the contact compliance of nodes beside an edge of the object, so that the contact ends at the edge and not at
the next node.

A node in contact widens the contact by one step. With a share r of its full contact force, the contact's energy is interpolated by
that share; this is the energy of an edge r steps beyond the previous node. So a spring of 1/r - 1 times the compliance of the node,
among nodes in contact, represents an edge there (compare cut cells in other methods).
On a rounded edge contact ends where the free surface, which falls with the square root of the distance, meets it: the height up to
which the edge counts as flat is a share of the depth. Two numbers are calibrated: the edge's position for a contact that ends at an
element's middle node, from finer grids of the same model; and that share, from the sixteen presses of
docs/notebook/2026-11-23-foundation-model.md.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp

from softtact.contact.object_points import ObjectPoints
from softtact.models.foundation.compliance import FoundationCompliance
from softtact.models.quarter_symmetry import ParityProduct, SignedPlaces

_AROUND, _DEEP = 6, 6     # nodes along an edge, and in contact behind it, for the computation of a node's compliance
_ROUNDED = 0.12           # of the depth: height on a rounded edge up to which the rounding is ignored
_EVEN_MM = 1e-3           # tolerance of heights in a plane, which are in single precision
_MIDDLE_BEYOND = 0.26     # of a step: distance of an edge beyond an element's middle node in full contact, from finer grids


class Places:
    """Numbers in the quarter and signs of a press' nodes and frusta, and the compliance matrices of a press."""

    def __init__(self, compliance: FoundationCompliance, points: ObjectPoints) -> None:
        self.compliance, grid = compliance, compliance.grid
        nodes, signs = grid.quarter(points.nodes)
        self.frusta, self.frustum_signs = lattice_places(compliance.counts)
        quarter = (len(grid.x) // 2 + 1) * (len(grid.y) // 2 + 1)
        self.columns = np.concatenate([nodes, quarter + self.frusta])
        self.signs = np.vstack([signs, self.frustum_signs])
        self._map_start = quarter + len(self.frusta) // 4
        self._loaded = SignedPlaces(self.columns, self.signs)
        x, y = self.frustum_signs.T
        self._roots = self._of_frusta(x, x, y, y)

    def _of_frusta(self, *factors):
        """Places of quantities of all frusta, one after the other, each with its factors (b,)."""
        kinds, quarter = len(factors), len(self.frusta) // 4
        return SignedPlaces(np.concatenate([kind * quarter + self.frusta for kind in range(kinds)]),
                                       np.tile(self.frustum_signs, (kinds, 1)), np.concatenate(factors))

    def surface(self) -> np.ndarray:
        """Compliance (n + b, n + b) of nodes and frusta."""
        return self.compliance.surface.between(self.columns, self.signs, self.columns, self.signs)

    def maps(self, load: np.ndarray, lateral: np.ndarray) -> np.ndarray:
        """Deformation maps (l, ny, nx) in mm, fixed sides included, under loads (n + b, l) and lateral loads of frusta (4 b, l)."""
        coarse = self.compliance.grid.every_second
        numbers, signs = coarse.quarter(np.arange(coarse.count))
        at = SignedPlaces(self._map_start + numbers, signs)
        by_frusta = lateral.T.astype(np.float32) @ ParityProduct(self.compliance.lateral, self._roots, at)
        down = ParityProduct(self.compliance.surface, at, self._loaded) @ load.astype(np.float32) + by_frusta.T
        return coarse.with_held_sides(down.T.reshape(-1, *coarse.shape).astype(float))

    def sideways(self, nodes: np.ndarray) -> ParityProduct:
        """Lateral displacements (2 k, n + b) in x and y of nodes (k,) of the grid of every second node."""
        numbers, signs = self.compliance.grid.every_second.quarter(nodes)
        quarter = self.compliance.sideways.blocks.shape[1] // 2
        rows = SignedPlaces(np.concatenate([numbers, quarter + numbers]), np.tile(signs, (2, 1)), signs.T.ravel())
        return ParityProduct(self.compliance.sideways, rows, self._loaded)

    def lateral(self) -> ParityProduct:
        """Displacement and tilt along x, then along y (4 b, n + b), of all frusta's roots."""
        return ParityProduct(self.compliance.lateral, self._roots, self._loaded)

    def lateral_self(self) -> ParityProduct:
        """`lateral` (4 b, 4 b) from unit forces and moments on the frusta along x, then along y."""
        return ParityProduct(self.compliance.lateral_self, self._roots, self._roots)

    def membrane(self) -> ParityProduct:
        """Membrane forces (3 b, n + b) of all cells."""
        even, both = np.ones(len(self.frusta)), self.frustum_signs.prod(axis=1)
        return ParityProduct(self.compliance.membrane, self._of_frusta(even, even, both), self._loaded)

def lattice_places(counts: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Numbers (b,) in the quarter, counted from the middle, and signs (b, 2) of all frusta, x fastest."""
    i, j = (grid.ravel() for grid in np.meshgrid(*(np.arange(count) for count in counts)))
    half = [count // 2 for count in counts]
    away = [np.where(k >= h, k - h, h - 1 - k) for k, h in zip((i, j), half, strict=True)]
    return away[1] * half[0] + away[0], np.column_stack([np.where(i < half[0], -1, 1), np.where(j < half[1], -1, 1)])


class Sideways:
    """Lateral displacements of the points in x and y, interpolated on the grid of every second node."""

    def __init__(self, compliance: FoundationCompliance, points: ObjectPoints, places: Places) -> None:
        grid, coarse = compliance.grid, compliance.grid.every_second
        j, i = np.divmod(points.nodes, grid.shape[1])
        at = (np.column_stack([i, j]) - grid.first_of_second) / 2       # in steps of the coarse grid
        low = np.floor(at).astype(int)
        share = at - low
        corner, weight = [], []
        for dx, dy in ((0, 0), (1, 0), (0, 1), (1, 1)):
            x, y = low[:, 0] + dx, low[:, 1] + dy
            inside = (x >= 0) & (x < coarse.shape[1]) & (y >= 0) & (y < coarse.shape[0])
            corner.append(np.where(inside, y * coarse.shape[1] + x, 0))
            product = np.where(dx, share[:, 0], 1 - share[:, 0]) * np.where(dy, share[:, 1], 1 - share[:, 1])
            weight.append(np.where(inside, product, 0.0))
        used, place = np.unique(np.stack(corner, axis=1), return_inverse=True)
        rows = np.repeat(np.arange(points.count), 4)
        self._between = sp.csr_matrix((np.stack(weight, axis=1).ravel(), (rows, place.ravel())), shape=(points.count, len(used)))
        self._nodes = places.sideways(used)

    def __call__(self, load: np.ndarray) -> np.ndarray:
        """Displacements (2, c) in mm under a load (n + b,); (2, c, l) under loads (n + b, l)."""
        return np.stack([self._between @ part for part in np.split(self._nodes @ load, 2)])


class SoftEdges:
    """Contact compliance beside edges of points on a `FoundationCompliance`'s grid."""

    def __init__(self, compliance: FoundationCompliance) -> None:
        self._grid = compliance.grid
        self._by_axis = np.stack([own_compliance(compliance, axis) for axis in (0, 1)])
        self._last: Any = None

    def __call__(self, points: ObjectPoints, moved: np.ndarray, depth: float) -> np.ndarray:
        """Contact compliance (c,) in mm/N of `ObjectPoints` with lateral displacements `moved` (2, c) in mm; infinite if uncovered.

        depth: of the object below its first touch in mm
        """
        contact_compliance = np.zeros(points.count)
        own, held_at = self.of_nodes(points)
        reaches = beyond(points.covered_at(moved, rounding_mm=_ROUNDED * depth + _EVEN_MM)[points.edge])
        with np.errstate(divide="ignore"):
            contact_compliance[points.edge] = own * np.maximum(held_at / reaches - 1, 0.0)
        return contact_compliance

    def of_nodes(self, points: ObjectPoints) -> tuple[np.ndarray, np.ndarray]:
        """Compliance (e,) in mm/N of nodes near edges among nodes in contact; distance (e,) in steps of an edge in full contact."""
        if self._last is None or self._last[0] is not points:
            middle = self._grid.from_middle(points.nodes[points.edge]) % 2
            outwards = points.outwards()
            own = (outwards * self._by_axis[[0, 1], middle]).sum(axis=1)
            self._last = points, own, 1 + _MIDDLE_BEYOND * (outwards * middle).sum(axis=1)
        return self._last[1:]


def beyond(covered: np.ndarray) -> np.ndarray:
    """Distance (c,) in steps, up to 2, of a straight edge beyond the previous node, from its shares (c,) of the hat functions."""
    inner = np.sqrt(2 * np.minimum(covered, 0.5))
    return np.where(covered < 0.5, inner, 2 - np.sqrt(2 * np.clip(1 - covered, 0.0, 0.5)))


def own_compliance(compliance: FoundationCompliance, axis: int) -> np.ndarray:
    """Compliance (2,) in mm/N of a row of nodes across an axis (0: x) under equal forces beside fixed rows, in the sensor's
    middle: for rows through elements' corners and through their middles.
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
