"""An elastic layer solved whole, with its object on it by a penalty: what the elastic model's quarters are compared with."""

import numpy as np
import scipy.sparse as sp

from softtact.linalg.direct import make_solver
from softtact.models.elastic.compliance import elastic_slab, map_cells


class WholeLayer:
    """A sensor's elastic layer on the mesh of its model, no symmetry used: of a layer twice as large the quarter is the whole."""

    def __init__(self, spec):
        double = spec.model_copy(update={"footprint_mm": tuple(2 * side for side in spec.footprint_mm)})
        slab = elastic_slab(double, cells=tuple(2 * count for count in map_cells(spec)))
        free = np.ones((*slab.numbers.shape, 3), dtype=bool)
        for held in (slab.numbers[slab.side_held][:, [0, -1]], slab.numbers[slab.side_held][:, :, [0, -1]], slab.numbers[0]):
            free.reshape(-1, 3)[held.ravel()] = False
        free = np.flatnonzero(free)
        self.stiffness = slab.stiffness[free][:, free]
        top = slab.numbers[-1, 1:-1, 1:-1] if slab.side_held[-1] else slab.numbers[-1]
        self.top, self.shape = np.searchsorted(free, 3 * top.ravel() + 2), top.shape      # in the order of the model's grid
        self.sides_held = slab.side_held[-1]

    def press(self, points, force, *, stiffness=1e5, iterations=40):
        """Depth in mm, and descent (n,) of the top's nodes, under `ObjectPoints`; stiffness: N/mm of each point's penalty.

        Newton's method on the energy  1/2 u.K u + k/2 sum min(gap, 0)^2 - F depth,  gap = gap0 - depth - B u.
        """
        nodes = self.top[points.nodes]
        descend = sp.csr_matrix((np.ones(len(nodes)), (np.arange(len(nodes)), nodes)), shape=(len(nodes), self.stiffness.shape[0]))
        gap0, solver = points.gap, make_solver()
        active = gap0 < gap0.min() + 0.3
        for _ in range(iterations):
            b = descend[np.flatnonzero(active)]
            upper = sp.triu(self.stiffness + stiffness * (b.T @ b), format="csr")
            upper.sort_indices()
            solver.factor(upper)
            resting, per_depth = solver.solve(stiffness * (b.T @ np.column_stack([gap0[active], np.ones(len(gap0[active]))]))).T
            own, by_depth = stiffness * (b @ resting - gap0[active]), stiffness * (1 - b @ per_depth)
            depth = (force - own.sum()) / by_depth.sum()
            moved = resting - depth * per_depth
            before, active = active, gap0 - depth - descend @ moved < 0
            if (before == active).all():
                solver.close()
                return depth, -moved[self.top]
        raise ArithmeticError(f"no contact after {iterations} iterations")

    def map_of(self, descent):
        """Map (ny, nx) of a descent, with sides that are held."""
        first = int(self.sides_held)
        return np.pad(descent.reshape(self.shape)[first::2, first::2], first)
