"""Sheet and cover as one slab of 20-node hexahedra over the frusta, with the contact of a rigid object on its top."""

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numba import njit

from softtact.contact.penalty import penalty
from softtact.geometry.hex_mesh import extrude, grid_plan
from softtact.mechanics.blocks import HexBlock
from softtact.mechanics.elements import HEX20_TOP, gauss, quad8

# Contact points along a side of a top face, which is a pitch wide. With 3 a punch's edge between them goes unnoticed: a cylinder
# of 1.8 mm went 0.073 mm deep instead of 0.048 mm, and maps were up to a tenth of their maximum off (docs/decks.md).
TOP_POINTS = 8


@dataclass(frozen=True)
class SlabState:
    """energy (mJ), force (n, 3) in N without the object's, contact quantities at the top's points, displacement (n, 3)."""

    energy: float
    force: np.ndarray
    gaps: np.ndarray
    normals: np.ndarray
    displacement: np.ndarray
    indentation_force: float


@dataclass(frozen=True)
class FacingPlanes:
    """The planes of the object's facets that points face: anchors (p, 3) in mm at no indentation, outward normals (p, 3).

    A point keeps its plane during a load step: one that slides past an edge would otherwise see the height jump, and
    Newton's method cycle. The planes are found anew before every step.
    """

    anchors: np.ndarray
    normals: np.ndarray


