"""The elastic model's layer, thick and wide against a contact in its middle: its elements on a mesh that grows outwards."""

import numpy as np
import scipy.sparse as sp
from slabs import graded

from softtact.contact.node_grid import NodeGrid
from softtact.fem.elements import HEX27
from softtact.fem.solid_block import HexBlock
from softtact.materials.laws.registry import make_law
from softtact.models.elastic.tangential import SurfaceCompliance
from softtact.models.quarter_symmetry import PARITIES, LinearLayer, QuarterSlab


class GradedSlab(QuarterSlab):
    """A `QuarterSlab` whose elements' sides lie on given lines from 0, the same in x and y."""

    def __init__(self, lines, layer):
        count = len(lines) - 1
        super().__init__((2 * lines[-1], 2 * lines[-1]), [layer], (count, count), base_held=True)
        self.lines = lines
        self.x = self.y = np.interp(np.arange(2 * count + 1) / 2, np.arange(count + 1), lines)

    @property
    def stiffness(self):
        """The stiffness (unknowns, unknowns) in N/mm, element by element."""
        dx, dy = (side.ravel() for side in np.meshgrid(np.diff(self.lines), np.diff(self.lines)))     # x fastest, as `hexes`
        parts = []
        for (layer, thickness), hexes in zip(self.layers, self.hexes, strict=True):
            law = make_law("neo_hooke", {"c10": 0.5 * layer.shear_modulus}, bulk_modulus=layer.bulk_modulus)
            corners = 0.5 * HEX27.nodes[None] * np.column_stack([dx, dy, np.full_like(dx, thickness)])[:, None]
            dofs = (3 * hexes[..., None] + np.arange(3)).reshape(len(hexes), -1)
            parts.append((HexBlock(corners, law).tangent(np.zeros(corners.shape)), dofs))
        values = np.concatenate([tangent.ravel() for tangent, _ in parts])
        rows, columns = (np.concatenate([f(dofs) for _, dofs in parts])
                         for f in (lambda d: np.repeat(d, 81, axis=1).ravel(), lambda d: np.tile(d, (1, 81)).ravel()))
        return sp.csr_matrix((values, (rows, columns)), shape=(self.unknowns, self.unknowns))


def thick_layer(a, far, *, cells, shear, poisson, reach=1.25):
    """`SurfaceCompliance` in a block of half-width and depth `far`: nodes a / (2 cells) apart within `reach` a of its middle.

    For loads that are even in y, with x components that are even or z components that are even in x: the other two parities, which
    these do not excite, are left out.
    """
    lines = graded(1.5 * a, round(1.5 * cells), far, round(np.log(far / (1.5 * a)) / np.log(1.5)) + 1)
    bulk = 2 * shear * (1 + poisson) / (3 * (1 - 2 * poisson))
    slab = GradedSlab(lines, LinearLayer(far, bulk, shear, tuple(np.diff(lines)[::-1] / far)))
    side = int(reach * 2 * cells) + 1
    kept = (3 * slab.top[:side, :side].ravel()[:, None] + np.arange(3)).ravel()
    lower, down, stiffness = np.tril_indices(len(kept)), np.tile([1.0, 1.0, -1.0], side**2), slab.stiffness
    triangles = np.zeros((len(PARITIES), len(lower[0])))
    for number, parity in enumerate(PARITIES):
        if parity in _EXCITED:
            triangles[number] = (slab.compliance(stiffness, kept, parity) * down[:, None] * down)[lower]
    x = np.concatenate([-slab.x[side - 1:0:-1], slab.x[:side]])
    return SurfaceCompliance(NodeGrid(x, x), triangles, foundation_modulus=2 * shear / far)


_EXCITED = ((0, 0), (1, 0))      # by pressure, which is even; by a force along x, whose mirror image in x is odd
