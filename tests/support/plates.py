"""Plates of points: matrices as those of wide and thin bodies, with places in plan."""

import numpy as np
import scipy.sparse as sp


def plate(width, length, *, layers=2, stiffness=(1.0, 1.0, 1.0), shift=0.2):
    """A Laplacian on a plate of points, which resists differently along x, y and z: whole, upper triangle, and places in plan."""
    lines = [sp.diags([-s, 2 * s, -s], [-1, 0, 1], shape=(n, n))
             for n, s in zip((width, length, layers), stiffness, strict=True)]
    one = [sp.eye(n) for n in (width, length, layers)]
    whole = (sp.kron(sp.kron(lines[0], one[1]), one[2]) + sp.kron(sp.kron(one[0], lines[1]), one[2])
             + sp.kron(sp.kron(one[0], one[1]), lines[2]) + shift * sp.eye(width * length * layers)).tocsr()
    upper = sp.triu(whole, format="csr")
    upper.sort_indices()
    x, y, _ = np.meshgrid(*map(np.arange, (width, length, layers)), indexing="ij")
    return whole, upper, np.column_stack([x.ravel(), y.ravel()]).astype(float)
