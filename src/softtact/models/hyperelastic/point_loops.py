"""Loops over the contact points of many bodies with the same local nodes."""

import numpy as np
from numba import njit


@njit(cache=True, nogil=True)
def weighted_component(field: np.ndarray, nodes: np.ndarray, weights: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Weighted components (f, p) of nodal fields (f, nodes, 3) at points of nodes (p, k), weights (p, k), axis (p,)."""
    out = np.zeros((field.shape[0], nodes.shape[0]))
    for f in range(field.shape[0]):
        for p in range(nodes.shape[0]):
            for k in range(nodes.shape[1]):
                out[f, p] += weights[p, k] * field[f, nodes[p, k], axis[p]]
    return out


@njit(cache=True, nogil=True)
def scatter_contact(force: np.ndarray, magnitude: np.ndarray, nodes: np.ndarray, weights: np.ndarray, axis: np.ndarray) -> None:
    """Add to nodal forces (f, nodes, 3) those of magnitudes (f, p) at the same points."""
    for f in range(force.shape[0]):
        for p in range(nodes.shape[0]):
            if magnitude[f, p] != 0.0:
                for k in range(nodes.shape[1]):
                    force[f, nodes[p, k], axis[p]] += magnitude[f, p] * weights[p, k]
