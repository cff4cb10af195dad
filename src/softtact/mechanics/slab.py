"""Sheet and cover as one slab over the frusta, with the contact of a rigid object on its top.

The sheet's elements meet the frusta's roots node by node. The cover knows nothing of the frusta, so its hexahedra may be
coarser in plan: the sheet's upper nodes follow the cover's lower side.
"""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numba import njit

from softtact.mechanics.blocks import HexBlock, WedgeBlock
from softtact.mechanics.elements import gauss, quad8
from softtact.mechanics.hex_mesh import extrude, grid_plan
from softtact.mechanics.parallel import SERIAL, unique_rows

# Contact points along a side of a top face, which is a pitch wide. With 3 a punch's edge between them goes unnoticed: a cylinder
# of 1.8 mm went 0.073 mm deep instead of 0.048 mm, and maps were up to a tenth of their maximum off (docs/decks.md).
TOP_POINTS = 8
_NEAR_MM, _LARGEST_SHIFT_MM = 0.2, 0.02   # points that may touch when the object is let down on the cover, and how far at once


@dataclass(frozen=True)
class SlabState:
    """energy (mJ), force (n, 3) in N, contact quantities at the top's points, displacement (n, 3).

    elastic: energy and force of the rubber alone; planes: what the points face; indentation_force: the object's, N downwards.
    """

    elastic: tuple
    energy: float
    force: np.ndarray
    gaps: np.ndarray
    planes: "FacingPlanes"
    displacement: np.ndarray
    indentation_force: float


@dataclass(frozen=True)
class FacingPlanes:
    """The planes of the object's facets that points face: anchors (p, 3) in mm at no indentation, outward normals (p, 3).

    A point keeps its plane during a step of Newton's method, so that each step lowers one potential.
    """

    anchors: np.ndarray
    normals: np.ndarray


@dataclass(frozen=True)
class Layer:
    """One material's layer: increasing heights z of its element layers (mm), and its law."""

    levels: np.ndarray
    law: object


