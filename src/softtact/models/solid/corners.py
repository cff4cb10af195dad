"""The corners' share in the nodes of solids whose systems two levels solve: large, spatial, and not nearly incompressible."""

from collections.abc import Mapping

import numpy as np
import scipy.sparse as sp

from softtact.fem.quadratic_nodes import shares_of_corners
from softtact.fem.solid_mesh import SolidMesh
from softtact.materials.laws.base import Law

_LARGE = 80_000  # unknowns: from here on a factor of the whole costs more
_MOST_BULK = 100.0  # times the shear modulus: beyond, corners alone lock, and two levels take too many steps


def lift_from_corners(mesh: SolidMesh, laws: Mapping[str, Law], free: np.ndarray) -> sp.csr_matrix | None:
    """Values (unknowns, c) at the free unknowns, numbered 3 to a node, from those at the free corners.

    None where two levels do not serve (docs/notebook/2026-11-27-large-solids.md).
    """
    plane = mesh.geometry != "solid"  # whose factors take few operations
    if plane or len(free) < _LARGE or any(law.bulk_modulus > _MOST_BULK * law.mu0 for law in laws.values()):
        return None
    shares = shares_of_corners(len(mesh.points), ((element, nodes) for _, element, nodes in mesh.parts()))
    if shares is None:
        return None
    lift = sp.csr_matrix(sp.kron(shares, sp.identity(3)))
    corners = free[lift.diagonal()[free] > 0]
    return sp.csr_matrix(lift[free][:, corners]) if len(corners) else None
