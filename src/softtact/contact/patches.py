"""Patches of contact points that share a pressure: fewer unknowns where a contact is large."""

import numpy as np
import scipy.sparse as sp
from scipy.ndimage import binary_erosion

from softtact.contact.node_grid import NodeGrid
from softtact.contact.object_points import ObjectPoints

_LEVEL_MM = 0.02     # range of heights among the points of a patch
_WHOLE = 0.999        # covered share from which on a point may share a patch
_MANY_POINTS = 800   # from which on patches save time; a small contact wants all of its points


def patches_of(points: ObjectPoints, grid: NodeGrid, shared: bool, *, beside_edge: int = 0) -> sp.csr_matrix:
    """Matrix (patches, c) of the points' shares in patches: four whole points of a square, level with each other, or one alone.

    Squares are counted from the middle, where a row's and a column's points go in pairs, so that a symmetric contact stays so.
    beside_edge: how many rows of points along the edge of all points keep a pressure of their own
    """
    label = np.arange(points.count)
    if shared and points.count > _MANY_POINTS:
        place = grid.from_middle(points.nodes)
        full = np.where(place == 0, 1, 2).prod(axis=1)
        _, square = np.unique(np.sign(place) * ((np.abs(place) + 1) // 2), axis=0, return_inverse=True)
        square = square.ravel()
        whole = np.minimum(points.covered, points.as_deep(0.0).covered) > _WHOLE
        if beside_edge:
            whole &= binary_erosion(_mask(points, grid), np.ones((3, 3)), iterations=beside_edge).ravel()[points.nodes]
        count = np.bincount(square, weights=whole)
        low, high = np.full(len(count), np.inf), np.full(len(count), -np.inf)
        np.minimum.at(low, square, points.gap)
        np.maximum.at(high, square, points.gap)
        together = (count[square] == full) & (high - low <= _LEVEL_MM)[square]
        label = np.where(together, points.count + square, label)
    _, label = np.unique(label, return_inverse=True)
    weight = pressure_weights(points, grid)
    return sp.csr_matrix((weight / np.bincount(label, weights=weight)[label], (label, np.arange(points.count))))


def _mask(points, grid):
    """Which nodes (ny, nx) of the grid are points."""
    there = np.zeros(grid.count, dtype=bool)
    there[points.nodes] = True
    return there.reshape(grid.shape)


def pressure_weights(points: ObjectPoints, grid: NodeGrid) -> np.ndarray:
    """Nodal forces (c,) of a uniform pressure on quadratic elements, whose corners are every second node from the middle."""
    return np.where(grid.from_middle(points.nodes) % 2, 2.0, 1.0).prod(axis=1) * grid.share_inside(points.nodes)
