"""Cells of the lattice, each a frustum with the sheet over it, connected to the rest through the cell's walls and top.

The cells' inner unknowns are eliminated cell by cell, after those of their frusta. The global matrix contains only the cells' walls
and the cover. Cells under differently split parts of the cover are of different kinds.
"""


import numpy as np

from softtact.fem.elements import dofs_of
from softtact.fem.static_condensation import TangentCache, packed
from softtact.fem.substructuring import LayerwiseElimination
from softtact.linalg.workers import SERIAL, Workers, chunks
from softtact.models.hyperelastic.frusta import FrustumArray
from softtact.models.hyperelastic.slab import CellGroup, Slab
from softtact.models.hyperelastic.states import BodyState

_CHUNK = 8                          # cells that one thread condenses, or makes positive, at once
_ELEMENTS_KEEP_MM = 0.004           # relative movement of an element's nodes up to which it keeps its tangent
_REFRESH_SLOPE = 0.2                # change of a contact point's stiffness, relative to the penalty, that renews a cell's tangent
_REFRESH_WITH_FRICTION = 20.0       # ... with friction, in N/mm3: with 100 light presses converge too slowly
# A cell moves too far if its inner nodes move by this distance more than this multiple of its walls' step, or its walls farther.
_FARTHEST_MM, _FARTHEST_RATIO, _FARTHEST_OUTER_MM = 0.05, 2.0, 0.4
_LEAST_DAMPING, _DAMPING_GROWTH = 0.05, 4.0     # N/mm on each unknown; a frustum's softest mode has 0.03 at rest