class Slab:
    """Hexahedra between grid lines; `laws` holds one law per element layer, from below."""

    def __init__(self, x_lines, y_lines, z_levels, laws, *, sides, contact):
        self.plan = grid_plan(np.asarray(x_lines), np.asarray(y_lines))
        self.x_lines, self.y_lines = np.asarray(x_lines), np.asarray(y_lines)
        self.mesh = extrude(self.plan, z_levels)
        self.contact = contact
        self.nodes = len(self.mesh.points)
        self.blocks = self._blocks(laws)
        self._number_unknowns(sides)
        self._top_points()

    def _blocks(self, laws):
        """One block per run of layers of the same law: (hexes, block)."""
        blocks, start = [], 0
        for end in range(1, len(laws) + 1):
            if end == len(laws) or laws[end] is not laws[start]:
                hexes = np.vstack([self.mesh.layer(k) for k in range(start, end)])
                blocks.append((hexes, HexBlock(self.mesh.points[hexes], laws[start], points_per_side=2)))
                start = end
        return blocks

    def _number_unknowns(self, sides):
        """Free unknowns: all but the sides, which are `held` (sensor shell) or `symmetric` (unit cell)."""
        x, y, _ = self.mesh.points.T
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
        self.top_faces = self.mesh.layer(self.mesh.layers - 1)[:, HEX20_TOP]
        xy = self.mesh.points[self.top_faces][..., :2]
        edges = np.einsum("tad,gai->tgdi", xy, slopes)
        self.top_values = values
        self.top_area = (np.linalg.det(edges) * weights).ravel()
        self.top_reference = self._at_top(self.mesh.points)

    def _at_top(self, field):
        """A nodal field (n, 3) at the top's quadrature points (t * points, 3)."""
        return np.einsum("ga,tad->tgd", self.top_values, field[self.top_faces], optimize=True).reshape(-1, 3)

    def facing(self, displacement, surface):
        """The object's facets above the top's points, kept through a load step (see `FacingPlanes`)."""
        position = self.top_reference + self._at_top(displacement)
        height, normals = surface(position[:, 0], position[:, 1])
        return FacingPlanes(anchors=np.column_stack([position[:, :2], height]), normals=normals)

    def evaluate(self, displacement, planes, indentation):
        """Energy, forces and contact with the object lowered by `indentation` mm; None if an element is inside out."""
        force = np.zeros((self.nodes, 3))
        energy = 0.0
        for hexes, block in self.blocks:
            state = block.evaluate(displacement[hexes])
            if state is None:
                return None
            energy += state.energy
            np.add.at(force, hexes.ravel(), state.force.reshape(-1, 3))
        gaps, normals = self.gaps(displacement, planes, indentation), planes.normals
        density, pressure, _ = penalty(gaps, stiffness=self.contact.stiffness, smoothing=self.contact.smoothing)
        push = (pressure * self.top_area)[:, None] * normals      # on the slab: along the object's outward normal
        nodal = np.einsum("tgd,ga->tad", push.reshape(len(self.top_faces), -1, 3), self.top_values, optimize=True)
        np.add.at(force, self.top_faces.ravel(), -nodal.reshape(-1, 3))
        return SlabState(energy=energy + float(density @ self.top_area), force=force, gaps=gaps, normals=normals,
                         displacement=displacement, indentation_force=float(-push[:, 2].sum()))

    def gaps(self, displacement, planes, indentation):
        """Normal gaps (p,) in mm between the top's points and the planes they face."""
        offset = self.top_reference + self._at_top(displacement) - planes.anchors
        return np.einsum("pd,pd->p", planes.normals, offset) + indentation * planes.normals[:, 2]

    def build_pattern(self, ties):
        """Fix the matrix's sparsity for slab elements and `ties` (f, k) = slab nodes that each frustum hangs on."""
        groups = [self._dofs(hexes) for hexes, _ in self.blocks] + [self._dofs(ties)]
        n = len(self.free)
        keys = [self._keys(dofs, n) for dofs in groups]
        unique, slots = np.unique(np.concatenate([k.ravel() for k in keys]), return_inverse=True)
        offset = int(unique[0] == -1)          # key -1: lower triangle or held
        unique, slots = unique[offset:], slots - offset
        sizes = np.cumsum([k.size for k in keys])[:-1]
        self._slots = [part.reshape(k.shape).astype(np.int32)
                       for part, k in zip(np.split(slots, sizes), keys, strict=True)]
        indptr = np.searchsorted(unique // n, np.arange(n + 1)).astype(np.int32)
        self._pattern = ((unique % n).astype(np.int32), indptr, (n, n))
        self._matrix = sp.csr_matrix((np.zeros(len(unique)), *self._pattern[:2]), shape=self._pattern[2])

    def _dofs(self, nodes):
        return self.number[(3 * nodes[..., None] + np.arange(3)).reshape(len(nodes), -1)]

    @staticmethod
    def _keys(dofs, n):
        rows, columns = dofs[:, :, None], dofs[:, None, :]
        return np.where((rows >= 0) & (columns >= rows), rows * n + columns, -1)

    def tangent(self, state, tied):
        """Upper triangle (csr) of the tangent with the frusta's condensed blocks `tied` (f, 3 k, 3 k), and its border.

        The border is the derivative (n_free,) of the residual by the indentation; the corner its own second derivative.
        """
        data = self._matrix.data
        data[:] = 0.0
        face_blocks, border, corner = self._contact_tangent(state)
        for k, (hexes, block) in enumerate(self.blocks):
            matrices = block.tangent(state.displacement[hexes])
            if k == len(self.blocks) - 1:       # the top faces belong to the last elements
                top = matrices[-len(self.top_faces):]
                dofs = (3 * HEX20_TOP[:, None] + np.arange(3)).ravel()
                top[:, dofs[:, None], dofs[None, :]] += face_blocks
            _scatter(data, matrices, self._slots[k])
        _scatter(data, tied, self._slots[-1])
        return self._matrix, border, corner

    def add_to_diagonal(self, matrix, value):
        """Add `value` (N/mm) to each diagonal entry of what `tangent` gave."""
        matrix.data[matrix.indptr[:-1]] += value   # sorted upper triangle: each row begins with its diagonal

    def _contact_tangent(self, state):
        _, _, slope = penalty(state.gaps, stiffness=self.contact.stiffness, smoothing=self.contact.smoothing)
        weight = (slope * self.top_area).reshape(len(self.top_faces), -1)
        normal = state.normals.reshape(*weight.shape, 3)
        shape = np.einsum("ga,tgd->tgad", self.top_values, normal).reshape(*weight.shape, 24)
        blocks = np.matmul((shape * weight[..., None]).transpose(0, 2, 1), shape)
        # gap = n.(x - surface): raising the indentation by 1 closes it by -n_z, which is positive downwards
        lowering = normal[..., 2]
        border = np.zeros(3 * self.nodes)
        dofs = (3 * self.top_faces[..., None] + np.arange(3)).reshape(len(weight), 24)
        np.add.at(border, dofs.ravel(), np.einsum("tg,tgk->tk", weight * lowering, shape).ravel())
        return blocks, border[self.free], float((weight * lowering**2).sum())

    def locate(self, points):
        """Plan quads (p,) and shape values (p, 8) at points (p, 2); points on a line belong to the lower side."""
        def cell(value, lines):
            k = np.clip(np.searchsorted(lines, value) - 1, 0, len(lines) - 2)
            return k, 2 * (value - lines[k]) / (lines[k + 1] - lines[k]) - 1

        i, xi = cell(points[:, 0], self.x_lines)
        j, eta = cell(points[:, 1], self.y_lines)
        return j * (len(self.x_lines) - 1) + i, quad8(np.column_stack([xi, eta]))[0]

    def sampling(self, points, plane):
        """Sparse matrix (p, nodes) that interpolates a nodal field of one horizontal plane of nodes at points (p, 2)."""
        quads, values = self.locate(points)
        columns = self.mesh.planes[plane][self.plan.quads[quads]]
        rows = np.repeat(np.arange(len(points)), 8)
        return sp.csr_matrix((values.ravel(), (rows, columns.ravel())), shape=(len(points), self.nodes))


@njit(cache=True, nogil=True)
def _scatter(data, matrices, slots):
    for e in range(matrices.shape[0]):
        for i in range(matrices.shape[1]):
            for j in range(matrices.shape[2]):
                if slots[e, i, j] >= 0:
                    data[slots[e, i, j]] += matrices[e, i, j]
