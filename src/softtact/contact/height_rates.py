"""How the heights of an object's underside change with its pose: the derivatives of `ObjectPoints.gap` and of first touch.

A rigid motion with the velocity v moves a facet of normal n. Over a place that stays, its height changes by n.v / n_z, which is
v_z - slope.(v_x, v_y), exact as long as the place stays under this facet. A node that takes the height of a narrow part follows
the point of the part's edge.
"""

from collections.abc import Callable

import numpy as np

from softtact.contact.height_field import NO_CONTACT_MM, HeightField
from softtact.contact.narrow_parts import along_edges_over
from softtact.contact.node_grid import NodeGrid
from softtact.contact.object_points import ObjectPoints

Rates = Callable[[np.ndarray], np.ndarray]     # velocities (k, n, 3) of an object's points (n, 3), by k numbers


def gap_rates(surface: HeightField, grid: NodeGrid, points: ObjectPoints, rates: Rates) -> np.ndarray:
    """Derivatives (k, c) of the gaps of an object's points by the k numbers of `rates`.

    Beside an edge a node has the plane of a facet (`Underside`), which it follows as far as its slope is kept there; all others
    follow the facet over them.
    """
    places = np.column_stack([grid.points[points.nodes], points.gap])
    over_facet, triangles = surface.over_lines(grid.x, grid.y)
    slope = surface.slopes_of(triangles.ravel()[points.nodes])
    narrow = points.gap < over_facet.ravel()[points.nodes]
    slope[points.edge], narrow[points.edge] = points.slope[points.edge], False
    if narrow.any():
        places[narrow], slope[narrow] = _lowest_at(surface, grid, points.nodes[narrow], points.gap[narrow]), 0.0
    return _height_rates(rates(places), slope)


def touch_rates(surface: HeightField, x_mm: np.ndarray, y_mm: np.ndarray, rates: Rates) -> np.ndarray:
    """Derivatives (k,) of `HeightField.first_touch_mm` by the k numbers of `rates`; of one of several lowest places."""
    heights, triangles = surface.over_lines(x_mm, y_mm)
    touch = surface.first_touch_mm(x_mm, y_mm)
    if heights.min() <= touch < NO_CONTACT_MM:
        j, i = np.unravel_index(heights.argmin(), heights.shape)
        return _height_rates(rates(np.array([[x_mm[i], y_mm[j], touch]])), surface.slopes_of(triangles[[j], [i]]))[:, 0]
    corners = surface.triangles.reshape(-1, 3)
    over = (np.abs(corners[:, :2]) <= [x_mm[-1], y_mm[-1]]).all(axis=1) & (corners[:, 2] == touch)
    return rates(corners[over][:1])[:, 0, 2]


def _height_rates(velocity, slope):
    return velocity[..., 2] - (velocity[..., :2] * slope).sum(axis=-1)


def _lowest_at(surface, grid, nodes, heights):
    """The points (m, 3) on edges from which nodes (m,) have their heights (m,)."""
    found, owners = along_edges_over(surface, grid, heights.max() + 1e-9)
    near = (found[owners == node] for node in nodes)
    return np.array([own[np.abs(own[:, 2] - height).argmin()] for own, height in zip(near, heights, strict=True)])