class SheetCells:
    """Cells of a `Slab` with their frusta; `roots` (f, k) are the slab's nodes of each frustum's root."""

    def __init__(self, slab: Slab, support: FrustumArray, roots: np.ndarray) -> None:
        self.slab, self.support, self.roots, self.count = slab, support, roots, support.count
        self.kinds = [CellKind(slab, group, roots[group.cells]) for group in slab.cell_groups]
        self._tangent_at = None
        self._damping, self._damped_with = np.zeros(self.count), np.zeros(self.count)

    @property
    def eliminated(self) -> np.ndarray:
        """All unknowns that the cells eliminate."""
        return np.concatenate([kind.inner_dofs.ravel() for kind in self.kinds])

    @property
    def outer_dofs(self) -> list[np.ndarray]:
        """Unknowns that the cells leave, kind by kind (c, k)."""
        return [kind.outer_dofs for kind in self.kinds]

    @property
    def outer(self) -> list[np.ndarray]:
        """Condensed matrices, kind by kind (c, k, k)."""
        return [kind.elimination.matrices for kind in self.kinds]

    def positive_outer(self, *, workers: Workers = SERIAL) -> list[np.ndarray]:
        """The condensed matrices without their modes of negative stiffness."""
        kinds = [kind.elimination.last for kind in self.kinds]
        tasks = [(kind, part) for kind in kinds for part in chunks(kind.not_judged, _CHUNK)]
        workers.map(lambda task: task[0].make_positive(task[1]), tasks)
        return [kind.positive_outer() for kind in kinds]

    def refresh(self, state: BodyState, *, kept_mm: float = 0.0, workers: Workers = SERIAL) -> int:
        """Recompute the condensed tangents of cells that moved by more than `kept_mm` or changed contact since the last one.

        Keeping the others makes a quasi-Newton step: the forces are always exact. Returns the number of recomputed tangents.
        """
        stale = self._stale(state, kept_mm)
        frusta = chunks(np.flatnonzero(stale), _CHUNK)
        kept = min(kept_mm, _ELEMENTS_KEEP_MM)
        workers.map(lambda part: self.support.condense(state.support, part, self._damping[part], kept_mm=kept), frusta)
        tasks = [(kind, part) for kind in self.kinds for part in chunks(np.flatnonzero(stale[kind.cells]), _CHUNK)]
        workers.map(lambda task: task[0].condense(state, self.support, task[1], self._damping, kept_mm=kept), tasks)
        self._damped_with = self._damping.copy()
        return int(stale.sum())

    def damp(self, slab_step: np.ndarray, bed_step: np.ndarray) -> bool:
        """Damp the cells that a step moves too far, undamp the others; returns whether there are any, so that the step is repeated.

        A frustum that is about to snap through has a soft mode: its long step would be useless and shorten that of all others.
        """
        inner, outer = self._movement(slab_step, bed_step)
        thrown = (inner > _FARTHEST_MM + _FARTHEST_RATIO * outer) | (outer > _FARTHEST_OUTER_MM)
        if thrown.any():
            self._damping = np.where(thrown, np.maximum(_DAMPING_GROWTH * self._damping, _LEAST_DAMPING), self._damping)
        else:
            self._damping = np.where(self._damping > _LEAST_DAMPING, self._damping / _DAMPING_GROWTH, 0.0)
        return bool(thrown.any())

    def reset(self) -> None:
        """Discard the tangents and damping of an earlier press."""
        self.forget()
        self._damping, self._damped_with = np.zeros(self.count), np.zeros(self.count)

    def forget(self, cells: np.ndarray | None = None) -> None:
        """Make the next `refresh` recompute the given cells, or all; in the latter case also the elements' cached tangents."""
        if cells is None:
            self._tangent_at = None
            self.support.forget()
            for kind in self.kinds:
                kind.forget()
        elif self._tangent_at is not None:
            self._tangent_at[cells] = np.inf

    def _stale(self, state, kept_mm):
        slope, limit = self._slope(state)
        roots = state.slab.displacement[self.roots].reshape(self.count, -1)
        place = np.hstack([roots, state.support.displacement.reshape(self.count, -1)])
        above = [state.slab.displacement[kind.nodes].reshape(len(kind.cells), -1) for kind in self.kinds]
        if self._tangent_at is None:
            self._tangent_at, self._above, self._slope_at = place, above, slope
            return np.ones(self.count, dtype=bool)
        stale = np.abs(place - self._tangent_at).max(axis=1) > kept_mm
        stale |= (np.abs(slope - self._slope_at).max(axis=1) > limit) | (self._damping != self._damped_with)
        for kind, now, before in zip(self.kinds, above, self._above, strict=True):
            stale[kind.cells] |= np.abs(now - before).max(axis=1) > kept_mm
            before[stale[kind.cells]] = now[stale[kind.cells]]
        self._tangent_at[stale], self._slope_at[stale] = place[stale], slope[stale]
        return stale

    def _slope(self, state):
        """Stiffnesses (f, q) in N/mm3 of the contact points and of friction, and their allowed changes."""
        slope, friction_response = self.support.contact_slope(state.support), state.support.friction_response
        if friction_response is not None:
            slope = np.hstack([slope, friction_response.stiffness().reshape(self.count, -1)])
        without = state.slab.friction_response is None and friction_response is None
        return slope, _REFRESH_SLOPE * self.support.contact.stiffness if without else _REFRESH_WITH_FRICTION

    def condensed_residual(self, state: BodyState, *, workers: Workers = SERIAL) -> tuple[np.ndarray, tuple[list, list]]:
        """Residual (n, 3) of the slab with all inner unknowns eliminated, and the forward-solved right-hand sides for `recover`."""
        root_force, in_frusta = self.support.condensed_residual(state.support, workers=workers)
        residual = state.slab.force.copy()
        np.add.at(residual, self.roots.ravel(), root_force.reshape(-1, 3))
        flat = residual.reshape(-1)
        reduced = workers.map(lambda kind: kind.residual(flat), self.kinds)
        for kind, (passed_on, _) in zip(self.kinds, reduced, strict=True):
            np.add.at(flat, kind.outer_dofs.ravel(), passed_on.ravel())
        return residual, (in_frusta, [forward_solved for _, forward_solved in reduced])

    def recover(self, kept: tuple[list, list], slab_step: np.ndarray, *,
                workers: Workers = SERIAL) -> tuple[np.ndarray, np.ndarray]:
        """Newton steps of the slab (n, 3), its inner nodes filled in, and of the frusta (f, nodes, 3).

        A cell's step is the sum of its response to its walls' movement and its local step. The latter is cut if it exceeds
        `_FARTHEST_MM`: otherwise a frustum that snaps through would shorten the step of the whole sensor. Since each
        cell's inner matrix is positive definite, the shortened step still decreases the energy.
        """
        slab, frusta = self._recovered(kept, slab_step, workers)
        if max(np.abs(slab).max(), np.abs(frusta).max()) <= _FARTHEST_MM:
            return slab, frusta
        inner, _ = self._movement(*self._recovered(kept, np.zeros_like(slab_step), workers))
        if not (inner > _FARTHEST_MM).any():
            return slab, frusta
        share, (in_frusta, in_cells) = _FARTHEST_MM / np.maximum(inner, _FARTHEST_MM), kept
        cut = ([share[:, None] * half for half in in_frusta],
               [[share[kind.cells, None] * half for half in forward_solved] for kind,
                forward_solved in zip(self.kinds, in_cells, strict=True)])
        return self._recovered(cut, slab_step, workers)

    def _movement(self, slab, frusta):
        """Largest movement (f,) in mm of each cell's inner nodes in a step, and of its walls."""
        inner, outer, flat = np.abs(frusta.reshape(self.count, -1)).max(axis=1), np.zeros(self.count), slab.reshape(-1)
        for kind in self.kinds:
            inner[kind.cells] = np.maximum(inner[kind.cells], np.abs(flat[kind.inner_dofs]).max(axis=1, initial=0.0))
            outer[kind.cells] = np.abs(flat[kind.outer_dofs]).max(axis=1, initial=0.0)
        return inner, outer

    def _recovered(self, kept, slab_step, workers):
        """The steps of slab and frusta for the walls' step, from the forward-solved right-hand sides of cells and frusta."""
        in_frusta, in_cells = kept
        flat = slab_step.copy().reshape(-1)
        steps = workers.map(lambda both: both[0].inner_step(both[1], flat), list(zip(self.kinds, in_cells, strict=True)))
        for kind, step in zip(self.kinds, steps, strict=True):
            flat[kind.inner_dofs] = step
        full = flat.reshape(-1, 3)
        return full, self.support.inner_step(in_frusta, full[self.roots].reshape(self.count, -1), workers=workers)


