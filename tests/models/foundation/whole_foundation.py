"""The foundation model's slab on its frusta, solved whole: what the blocks of its quarter are compared with."""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from softtact.models.elastic.compliance import map_cells
from softtact.models.foundation.compliance import _roots, foundation_slab


class WholeFoundation:
    """Sheet and cover with the frusta's linear stiffness, no symmetry used: of a slab twice as large the quarter is the whole."""

    def __init__(self, spec, laws, frustum):
        self.spec, self.half = spec, 0.5 * np.array(spec.footprint_mm)
        double = spec.model_copy(update={"footprint_mm": tuple(2 * side for side in spec.footprint_mm)})
        cells = tuple(2 * count for count in map_cells(spec))
        self.slab = foundation_slab(double, laws["dielectric"], laws["cover"], cells=cells)
        roots = _roots(self.slab, self.centres() + self.half, frustum)
        count = len(self.centres())
        self.stiffness = (self.slab.stiffness + roots.T @ sp.kron(sp.eye(count), frustum.rest, format="csr") @ roots).tocsr()
        self.descents = sp.kron(sp.eye(count), frustum.descent[None], format="csr") @ roots
        self.lateral = sp.vstack([sp.kron(sp.eye(count), row[None], format="csr") @ roots for row in frustum.lateral]).tocsr()
        free = np.ones((*self.slab.numbers.shape, 3), dtype=bool)
        for held in (self.slab.numbers[self.slab.side_held][:, [0, -1]], self.slab.numbers[self.slab.side_held][:, :, [0, -1]]):
            free.reshape(-1, 3)[held.ravel()] = False
        self.free, self.held = np.flatnonzero(free), np.flatnonzero(~free)
        first = int(self.slab.side_held[-1])
        last = -first or None
        self.top = self.slab.numbers[-1, first:last, first:last].ravel()       # in the order of the model's grid
        self.top_at_map = self.slab.numbers[-1, 2 * first:-2 * first or None:2, 2 * first:-2 * first or None:2]
        self.electrode = self.slab.numbers[2, 2:-2:2, 2:-2:2]                  # the sheet's top at the map's inner points

    def centres(self):
        """Axes (b, 2) of the frusta, x fastest."""
        pitch = self.spec.dielectric.frusta.pitch_mm
        x, y = (pitch * (np.arange(count) - (count - 1) / 2) for count in self.spec.frusta_counts)
        return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)

    def forces(self, nodes, load, lateral=None):
        """Forces (unknowns,) of a load (n + b,): downwards on nodes (n,) of the grid, and on the frusta's roots.

        lateral (4 b,): forces and moments on the roots along x, then along y
        """
        force = np.zeros(self.slab.unknowns)
        force[3 * self.top[nodes] + 2] = -load[:len(nodes)]
        force -= self.descents.T @ load[len(nodes):]
        return force if lateral is None else force + self.lateral.T @ lateral

    def displacement(self, forces):
        """Displacement (unknowns,) under forces (unknowns,)."""
        moved = np.zeros_like(forces)
        moved[self.free] = spsolve(self.stiffness[self.free][:, self.free].tocsc(), forces[self.free])
        return moved

    def sides_carry(self, moved, forces):
        """Force in N that the held sides push upwards with; roots at the sides push on them, too."""
        vertical = self.held[self.held % 3 == 2]
        return float((self.stiffness[vertical] @ moved - forces[vertical]).sum())

    def membrane(self, moved):
        """Membrane forces (3, b) in N/mm of the frusta's cells."""
        pitch, (nx, ny) = self.spec.dielectric.frusta.pitch_mm, self.spec.frusta_counts

        def cells_of(x, y):
            return (y / pitch).astype(int) * nx + (x / pitch).astype(int)

        return np.array([matrix @ moved for matrix in self.slab.mean_forces(cells_of, nx * ny)]) / pitch**2
