"""Parts of an object that lie between the nodes of a grid: thin walls, pins, wires and ridges, which no node is under.

A node sees the object's height above itself alone. A wall narrower than a step of the grid is above a row of nodes or not, so its
contact would depend on where it stands. Such a part ends at edges of the object's facets, so points along these edges find it
however thin it is. A point that no node around it sees is missed; the nearest node then takes its height.
"""

from typing import TYPE_CHECKING

import numpy as np

from softtact.contact.height_field import HeightField
from softtact.contact.lower_envelope import SPACING, lowest_between

if TYPE_CHECKING:
    from softtact.contact.node_grid import NodeGrid


def lowest_missed(surface: HeightField, grid: "NodeGrid", gap_mm: np.ndarray, below_mm: float) -> np.ndarray:
    """Heights (n,) in mm of the lowest part of an object in each node's cell that no node sees; NO_CONTACT_MM where there is none.

    gap_mm (n,): heights that the nodes see, NO_CONTACT_MM for none;  below_mm: height from which on parts cannot touch
    """
    return lowest_between(surface.triangles, gap_mm, grid.x, grid.y, margin(grid), below_mm)


def margin(grid: "NodeGrid") -> float:
    """How far beside the outer nodes, in steps, a part still touches: not at all where these lie on the sensor's sides."""
    return 0.0 if grid.sides else 0.5


def along_edges_over(surface: HeightField, grid: "NodeGrid", below_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """Points (k, 3) along the edges of an object's facets below a height, over a grid; and the node (k,) nearest to each."""
    points = surface.along_edges(below_mm, SPACING * grid.step.min())
    last = np.array(grid.shape[::-1]) - 1
    place = (points[:, :2] - grid.points[0]) / grid.step
    beside = margin(grid)
    inside = ((place >= -beside) & (place <= last + beside)).all(axis=1)
    i, j = np.rint(place[inside]).astype(int).T
    return points[inside], j * grid.shape[1] + i
