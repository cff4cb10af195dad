"""About the inverse of a surface's compliance: what a node feels of its neighbours when all surface nodes are given their depth.

A surface's stiffness reaches hardly further than its elements, so a few neighbours make a good preconditioner.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit

from softtact.contact.node_grid import NodeGrid


@dataclass(frozen=True)
class Stencil:
    """values (2, 2, 2 k + 1, 2 k + 1) in N/mm: by a node's row and column, even or odd from the middle, and its neighbour's offset.

    Nodes at corners, mid-sides and centres of elements are of four kinds.
    """

    values: np.ndarray

    def on(self, grid: NodeGrid, nodes: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
        """The stencil's action on values (n, levels) at some of a `NodeGrid`'s nodes (n,), all others being zero."""
        reach = self.values.shape[2] // 2
        j, i = np.divmod(nodes, grid.shape[1])
        place = np.full((grid.shape[0] + 2 * reach, grid.shape[1] + 2 * reach), -1)
        place[j + reach, i + reach] = np.arange(len(nodes))
        kind = (j - grid.shape[0] // 2) % 2, (i - grid.shape[1] // 2) % 2
        offsets = [(dj, di) for dj in range(2 * reach + 1) for di in range(2 * reach + 1)]
        neighbours = np.stack([place[j + dj, i + di] for dj, di in offsets], axis=1)
        weights = np.stack([self.values[(*kind, dj, di)] for dj, di in offsets], axis=1).astype(np.float32)
        return lambda x: _apply(np.ascontiguousarray(x, dtype=np.float32), neighbours, weights)


@njit(cache=True, nogil=True)
def _apply(x, neighbours, weights):
    out = np.zeros_like(x)
    for n in range(len(neighbours)):
        for k in range(neighbours.shape[1]):
            m = neighbours[n, k]
            if m >= 0:
                for l in range(x.shape[1]):
                    out[n, l] += weights[n, k] * x[m, l]
    return out
