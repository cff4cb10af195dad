"""The sheet over each frustum together with the frustum: one cell of the lattice, seen by the rest through its walls and its top.

Cells repeat, so their inner unknowns are eliminated cell by cell, after the frustum's own. What is left for the global
matrix are the cells' walls and the cover.
"""

import numpy as np

from softtact.mechanics.condensation import Condensation
from softtact.mechanics.parallel import SERIAL, chunks

_CHUNK = 8                          # cells that one thread condenses at once
_REFRESH_MM = 1e-3                  # a cell that moved less than this keeps its tangent (residuals stay exact)
_REFRESH_SLOPE = 0.05               # ... unless a contact point's stiffness changed by this share of the penalty


class SheetCells:
    """Cells of a `Slab` with their frusta; `roots` (f, k) are the slab's nodes of each frustum's root."""

    def __init__(self, slab, bed, roots):
        self.slab, self.bed, self.roots, self.count = slab, bed, roots, bed.count
        members = [nodes.reshape(self.count, -1) for nodes, _ in slab.cell_groups]
        self._nodes, local = _same_in_all(np.hstack([*members, roots]))
        ends = np.cumsum([m.shape[1] for m in members])
        *groups, root = np.split(local, ends)
        self._number_dofs()
        widths = [nodes.shape[1] for nodes, _ in slab.cell_groups]
        element_nodes = [root[None], *(group.reshape(-1, width) for group, width in zip(groups, widths, strict=True))]
        self._tangent_at = None
        self.condensed = Condensation(self.count, self.inner_dofs.shape[1], self.outer_dofs.shape[1],
                                      [self._place[_dofs(nodes)] for nodes in element_nodes])

    def _number_dofs(self):
        """Inner unknowns: of nodes in one cell only and in every cell; the others stay global (-1 where held)."""
        slab = self.slab
        uses = np.bincount(self._nodes.ravel(), minlength=slab.nodes)
        for nodes, _ in slab.groups:
            uses[np.unique(nodes)] += 1
        uses[slab.top_faces] += 1
        free = np.zeros(3 * slab.nodes, dtype=bool)
        free[slab.free] = True
        dofs = _dofs(self._nodes)
        inner = (np.repeat(uses[self._nodes] == 1, 3, axis=1) & free[dofs]).all(axis=0)
        self._place = np.empty(len(inner), dtype=np.int64)
        self._place[inner] = np.arange(inner.sum())
        self._place[~inner] = inner.sum() + np.arange((~inner).sum())
        self.inner_dofs, self.outer_dofs = dofs[:, inner], dofs[:, ~inner]

    def refresh(self, state, *, workers=SERIAL):
        """Recompute the condensed tangents of the cells that moved or changed contact since their last one; their number.

        Keeping the others is a quasi-Newton step: forces are always exact.
        """
        stale = self._stale(state)
        workers.map(lambda cells: self._condense(state, cells), chunks(stale, _CHUNK))
        return len(stale)

    def forget(self):
        """Let the next `refresh` recompute all cells."""
        self._tangent_at = None

    def _stale(self, state):
        slope = self.bed.contact_slope(state.bed.gaps)
        place = np.hstack([state.slab.displacement[self._nodes].reshape(self.count, -1),
                           state.bed.displacement.reshape(self.count, -1)])
        if self._tangent_at is None:
            self._tangent_at, self._slope_at = place, slope
            return np.arange(self.count)
        moved = np.abs(place - self._tangent_at).max(axis=1) > _REFRESH_MM
        touched = np.abs(slope - self._slope_at).max(axis=1) > _REFRESH_SLOPE * self.bed.contact.stiffness
        stale = np.flatnonzero(moved | touched)
        self._tangent_at[stale], self._slope_at[stale] = place[stale], slope[stale]
        return stale

    def _condense(self, state, cells):
        tangents = [self.bed.condense(state.bed, cells)]
        for nodes, block in self.slab.cell_groups:
            per_cell = len(nodes) // self.count
            elements = (cells[:, None] * per_cell + np.arange(per_cell)).ravel()
            each = block.tangent(state.slab.displacement[nodes[elements]], elements)
            tangents.append(each.reshape(len(cells), per_cell, *each.shape[1:]))
        self.condensed.set(cells, tangents)

    def condensed_residual(self, state):
        """Residual (n, 3) of the slab with all inner unknowns eliminated, and what `recover` needs again."""
        root_force, in_frusta = self.bed.condensed_residual(state.bed)
        residual = state.slab.force.copy()
        np.add.at(residual, self.roots.ravel(), root_force.reshape(-1, 3))
        passed_on, in_cells = self.condensed.residual(residual.ravel()[self.inner_dofs])
        np.add.at(residual.reshape(-1), self.outer_dofs.ravel(), passed_on.ravel())
        return residual, (in_frusta, in_cells)

    def recover(self, kept, slab_step):
        """Newton steps of the slab (n, 3), its inner nodes filled in, and of the frusta (f, nodes, 3)."""
        in_frusta, in_cells = kept
        flat = slab_step.copy().reshape(-1)
        flat[self.inner_dofs] = self.condensed.recover(in_cells, flat[self.outer_dofs])
        full = flat.reshape(-1, 3)
        return full, self.bed.inner_step(in_frusta, full[self.roots].reshape(self.count, -1))


def _dofs(nodes):
    """Unknowns (..., 3 k) of nodes (..., k)."""
    return (3 * nodes[..., None] + np.arange(3)).reshape(*nodes.shape[:-1], -1)


def _same_in_all(members):
    """Members (f, k) of cells that are translations of each other: each cell's nodes (f, n) and local numbers (k,)."""
    _, first, local = np.unique(members[0], return_index=True, return_inverse=True)
    nodes = members[:, first]
    if (nodes[:, local] != members).any():
        raise ValueError("The cells of the sheet are not alike.")
    return nodes, local