class CellKind:
    """Cells (c,) that are translations of each other, with the sheet's elements in them; nodes (c, n) of each."""

    def __init__(self, slab: Slab, group: CellGroup, roots: np.ndarray) -> None:
        self.cells = group.cells
        self._layers = [[(nodes, TangentCache(block)) for nodes, block in layer] for layer in group.layers]
        members = [nodes.reshape(len(self.cells), -1) for nodes, _ in group.parts]
        self.nodes, local = _same_in_all(np.hstack([*members, roots]))
        *groups, root = np.split(local, np.cumsum([m.shape[1] for m in members]))
        elements = iter(dofs_of(group.reshape(-1, nodes.shape[1])) for group, (nodes, _) in zip(groups, group.parts, strict=True))
        layers = [[next(elements) for _ in layer] for layer in self._layers]
        layers[0].insert(0, dofs_of(root[None]))
        inner = self._inner(slab)
        self.elimination = LayerwiseElimination(len(self.cells), inner, layers)
        self.inner_dofs, self.outer_dofs = dofs_of(self.nodes)[:, inner], dofs_of(self.nodes)[:, self.elimination.outer]
        self._inner_places = np.flatnonzero(inner)

    def _inner(self, slab):
        """Which unknowns (n,) belong, in every cell, to nodes of that cell only; the others stay global."""
        free = np.zeros(3 * slab.nodes, dtype=bool)
        free[slab.free] = True
        return (np.repeat(slab.uses[self.nodes] == 1, 3, axis=1) & free[dofs_of(self.nodes)]).all(axis=0)

    def residual(self, flat: np.ndarray) -> tuple[np.ndarray, list[np.ndarray]]:
        """Condensed forces (c, k) on the outer unknowns from the slab's forces (all unknowns,), and the data for `inner_step`."""
        force = np.zeros((len(self.cells), 3 * self.nodes.shape[1]))
        force[:, self._inner_places] = flat[self.inner_dofs]
        forward_solved = self.elimination.residual(force)
        return force[:, self.elimination.outer], forward_solved

    def inner_step(self, forward_solved: list[np.ndarray], flat: np.ndarray) -> np.ndarray:
        """The Newton step (c, inner) of the inner unknowns for a step (all unknowns,) of the slab's outer ones."""
        step = np.zeros((len(self.cells), 3 * self.nodes.shape[1]))
        step[:, self.elimination.outer] = flat[self.outer_dofs]
        self.elimination.recover(forward_solved, step)
        return step[:, self._inner_places]

    def condense(self, state: BodyState, support: FrustumArray, chosen: np.ndarray, damping: np.ndarray, *,
                 kept_mm: float = 0.0) -> None:
        """Recompute the condensed tangents of some cells, by their indices (k,) in this kind, from those of their frusta.

        damping: of all cells, in N/mm;  kept_mm: see `TangentCache`
        """
        frusta = [packed(support.root_stiffness[self.cells[chosen], None])]
        layers = (((frusta if k == 0 else []) + [self._tangents(state, part, chosen, kept_mm) for part in layer], None)
                  for k, layer in enumerate(self._layers))
        self.elimination.set(chosen, layers, damping=damping[self.cells[chosen]])

    def forget(self) -> None:
        """Discard the cached tangents of all elements, so that the next `condense` recomputes them."""
        for layer in self._layers:
            for _, kept in layer:
                kept.forget()

    def _tangents(self, state, part, chosen, kept_mm):
        """Packed tangents (b, k, w) of like elements in some of the cells (b,)."""
        nodes, kept = part
        per_cell = len(nodes) // len(self.cells)
        elements = (chosen[:, None] * per_cell + np.arange(per_cell)).ravel()
        each = kept.at(state.slab.displacement[nodes[elements]], elements, kept_mm=kept_mm)
        return each.reshape(len(chosen), per_cell, -1)


def _same_in_all(members):
    """Members (f, k) of cells that are translations of each other: each cell's nodes (f, n) and local numbers (k,)."""
    _, first, local = np.unique(members[0], return_index=True, return_inverse=True)
    nodes = members[:, first]
    if (nodes[:, local] != members).any():
        raise ValueError("The cells of the sheet are not alike.")
    return nodes, local