class Slab:
    """Sheet (its plan a `SheetPlan`) under a cover on a grid; a cover of one level is the sheet's top without a cover.

    Nodes: the cover's first, then the sheet's without its top. `bottom` are the nodes under the sheet, in the plan's order.
    """

    def __init__(self, sheet, cover, sheet_plan, x_lines, y_lines, *, sides, contact, coarse_walls=True):
        self.plan = grid_plan(np.asarray(x_lines), np.asarray(y_lines))
        self.x_lines, self.y_lines = np.asarray(x_lines), np.asarray(y_lines)
        self.layers, self.sheet_plan, self.contact = (sheet, cover), sheet_plan, contact
        self.cover_mesh = extrude(self.plan, cover.levels)
        self.sheet_mesh = extrude(sheet_plan.plan, sheet.levels)
        self._coarse_walls = coarse_walls
        self._number_nodes(sheet_plan)
        self.groups, self.cell_groups = [], []
        if self.cover_mesh.layers:
            self.groups.append((self.cover_mesh.hexes, HexBlock(self.points[self.cover_mesh.hexes], cover.law, points_per_side=2)))
        self._add_sheet(sheet_plan, sheet.law)
        self._number_unknowns(sides)
        self._top_points()

    def _number_nodes(self, plan):
        """Masters (p, 8) and weights (p, 8) of the sheet's nodes: its top follows the cover, the rest its own unknowns.

        Along the walls between cells, two elements a side, the sheet moves as one quadratic curve: the nodes at the quarters
        follow the corner, the middle and the next corner. (Free quarters: half as many unknowns again, and 1 % softer.)
        """
        mesh, first = self.sheet_mesh, len(self.cover_mesh.points)
        top = mesh.planes[-1]
        curve, curve_weights = plan.quarters if self._coarse_walls else (np.zeros((0, 4), dtype=np.int64), np.zeros(3))
        follows = np.zeros(len(mesh.points), dtype=bool)
        follows[top] = True
        planes = mesh.inner_planes
        follows[planes[:, curve[:, 0]]] = True
        own = np.flatnonzero(~follows)
        number = np.full(len(mesh.points), -1, dtype=np.int64)
        number[own] = first + np.arange(len(own))
        self._masters, self._weights = np.zeros((len(mesh.points), 8), dtype=np.int64), np.zeros((len(mesh.points), 8))
        self._masters[own, 0], self._weights[own, 0] = number[own], 1.0
        quads, weights = self.locate(plan.plan.points)
        self._masters[top], self._weights[top] = self.cover_mesh.planes[0][self.plan.quads[quads]], weights
        for plane in planes:
            self._masters[plane[curve[:, 0]], :3] = number[plane[curve[:, 1:]]]
            self._weights[plane[curve[:, 0]], :3] = curve_weights
        self.points = np.vstack([self.cover_mesh.points, mesh.points[own]])
        self.nodes = len(self.points)
        self.bottom = number[mesh.planes[0]]

    @property
    def sheet_nodes(self):
        """Masters (p, 8) and weights (p, 8) of the nodes of `sheet_mesh`: numbers of the slab's nodes that each follows."""
        return self._masters, self._weights

    def _add_sheet(self, plan, law):
        """Groups of like elements (nodes, block): those of the frusta's cells, cell by cell, and those of the strips."""
        mesh = self.sheet_mesh
        in_cells = len(plan.roots) * plan.cell_quads
        for k in range(mesh.layers):
            hexes, wedges = mesh.layer(k), mesh.wedge_layer(k)
            for target, elements, make in ((self.cell_groups, hexes[:in_cells], HexBlock), (self.cell_groups, wedges, WedgeBlock),
                                           (self.groups, hexes[in_cells:], HexBlock)):
                if len(elements):
                    target.append(self._of_masters(elements, make(mesh.points[elements], law)))

    def _of_masters(self, elements, block):
        """Nodes (e, w) that elements (e, m) of the sheet hang on, and the block in terms of these."""
        masters, weights = self._masters[elements], self._weights[elements]
        used = np.abs(weights) > 1e-12
        needed = [np.unique(m[u]) for m, u in zip(masters, used, strict=True)]
        width = max(map(len, needed))
        nodes = np.stack([np.pad(n, (0, width - len(n)), mode="edge") for n in needed])
        follow = np.zeros((*elements.shape, width))
        for e, unique in enumerate(needed):
            rows, columns = np.nonzero(used[e])
            np.add.at(follow[e], (rows, np.searchsorted(unique, masters[e][rows, columns])), weights[e][rows, columns])
        table = np.hstack([block.shapes[:, None], follow.reshape(len(follow), -1)])
        first, block.shapes = unique_rows(table)
        own = table[first, 0].astype(int)
        block.gradients = np.ascontiguousarray(np.einsum("egmd,emw->egwd", block.gradients[own], follow[first], optimize=True))
        block.volumes, block.gram_inverse = block.volumes[own], block.gram_inverse[own]
        return nodes, block

    def _number_unknowns(self, sides):
        """Free unknowns: all but the sides, which are `held` (sensor shell) or `symmetric` (unit cell)."""
        x, y, _ = self.points.T
        on_x = (np.abs(x - self.x_lines[0]) < 1e-9) | (np.abs(x - self.x_lines[-1]) < 1e-9)
        on_y = (np.abs(y - self.y_lines[0]) < 1e-9) | (np.abs(y - self.y_lines[-1]) < 1e-9)
        held = np.zeros((self.nodes, 3), dtype=bool)
        if sides == "held":
            held[on_x | on_y] = True
        elif sides == "symmetric":
            held[on_x, 0] = held[on_y, 1] = True
        else:
            raise ValueError(f"sides must be 'held' or 'symmetric', not {sides!r}")
        self.free = np.flatnonzero(~held.ravel())
        self.number = np.full(held.size, -1, dtype=np.int64)
        self.number[self.free] = np.arange(len(self.free))

    def _top_points(self):
        """Quadrature points of the top faces, flattened (t * points)."""
        points, weights = gauss(TOP_POINTS, 2)
        values, slopes = quad8(points)
        self.top_faces = self.cover_mesh.planes[-1][self.plan.quads]
        xy = self.points[self.top_faces][..., :2]
        edges = np.einsum("tad,gai->tgdi", xy, slopes)
        self.top_values = values
        self.top_area = (np.linalg.det(edges) * weights).ravel()
        self.top_reference = self._at_top(self.points)

    def _at_top(self, field):
        """A nodal field (n, 3) at the top's quadrature points (t * points, 3)."""
        return np.einsum("ga,tad->tgd", self.top_values, field[self.top_faces], optimize=True).reshape(-1, 3)

    def facing(self, displacement, surface):
        """The object's facets above the top's points (see `FacingPlanes`)."""
        position = self.top_reference + self._at_top(displacement)
        height, normals = surface(position[:, 0], position[:, 1])
        return FacingPlanes(anchors=np.column_stack([position[:, :2], height]), normals=normals)

    def evaluate(self, displacement, planes, indentation, *, workers=SERIAL):
        """Energy, forces and contact with the object lowered by `indentation` mm; None if an element is inside out."""
        force = np.zeros((self.nodes, 3))
        energy = 0.0
        for nodes, block in self.groups + self.cell_groups:
            state = block.evaluate(displacement[nodes], workers=workers)
            if state is None:
                return None
            energy += state.energy
            np.add.at(force, nodes.ravel(), state.force.reshape(-1, 3))
        return self._with_contact(displacement, (energy, force), planes, indentation)

    def reface(self, state, planes, indentation):
        """The same displacements in front of other planes."""
        return self._with_contact(state.displacement, state.elastic, planes, indentation)

    def balanced(self, state, indentation, force_n):
        """The indentation (mm) at which the object's force is `force_n` on the cover as it is.

        The force grows with the depth, from a square root's slope on: Newton's method with bounded steps.
        """
        near = np.flatnonzero(state.gaps < _NEAR_MM)
        down, area = -state.planes.normals[near, 2], self.top_area[near]
        contact, gaps, shift = self.contact.at(near), state.gaps[near], 0.0
        for _ in range(50):
            _, pressure, slope = contact.response(gaps - shift * down)
            excess = pressure @ (down * area) - force_n
            if abs(excess) <= 1e-9 * force_n:
                break
            stiffness = slope @ (down**2 * area)
            shift -= np.clip(excess / max(stiffness, 1e-12), -_LARGEST_SHIFT_MM, _LARGEST_SHIFT_MM)
        return indentation + shift

    def _with_contact(self, displacement, elastic, planes, indentation):
        gaps, normals = self.gaps(displacement, planes, indentation), planes.normals
        density, pressure, _ = self.contact.response(gaps)
        push = (pressure * self.top_area)[:, None] * normals      # on the slab: along the object's outward normal
        nodal = np.einsum("tgd,ga->tad", push.reshape(len(self.top_faces), -1, 3), self.top_values, optimize=True)
        force = elastic[1].copy()
        np.add.at(force, self.top_faces.ravel(), -nodal.reshape(-1, 3))
        return SlabState(elastic=elastic, energy=elastic[0] + float(density @ self.top_area), force=force, gaps=gaps,
                         planes=planes, displacement=displacement, indentation_force=float(-push[:, 2].sum()))

    def gaps(self, displacement, planes, indentation):
        """Normal gaps (p,) in mm between the top's points and the planes they face."""
        offset = self.top_reference + self._at_top(displacement) - planes.anchors
        return np.einsum("pd,pd->p", planes.normals, offset) + indentation * planes.normals[:, 2]

    def build_pattern(self, eliminated, cells):
        """Fix the global matrix: its unknowns are the free ones but the `eliminated`; `cells` (f, k) are the cells' outer ones."""
        keep = np.setdiff1d(self.free, eliminated.ravel())
        self.unknowns = keep
        number = np.full(3 * self.nodes, -1, dtype=np.int64)
        number[keep] = np.arange(len(keep))
        members = [(3 * nodes[..., None] + np.arange(3)).reshape(len(nodes), -1)
                   for nodes in [*(nodes for nodes, _ in self.groups), self.top_faces]] + [cells]
        self._dofs = [number[dofs] for dofs in members]
        indptr, indices = _upper_pattern(self._dofs, len(keep))
        self._matrix = sp.csr_matrix((np.zeros(len(indices)), indices, indptr), shape=(len(keep),) * 2)

    def tangent(self, state, condensed, *, workers=SERIAL):
        """Upper triangle (csr) of the tangent with the cells' condensed blocks (f, k, k), and its border.

        The border is the derivative (unknowns,) of the residual by the indentation; the corner its own second derivative.
        """
        matrix = self._matrix
        matrix.data[:] = 0.0
        faces, border, corner = self._contact_tangent(state)
        blocks = workers.map(lambda group: group[1].tangent(state.displacement[group[0]]), self.groups)
        parts = [*blocks, faces, condensed]
        for part, dofs in zip(parts, self._dofs, strict=True):
            _add_upper(matrix.data, matrix.indptr, matrix.indices, part, dofs)
        return matrix, border, corner

    @staticmethod
    def add_to_diagonal(matrix, value):
        """Add `value` (N/mm) to each diagonal entry of what `tangent` gave."""
        matrix.data[matrix.indptr[:-1]] += value   # sorted upper triangle: each row begins with its diagonal

    def _contact_tangent(self, state):
        _, _, slope = self.contact.response(state.gaps)
        weight = (slope * self.top_area).reshape(len(self.top_faces), -1)
        normal = state.planes.normals.reshape(*weight.shape, 3)
        shape = np.einsum("ga,tgd->tgad", self.top_values, normal).reshape(*weight.shape, 24)
        blocks = np.matmul((shape * weight[..., None]).transpose(0, 2, 1), shape)
        # gap = n.(x - surface): raising the indentation by 1 closes it by -n_z, which is positive downwards
        lowering = normal[..., 2]
        border = np.zeros(3 * self.nodes)
        dofs = (3 * self.top_faces[..., None] + np.arange(3)).reshape(len(weight), 24)
        np.add.at(border, dofs.ravel(), np.einsum("tg,tgk->tk", weight * lowering, shape).ravel())
        return blocks, border[self.unknowns], float((weight * lowering**2).sum())

    def locate(self, points):
        """Plan quads (p,) and shape values (p, 8) at points (p, 2); points on a line belong to the lower side."""
        def cell(value, lines):
            k = np.clip(np.searchsorted(lines, value - 1e-9) - 1, 0, len(lines) - 2)
            return k, 2 * (value - lines[k]) / (lines[k + 1] - lines[k]) - 1

        i, xi = cell(points[:, 0], self.x_lines)
        j, eta = cell(points[:, 1], self.y_lines)
        return j * (len(self.x_lines) - 1) + i, quad8(np.column_stack([xi, eta]))[0]

    def sampling(self, points):
        """Sparse matrix (p, nodes) that interpolates a nodal field of the plane between sheet and cover at points (p, 2)."""
        quads, values = self.locate(points)
        columns = self.cover_mesh.planes[0][self.plan.quads[quads]]
        rows = np.repeat(np.arange(len(points)), 8)
        return sp.csr_matrix((values.ravel(), (rows, columns.ravel())), shape=(len(points), self.nodes))


