"""Refused before anything is solved: bodies that nothing holds."""

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from softtact.errors import InputError
from softtact.fem.solid_mesh import SolidMesh


def refuse_loose(mesh: SolidMesh, free: np.ndarray, held: Mapping[str, str]) -> None:
    """Refuse a body of which every component of every node is free: it has no balance.

    free (n, 3): which components are unknown, the mesh's nodes first;  held: the faces that are held, for the message
    """
    n, dimensions = len(mesh.points), 3 if mesh.geometry == "solid" else 2
    cells = [nodes for _, _, nodes in mesh.cells]
    pairs = np.concatenate([np.column_stack([np.repeat(nodes[:, 0], nodes.shape[1]), nodes.ravel()]) for nodes in cells])
    count, label = connected_components(sp.coo_matrix((np.ones(len(pairs)), pairs.T), shape=(n, n)), directed=False)
    used = np.zeros(n, dtype=bool)
    used[pairs.ravel()] = True
    somewhere = np.zeros(count, dtype=bool)
    np.logical_or.at(somewhere, label, used & ~free[:n, :dimensions].all(axis=1))
    for k in np.flatnonzero(~somewhere):
        own = (label == k) & used
        if own.any():
            x, y, z = mesh.points[own].mean(axis=0)
            raise InputError(
                f"Nothing holds the body around {x:.4g}, {y:.4g}, {z:.4g} mm; hold one of its faces or let a frame carry it "
                f"(held are {', '.join(held) or 'none'})."
            )
