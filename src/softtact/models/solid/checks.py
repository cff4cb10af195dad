"""Which nodes hang together, and what is refused before anything is solved: bodies that nothing holds."""

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from softtact.errors import InputError
from softtact.fem.solid_mesh import SolidMesh


def bodies_of(mesh: SolidMesh) -> np.ndarray:
    """(n,) number of the body that each node of a mesh belongs to; nodes of no element are -1."""
    n, cells = len(mesh.points), [nodes for _, _, nodes in mesh.cells]
    pairs = np.concatenate([np.column_stack([np.repeat(nodes[:, 0], nodes.shape[1]), nodes.ravel()]) for nodes in cells])
    _, label = connected_components(sp.coo_matrix((np.ones(len(pairs)), pairs.T), shape=(n, n)), directed=False)
    used = np.zeros(n, dtype=bool)
    used[pairs.ravel()] = True
    return np.where(used, label, -1)


def refuse_loose(mesh: SolidMesh, free: np.ndarray, supported: np.ndarray, held: Sequence[str]) -> None:
    """Refuse a body of which every component of every node is free: it has no balance.

    free (n, 3): which components are unknown, the mesh's nodes first;  supported: nodes that items tie to the ground
    held: the faces that are held, for the message
    """
    dimensions, body = 3 if mesh.geometry == "solid" else 2, bodies_of(mesh)
    bound = np.logical_not(free[: len(body), :dimensions].all(axis=1))
    bound[supported] = True
    for k in np.unique(body[body >= 0]):
        own = body == k
        if not bound[own].any():
            x, y, z = mesh.points[own].mean(axis=0)
            raise InputError(
                f"Nothing holds the body around {x:.4g}, {y:.4g}, {z:.4g} mm; hold one of its faces or let a frame carry it "
                f"(held are {', '.join(held) or 'none'})."
            )