def _upper_pattern(members, size):
    """indptr, indices of the upper triangle of all unknowns that meet in an element; members (e, k), -1 where held."""
    pattern = sp.csr_matrix((size, size), dtype=bool)
    for dofs in members:
        here = dofs >= 0
        rows = np.repeat(np.arange(len(dofs)), dofs.shape[1]).reshape(dofs.shape)[here]
        incidence = sp.csr_matrix((np.ones(len(rows), dtype=bool), (rows, dofs[here])), shape=(len(dofs), size))
        pattern = pattern + sp.triu(incidence.T @ incidence, format="csr")
    pattern.sort_indices()
    return pattern.indptr, pattern.indices


@njit(cache=True, nogil=True)
def _add_upper(data, indptr, indices, matrices, dofs):
    """Add element matrices (e, k, k) into the upper triangle; dofs (e, k), -1 where held."""
    size = dofs.shape[1]
    for e in range(matrices.shape[0]):
        for i in range(size):
            row = dofs[e, i]
            if row < 0:
                continue
            for j in range(size):
                column = dofs[e, j]
                if column >= row:
                    low, high = indptr[row], indptr[row + 1]
                    while high - low > 1:
                        middle = (low + high) // 2
                        if indices[middle] <= column:
                            low = middle
                        else:
                            high = middle
                    data[low] += matrices[e, i, j]
